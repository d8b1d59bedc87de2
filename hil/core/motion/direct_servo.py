"""DirectServo: a velocity-limited digital filter from the present position to the newest destination (manual 3.1.1).

Planning is the application's; this only makes of its destinations what the drives can do. Each axis is for itself.

- **Order and pole**: second order, two equal real poles at 100 rad/s, the frequency of the MuJoCo arm's position loop.
  Destinations that jump by less than 0.1 to 0.4 degrees meet nothing else.
- **Delay**: a ramp is followed 20 ms late, less one cycle, after the dead time (measured on the iiwa 7 in cycles of
  1 ms: set point 19.0 ms, arm 19.1 ms). Above 0.3 rad/s (A2) to 1.3 rad/s (A1, A5) the distance grows with the square
  of the velocity, because an axis keeps the way it needs to brake for its destination. With the default reaction time
  the 5 degrees are enough for ramps of 85 % of the axis velocity on A2, 88 % on A4, 53 % on A6 and A7 of size 7, 75 %
  on A6 and 77 % on A7 of size 14, and 100 % on the other axes (measured).
- **Limits**: axis velocity x velocity rel, and an acceleration: 20 times SmartServo's base, which is what an unloaded
  arm can do. The jerk is not limited. The same poles without a limit of acceleration are more than the arm can follow:
  in a step of 5 degrees the iiwa 7 ran past its destination by 2.4 degrees (A2) and was within 0.05 degrees of it after
  235 ms. With the limit it runs past by 0.0001 degrees and is there after 143 ms (A2) or 94 ms (A5), and it is never
  farther behind than it moves in a cycle (3.3 mrad; all robots, steps of 1 to 5 degrees, pose of manual 7.12).
- **Overshoot**: the set point has none in a step from rest, saturated or not. Where the destination is moved while an
  axis moves, the axis may pass it. It never leaves its range.
- **Settling**: a step of 5 degrees is reached exactly after 165 ms (A5) to 213 ms (A2) on size 7, 165 ms to 191 ms on
  size 14, in cycles of 1 ms.

A minimum execution time lowers the velocity, for each destination, to distance / time until the time is over. There is
no velocity after the destination, so the speed timeout and velocity planning mean nothing here; nor do acceleration
rel, override and jerk (manual 7.8, 9.2.1).
"""

from hil.core.motion.application_motion import MotionBasis
from hil.core.motion.destinations import Destination
from hil.core.motion.direct_filter import DirectFilter
from hil.core.motion.fine_interpolator import Trigger
from hil.core.motion.motion_limits import DIRECT_SERVO_CHECKS, direct_servo_limits
from hil.core.motion.servo_motion import ServoMotion
from hil.core.motion.set_point import SetPoint
from hil.values.motion import (
    DIRECT_SERVO_DELTA_RAD,
    ErrorReason,
    Fault,
    FineInterpolatorState,
    MotionKind,
    MotionParameters,
)
from hil.values.pose import Pose
from hil.values.robot import JOINT_NAMES, Seven
from hil.values.servo import Vector

_DELTA_TOLERANCE_RAD = 1e-9


class DirectServo(ServoMotion):
    """Filters each axis for itself; a destination may be 5 degrees from the measured position when it arrives."""

    kind = MotionKind.DIRECT_SERVO
    checks = DIRECT_SERVO_CHECKS
    out_of_range = ErrorReason.DIRECT_SERVO_LIMIT
    takes_velocity = False

    def __init__(self, parameters: MotionParameters, *, basis: MotionBasis, destination: Vector | Pose | None) -> None:
        super().__init__(parameters, basis=basis, destination=destination, dead_time_ns=basis.direct_servo_dead_time_ns)
        self._filter: DirectFilter

    def remaining_s(self, *, now_ns: int) -> float:
        """Return about how long it takes until the last destination is reached; from rest true to 45 ms."""
        if self.interpolator is not FineInterpolatorState.MOVING:
            return 0.0
        if not self._line:
            return self._filter.settling_s()
        return self._line.wait_ns(now_ns=now_ns) * 1e-9 + self._filter.settling_s(self._line.newest.position_rad)

    @property
    def _present(self) -> SetPoint:
        return self._filter.set_point

    def _prepare(self) -> None:
        self._filter = DirectFilter(
            direct_servo_limits(self.basis, self.parameters), cycle_s=self.basis.cycle_ns * 1e-9
        )

    def _unreachable(self, goal: Destination, measured_rad: Seven) -> Fault | None:
        for axis, (there, here) in enumerate(zip(goal.position_rad, measured_rad, strict=True)):
            if not abs(there - here) <= DIRECT_SERVO_DELTA_RAD + _DELTA_TOLERANCE_RAD:
                return Fault(
                    ErrorReason.DIRECT_SERVO_DELTA,
                    f"destination of {JOINT_NAMES[axis]} {there:.6f} rad is {there - here:+.6f} rad from its measured "
                    f"position, {DIRECT_SERVO_DELTA_RAD:.6f} rad (5 degrees) are allowed",
                )
        return None

    def _take_over(self, start: SetPoint, goal: Destination | None, *, now_ns: int) -> Fault | None:
        self._filter.begin(start)
        if goal is not None:
            return self._aim(goal)
        self.destination, self.destination_at_ns = self._filter.goal_rad, now_ns
        if self._filter.at_goal:
            self._goal_reached(Trigger.GOAL_REACHED, now_ns)
        return None

    def _aim(self, goal: Destination) -> Fault | None:
        self._filter.aim(goal.position_rad, minimum_time_s=self.parameters.minimum_execution_time_s)
        return None

    def _next(self, now_ns: int) -> SetPoint | Fault:
        directly = self._filter
        moves = not directly.at_goal
        if moves:
            directly.advance()
        if directly.at_goal:
            if moves:
                self.seconds_hand.stands(now_ns)
            if self.interpolator is FineInterpolatorState.MOVING:
                self._goal_reached(Trigger.GOAL_REACHED, now_ns)
            self._rest(now_ns)
        return directly.set_point
