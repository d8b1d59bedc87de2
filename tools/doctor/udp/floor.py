"""The line below delays: how fast two clocks drift apart, and how much later than the quickest something came."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple


class Floor(NamedTuple):
    """``delay_ns = base_ns + slope * (at_ns - from_ns)``; the slope is the drift of one clock against the other."""

    from_ns: int
    base_ns: int
    slope: float
    over_ns: int = 0
    """Between the two delays that the line touches."""

    def delay_ns(self, at_ns: int) -> int:
        """Return the line's delay at a time."""
        return self.base_ns + round(self.slope * (at_ns - self.from_ns))

    def excess_ns(self, at_ns: int, delay_ns: int) -> int:
        """Return how far a delay is above the line; not negative, but for rounding, for those it was laid under."""
        return delay_ns - self.delay_ns(at_ns)


def floor_under(at_ns: Sequence[int], delays_ns: Sequence[int]) -> Floor:
    """Return the line with the least mean distance of all that lie below every delay.

    It goes along the edge of the lower convex hull above which the mean time lies (Moon, Skelly and Towsley,
    "Estimation and removal of clock skew from network delay measurements", 1999). Jitter only adds to a delay, so one
    that is the same all the time does not bend it.
    """
    points = sorted(zip(at_ns, delays_ns, strict=True))
    if not points:
        return Floor(0, 0, 0.0)
    hull: list[tuple[int, int]] = []
    for point in points:
        while len(hull) >= 2 and _turns_right(hull[-2], hull[-1], point):
            hull.pop()
        if hull and hull[-1][0] == point[0]:
            continue
        hull.append(point)
    mean_ns = sum(point[0] for point in points) / len(points)
    for first, second in pairwise(hull):
        if second[0] >= mean_ns:
            over_ns = second[0] - first[0]
            return Floor(first[0], first[1], (second[1] - first[1]) / over_ns, over_ns)
    return Floor(hull[0][0], hull[0][1], 0.0)


def _turns_right(first: tuple[int, int], second: tuple[int, int], third: tuple[int, int]) -> bool:
    """Return whether ``second`` lies on or above the line from ``first`` to ``third``."""
    return (second[1] - first[1]) * (third[0] - first[0]) >= (third[1] - first[1]) * (second[0] - first[0])
