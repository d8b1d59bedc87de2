"""``hil top``: running robots in the terminal, for people on SSH."""

import signal
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from hil.values.errors import ConfigurationError

if TYPE_CHECKING:
    from tools.view.watch import Watch

_STATE_PERIOD_MS: Final = 50
_FRAME_S: Final = 0.1
_LINE_S: Final = 1.0
_FIRST_S: Final = 2.0
"""How long one picture waits for the pad, which is asked in a thread of its own."""


def top(
    robots: Annotated[
        list[str] | None,
        typer.Argument(metavar="[HOST[:PORT]]...", help="Servo links to watch; none: your controller's."),
    ] = None,
    *,
    socket: Annotated[
        Path | None, typer.Option("--socket", metavar="PATH", help="Pad of the controller; your only one is found.")
    ] = None,
    servo_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Pre-shared key of the servo links given by address.")
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Show it once, and end.")] = False,
) -> None:
    """Show running robots in the terminal, live; it only looks. Ctrl-C ends it.

    Where the output is no terminal, each robot is a line a second.
    """
    if robots and socket is not None:
        raise ConfigurationError("give either the addresses of servo links or a controller's socket (--socket)")
    from tools.view.sources import from_addresses, from_pad
    from tools.view.watch import Watch

    sources = from_addresses(robots, key_file=servo_key) if robots else from_pad(socket)
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: ended.set())
    with Watch(sources, name="hil top", period_ms=_STATE_PERIOD_MS) as watch:
        if once:
            _once(watch, ended)
        elif sys.stdout.isatty():
            _full_screen(watch, ended)
        else:
            _lines(watch, ended)


def _once(watch: "Watch", ended: threading.Event) -> None:
    from rich.console import Console

    from tools.view.terminal import figures_of, screen

    if watch.sources.pad is not None:
        for _ in range(round(_FIRST_S / _FRAME_S)):
            if watch.pad() or ended.wait(_FRAME_S):
                break
    console = Console(highlight=False)
    console.print(screen(figures_of(watch), width=console.width, height=None))


def _full_screen(watch: "Watch", ended: threading.Event) -> None:
    from rich.console import Console
    from rich.live import Live

    from tools.view.terminal import figures_of, screen

    console = Console(highlight=False)
    with Live(console=console, screen=True, auto_refresh=False) as live:
        while not ended.is_set():
            live.update(screen(figures_of(watch), width=console.width, height=console.height), refresh=True)
            ended.wait(_FRAME_S)


def _lines(watch: "Watch", ended: threading.Event) -> None:
    from tools.view.terminal import figures_of, one_line

    while not ended.is_set():
        for robot in figures_of(watch):
            typer.echo(one_line(robot))
        ended.wait(_LINE_S)
