"""``hil view``: running robots in a browser, and the operator's pad beside them."""

import contextlib
import os
import signal
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.values.errors import ConfigurationError

if TYPE_CHECKING:
    from tools.view.browser.page import Page
    from tools.view.sources import Sources

DEFAULT_PORT = 8080


def view(
    robots: Annotated[
        list[str] | None,
        typer.Argument(metavar="[HOST[:PORT]]...", help="Servo links to watch; none: your controller's."),
    ] = None,
    *,
    socket: Annotated[
        Path | None, typer.Option("--socket", metavar="PATH", help="Pad of the controller; your only one is found.")
    ] = None,
    host: Annotated[str, typer.Option(metavar="ADDR", help="Where the page is served.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="Its port, or the next one that is free.")] = DEFAULT_PORT,
    station: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Station file; what is chosen in the page is kept beside it.")
    ] = None,
    token: Annotated[
        str | None, typer.Option(metavar="TEXT", help="The operator's token; a new one is made unless given.")
    ] = None,
    end_with_input: Annotated[
        bool, typer.Option("--end-with-input", hidden=True, help="End when the standard input does.")
    ] = False,
    servo_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Pre-shared key of the servo links given by address.")
    ] = None,
) -> None:
    """Show running robots in a browser, live, with the operator's pad. Ctrl-C ends it, and lets go of everything."""
    if robots and socket is not None:
        raise ConfigurationError("give either the addresses of servo links or a controller's socket (--socket)")
    from tools.view.sources import from_addresses, from_pad

    def find() -> "Sources":
        return from_addresses(robots, key_file=servo_key) if robots else from_pad(socket)

    sources = find()
    from tools.view.browser.page import Page, PageOptions
    from tools.view.token import checked_token, new_token
    from tools.view.watch import Watch

    secret = new_token() if token is None else checked_token(token)
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: ended.set())
    if end_with_input:
        threading.Thread(target=_end_with_input, args=(ended,), daemon=True).start()
    with Watch(sources) as watch:
        page = Page(watch, PageOptions(secret, find, host, port, station))
        try:
            page.open()
            _say(page, may_act=sources.pad is not None)
            page.run(ended)
        finally:
            page.close()


def _end_with_input(ended: threading.Event) -> None:
    # Not through sys.stdin, whose lock a thread that reads would hold at the end of the interpreter.
    with contextlib.suppress(OSError):
        while os.read(0, 4096):
            pass
    ended.set()


def _say(page: "Page", *, may_act: bool) -> None:
    typer.echo(f"view: {page.address} shows it", err=True)
    if may_act:
        typer.echo(f"view: {page.operator_address} is the operator's: keep it to yourself", err=True)
