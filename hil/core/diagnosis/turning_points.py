"""Where one number turns back as it goes to and fro: its peaks and valleys, in bounded memory."""

from collections import deque
from collections.abc import Sequence
from typing import Final, NamedTuple

FLOOR_RAD: Final = 2e-4
"""An axis that goes back by less has not turned: 0.2 mrad are 0.2 mm at a metre."""
_SHARE_OF_SWING: Final = 0.15
"""Nor has one that goes back by less than this share of its swing before."""
_QUIET_HALVES: Final = 4
"""After so many half periods without a turn the swing before is forgotten."""
REMEMBERED: Final = 64
MOST_ROWS: Final = 32
_FEW: Final = 8
_UNEVEN: Final = (0.0, 0.03, 0.1, 0.22, 0.4, 0.58, 0.8, 1.0)


def _places(count: int) -> tuple[int, ...]:
    """Return which of ``count`` values to look at first: all of few, else some at uneven distances, with both ends.

    A swing of any period shows in them, unless it is small against the way in between.
    """
    return tuple(range(count)) if count <= _FEW else tuple(sorted({round(part * (count - 1)) for part in _UNEVEN}))


_PLACES: Final = tuple(map(_places, range(MOST_ROWS + 1)))


class Turn(NamedTuple):
    """A peak or a valley."""

    at_ns: int
    value: float
    peak: bool


class TurningPoints:
    """Takes a number as it comes and keeps its last :data:`REMEMBERED` turns.

    A turn is known once the number has gone back far enough. Its time is when the number first had that value.
    """

    __slots__ = ("_at_ns", "_back", "_best", "_rising", "swings", "turns")

    def __init__(self) -> None:
        self.turns: deque[Turn] = deque(maxlen=REMEMBERED)
        self.swings: deque[float] = deque(maxlen=REMEMBERED - 1)
        """From each turn to the next."""
        self._rising: bool | None = None
        self._best = 0.0
        """The farthest value in the present direction."""
        self._at_ns = -1
        self._back = FLOOR_RAD

    def take(self, times_ns: Sequence[int], rows: Sequence[Sequence[float]], column: int) -> bool:
        """Take the numbers in a column of ``rows``, in the order of time; return whether they turned."""
        at = _PLACES[len(rows)]
        sample = [rows[place][column] for place in at]
        low, high, first, last = min(sample), max(sample), sample[0], sample[-1]
        if self._at_ns < 0:
            self._at_ns, self._best = times_ns[0], first
        if high - self._best < FLOOR_RAD and self._best - low < FLOOR_RAD:
            return False
        if (first == low and last == high and sample == sorted(sample)) or (
            first == high and last == low and sample[::-1] == sorted(sample)
        ):
            # One way all along: where it turned, if it did, is at one of the ends.
            place = at[sample.index(last)]
            while place and rows[place - 1][column] == last:
                place -= 1
            turned = self._take(times_ns[0], first)
            return self._take(times_ns[place], last) or turned
        turned = False
        for at_ns, row in zip(times_ns, rows, strict=True):
            turned |= self._take(at_ns, row[column])
        return turned

    def _take(self, at_ns: int, value: float) -> bool:
        off = value - self._best
        rising = self._rising
        if rising is None:
            if abs(off) >= FLOOR_RAD:
                self._rising, self._best, self._at_ns = off > 0.0, value, at_ns
            return False
        if (off > 0.0) if rising else (off < 0.0):
            self._best, self._at_ns = value, at_ns
            return False
        if abs(off) < self._back and not (abs(off) >= FLOOR_RAD and self._long_quiet(at_ns)):
            return False
        turns = self.turns
        turns.append(Turn(self._at_ns, self._best, rising))
        if len(turns) > 1:
            swing = abs(turns[-1].value - turns[-2].value)
            self.swings.append(swing)
            self._back = max(FLOOR_RAD, _SHARE_OF_SWING * swing)
        self._rising, self._best, self._at_ns = not rising, value, at_ns
        return True

    def _long_quiet(self, at_ns: int) -> bool:
        turns = self.turns
        return len(turns) < 2 or at_ns - turns[-1].at_ns > _QUIET_HALVES * (turns[-1].at_ns - turns[-2].at_ns)
