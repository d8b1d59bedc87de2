"""Reaction, rise, overshoot and settling of one recorded step; pure arithmetic on samples.

Times count from when the step was commanded and are in the unit of the times given. A response is told as its way: how
far from where it began, positive towards the destination, in the unit of the step. Between two samples it is taken to
be straight.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

RISE_FROM: Final = 0.1
RISE_TO: Final = 0.9
SETTLED_WITHIN: Final = 0.02
"""Share of the step, on either side of the destination."""
SEEN_FROM: Final = 0.02
"""Share of the step from which on a figure shows that something moves."""


@dataclass(frozen=True, slots=True)
class FiguresOfMerit:
    """Of one step; None for what did not happen while it was recorded."""

    reaction: float | None
    """Time of the first sample that is off the start by more than the threshold."""
    seen: float | None
    """Time at which :data:`SEEN_FROM` of the step is covered."""
    rise: float | None
    """Time from :data:`RISE_FROM` to :data:`RISE_TO` of the step, each passed for the first time."""
    overshoot_percent: float
    """How far beyond the destination, of the step; 0 where it was never passed."""
    settling: float | None
    """Time from which on the way stays within :data:`SETTLED_WITHIN` of the destination, to the end of the samples."""


def figures_of_merit(times: Sequence[float], ways: Sequence[float], *, step: float, threshold: float) -> FiguresOfMerit:
    """Return the figures of a response whose ``ways`` at ``times`` should become ``step``, which is positive."""
    begun, ended = crossing(times, ways, RISE_FROM * step), crossing(times, ways, RISE_TO * step)
    return FiguresOfMerit(
        reaction=reaction(times, ways, threshold=threshold),
        seen=crossing(times, ways, SEEN_FROM * step),
        rise=None if begun is None or ended is None else ended - begun,
        overshoot_percent=max(0.0, 100.0 * (max(ways, default=0.0) / step - 1.0)),
        settling=settling(times, ways, step=step, within=SETTLED_WITHIN * step),
    )


def reaction(times: Sequence[float], ways: Sequence[float], *, threshold: float) -> float | None:
    """Return the time of the first sample that is off the start by more than ``threshold``, either way."""
    return next((at for at, way in zip(times, ways, strict=True) if at >= 0.0 and abs(way) > threshold), None)


def crossing(times: Sequence[float], ways: Sequence[float], level: float) -> float | None:
    """Return when ``level`` is reached for the first time."""
    before: tuple[float, float] | None = None
    for at, way in zip(times, ways, strict=True):
        if way >= level:
            return at if before is None else _between(before, (at, way), level)
        before = at, way
    return None


def settling(times: Sequence[float], ways: Sequence[float], *, step: float, within: float) -> float | None:
    """Return from when on the way is within ``within`` of ``step`` until the samples end; None if it is not."""
    after: tuple[float, float] | None = None
    for at, way in zip(reversed(times), reversed(ways), strict=True):
        off = way - step
        if abs(off) > within:
            edge = step + within if off > 0.0 else step - within
            return None if after is None else _between((at, way), after, edge)
        after = at, way
    return None if after is None else after[0]


def differences(values: Sequence[float], *, period: float) -> list[float]:
    """Return the rate of change over the period before each value; 0 for the first."""
    return [0.0, *((here - before) / period for before, here in pairwise(values))]


def peak(values: Sequence[float]) -> float:
    """Return the largest magnitude."""
    return max(map(abs, values), default=0.0)


def _between(first: tuple[float, float], second: tuple[float, float], level: float) -> float:
    (at, way), (later, there) = first, second
    return at + (later - at) * (level - way) / (there - way)
