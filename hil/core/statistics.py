"""Distributions in bounded memory."""

import math
from array import array
from typing import Final

import numpy as np

_SUB_BITS = 6
_SUB = 1 << _SUB_BITS
_DIRECT_BITS = _SUB_BITS + 1
"""Values of fewer bits have a bucket each."""
_BUCKETS = (64 - _SUB_BITS) * _SUB
_MORE_THAN_ANY = 1 << 64
FINE_SHIFT: Final = 10
_FINE_BUCKETS: Final = 4096


class Histogram:
    """Counts of non-negative integers (nanoseconds) in log-linear buckets: 1.6 % wide, 30 kB.

    Count, minimum, mean, maximum and standard deviation are exact, quantiles to a bucket. ``add`` is what runs in every
    cycle; reading costs some microseconds.
    """

    def __init__(self) -> None:
        self._counts = array("Q", bytes(8 * _BUCKETS))
        self._least = _MORE_THAN_ANY
        self._sum = 0
        self._sum_of_squares = 0
        self.maximum = 0

    def add(self, value: int, count: int = 1) -> None:
        """Count one ``value``, or more of it; a negative one counts as 0."""
        # Comparisons, not max(), and no count of its own: each call or attribute costs a tenth of all this.
        if value < 0:  # noqa: PLR1730
            value = 0
        shift = value.bit_length() - _DIRECT_BITS
        self._counts[value if shift < 0 else (shift << _SUB_BITS) + (value >> shift)] += count
        self._sum += count * value
        self._sum_of_squares += count * value * value
        if value > self.maximum:  # noqa: PLR1730
            self.maximum = value
        if value < self._least:  # noqa: PLR1730
            self._least = value

    @property
    def count(self) -> int:
        """Values that were counted."""
        return int(np.frombuffer(self._counts, dtype=np.uint64).sum())

    @property
    def minimum(self) -> int | None:
        """Smallest value; None when empty."""
        return None if self._least == _MORE_THAN_ANY else self._least

    @property
    def mean(self) -> float | None:
        """Average value; None when empty."""
        count = self.count
        return self._sum / count if count else None

    @property
    def standard_deviation(self) -> float | None:
        """Standard deviation of the values themselves (divided by their number); None when empty."""
        count = self.count
        # Whole numbers: nothing is lost where two large sums differ by little.
        return math.sqrt(count * self._sum_of_squares - self._sum * self._sum) / count if count else None

    def add_all(self, other: "Histogram") -> None:
        """Count all that ``other`` counted."""
        counts = np.frombuffer(self._counts, dtype=np.uint64)
        counts += np.frombuffer(other._counts, dtype=np.uint64)
        self._sum += other._sum
        self._sum_of_squares += other._sum_of_squares
        self._least = min(self._least, other._least)
        self.maximum = max(self.maximum, other.maximum)

    def quantile(self, fraction: float) -> int | None:
        """Return the upper edge of the bucket that holds the quantile, at most the maximum; None when empty."""
        up_to = np.cumsum(np.frombuffer(self._counts, dtype=np.uint64))
        count = int(up_to[-1])
        if not count:
            return None
        wanted = max(1, math.ceil(count * fraction))
        index = int(np.searchsorted(up_to, wanted))
        return min(_upper_edge(index), self.maximum)

    def summary_us(self) -> dict[str, float | None]:
        """Return p50, p99, p99_9 and max in microseconds; None where nothing was counted."""

        def microseconds(value_ns: int | None) -> float | None:
            return None if value_ns is None else round(value_ns / 1000, 1)

        return {
            "p50": microseconds(self.quantile(0.5)),
            "p99": microseconds(self.quantile(0.99)),
            "p99_9": microseconds(self.quantile(0.999)),
            "max": microseconds(self.maximum if self.count else None),
        }


class CycleHistogram:
    """What is counted in every cycle, in a third of the time: 1.024 us wide up to 4.2 ms, then as :class:`Histogram`.

    Who has no time for a call writes ``fine[value >> FINE_SHIFT] += 1`` for a value that is not negative, and calls
    :meth:`add_long` for one that this raises ``IndexError`` for.
    """

    def __init__(self) -> None:
        self.fine = [0] * _FINE_BUCKETS
        self._long = Histogram()

    def add(self, value: int) -> None:
        """Count one ``value``; a negative one counts as 0."""
        try:
            self.fine[value >> FINE_SHIFT if value > 0 else 0] += 1
        except IndexError:
            self._long.add(value)

    def add_long(self, value: int) -> None:
        """Count a value for which there is no fine bucket."""
        self._long.add(value)

    def whole(self) -> Histogram:
        """Return all that was counted until now; fine values at the upper edge of their bucket, the maximum too."""
        whole = Histogram()
        for bucket in [bucket for bucket, count in enumerate(self.fine) if count]:
            whole.add(((bucket + 1) << FINE_SHIFT) - 1, self.fine[bucket])
        whole.add_all(self._long)
        return whole


def _upper_edge(index: int) -> int:
    if index < _SUB:
        return index
    shift = index // _SUB - 1
    return ((index % _SUB + _SUB + 1) << shift) - 1
