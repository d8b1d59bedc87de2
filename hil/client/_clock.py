"""The one clock of the client library: deadlines on the monotonic clock, and durations.

An application process has no controller's clock to be handed, and :mod:`hil.client` may not import the runtime's. So
this one small module reads the clock for the shells, and only to learn how long a wait for a datagram may still last
and how long a call took: no message, no command and no callback depends on it.
"""

import math
import threading
import time

from hil.values.errors import ConfigurationError


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
