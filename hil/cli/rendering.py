"""``hil rendering``: the robots of a station live in a scene of CoppeliaSim (manual, chapter 6)."""

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from hil.cli.plain import plain
from hil.values.errors import HilError, UsageError

if TYPE_CHECKING:
    from rich.table import Table

    from tools.view.connection import RenderingConnection, Row
    from tools.view.watch import Watch

_PERIOD_S: Final = 0.05
_RETRY_PERIODS: Final = 40
"""A renderer that was lost is asked again after 2 s."""
DEFAULT_COPPELIASIM = "127.0.0.1:23000"


def rendering(
    station: Annotated[Path, typer.Argument(metavar="STATION.toml", help="Station file of the running controller.")],
    *,
    scene: Annotated[
        Path | None, typer.Option(metavar="FILE.ttt", help="Scene to load; default: the one kept with the station.")
    ] = None,
    coppeliasim: Annotated[
        str, typer.Option(metavar="HOST[:PORT]", help="ZMQ remote API server of CoppeliaSim.")
    ] = DEFAULT_COPPELIASIM,
    devices: Annotated[
        list[str] | None,
        typer.Option(metavar="ROBOT=DEVICE", help="Which robot of the scene a robot is; kept with the station."),
    ] = None,
    socket: Annotated[
        Path | None, typer.Option("--socket", metavar="PATH", help="Pad of the controller; your only one is found.")
    ] = None,
    choices: Annotated[bool, typer.Option("--choices", help="Show what is kept with the station, and end.")] = False,
) -> None:
    """Show the robots of a running controller live in a scene of CoppeliaSim, with their frames, until Ctrl-C.

    A robot that is lost is red there and in the table. Enter reads station and scene again. Scene and devices are kept
    beside the station file, in STATION.rendering.toml.
    """
    if choices:
        _show_choices(station)
        return
    wanted = [_device(text) for text in devices or ()]
    from tools.view.choices import COPPELIASIM
    from tools.view.connection import RenderingConnection
    from tools.view.coppelia import CoppeliaSim
    from tools.view.sources import from_pad
    from tools.view.station_robots import station_robots
    from tools.view.watch import Watch

    renderer = CoppeliaSim(coppeliasim, folder=station.parent)
    connection = RenderingConnection(renderer, kind=COPPELIASIM, read_station=station_robots)
    try:
        connection.select_station(station)
        if scene is not None:
            connection.select_scene(renderer.kept_name(scene))
        if not connection.scene:
            raise UsageError(f"no scene is kept with {station} yet; choose one with --scene FILE.ttt")
        with Watch(from_pad(socket), name="hil rendering") as watch:
            _say(f"loading {connection.scene} in CoppeliaSim at {renderer.link.address}")
            connection.load_scene()
            # All are free first, so that two may change places.
            for robot, device in (*((robot, "") for robot, _ in wanted), *wanted):
                connection.assign(robot, device)
            if not any(row.device for row in connection.rows()):
                raise UsageError(
                    f"choose which robot of the scene each one is, with --devices ROBOT=DEVICE; the scene has "
                    f"{', '.join(connection.devices)}, the station {', '.join(row.robot for row in connection.rows())}"
                )
            connection.start_live_view()
            frames = connection.synchronise_frames()
            _say(f"the live view is on; {frames} frames are drawn; Enter reads station and scene again, Ctrl-C ends it")
            for note in renderer.notes:
                _say(note)
            _run(connection, watch)
    finally:
        connection.close()


def _run(connection: "RenderingConnection", watch: "Watch") -> None:
    ended, again = threading.Event(), threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: ended.set())
    threading.Thread(target=_read_input, args=(again,), daemon=True).start()
    if not sys.stdout.isatty():
        _follow(connection, watch, ended, again, _Lines())
        return
    from rich.live import Live

    with Live(auto_refresh=False) as live:
        _follow(connection, watch, ended, again, lambda one: live.update(_table(one), refresh=True))


def _follow(
    connection: "RenderingConnection",
    watch: "Watch",
    ended: threading.Event,
    again: threading.Event,
    tell: "Callable[[RenderingConnection], None]",
) -> None:
    waited = 0
    while not ended.wait(_PERIOD_S):
        connection.show(watch.now())
        waited = waited + 1 if connection.trouble else 0
        if again.is_set() or waited >= _RETRY_PERIODS:
            again.clear()
            waited = 0
            _refresh(connection)
        tell(connection)
    with contextlib.suppress(HilError):
        connection.stop_live_view()


def _refresh(connection: "RenderingConnection") -> None:
    try:
        connection.refresh()
        frames = connection.synchronise_frames()
    except HilError as error:
        # What makes the live view stand still is shown as long as it does.
        if not connection.trouble:
            _say(str(error))
    else:
        _say(f"station and scene were read again; {frames} frames are drawn")


class _Lines:
    """A line a change, where there is no terminal."""

    def __init__(self) -> None:
        self._told: dict[str, str] = {}

    def __call__(self, connection: "RenderingConnection") -> None:
        lines = {row.robot: _line(row) for row in connection.rows()}
        lines[""] = f"the live view stands still: {connection.trouble}" if connection.trouble else ""
        for name, line in lines.items():
            if self._told.get(name, "") != line:
                typer.echo(line or "the live view goes on")
        self._told = lines


def _line(row: "Row") -> str:
    from tools.view.connection import NO_DEVICE

    return f"{row.robot}: {row.device or NO_DEVICE}, {f'lost: {row.lost}' if row.lost else 'connected'}"


def _table(connection: "RenderingConnection") -> "Table":
    from rich.table import Table

    caption = f"[bold red]it stands still: {plain(connection.trouble)}[/bold red]" if connection.trouble else None
    table = Table("robot", "model", "robot of the scene", "connection", title=plain(connection.scene), caption=caption)
    for row in connection.rows():
        cells = (row.robot, row.model, row.device or "-", row.lost or "connected")
        table.add_row(*map(plain, cells), style="red" if row.lost else None)
    return table


def _show_choices(station: Path) -> None:
    from tools.view.choices import BROWSER, COPPELIASIM, load_choices
    from tools.view.station_robots import station_robots

    robots = station_robots(station)
    for renderer in (BROWSER, COPPELIASIM):
        kept = load_choices(station, renderer)
        typer.echo(f"{renderer}: {kept.scene or 'no scene was chosen yet'}")
        if kept.scene:
            for one in robots:
                typer.echo(f"  {one.name} ({one.model}): {kept.devices.get(one.name, '-')}")


def _device(text: str) -> tuple[str, str]:
    robot, equals, device = text.partition("=")
    if not (robot and equals and device):
        raise UsageError(f"--devices {text!r} is not ROBOT=DEVICE, such as left=/LBRiiwa7R800")
    return robot, device


def _read_input(again: threading.Event) -> None:
    # Not through sys.stdin, whose lock a thread that reads would hold at the end of the interpreter.
    with contextlib.suppress(OSError):
        while os.read(0, 4096):
            again.set()


def _say(line: str) -> None:
    typer.echo(f"rendering: {line}", err=True)
