"""Bars of a given number of characters, for terminals; none is ever longer, whatever the figures."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

_LEVELS: Final = "▁▂▃▄▅▆▇█"
_TRACK, _MIDDLE, _MARK = "─", "┼", "█"
_FULL, _EMPTY, _MOST = "█", "░", "┃"


def mark(share: float, width: int) -> str:
    """Return a track with a mark at ``share`` of it, 0 ... 1; what is beyond an end stands at that end."""
    if width <= 0:
        return ""
    # An odd number, so that there is a middle.
    length = width - 1 + width % 2 or 1
    track = [_TRACK] * length
    track[length // 2] = _MIDDLE
    if math.isfinite(share):
        track[round(min(max(share, 0.0), 1.0) * (length - 1))] = _MARK
    return "".join(track).ljust(width)


def gauge(share: float, width: int, *, most: float = 0.0) -> str:
    """Return a bar that is full at 1, with a line at the ``most`` there was unless that is 0."""
    if width <= 0:
        return ""
    filled = round(min(max(share, 0.0), 1.0) * width) if math.isfinite(share) else 0
    bar = [_FULL] * filled + [_EMPTY] * (width - filled)
    if most > 0.0 and math.isfinite(most):
        bar[min(int(min(most, 1.0) * width), width - 1)] = _MOST
    return "".join(bar)


def sparkline(values: Sequence[float], width: int) -> str:
    """Return the last values as columns, from 0 to the largest; where there are more, a column shows its largest."""
    if width <= 0 or not values:
        return ""
    if len(values) > width:
        ends = [len(values) * column // width for column in range(width + 1)]
        values = [max(values[begin:end]) for begin, end in pairwise(ends)]
    largest = max(values)
    if largest <= 0.0:
        return _LEVELS[0] * len(values)
    return "".join(_LEVELS[round(max(value, 0.0) / largest * (len(_LEVELS) - 1))] for value in values)
