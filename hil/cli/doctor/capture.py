"""``hil doctor capture``: why the session of a capture dropped."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from hil.cli.doctor.output import JsonFile, Output
from hil.values.fri import MAX_PERIOD_MS, Release

_UNREADABLE = 2


def capture(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Capture: pcapng or pcap, of hil run or from elsewhere.")
    ],
    json_file: JsonFile = None,
    fri_version: Annotated[
        Release | None, typer.Option(help="Release of the controller's messages, where it cannot be told.")
    ] = None,
    period: Annotated[
        int | None, typer.Option(min=1, max=MAX_PERIOD_MS, metavar="MS", help="Send period, where no message tells it.")
    ] = None,
    limit: Annotated[int, typer.Option(min=1, max=20, help="Slowest answers to show.")] = 10,
) -> None:
    """Say whose fault late and missing FRI answers were, and which of them lowered the quality.

    A recording of hil run is replayed, so that the verdict is the one the controller gave live. A capture from
    elsewhere (tcpdump beside a real robot) is judged from its packets. --fri-version and --period make it one.
    """
    from hil.cli.reading_bar import reading_bar
    from tools.doctor.capture.diagnose import CaptureOptions, diagnose_capture

    output = Output(json_file)
    with reading_bar("diagnose", file, shown=not output.alone and sys.stderr.isatty()) as progress:
        found = diagnose_capture(file, CaptureOptions(fri_version, period, limit), progress=progress)
    try:
        output.tell(found.diagnosis)
    finally:
        if found.damage:
            raise typer.Exit(_UNREADABLE)
