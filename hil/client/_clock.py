"""The one clock of the client library: deadlines on the monotonic clock, and durations.

An application process has no controller's clock to be handed, and :mod:`hil.client` may not import the runtime's. So
this one small module reads the clock for the shells, and only to learn how long a wait for a datagram may still last
and how long a call took: no message, no command and no callback depends on it.
"""

import time


class Deadline:
    """A moment ``after_s`` seconds from now or from the last :meth:`restart`; None never comes."""

    def __init__(self, after_s: float | None) -> None:
        self._after_ns = None if after_s is None else int(after_s * 1e9)
        self._due_ns = 0
        self.restart()

    def restart(self) -> None:
        """Count from now again."""
        if self._after_ns is not None:
            self._due_ns = time.monotonic_ns() + self._after_ns

    def left_s(self) -> float | None:
        """Return the seconds left, not positive when it has passed; None for a deadline that never comes."""
        return None if self._after_ns is None else (self._due_ns - time.monotonic_ns()) * 1e-9


def stopwatch_ns() -> int:
    """Return the reading in ns of a clock that is good for durations and nothing else."""
    return time.perf_counter_ns()
