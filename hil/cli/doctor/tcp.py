"""``hil doctor tcp``: small messages over TCP, and which side makes them wait."""

import sys
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress, TextColumn, TimeElapsedColumn

from hil.cli.doctor.output import JsonFile, Output


def tcp(
    peer: Annotated[str, typer.Argument(metavar="HOST:PORT", help="The responder: hil run --tcp-probe ADDR:PORT.")],
    count: Annotated[int, typer.Option(metavar="N", min=1, max=200, help="Round trips of each kind, at most.")] = 20,
    timeout: Annotated[
        float, typer.Option(metavar="S", min=0.05, max=60.0, help="Longest wait for the peer, each time.")
    ] = 2.0,
    echo: Annotated[
        bool, typer.Option("--echo", help="The peer is an echo server; it shows its own Nagle only, not this side's.")
    ] = False,
    json_file: JsonFile = None,
) -> None:
    """Measure round trips of small messages, in one write and in two, with TCP_NODELAY and without.

    It connects several times and sends nothing to a peer that is no responder, unless --echo was given. A server that
    serves one connection and then ends (KST on a Sunrise Cabinet) would be used up by it.
    """
    from tools.doctor.tcp.connection import find_address
    from tools.doctor.tcp.measure import measure_echo, measure_responder
    from tools.doctor.tcp.verdict import diagnose
    from tools.doctor.tcp.windows import with_registry

    output = Output(json_file)
    address = find_address(peer, timeout_s=timeout)
    measure = measure_echo if echo else measure_responder
    shown = not output.alone and sys.stderr.isatty()
    with Progress(
        *Progress.get_default_columns()[:2],
        TextColumn("{task.completed}/{task.total}"),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
        disable=not shown,
    ) as bar:
        task = bar.add_task("connecting", total=None)
        measured = measure(
            address,
            count=count,
            timeout_s=timeout,
            progress=lambda name, done, total: bar.update(task, description=name, completed=done, total=total),
        )
    output.tell(with_registry(diagnose(measured), towards=address.host))
