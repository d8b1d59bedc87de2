"""Replies, each of them one write: US-ASCII, ended by one LF (a pin's by two)."""

from collections.abc import Iterable
from typing import Final

from transport.kst.numbers import java_text

DONE: Final = b"done\n"
NAK: Final = b"nak\n"
INTERRUPTED: Final = b"interrupted\n"
REPLY_MOST_BYTES: Final = 1024
"""What a published client reads at once, and takes for the whole reply."""


def values_reply(values: Iterable[float]) -> bytes:
    """Return a list of numbers: each followed by an underscore, the last one too."""
    return ("".join(f"{java_text(float(value))}_" for value in values) + "\n").encode("ascii")


def pin_reply(high: bool) -> bytes:
    """Return the state of an input."""
    return b"1\n\n" if high else b"0\n\n"
