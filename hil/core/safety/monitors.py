"""Monitors on the set point before the backend sees it, and on the measured state after.

Texts of the T1 monitors: manual, chapter 10.3. 250 mm/s: manual chapter 4, design page "Safety, each cycle". These are
an emulator's monitors, not certified safety functions.
"""

import math

from hil.core.model import ArmModel
from hil.core.motion.set_point import SetPoint
from hil.values.arm import ArmState
from hil.values.fri import OperationMode
from hil.values.robot import JOINT_NAMES, JointLimits

T1_SPEED_LIMIT_MM_S = 250.0
_RANGE_TOLERANCE_RAD = 1e-9
_SPEED_TOLERANCE = 1e-6

_NOT_FINITE = "the robot side reports a state that is not finite"
COMMAND_T1 = "cmd T1 illegal speed limit detected"
MEASURED_T1 = "msr T1 illegal speed limit detected"


class Monitors:
    """Returns the reason for a stop in words, or None."""

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

    def set_point(self, set_point: SetPoint) -> str | None:
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
                return f"set point of {JOINT_NAMES[axis]} {position:.4f} rad is outside {low:.4f}..{high:.4f} rad"
            if not -fastest <= velocity <= fastest:
                return f"set point of {JOINT_NAMES[axis]} moves {velocity:+.4f} rad/s, its limit is {fastest:.4f} rad/s"
        if self._t1 and moving:
            flange = self._model.flange_speed_mm_s(set_point.position_rad, set_point.velocity_rad_s)
            if flange > T1_SPEED_LIMIT_MM_S:
                return f"{COMMAND_T1}: {flange:.2f} mm/s, the limit is {T1_SPEED_LIMIT_MM_S:g} mm/s"
        return None

    def measured(self, state: ArmState) -> str | None:
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
            return f"{MEASURED_T1}: {speed:.2f} mm/s, the limit is {T1_SPEED_LIMIT_MM_S:g} mm/s"
        return None
