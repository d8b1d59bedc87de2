"""Statistics of times, in the manual's format and with percentiles; 30 kB once something is counted."""

from hil.client.servo.statistic_timer import StatisticTimer
from hil.core.statistics import Histogram

_NS_PER_MS = 1e6


class Spread:
    """Number, shortest, average, longest, deviation and percentiles of times."""

    def __init__(self) -> None:
        self.timer = StatisticTimer()
        self._histogram: Histogram | None = None

    def add(self, time_ns: int) -> None:
        """Count one; a negative one counts as 0."""
        time_ns = max(time_ns, 0)
        self.timer.add(time_ns / _NS_PER_MS)
        if self._histogram is None:
            self._histogram = Histogram()
        self._histogram.add(time_ns)

    @property
    def count(self) -> int:
        """Return how many were counted."""
        return self.timer.count

    def quantile_ms(self, fraction: float) -> float:
        """Return a quantile [ms]; 0 before the first."""
        found = None if self._histogram is None else self._histogram.quantile(fraction)
        return 0.0 if found is None else found / _NS_PER_MS

    def __str__(self) -> str:
        return str(self.timer)
