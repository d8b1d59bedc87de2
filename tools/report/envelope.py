"""Time series of any length in bounded memory, thinned so that no peak is lost.

Samples fall into bins of equal counts; of each bin the smallest and the largest value stay, each with its time. When
all bins are full, two become one, and from then on each takes twice as many samples. Up to that a bin holds one
sample: a short recording is drawn as it is.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
MOST_BINS: Final = 2048
"""Two points each: 4096 points a series."""
_BLOCK: Final = 4096
"""Samples that are thinned at once: numpy is then the smaller part of the cost of a sample."""


class _Bins(NamedTuple):
    """Bins by column: extremes, NaN where a bin holds no value, and when they were [s]."""

    low: Floats
    low_s: Floats
    high: Floats
    high_s: Floats

    @classmethod
    def empty(cls, columns: int) -> "_Bins":
        return cls(*(np.empty((0, columns)) for _ in range(4)))

    def joined(self, other: "_Bins") -> "_Bins":
        return _Bins(*(np.concatenate(both) for both in zip(self, other, strict=True)))

    def parted(self, count: int) -> tuple["_Bins", "_Bins"]:
        """Return the first ``count``, and the others."""
        return _Bins(*(one[:count] for one in self)), _Bins(*(one[count:] for one in self))

    def merged(self, count: int) -> "_Bins":
        """Make one of ``count`` neighbours each; the last may have fewer."""
        short = -len(self.low) % count
        padded = self if not short else self.joined(_Bins(*(np.full((short, self.low.shape[1]), np.nan),) * 4))
        shape = (-1, count, self.low.shape[1])
        low, low_s = _chosen(padded.low.reshape(shape), padded.low_s.reshape(shape), largest=False)
        high, high_s = _chosen(padded.high.reshape(shape), padded.high_s.reshape(shape), largest=True)
        return _Bins(low, low_s, high, high_s)


class Envelope:
    """Series of several values that share their times; ``columns`` is how many."""

    def __init__(self, columns: int, *, most_bins: int = MOST_BINS) -> None:
        self._columns = columns
        self._most_bins = most_bins
        self._rows: list[Sequence[float]] = []
        self._bins = _Bins.empty(columns)
        self._width = 1
        """Samples of a bin."""
        self._open = _Bins.empty(columns)
        """At most one bin, which is not full yet."""
        self._open_samples = 0
        self.samples = 0

    def add(self, row: Sequence[float]) -> None:
        """Take a sample: its time [s], then its values; NaN where there is none."""
        self._rows.append(row)
        if len(self._rows) >= _BLOCK:
            self._thin()

    def points(self, column: int) -> tuple[Floats, Floats]:
        """Return times [s] and values of a column in the order of time."""
        self._thin()
        low, low_s, high, high_s = (one[:, column] for one in self._bins.joined(self._open))
        low_first = low_s <= high_s
        times = np.column_stack((np.where(low_first, low_s, high_s), np.where(low_first, high_s, low_s))).ravel()
        values = np.column_stack((np.where(low_first, low, high), np.where(low_first, high, low))).ravel()
        # A bin of one sample has it twice.
        there = ~np.isnan(values)
        times, values = times[there], values[there]
        again = np.zeros(len(times), dtype=bool)
        again[1:] = (np.diff(times) == 0.0) & (np.diff(values) == 0.0)
        return times[~again], values[~again]

    @property
    def thinned(self) -> int:
        """Samples that two points stand for; 1 where every sample is there."""
        return self._width

    def _thin(self) -> None:
        if not self._rows:
            return
        block = np.array(self._rows, dtype=np.float64)
        self._rows.clear()
        self.samples += len(block)
        values = block[:, 1:]
        times = np.where(np.isnan(values), np.nan, block[:, :1])
        self._take(_Bins(values, times, values, times))

    def _take(self, fine: _Bins) -> None:
        """Put bins of one sample each behind the ones that are there."""
        while len(fine.low):
            if len(self._bins.low) >= self._most_bins:
                self._bins = self._bins.merged(2)
                self._width *= 2
                continue
            if self._open_samples:
                now, fine = fine.parted(self._width - self._open_samples)
                self._keep_open(now)
                continue
            room = self._most_bins - len(self._bins.low)
            whole, fine = fine.parted(min(len(fine.low) // self._width, room) * self._width)
            self._bins = self._bins.joined(whole.merged(self._width))
            if len(fine.low) < self._width:
                self._keep_open(fine)
                break

    def _keep_open(self, few: _Bins) -> None:
        """Put samples, no more than fit, into the bin that is not full."""
        if not len(few.low):
            return
        self._open_samples += len(few.low)
        both = self._open.joined(few)
        self._open = both.merged(len(both.low))
        if self._open_samples == self._width:
            self._bins = self._bins.joined(self._open)
            self._open, self._open_samples = _Bins.empty(self._columns), 0


def _chosen(values: Floats, times: Floats, *, largest: bool) -> tuple[Floats, Floats]:
    """Return the largest or smallest value of each bin and when it was; NaN where a bin has none."""
    nowhere = -np.inf if largest else np.inf
    filled = np.where(np.isnan(values), nowhere, values)
    place = np.expand_dims(filled.argmax(axis=1) if largest else filled.argmin(axis=1), 1)
    return np.take_along_axis(values, place, 1)[:, 0], np.take_along_axis(times, place, 1)[:, 0]
