"""Braking to a standstill on the path: all axes stop together, so the arm stays on the line it was moving along.

It was moving along one if its acceleration was in the direction of its velocity, or none; else the way it stops on is
as curved as the one it was on.
"""

import math

from ruckig import ControlInterface, InputParameter, Result, Ruckig, RuckigError, Synchronization, Trajectory

from hil.core.motion.axis_range import leaves_range
from hil.core.motion.motion_limits import admissible
from hil.core.motion.planner import Plan
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.robot import JOINT_COUNT, JointLimits, Seven


class Brake:
    """Brakes from a set point with the rated deceleration and jerk; its acceleration is kept where they can carry it.

    Where that would leave an axis range, the acceleration is dropped at once; where it still would, all axes decelerate
    harder instead, uniformly, so that the first axis stops before its end: a drive that has to choose between its rated
    deceleration and its end stop chooses the former last. With ``longest_s`` the deceleration is uniform and takes no
    longer than that; 0 stops within one cycle.
    """

    def __init__(self, start: SetPoint, *, limits: JointLimits, cycle_s: float, longest_s: float | None = None) -> None:
        self._cycle_s = cycle_s
        self._elapsed_s = 0.0
        self._last = start
        self._limits = limits
        self._start = start
        self._plan = self._jerk_limited() if longest_s is None else None
        if self._plan is None:
            self.duration_s = min(self._uniform_duration(start), math.inf if longest_s is None else longest_s)
        else:
            self.duration_s = self._plan.duration_s

    @property
    def at_rest(self) -> bool:
        """True when the arm's set point stands still."""
        return self._elapsed_s >= self.duration_s

    @property
    def end_rad(self) -> Seven:
        """Where the arm will stand still."""
        if self._plan is not None:
            return self._plan.at(self.duration_s).position_rad
        return self._uniform(self.duration_s).position_rad if self.duration_s else self._start.position_rad

    @property
    def remaining_s(self) -> float:
        """Time until then."""
        return max(0.0, self.duration_s - self._elapsed_s)

    def interpolate(self) -> SetPoint:
        """Return the set point of the next cycle."""
        if self.at_rest:
            return SetPoint(self._last.position_rad, STILL)
        elapsed_s = self._elapsed_s = min(self._elapsed_s + self._cycle_s, self.duration_s)
        set_point = self._uniform(elapsed_s) if self._plan is None else self._plan.at(elapsed_s)
        self._last = set_point if elapsed_s < self.duration_s else SetPoint(set_point.position_rad, STILL)
        return self._last

    def _uniform(self, at_s: float) -> SetPoint:
        left = 1.0 - at_s / self.duration_s
        share = 0.5 * at_s * (1.0 + left)
        velocity = self._start.velocity_rad_s
        return SetPoint(
            tuple(here + speed * share for here, speed in zip(self._start.position_rad, velocity, strict=True)),  # type: ignore[arg-type]
            tuple(speed * left for speed in velocity),  # type: ignore[arg-type]
            tuple(-speed / self.duration_s for speed in velocity),  # type: ignore[arg-type]
        )

    def _jerk_limited(self) -> Plan | None:
        carried = admissible(self._start, self._limits)
        for start in (carried, carried._replace(acceleration_rad_s2=STILL)):
            plan = self._planned(start)
            if plan is not None:
                return plan
        return None

    def _planned(self, start: SetPoint) -> Plan | None:
        request = InputParameter(JOINT_COUNT)
        request.control_interface = ControlInterface.Velocity
        request.synchronization = Synchronization.Phase
        request.current_position, request.current_velocity, request.current_acceleration = start
        request.target_velocity = STILL
        request.target_acceleration = STILL
        request.max_acceleration = self._limits.acceleration_rad_s2
        request.max_jerk = self._limits.jerk_rad_s3
        trajectory = Trajectory(JOINT_COUNT)
        try:
            result = Ruckig(JOINT_COUNT).calculate(request, trajectory)
        except (RuckigError, ValueError):
            return None
        if result not in (Result.Working, Result.Finished):
            return None
        plan = Plan(trajectory)
        fault = leaves_range(trajectory, start, plan.end.position_rad, limits=self._limits)
        return plan if fault is None else None

    def _uniform_duration(self, start: SetPoint) -> float:
        """Return how long all axes may take without decelerating less than rated, or leaving the range; 0 at rest."""
        longest, rated = math.inf, 0.0
        for axis, speed in enumerate(start.velocity_rad_s):
            if speed == 0.0:
                continue
            here = start.position_rad[axis]
            room = (
                self._limits.position_max_rad[axis] - here if speed > 0 else here - self._limits.position_min_rad[axis]
            )
            longest = min(longest, max(2 * room / abs(speed), 0.0))
            rated = max(rated, abs(speed) / self._limits.acceleration_rad_s2[axis])
        return min(longest, rated)
