"""``hil shadow``: what an emulated arm would have measured beside a real one."""

import asyncio
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from hil.cli.json_output import JsonOutput
from hil.cli.plain import plain
from hil.cli.reading_bar import reading_bar
from hil.values.errors import UsageError
from hil.values.fri import Release

if TYPE_CHECKING:
    from tools.shadow.comparison import ShadowComparison

_NOTHING = 1
DEFAULT_ROBOT = "lbr-iiwa-14-r820"


def shadow(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="Capture beside a real robot: pcapng or pcap.")
    ] = None,
    bind: Annotated[
        str | None, typer.Option(metavar="ADDR[:PORT]", help="Watch live instead, where the Cabinet sends to.")
    ] = None,
    cabinet: Annotated[
        str | None, typer.Option(metavar="HOST[:PORT]", help="Live: who alone is believed; default: the first one.")
    ] = None,
    fri_version: Annotated[
        Release | None, typer.Option(help="Release of FRI; live 1.15 is the default, a capture shows what it is.")
    ] = None,
    robot: Annotated[str, typer.Option(help="Robot model.")] = DEFAULT_ROBOT,
    seconds: Annotated[
        float | None, typer.Option(min=0.1, help="Live: how long to watch; until Ctrl-C unless given.")
    ] = None,
    connect_s: Annotated[float, typer.Option(min=0.1, max=3600.0, help="Live: wait for the first message.")] = 10.0,
    plot: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw both arms and their differences.")] = None,
    json_file: Annotated[
        str | None, typer.Option("--json", metavar="FILE|-", help="Write what was found; -: to the output, alone.")
    ] = None,
) -> None:
    """Compare a real arm with an emulated one that is led as it is: position, measured and external torque.

    It never commands: live it answers as an FRI client that only monitors. Exit code 0: compared; 1: there was nothing
    to compare; 2: it could not be looked at.
    """
    if (file is None) is (bind is None):
        raise UsageError("give a capture, or --bind ADDR:PORT to watch a Cabinet live")
    if file is not None and (cabinet is not None or seconds is not None):
        raise UsageError("--cabinet and --seconds are for watching live, a capture is read to its end")
    output = JsonOutput(json_file)
    if plot is not None:
        from tools.shadow.drawing import check_picture

        check_picture(plot)
    if file is not None:
        comparison, title, notes = _of_capture(file, fri_version, robot, shown=not output.alone)
    else:
        comparison, title, notes = _live(
            str(bind), cabinet, fri_version, robot, seconds=seconds, connect_s=connect_s, quiet=output.alone
        )
    notes += comparison.notes()
    output.write({"source": title, "notes": notes, **comparison.report()})
    if plot is not None:
        from tools.shadow.drawing import draw

        draw(comparison, plot, title=title)
    if not output.alone:
        _show(comparison, title, notes, plot)
    if not comparison.compared:
        raise typer.Exit(_NOTHING)


def _of_capture(
    file: Path, release: Release | None, robot: str, *, shown: bool
) -> tuple["ShadowComparison", str, list[str]]:
    from tools.shadow.recording import compare_recording

    with reading_bar("shadow", file, shown=shown and sys.stderr.isatty()) as progress:
        comparison, flow, notes = compare_recording(file, release=release, robot=robot, progress=progress)
    return comparison, f"{file.name}: {flow.controller}, release {flow.release}", notes


def _live(
    bind: str,
    cabinet: str | None,
    release: Release | None,
    robot: str,
    *,
    seconds: float | None,
    connect_s: float,
    quiet: bool,
) -> tuple["ShadowComparison", str, list[str]]:
    from backends.cabinet.options import parse_options
    from tools.shadow.comparison import ShadowComparison
    from tools.shadow.live import watch

    chosen = release or Release.V1_15
    options = parse_options(
        {"bind": bind, "cabinet": cabinet, "release": chosen.value, "connect_s": connect_s, "shadow": True}
    )
    comparison = ShadowComparison(release=chosen, robot=robot)
    tell = partial(print, file=sys.stderr, flush=True)
    link = asyncio.run(watch(comparison, options, seconds=seconds, tell=(lambda _line: None) if quiet else tell))
    report = link.report()
    notes = [f"link: {report['messages']} messages, {report['lost']} lost, {report['strangers']} from strangers"]
    return comparison, f"Cabinet at {report['cabinet']}, release {chosen}", notes


def _show(comparison: "ShadowComparison", title: str, notes: list[str], plot: Path | None) -> None:
    from hil.values.robot import JOINT_NAMES
    from tools.shadow.comparison import QUANTITIES, UNITS

    console = Console(highlight=False)
    console.print(plain(f"{title}: emulated minus real, {comparison.compared} messages compared"), soft_wrap=True)
    table = Table()
    for column in ("", "axis", "rms", "worst", "at s"):
        table.add_column(column, justify="right" if column in {"rms", "worst", "at s"} else "left", no_wrap=True)
    for what in QUANTITIES:
        for name, one in zip(JOINT_NAMES, comparison.differences[what], strict=True):
            first = f"{what}, {UNITS[what]}" if name == JOINT_NAMES[0] else ""
            table.add_row(first, name, f"{one.rms:.3f}", f"{one.worst:+.3f}", f"{one.worst_at_s:.3f}")
        table.add_section()
    console.print(table)
    for note in notes:
        console.print(plain(note), style="dim", soft_wrap=True)
    if plot is not None:
        console.print(plain(f"picture: {plot}"), soft_wrap=True)
