"""Distributions in bounded memory."""

import math
from array import array

import numpy as np

_SUB_BITS = 6
_SUB = 1 << _SUB_BITS
_BUCKETS = (64 - _SUB_BITS) * _SUB


class Histogram:
    """Counts of non-negative integers (nanoseconds) in log-linear buckets: 1.6 % wide, 30 kB, exact maximum."""

    def __init__(self) -> None:
        self._counts = array("Q", bytes(8 * _BUCKETS))
        self.count = 0
        self.maximum = 0

    def add(self, value: int) -> None:
        """Count one ``value``; a negative one counts as 0."""
        # Comparisons, not max(): this runs every cycle, and a call costs more than they do.
        if value < 0:  # noqa: PLR1730
            value = 0
        shift = value.bit_length() - _SUB_BITS - 1
        index = value if shift < 0 else (shift + 1) * _SUB + (value >> shift) - _SUB
        self._counts[index] += 1
        self.count += 1
        if value > self.maximum:  # noqa: PLR1730
            self.maximum = value

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


def _upper_edge(index: int) -> int:
    if index < _SUB:
        return index
    shift = index // _SUB - 1
    return ((index % _SUB + _SUB + 1) << shift) - 1
