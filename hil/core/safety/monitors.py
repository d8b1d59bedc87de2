"""Monitors on the set point before the backend sees it, and on the measured state after.

Texts: manual, chapter 10.3. 250 mm/s: manual chapter 4, design page "Safety, each cycle". These are
an emulator's monitors, not certified safety functions.
"""

import math
from operator import sub

from hil.core.model import ArmModel
from hil.core.motion.set_point import SetPoint
from hil.values.arm import ArmState
from hil.values.fri import OperationMode
from hil.values.motion import ErrorReason, Fault
from hil.values.robot import JOINT_NAMES, JointLimits

T1_SPEED_LIMIT_MM_S = 250.0
_RANGE_TOLERANCE_RAD = 1e-9
_SPEED_TOLERANCE = 1e-6

TRACKING_LIMIT_RAD = 0.1
"""Ours, no public figure: a little more than the 5 degrees that a DirectServo destination may be away."""
_OUT_OF_RANGE = "set point outside the axis range"
_NOT_FINITE = Fault("the robot side reports a state that is not finite")


class Monitors:
    """Return why the arm must stop, or None."""

    def __init__(self, *, limits: JointLimits, model: ArmModel, operation_mode: OperationMode) -> None:
        self._axes = tuple(
            (low - _RANGE_TOLERANCE_RAD, high + _RANGE_TOLERANCE_RAD, fastest * (1 + _SPEED_TOLERANCE))
            for low, high, fastest in zip(
                limits.position_min_rad, limits.position_max_rad, limits.velocity_rad_s, strict=True
            )
        )
        self._model = model
        self._t1 = operation_mode is OperationMode.T1
        self._no_news_mm_s = 0.0
        self.max_flange_speed_mm_s = 0.0

    def set_point(self, set_point: SetPoint) -> Fault | None:
        """Check a set point that is about to be handed to the backend."""
        moving = False
        for axis, velocity in enumerate(set_point.velocity_rad_s):
            # An axis that does not move is where it was found legal before; not a number is not zero.
            if velocity == 0.0:
                continue
            moving = True
            position = set_point.position_rad[axis]
            low, high, fastest = self._axes[axis]
            if not low <= position <= high:
                return Fault(
                    _OUT_OF_RANGE,
                    f"set point of {JOINT_NAMES[axis]} {position:.4f} rad is outside {low:.4f}..{high:.4f} rad",
                )
            if not -fastest <= velocity <= fastest:
                return Fault(
                    ErrorReason.SPEED_LIMIT,
                    f"set point of {JOINT_NAMES[axis]} moves {velocity:+.4f} rad/s, its limit is {fastest:.4f} rad/s",
                )
        if self._t1 and moving:
            flange = self._model.flange_speed_mm_s(set_point.position_rad, set_point.velocity_rad_s)
            if flange > T1_SPEED_LIMIT_MM_S:
                return Fault(ErrorReason.COMMANDED_T1, _faster_than_t1(flange))
        return None

    def measured(self, state: ArmState) -> Fault | None:
        """Check the measured state, and keep the largest flange speed."""
        if not math.isfinite(sum(state.position_rad)):
            return _NOT_FINITE
        # The exact speed matters only where it could be a new maximum or over the limit.
        if self._model.flange_speed_bound_mm_s(state.velocity_rad_s) <= self._no_news_mm_s:
            return None
        speed = self._model.flange_speed_mm_s(state.position_rad, state.velocity_rad_s)
        if not math.isfinite(speed):
            return _NOT_FINITE
        self.max_flange_speed_mm_s = max(self.max_flange_speed_mm_s, speed)
        self._no_news_mm_s = min(self.max_flange_speed_mm_s, T1_SPEED_LIMIT_MM_S if self._t1 else math.inf)
        if self._t1 and speed > T1_SPEED_LIMIT_MM_S:
            return Fault(ErrorReason.MEASURED_T1, _faster_than_t1(speed))
        return None

    @staticmethod
    def tracking(state: ArmState, set_point: SetPoint) -> Fault | None:
        """Check how far the measured axes are from the set point they were given in the cycle before."""
        worst = max(map(abs, map(sub, state.position_rad, set_point.position_rad)))
        if worst <= TRACKING_LIMIT_RAD:
            return None
        off = [there - here for there, here in zip(set_point.position_rad, state.position_rad, strict=True)]
        axis = max(range(len(off)), key=lambda place: abs(off[place]))
        return Fault(
            ErrorReason.TRACKING_ERROR,
            f"{JOINT_NAMES[axis]} is {off[axis]:+.4f} rad off its set point, {TRACKING_LIMIT_RAD:g} rad are allowed",
        )


def _faster_than_t1(speed_mm_s: float) -> str:
    return f"{speed_mm_s:.2f} mm/s, the limit is {T1_SPEED_LIMIT_MM_S:g} mm/s"
