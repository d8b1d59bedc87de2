"""A PTP that plans itself slow enough for T1: how fast its axes may move so that the flange keeps the speed limit.

On a straight line in axis space all axes have one profile, so the flange's speed is the profile's times the length of
the Jacobian along the line: one factor, exact but for the distance between the places looked at.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from hil.values.robot import JointLimits, Seven

_PLACES: Final = 24
"""Looked at on a way, both ends included: a look costs 5 us, and a way begins within one control cycle."""
_AIM: Final = 0.97
"""Share of the limit a way is planned for: between two places the flange may be faster than at both."""


@dataclass(slots=True)
class FlangeLimit:
    """Speed limit of the flange for planning; ``limit_mm_s`` is None where there is none (T2, AUT)."""

    speed_mm_s: Callable[[Seven, Seven], float]
    """Of the flange at a position in rad and velocities in rad/s."""
    limit_mm_s: float | None = None

    def straight(self, start_rad: Seven, goal_rad: Seven, limits: JointLimits) -> JointLimits:
        """Return limits with which the straight way from ``start_rad`` to ``goal_rad`` keeps the speed limit."""
        if self.limit_mm_s is None:
            return limits
        way = [there - here for here, there in zip(start_rad, goal_rad, strict=True)]
        rates = [fastest / abs(part) for fastest, part in zip(limits.velocity_rad_s, way, strict=True) if part]
        if not rates:
            return limits
        velocity: Seven = tuple(part * min(rates) for part in way)  # type: ignore[assignment]
        fastest_mm_s = max(
            self.speed_mm_s(_between(start_rad, way, place / (_PLACES - 1)), velocity) for place in range(_PLACES)
        )
        return _slower(limits, _AIM * self.limit_mm_s / fastest_mm_s) if fastest_mm_s > 0.0 else limits


def _slower(limits: JointLimits, factor: float) -> JointLimits:
    if factor >= 1.0:
        return limits
    velocity: Seven = tuple(fastest * factor for fastest in limits.velocity_rad_s)  # type: ignore[assignment]
    return replace(limits, velocity_rad_s=velocity)


def _between(start_rad: Seven, way_rad: list[float], share: float) -> Seven:
    return tuple(here + part * share for here, part in zip(start_rad, way_rad, strict=True))  # type: ignore[return-value]
