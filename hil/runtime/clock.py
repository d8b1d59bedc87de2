"""Clocks. Only this module reads one."""

import asyncio
import time
from typing import Protocol


class Clock(Protocol):
    """Monotonic time in integer nanoseconds."""

    def now_ns(self) -> int:
        """Return the present time."""


class MonotonicClock:
    """The machine's CLOCK_MONOTONIC, the one timerfd runs on."""

    def now_ns(self) -> int:
        """Return the present time."""
        return time.monotonic_ns()


class VirtualClock:
    """Time that moves only when told to: the same controller as fast as the machine can."""

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns

    def now_ns(self) -> int:
        """Return the present time."""
        return self._now_ns

    def advance(self, by_ns: int) -> int:
        """Move on by ``by_ns`` (not negative) and return the new time."""
        if by_ns < 0:
            raise ValueError(f"time cannot go back by {-by_ns} ns")
        self._now_ns += by_ns
        return self._now_ns


def unix_time_ns() -> int:
    """Return Unix time; for time stamps on the wire and in captures, never for pacing."""
    return time.time_ns()


async def let_others_run(passes: int) -> None:
    """Give every other task and socket of the event loop its turn, ``passes`` times."""
    for _ in range(passes):
        await asyncio.sleep(0)  # noqa: TID251  # a turn, not a time


def elapsed_ns() -> int:
    """Return the time base for measuring how long something took."""
    return time.perf_counter_ns()
