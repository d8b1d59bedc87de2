"""Joint position overlay on a position hold: the client's positions, spread over the time between two of them."""

import math
from operator import add, gt, sub

from hil.core.motion.set_point import STILL, SetPoint
from hil.values.robot import JointLimits, Seven
from hil.values.tuples import new_tuple

_ROUNDING = 1.0 - 1e-9


class JointOverlay:
    """Follows the client's targets in straight lines, one receive period each, never faster than the axes may move.

    With a receive period of one cycle the set point is the target. With a longer one the set point reaches the target
    exactly when the next is due, which costs one receive period of delay and no jump. A target that came late (the
    one before was lost) is approached at the axis velocity at most, all axes slowed alike.
    """

    def __init__(self, start: SetPoint, *, limits: JointLimits, cycle_s: float, cycles_per_target: int) -> None:
        self._position = start.position_rad
        self._rate = 1.0 / cycle_s
        self._step_limit = [limit * cycle_s for limit in limits.velocity_rad_s]
        self._short_step = min(self._step_limit) * _ROUNDING
        self._cycles_per_target = cycles_per_target
        self.target = start.position_rad
        """The last position asked for, rad."""
        self._cycles_left = 0
        self.tracking_performance = 1.0

    @property
    def at_rest(self) -> bool:
        """True when the last target is reached."""
        return self._cycles_left == 0

    def retarget(self, target: Seven) -> None:
        """Go to ``target`` (rad), from where the set point is now, within one receive period."""
        self.target = target
        self._cycles_left = self._cycles_per_target

    def interpolate(self) -> SetPoint:
        """Return the set point of the next cycle."""
        if self._cycles_left == 0:
            self.tracking_performance = 1.0
            return SetPoint(self._position, STILL)
        # The step that keeps the schedule.
        step = list(map(sub, self.target, self._position))
        cycles_left, rate = self._cycles_left, self._rate
        if cycles_left != 1:
            scale = 1.0 / cycles_left
            step = [part * scale for part in step]
        # No axis goes farther than all of them together.
        fast = math.hypot(*step) > self._short_step and any(map(gt, map(abs, step), self._step_limit))
        slowed = self._slowed(step) if fast else 1.0
        self.tracking_performance = slowed
        if slowed == 1.0:
            self._cycles_left = cycles_left = cycles_left - 1
            self._position = tuple(map(add, self._position, step)) if cycles_left else self.target
        else:
            step = [part * slowed for part in step]
            self._cycles_left = max(1, cycles_left - 1)
            self._position = tuple(map(add, self._position, step))
        return new_tuple(SetPoint, (self._position, tuple([part * rate for part in step]), STILL))

    def _slowed(self, step: list[float]) -> float:
        """Return the factor, at most 1, that keeps every axis at its velocity."""
        worst = 1.0
        for part, allowed in zip(step, self._step_limit, strict=True):
            if abs(part) > allowed * worst:
                worst = abs(part) / allowed
        return 1.0 / worst
