"""DirectServo: a velocity-limited digital filter from the present position to the newest destination (manual 3.1.1).

XXX
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
from hil.values.robot import JOINT_NAMES, Seven
from hil.values.servo import Vector

_DELTA_TOLERANCE_RAD = 1e-9


class DirectServo(ServoMotion):
    """Filters each axis for itself; a destination may be 5 degrees from the measured position when it arrives."""

    kind = MotionKind.DIRECT_SERVO
    checks = DIRECT_SERVO_CHECKS
    out_of_range = ErrorReason.DIRECT_SERVO_LIMIT
    takes_velocity = False

    def __init__(self, parameters: MotionParameters, *, basis: MotionBasis, destination: Vector | None) -> None:
        super().__init__(parameters, basis=basis, destination=destination, dead_time_ns=basis.direct_servo_dead_time_ns)
        self._filter: DirectFilter

    def remaining_s(self, *, now_ns: int) -> float:
        """Return about how long it takes until the last destination is reached (within 20 ms; it may be less)."""
        if self.interpolator is not FineInterpolatorState.MOVING:
            return 0.0
        if not self._line:
            return self._filter.settling_s()
        return self._line.wait_ns(now_ns=now_ns) * 1e-9 + self._filter.settling_s(self._line.newest.position_rad)

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
        if not directly.at_goal:
            directly.advance()
        if directly.at_goal:
            if self.interpolator is FineInterpolatorState.MOVING:
                self._goal_reached(Trigger.GOAL_REACHED, now_ns)
            self._rest(now_ns)
        return directly.set_point
