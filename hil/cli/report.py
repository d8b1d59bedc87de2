"""``hil report``: a capture as one page that opens without a network."""

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from hil.cli.plain import plain
from hil.cli.reading_bar import reading_bar
from hil.values.fri import Release

_UNREADABLE = 2


def report(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Capture: pcapng or pcap, of hil run or from elsewhere.")
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE.html", help="Default: the capture's name with .html.")
    ] = None,
    robot: Annotated[
        str | None, typer.Option(help="Elsewhere: robot model, for the flange speed; lbr-iiwa-14-r820 is the default.")
    ] = None,
    fri_version: Annotated[
        Release | None, typer.Option(help="Elsewhere: release of the client's FRI library, where it cannot be told.")
    ] = None,
    servo_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Key of the servo link, where it is not where it was.")
    ] = None,
    open_it: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
) -> None:
    """Make one page of a capture: what happened when, and whose fault it was. It opens without a network.

    A recording of hil run is replayed through a fresh controller first, so the page shows what was inside it. Exit code
    2: the file is damaged (the page shows what is before that), or there is nothing in it.
    """
    from hil.replay.replay import Wish
    from tools.report.making import make_report

    page = file.with_name(f"{file.name}.html") if output is None else output
    with reading_bar("report", file, shown=sys.stderr.isatty()) as progress:
        made = make_report(file, page, wish=Wish(fri_version, robot), key_file=servo_key, progress=progress)
    console = Console(highlight=False)
    console.print(plain(made.verdict), soft_wrap=True)
    console.print(plain(f"page: {made.file} ({made.size_bytes / 1e6:.1f} MB)"), soft_wrap=True)
    if open_it:
        typer.launch(made.file.resolve().as_uri())
    if made.damage:
        console.print(f"[red]{plain(made.damage)}[/red]; the page shows what is before that", soft_wrap=True)
        raise typer.Exit(_UNREADABLE)
