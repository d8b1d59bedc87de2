"""Clocks. Only this module reads one; it is for the shells, the client library, the tools and the tests.

The core is handed its time. What the client library measures decides how long a wait for a datagram may still last and
how long a call took, and nothing else: no message, no command and no callback depends on it. A test that runs client
code in virtual time puts another clock under it with :func:`using`.
"""

import asyncio
import math
import threading
import time  # noqa: TID251  # the one module that may
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from hil.values.errors import ConfigurationError

_read_ns = time.perf_counter_ns
"""What the client library's deadlines and stopwatches read: the function itself, so that a reading costs one call."""


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


@contextmanager
def using(clock: Clock) -> Iterator[None]:
    """Let the client library measure with ``clock`` until the block ends; for tests in virtual time.

    It holds for the whole process, because a blocking client has a thread of its own. A :class:`Deadline` keeps the
    clock it was made under, so make a client inside the block, and close it there. A client that waits in a socket or
    an event loop still waits in real time: somebody has to send it what it waits for, or to wake it.
    """
    global _read_ns  # noqa: PLW0603  # one clock for all threads of the process is what it is for
    before, _read_ns = _read_ns, clock.now_ns
    try:
        yield
    finally:
        _read_ns = before


class Deadline:
    """A moment ``after_s`` seconds from now or from the last :meth:`restart`; None never comes.

    What is farther away than a thread can wait for (some 292 years) never comes either. Raises
    :class:`ConfigurationError` for what is not a number.
    """

    def __init__(self, after_s: float | None) -> None:
        if after_s is not None and math.isnan(after_s):
            raise ConfigurationError("a timeout of nan s; a number of seconds is needed, or None to wait for ever")
        never = after_s is None or after_s > threading.TIMEOUT_MAX
        self._after_ns = None if never or after_s is None else int(max(after_s, -1.0) * 1e9)
        self._now_ns = _read_ns
        self._due_ns = 0
        self.restart()

    def restart(self) -> None:
        """Count from now again."""
        if self._after_ns is not None:
            self._due_ns = self._now_ns() + self._after_ns

    def left_s(self) -> float | None:
        """Return the seconds left, not positive when it has passed; None for a deadline that never comes."""
        return None if self._after_ns is None else (self._due_ns - self._now_ns()) * 1e-9


def stopwatch_ns() -> int:
    """Return the reading in ns of the client library's clock: good for durations and nothing else."""
    return _read_ns()


def elapsed_ns() -> int:
    """Return the time base in ns for measuring what something cost the machine; never virtual."""
    return time.perf_counter_ns()


def unix_time_ns() -> int:
    """Return Unix time; for time stamps on the wire and in captures, never for pacing."""
    return time.time_ns()


class Pause:
    """Makes the thread wait for moments of another time, which goes ``factor`` times as fast as the machine's."""

    def __init__(self, factor: float) -> None:
        self._factor = factor
        self._began_ns: int | None = None
        self._first_ns = 0
        self._never = threading.Event()

    def until(self, moment_ns: int) -> None:
        """Return when ``moment_ns`` has come; the first one told is now."""
        now_ns = time.monotonic_ns()
        if self._began_ns is None:
            self._began_ns, self._first_ns = now_ns, moment_ns
        left_s = ((moment_ns - self._first_ns) / self._factor - (now_ns - self._began_ns)) * 1e-9
        if left_s > 0:
            self._never.wait(left_s)


async def let_others_run(passes: int) -> None:
    """Give every other task and socket of the event loop its turn, ``passes`` times."""
    for _ in range(passes):
        await asyncio.sleep(0)  # noqa: TID251  # a turn, not a time
