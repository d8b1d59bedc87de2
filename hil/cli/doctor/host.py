"""``hil doctor host``: what this machine can hold."""

from typing import Annotated

import typer

from hil.cli.doctor.output import JsonFile, Output
from hil.cli.doctor.waiting import waiting


def host(
    seconds: Annotated[float, typer.Option(min=0.1, max=3600.0, help="Length of the measurement.")] = 5.0,
    cycle_ms: Annotated[int, typer.Option("--cycle-ms", min=1, max=100, help="Control cycle to hold.")] = 1,
    realtime: Annotated[bool, typer.Option("--realtime", help="Measure as hil run --realtime would run.")] = False,
    json_file: JsonFile = None,
) -> None:
    """What this machine can hold: how late its timers are, what makes them late, and what helps, in order of effect."""
    from hil.runtime.realtime import ask_for_realtime
    from tools.doctor.host import diagnose_host

    output = Output(json_file)
    if realtime:
        for wish in ask_for_realtime():
            typer.echo(f"{wish.what}: {'granted' if wish.granted else 'refused'}: {wish.detail}", err=True)
    with waiting("measuring the timer", seconds) as progress:
        diagnosis = diagnose_host(seconds=seconds, cycle_ms=cycle_ms, progress=progress)
    output.tell(diagnosis)
