"""What became of a servo motion's destinations, beside what :class:`Accounting` counts: arrivals, ages, rate.

A motion lives on without it; it is for people who ask why their set points do nothing.
"""

import math
from typing import Final

from hil.core.statistics import Histogram
from hil.values.time_statistic import time_statistic

LONGEST_SECTION_NS: Final = 500_000_000
"""Destinations farther apart are points to go to, not a stream."""
BATCH: Final = 32
"""Times that are counted together: one after the other they cost half as much as each in its own cycle."""


class Spacing:
    """Times between events in ns: number, shortest, mean, longest, standard deviation. Exact, in bounded memory."""

    __slots__ = ("_last_ns", "_squares", "_sum", "count", "longest_ns", "shortest_ns")

    def __init__(self) -> None:
        self.count = 0
        self.shortest_ns = 0
        self.longest_ns = 0
        self._sum = 0
        self._squares = 0
        self._last_ns: int | None = None

    def event(self, at_ns: int) -> None:
        """Something happened; count the time since it happened last."""
        last_ns, self._last_ns = self._last_ns, at_ns
        if last_ns is None:
            return
        time_ns = at_ns - last_ns
        # Comparisons, not min() and max(): this may run in every cycle.
        if time_ns > self.longest_ns:  # noqa: PLR1730
            self.longest_ns = time_ns
        if time_ns < self.shortest_ns or not self.count:
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
        "_ages",
        "_ages_ns",
        "_arrivals_ns",
        "_spacing",
        "_stream_began_ns",
        "_streamed_ns",
        "_streams",
        "refused",
        "replaced_on_the_way",
    )

    def __init__(self) -> None:
        self.replaced_on_the_way = 0
        """Asked for by the application, but replaced by a newer one before they came here."""
        self.refused = 0
        self._spacing = Spacing()
        self._ages = Histogram()
        self._arrivals_ns: list[int] = []
        self._ages_ns: list[int] = []
        self._streams = 0
        self._streamed_ns = 0
        self._stream_began_ns = 0

    def arrived(self, at_ns: int) -> None:
        """A destination arrived, to be taken or refused."""
        arrivals_ns = self._arrivals_ns
        arrivals_ns.append(at_ns)
        if len(arrivals_ns) >= BATCH:
            self._count()

    def executed(self, *, age_ns: int) -> None:
        """The interpolator has a destination that was set while the motion ran, so long after its arrival."""
        ages_ns = self._ages_ns
        ages_ns.append(age_ns)
        if len(ages_ns) >= BATCH:
            self._count()

    @property
    def spacing(self) -> Spacing:
        """Of the arrivals of destinations."""
        self._count()
        return self._spacing

    @property
    def ages(self) -> Histogram:
        """From the arrival of a destination to the cycle in which the interpolator has it, ns."""
        self._count()
        return self._ages

    def stream_begins(self, now_ns: int, *, before_ns: int = 0) -> None:
        """The interpolator has its first destination, or the next one a long time after that of ``before_ns``."""
        if self._streams:
            self._streamed_ns += before_ns - self._stream_began_ns
        self._streams += 1
        self._stream_began_ns = now_ns

    def executed_per_s(self, *, executed: int, executed_at_ns: int) -> float | None:
        """Return the effective rate: how many destinations the interpolator had in a second while they streamed.

        Times of more than half a second between two of them are left out. None where there were no two.
        """
        streamed_ns = self._streamed_ns + executed_at_ns - self._stream_began_ns
        return (executed - self._streams) / streamed_ns * 1e9 if executed > self._streams and streamed_ns else None

    def _count(self) -> None:
        for at_ns in self._arrivals_ns:
            self._spacing.event(at_ns)
        for age_ns in self._ages_ns:
            self._ages.add(age_ns)
        self._arrivals_ns.clear()
        self._ages_ns.clear()
