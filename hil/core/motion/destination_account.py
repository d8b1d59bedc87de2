"""What became of a servo motion's destinations, beside what :class:`Accounting` counts: arrivals, ages, rate.

A motion lives on without it; it is for people who ask why their set points do nothing.
"""

import math
from typing import Final

from hil.core.statistics import Histogram
from hil.values.time_statistic import time_statistic

LONGEST_SECTION_NS: Final = 500_000_000
"""Destinations farther apart are points to go to, not a stream."""


class Spacing:
    """Times between events in ns: number, shortest, mean, longest, standard deviation. Exact, in bounded memory."""

    __slots__ = ("_squares", "_sum", "count", "longest_ns", "shortest_ns")

    def __init__(self) -> None:
        self.count = 0
        self.shortest_ns = 0
        self.longest_ns = 0
        self._sum = 0
        self._squares = 0

    def add(self, time_ns: int) -> None:
        """Count one time."""
        if not self.count:
            self.shortest_ns = self.longest_ns = time_ns
        elif time_ns > self.longest_ns:
            self.longest_ns = time_ns
        elif time_ns < self.shortest_ns:
            self.shortest_ns = time_ns
        self.count += 1
        self._sum += time_ns
        self._squares += time_ns * time_ns

    @property
    def mean_ns(self) -> float:
        """Mean; 0 of nothing."""
        return self._sum / self.count if self.count else 0.0

    @property
    def standard_deviation_ns(self) -> float:
        """Standard deviation of the times themselves (divided by their number); 0 of nothing."""
        count = self.count
        return math.sqrt(count * self._squares - self._sum * self._sum) / count if count else 0.0

    def __str__(self) -> str:
        return time_statistic(
            count=self.count,
            min_ms=self.shortest_ns / 1e6,
            mean_ms=self.mean_ns / 1e6,
            max_ms=self.longest_ns / 1e6,
            standard_deviation_ms=self.standard_deviation_ns / 1e6,
        )

    def report(self) -> dict[str, object]:
        """Return it for the status file."""
        return {
            "count": self.count,
            "min": round(self.shortest_ns / 1e6, 3),
            "mean": round(self.mean_ns / 1e6, 3),
            "max": round(self.longest_ns / 1e6, 3),
            "standard_deviation": round(self.standard_deviation_ns / 1e6, 3),
        }


class DestinationAccount:
    """The account of one motion; times are core times in ns."""

    __slots__ = (
        "_arrived_ns",
        "_executed_ns",
        "_stream_executed",
        "_stream_ns",
        "ages",
        "refused",
        "replaced_on_the_way",
        "spacing",
    )

    def __init__(self) -> None:
        self.replaced_on_the_way = 0
        """Asked for by the application, but replaced by a newer one before they came here."""
        self.refused = 0
        self.spacing = Spacing()
        """Between arrivals of destinations, whether they were taken or refused."""
        self.ages = Histogram()
        """From arrival to the cycle in which the interpolator has it; of those set while the motion ran."""
        self._arrived_ns: int | None = None
        self._executed_ns: int | None = None
        self._stream_executed = 0
        self._stream_ns = 0

    def arrived(self, at_ns: int) -> None:
        """A destination arrived."""
        before_ns = self._arrived_ns
        if before_ns is not None:
            self.spacing.add(at_ns - before_ns)
        self._arrived_ns = at_ns

    def executed(self, *, arrived_ns: int, at_ns: int) -> None:
        """The interpolator has a destination."""
        self.ages.add(at_ns - arrived_ns)
        before_ns = self._executed_ns
        if before_ns is not None and (since_ns := at_ns - before_ns) <= LONGEST_SECTION_NS:
            self._stream_executed += 1
            self._stream_ns += since_ns
        self._executed_ns = at_ns

    @property
    def executed_per_s(self) -> float | None:
        """Effective rate: destinations executed in a second while they stream; times between them of more than half a
        second are left out. None of fewer than two.
        """
        return self._stream_executed / self._stream_ns * 1e9 if self._stream_ns else None
