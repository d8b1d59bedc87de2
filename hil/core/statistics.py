"""Distributions in bounded memory."""

import math
from array import array
from typing import Final

import numpy as np

_SUB_BITS = 6
_SUB = 1 << _SUB_BITS
_BUCKETS = (64 - _SUB_BITS) * _SUB
FINE_SHIFT: Final = 10
_FINE_BUCKETS: Final = 4096


class Histogram:
    """Counts of non-negative integers (nanoseconds) in log-linear buckets: 1.6 % wide, 30 kB, exact maximum."""

    def __init__(self) -> None:
        self._counts = array("Q", bytes(8 * _BUCKETS))
        self.count = 0
        self.maximum = 0

    def add(self, value: int, count: int = 1) -> None:
        """Count one ``value``, or more of it; a negative one counts as 0."""
        # Comparisons, not max(): this runs every cycle, and a call costs more than they do.
        if value < 0:  # noqa: PLR1730
            value = 0
        shift = value.bit_length() - _SUB_BITS - 1
        index = value if shift < 0 else (shift + 1) * _SUB + (value >> shift) - _SUB
        self._counts[index] += count
        self.count += count
        if value > self.maximum:  # noqa: PLR1730
            self.maximum = value

    def add_all(self, other: "Histogram") -> None:
        """Count all that ``other`` counted."""
        counts = np.frombuffer(self._counts, dtype=np.uint64)
        counts += np.frombuffer(other._counts, dtype=np.uint64)
        self.count += other.count
        self.maximum = max(self.maximum, other.maximum)

    def quantile(self, fraction: float) -> int | None:
        """Return the upper edge of the bucket that holds the quantile, at most the maximum; None when empty."""
        if not self.count:
            return None
        wanted = max(1, math.ceil(self.count * fraction))
        index = int(np.searchsorted(np.cumsum(np.frombuffer(self._counts, dtype=np.uint64)), wanted))
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
