"""``hil impair``: be a bad network between a controller and its client or applications."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from hil.runtime.impair import ImpairOptions, Link, run_impair
from transport.impairment import FAULT_TEXTS, parse_fault
from transport.udp import parse_address

_COUNTS = ("fired", "met", "lost", "added")
_PORTS = {Link.FRI: 30200, Link.SERVO: 30300}


def impair(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    listen: Annotated[str, typer.Option(metavar="ADDR[:PORT]", help="Where it stands: the address that is spoken to.")],
    to: Annotated[str, typer.Option(metavar="HOST[:PORT]", help="Where what comes there is sent on to.")],
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FAULT",
            help=f"May repeat. {escape('; '.join(FAULT_TEXTS))}. Ends with :to-peer or :to-controller: one way only.",
        ),
    ] = None,
    link: Annotated[
        Link, typer.Option(help="fri: the controller speaks first, to the client; servo: applications, to it.")
    ] = Link.FRI,
    forward_from: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="ADDR[:PORT]",
            help="Where it sends on from; a free port for each speaker. A client that was given the controller's name "
            "hears only its own port number.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="The same seed, packets and times: the same faults.")] = 0,
    require_fired: Annotated[
        bool, typer.Option("--require-fired", help="Exit code 1 if a fault never did anything.")
    ] = False,
    duration: Annotated[float | None, typer.Option(metavar="S", min=0.0, help="End after so many seconds.")] = None,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the figures at exit.")] = None,
    progress: Annotated[
        float, typer.Option(metavar="S", min=0.0, help="Seconds between progress lines; 0: none.")
    ] = 1.0,
) -> None:
    """Pass datagrams on between two processes, and be as bad a network as the faults say. Ctrl-C ends it with a table.

    Times of faults count from the first datagram, packets from 0 in each direction.
    """
    port = _PORTS[link]
    result = run_impair(
        ImpairOptions(
            listen=parse_address(listen, default_port=port),
            to=parse_address(to, default_port=port),
            link=link,
            faults=tuple(parse_fault(text) for text in fault or ()),
            seed=seed,
            forward_from=None if forward_from is None else parse_address(forward_from, default_port=0),
            duration_s=duration,
            json_file=json_file,
            progress_s=progress,
        )
    )
    _print_summary(result.report)
    if result.fault is not None:
        typer.echo(f"hil: {result.fault}", err=True)
        raise typer.Exit(1)
    if require_fired and result.never_fired is not None:
        typer.echo(f"hil: {result.never_fired}", err=True)
        raise typer.Exit(1)


def _print_summary(report: dict[str, Any]) -> None:
    console = Console()
    table = Table("fault", *_COUNTS, title="fri-hil impair")
    table.columns[0].no_wrap = True
    for fault in report["faults"]:
        table.add_row(escape(fault["fault"]), *(str(fault[count]) for count in _COUNTS))
    if report["faults"]:
        console.print(table)
    for fault in report["faults"]:
        if fault["fired"]:
            console.print(escape(f"{fault['fault']}: {fault['packets_text']}"), highlight=False, soft_wrap=True)
    ways = ", ".join(
        f"{count} {direction} ({report['delivered'][direction]} passed on)"
        for direction, count in report["packets"].items()
    )
    console.print(f"packets: {ways}; {report['on_the_way']} still on the way", highlight=False)
    late = report["lateness_us"]
    if late["max"] is not None:
        console.print(
            f"passed on {late['p50']:.0f} us later than the model says in the median, p99 {late['p99']:.0f}, "
            f"max {late['max']:.0f} us",
            highlight=False,
        )
    reasons = {"refused": "nobody listened (ICMP)", "strangers": "from strangers", "turned_away": "no socket left"}
    for name, what in reasons.items():
        if report[name]:
            console.print(f"{report[name]} datagrams: {what}", highlight=False)
