"""What a destination with a velocity needs: room in the axis range to get so fast before it and to stop after it."""

import math

from hil.core.motion.axis_range import MARGIN_RAD
from hil.core.motion.destinations import Destination
from hil.core.motion.motion_limits import stopping_distance_rad
from hil.values.motion import ErrorReason, Fault
from hil.values.robot import JOINT_NAMES, JointLimits, Seven


class TargetVelocities:
    """Judges the velocities of destinations under the limits of one motion."""

    def __init__(self, limits: JointLimits) -> None:
        self._limits = limits
        # On its way to a velocity an axis may have to turn round. With acceleration a it does so a³/(8j²) after it had
        # v = a²/(2j), from where it would need a³/(6j²) to stop: with the difference kept free, it can still stop in
        # its range if the next destination asks for that. It never has more acceleration than its jerk builds up
        # between full velocity in one direction and in the other, sqrt(2vj).
        self._turning_rad = [
            min(acceleration, math.sqrt(2.0 * velocity * jerk)) ** 3 / (24.0 * jerk * jerk) + MARGIN_RAD
            for velocity, acceleration, jerk in zip(
                limits.velocity_rad_s, limits.acceleration_rad_s2, limits.jerk_rad_s3, strict=True
            )
        ]

    def refused(self, goal: Destination) -> Fault | None:
        """Return why ``goal`` cannot be reached with its velocity, or None."""
        for axis, velocity in enumerate(goal.velocity_rad_s):
            fastest = self._limits.velocity_rad_s[axis]
            if abs(velocity) > fastest:
                return Fault(
                    ErrorReason.SPEED_LIMIT,
                    f"target velocity of {JOINT_NAMES[axis]} {velocity:+.9g} rad/s, "
                    f"this motion allows {fastest:.9g} rad/s",
                )
        for axis, (position, velocity) in enumerate(zip(goal.position_rad, goal.velocity_rad_s, strict=True)):
            low, high = self._limits.position_min_rad[axis], self._limits.position_max_rad[axis]
            needed = self._stopping_rad(axis, velocity) + self._turning_rad[axis] if velocity else 0.0
            if position - low < needed or high - position < needed:
                return Fault(
                    ErrorReason.POSITIONAL_LIMITS,
                    f"{JOINT_NAMES[axis]} needs {needed:.4f} rad to get to {velocity:+.4f} rad/s and as much to stop, "
                    f"at {position:.4f} rad it has less to an end of its range {low:.4f}..{high:.4f} rad",
                )
        return None

    def margin_rad(self, goal: Destination) -> Seven:
        """Return how far each axis must stay from the ends of its range on the way to ``goal``."""
        return tuple(
            turning if velocity else 0.0
            for turning, velocity in zip(self._turning_rad, goal.velocity_rad_s, strict=True)
        )  # type: ignore[return-value]

    def longest_coasting_s(self, goal: Destination) -> float:
        """Return how long the arm can go on after ``goal`` until an axis must brake for the end of its range."""
        longest = math.inf
        for axis, (position, velocity) in enumerate(zip(goal.position_rad, goal.velocity_rad_s, strict=True)):
            if velocity == 0.0:
                continue
            end = (self._limits.position_max_rad if velocity > 0.0 else self._limits.position_min_rad)[axis]
            room = abs(end - position) - MARGIN_RAD - self._stopping_rad(axis, velocity)
            longest = min(longest, room / abs(velocity))
        return max(0.0, longest)

    def _stopping_rad(self, axis: int, velocity: float) -> float:
        return stopping_distance_rad(velocity, self._limits.acceleration_rad_s2[axis], self._limits.jerk_rad_s3[axis])
