"""``hil doctor kst``: which side makes a KST program slow."""

from pathlib import Path
from typing import Annotated

import typer

from hil.cli.doctor.output import JsonFile, Output


def kst(
    *,
    socket: Annotated[
        Path | None, typer.Option("--socket", metavar="PAD", help="Pad of the controller; your only one is found.")
    ] = None,
    robot: Annotated[str | None, typer.Option(metavar="NAME", help="Robot, where several have a KST link.")] = None,
    seconds: Annotated[float, typer.Option(min=0.0, max=60.0, help="How long to watch the rate.")] = 2.0,
    json_file: JsonFile = None,
) -> None:
    """Say what a running controller saw of its KST link: stalls and whose TCP makes them, rates, refusals.

    It asks the controller's pad and never connects to the KST port, which serves one client.
    """
    from tools.doctor.kst.told import ask
    from tools.doctor.kst.verdict import diagnose

    output = Output(json_file)
    output.tell(diagnose(ask(socket, robot, seconds=seconds)))
