"""Braking to a standstill on the path: all axes stop together, so the arm stays on the line it was moving along."""

import math

from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization, Trajectory

from hil.core.motion.set_point import STILL, SetPoint
from hil.values.robot import JOINT_COUNT, JointLimits, Seven


class Brake:
    """Brakes from a set point with the rated deceleration and jerk.

    Where that would leave an axis range, all axes decelerate harder instead, uniformly, so that the first axis stops
    before its end: a drive that has to choose between its rated deceleration and its end stop chooses the former last.
    With ``longest_s`` the deceleration is uniform and takes no longer than that; 0 stops within one cycle.
    """

    def __init__(self, start: SetPoint, *, limits: JointLimits, cycle_s: float, longest_s: float | None = None) -> None:
        self._cycle_s = cycle_s
        self._elapsed_s = 0.0
        self._last = start
        self._limits = limits
        self._start = start
        self._trajectory = None if longest_s is not None else self._jerk_limited(start)
        if self._trajectory is None or self._leaves_range(self._trajectory):
            self._trajectory = None
            self.duration_s = min(self._uniform_duration(start), math.inf if longest_s is None else longest_s)
        else:
            self.duration_s = self._trajectory.duration

    @property
    def at_rest(self) -> bool:
        """True when the arm's set point stands still."""
        return self._elapsed_s >= self.duration_s

    def interpolate(self) -> SetPoint:
        """Return the set point of the next cycle."""
        if self.at_rest:
            return SetPoint(self._last.position_rad, STILL)
        self._elapsed_s = min(self._elapsed_s + self._cycle_s, self.duration_s)
        position = self._position(self._elapsed_s)
        velocity: Seven = tuple(
            (there - here) / self._cycle_s for there, here in zip(position, self._last.position_rad, strict=True)
        )  # type: ignore[assignment]
        self._last = SetPoint(position, velocity)
        return self._last

    def _position(self, at_s: float) -> Seven:
        if self._trajectory is not None:
            return tuple(self._trajectory.at_time(at_s)[0])
        share = at_s - at_s * at_s / (2 * self.duration_s)
        return tuple(
            here + speed * share
            for here, speed in zip(self._start.position_rad, self._start.velocity_rad_s, strict=True)
        )  # type: ignore[return-value]

    def _jerk_limited(self, start: SetPoint) -> Trajectory | None:
        request = InputParameter(JOINT_COUNT)
        request.control_interface = ControlInterface.Velocity
        request.synchronization = Synchronization.Phase
        request.current_position = list(start.position_rad)
        request.current_velocity = list(start.velocity_rad_s)
        request.current_acceleration = list(STILL)
        request.target_velocity = list(STILL)
        request.target_acceleration = list(STILL)
        request.max_acceleration = list(self._limits.acceleration_rad_s2)
        request.max_jerk = list(self._limits.jerk_rad_s3)
        trajectory = Trajectory(JOINT_COUNT)
        result = Ruckig(JOINT_COUNT).calculate(request, trajectory)
        return trajectory if result in (Result.Working, Result.Finished) else None

    def _leaves_range(self, trajectory: Trajectory) -> bool:
        end = trajectory.at_time(trajectory.duration)[0]
        return any(
            not self._limits.position_min_rad[axis] <= end[axis] <= self._limits.position_max_rad[axis]
            for axis in range(JOINT_COUNT)
        )

    def _uniform_duration(self, start: SetPoint) -> float:
        """Return the longest time of a uniform deceleration that keeps every axis in range; at least one cycle."""
        longest = math.inf
        for axis, speed in enumerate(start.velocity_rad_s):
            if speed == 0.0:
                continue
            here = start.position_rad[axis]
            room = (
                self._limits.position_max_rad[axis] - here if speed > 0 else here - self._limits.position_min_rad[axis]
            )
            rated = abs(speed) / self._limits.acceleration_rad_s2[axis]
            longest = min(longest, max(2 * room / abs(speed), 0.0), rated if rated > 0 else math.inf)
        return 0.0 if longest is math.inf else longest
