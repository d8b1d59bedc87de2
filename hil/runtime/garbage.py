"""The garbage collector runs between control cycles, never in one.

Automatic collection begins wherever the next object is made, which may be in the middle of a cycle. So it is switched
off while robots run. What was made before stays out of every collection (``gc.freeze``); the little that a run adds is
looked through right after a cycle, when its successor is almost a period away.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from hil.clock import elapsed_ns

YOUNG_EVERY: Final = 1000
"""Cycles from one collection of what is new to the next: a second at 1 kHz."""
FULL_EVERY: Final = 60_000
"""Cycles from one full collection to the next."""


class Garbage:
    """Collections between cycles, and what they took."""

    def __init__(self) -> None:
        self.young = 0
        self.full = 0
        self.longest_ns = 0
        self._next_young = YOUNG_EVERY
        self._next_full = FULL_EVERY

    def between_cycles(self, cycles: int) -> None:
        """Collect, where it is time for that after so many cycles. Some may have been caught up since the last call."""
        if cycles < self._next_young:
            return
        self._next_young = cycles + YOUNG_EVERY
        before_ns = elapsed_ns()
        if cycles < self._next_full:
            gc.collect(0)
            self.young += 1
        else:
            gc.collect()
            self.full += 1
            self._next_full = cycles + FULL_EVERY
        self.longest_ns = max(self.longest_ns, elapsed_ns() - before_ns)

    def report(self) -> dict[str, object]:
        """Return the figures of the status file."""
        return {"young": self.young, "full": self.full, "longest_us": round(self.longest_ns / 1e3, 1)}


@contextmanager
def no_automatic_collection() -> Iterator[None]:
    """Collect once, keep what is there out of all collections, and let none begin by itself until the block ends."""
    was_on = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
        gc.unfreeze()
