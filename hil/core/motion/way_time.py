"""How long an axis needs from rest to rest, and which limits make it need longer; no trajectory is made for that."""

import math
from collections.abc import Callable
from typing import NamedTuple

_HALVINGS = 24


class AxisLimits(NamedTuple):
    """What an axis moves under: rad/s, rad/s2, rad/s3; an infinite jerk is none."""

    velocity: float
    acceleration: float
    jerk: float


def way_time_s(way_rad: float, limits: AxisLimits) -> float:
    """Return the shortest time from rest to rest over ``way_rad``, which must be positive."""
    velocity, acceleration, jerk = limits
    fastest = min(velocity, _peak(way_rad, acceleration, jerk))
    return way_rad / fastest + _ramp_s(fastest, acceleration, jerk)


def velocity_for(way_rad: float, time_s: float, limits: AxisLimits) -> float:
    """Return the velocity, at most the limit, that makes the way take ``time_s``."""
    return _largest(limits.velocity, lambda value: way_time_s(way_rad, limits._replace(velocity=value)) >= time_s)


def acceleration_for(way_rad: float, time_s: float, limits: AxisLimits) -> float:
    """Return the acceleration, at most the limit, that makes the way take ``time_s``."""
    return _largest(
        limits.acceleration, lambda value: way_time_s(way_rad, limits._replace(acceleration=value)) >= time_s
    )


def way_for(way_rad: float, time_s: float, limits: AxisLimits) -> float:
    """Return how long a way must be to take ``time_s``; ``way_rad`` is where the search begins."""
    longest = way_rad
    while way_time_s(longest, limits) < time_s:
        longest *= 2.0
    return _largest(longest, lambda value: way_time_s(value, limits) <= time_s)


def _largest(most: float, holds: Callable[[float], bool]) -> float:
    """Return the largest value up to ``most`` for which it holds; it holds for small ones."""
    if holds(most):
        return most
    low, high = 0.0, most
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return high


def _ramp_s(velocity: float, acceleration: float, jerk: float) -> float:
    """Return the time from rest to ``velocity``."""
    if velocity * jerk <= acceleration * acceleration:
        return 2.0 * math.sqrt(velocity / jerk)
    return velocity / acceleration + acceleration / jerk


def _peak(way_rad: float, acceleration: float, jerk: float) -> float:
    """Return the velocity at which one must brake at once: velocity x ramp time is the way."""
    if math.isfinite(jerk):
        peak: float = (0.5 * way_rad * math.sqrt(jerk)) ** (2.0 / 3.0)
        if peak * jerk <= acceleration * acceleration:
            return peak
        ramp = acceleration * acceleration / jerk
    else:
        ramp = 0.0
    return 0.5 * (math.sqrt(ramp * ramp + 4.0 * acceleration * way_rad) - ramp)
