"""How far a measurement is, told without disturbing what it measures."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def waiting(what: str, seconds: float) -> Iterator[Callable[[float], None]]:
    """Show on the terminal, if there is one, how much of ``seconds`` is over; yield what is told so.

    A bar is drawn by a thread of its own, which takes the interpreter from the loop that is measured. This writes a few
    bytes when it is told to, and nothing where the errors go to a file.
    """
    if not sys.stderr.isatty():
        yield lambda _: None
        return

    def show(gone_s: float) -> None:
        sys.stderr.write(f"\r{what}: {gone_s:.0f} of {seconds:g} s ")

    show(0)
    try:
        yield show
    finally:
        sys.stderr.write("\r\x1b[K")
