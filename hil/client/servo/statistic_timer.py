"""Time statistics of recurring events, in the manual's text format (7.9.1)."""

import math
from threading import Lock
from types import TracebackType
from typing import Self

from hil.client.servo.errors import IllegalStateException
from hil.clock import stopwatch_ns
from hil.values.time_statistic import time_statistic


class StatisticTimer:
    """Number of measurements, shortest, average and longest time, and standard deviation; in bounded memory.

    ::

        timing = StatisticTimer()
        with timing.new_time_step():  # or: step = timing.new_time_step() ... step.end()
            ...
        print(timing)  # n(20687) T(0.91, 1.92, 6.36 msec) (stdDev 0.36)

    All figures are 0 before the first measurement ended. Threads may share one.
    """

    def __init__(self) -> None:
        self.count = 0
        """Measurements that ended."""
        self.min_ms = 0.0
        """Shortest time in ms."""
        self.mean_ms = 0.0
        """Average time in ms."""
        self.max_ms = 0.0
        """Longest time in ms."""
        self._sum_of_squares = 0.0
        self._lock = Lock()

    @property
    def standard_deviation_ms(self) -> float:
        """Standard deviation in ms, of the measurements themselves (divided by their number)."""
        return math.sqrt(self._sum_of_squares / self.count) if self.count else 0.0

    def new_time_step(self) -> "OneTimeStep":
        """Return a measurement that begins now."""
        return OneTimeStep(self)

    def add(self, duration_ms: float) -> None:
        """Count a duration that was measured elsewhere."""
        with self._lock:
            self.count += 1
            self.min_ms = duration_ms if self.count == 1 else min(self.min_ms, duration_ms)
            self.max_ms = max(self.max_ms, duration_ms)
            # Welford: one pass, and no difference of large sums.
            distance = duration_ms - self.mean_ms
            self.mean_ms += distance / self.count
            self._sum_of_squares += distance * (duration_ms - self.mean_ms)

    def __str__(self) -> str:
        return time_statistic(
            count=self.count,
            min_ms=self.min_ms,
            mean_ms=self.mean_ms,
            max_ms=self.max_ms,
            standard_deviation_ms=self.standard_deviation_ms,
        )


class OneTimeStep:
    """One measurement; over at :meth:`end`, or at the end of its ``with`` block, unless an error ends that."""

    def __init__(self, timer: StatisticTimer) -> None:
        self._timer = timer
        self._ended = False
        self._began_ns = stopwatch_ns()

    def end(self) -> None:
        """Stop the measurement and count it; raise :class:`IllegalStateException` the second time."""
        ended_ns = stopwatch_ns()
        if self._ended:
            raise IllegalStateException("this time step has ended already; take a new one for each measurement")
        self._ended = True
        self._timer.add((ended_ns - self._began_ns) * 1e-6)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if kind is None and not self._ended:
            self.end()
