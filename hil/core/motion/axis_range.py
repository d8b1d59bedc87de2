"""Whether a planned trajectory stays in the axis ranges. Ruckig (community) plans without position limits.

Its ``position_extrema`` miss an axis that turns round while its acceleration is constant, so the extremes are computed
here, from the phases of each profile.
"""

import math
from collections.abc import Sequence
from itertools import chain
from typing import Any

from hil.core.motion.set_point import SetPoint
from hil.values.motion import ErrorReason, Fault
from hil.values.robot import JOINT_NAMES, JointLimits, Seven

TOLERANCE_RAD = 1e-9
"""As the monitor of set points has it."""
MARGIN_RAD = 2e-8
"""How far inside the range a plan ends: Ruckig meets a position to 1e-8."""


def leaves_range(
    trajectory: Any,  # a Ruckig trajectory: its stubs are not typed
    start: SetPoint,
    goal_rad: Sequence[float],
    *,
    limits: JointLimits,
    margin_rad: Seven | None = None,
) -> Fault | None:
    """Return which axis leaves its range (less ``margin_rad`` at each end) between ``start`` and ``goal_rad``."""
    profiles = None
    half_time_s = 0.5 * trajectory.duration
    for axis, (here, there) in enumerate(zip(start.position_rad, goal_rad, strict=True)):
        margin = 0.0 if margin_rad is None else margin_rad[axis]
        low, high = limits.position_min_rad[axis] + margin, limits.position_max_rad[axis] - margin
        # Most axes cannot even get to the end of their range in this time; to know more costs ten times as much.
        farthest = half_time_s * max(limits.velocity_rad_s[axis], abs(start.velocity_rad_s[axis]))
        middle = 0.5 * (here + there)
        if low <= middle - farthest and middle + farthest <= high:
            continue
        if profiles is None:
            profiles = trajectory.profiles[0]
        lowest, highest = extremes(profiles[axis])
        if lowest < low - TOLERANCE_RAD or highest > high + TOLERANCE_RAD:
            worst = lowest if low - lowest > highest - high else highest
            return Fault(
                ErrorReason.POSITIONAL_LIMITS,
                f"{JOINT_NAMES[axis]} would go to {worst:.6f} rad on its way, "
                f"its range is {limits.position_min_rad[axis]:.6f}..{limits.position_max_rad[axis]:.6f} rad",
            )
    return None


def extremes(profile: Any) -> tuple[float, float]:
    """Return the lowest and the highest position of one axis' profile."""
    brake = profile.brake
    positions = [profile.pf, *profile.p]
    positions += [position for duration, position in zip(brake.t, brake.p, strict=True) if duration > 0.0]
    phases = chain(
        zip(brake.t, brake.p, brake.v, brake.a, brake.j, strict=True),
        # Positions, velocities and accelerations have one entry more: the end.
        zip(profile.t, profile.p, profile.v, profile.a, profile.j, strict=False),
    )
    for duration, position, velocity, acceleration, jerk in phases:
        positions += [
            position + time * (velocity + time * (acceleration / 2.0 + time * jerk / 6.0))
            for time in _turns(velocity, acceleration, jerk)
            if 0.0 < time < duration
        ]
    return min(positions), max(positions)


def _turns(velocity: float, acceleration: float, jerk: float) -> tuple[float, ...]:
    """Return the times at which an axis that moves with constant jerk stands still."""
    if jerk == 0.0:
        return () if acceleration == 0.0 else (-velocity / acceleration,)
    square = acceleration * acceleration - 2.0 * jerk * velocity
    if square < 0.0:
        return ()
    root = math.sqrt(square)
    return (-acceleration - root) / jerk, (root - acceleration) / jerk


def within_range(position_rad: Seven, limits: JointLimits) -> Seven:
    """Return the position nearest to ``position_rad`` inside the axis ranges."""
    return tuple(
        min(max(value, low), high)
        for value, low, high in zip(position_rad, limits.position_min_rad, limits.position_max_rad, strict=True)
    )  # type: ignore[return-value]
