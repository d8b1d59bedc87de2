"""The safety laws: what holds for every command that reaches the arm, whoever asked for it."""

import math
from typing import Final

from hil.core.model import ArmModel
from hil.values.arm import JointCommand, seven
from hil.values.robot import JointLimits

BRAKING_CYCLES: Final = 900
"""Longest time from the moment nothing may move to standstill: from full axis velocity as rated, twice."""
_T1_MM_S: Final = 250.0


class Laws:
    """Finite, in range, within the axes' velocities, in T1 within 250 mm/s, and at rest where the program may not run.

    For control cycles of 1 ms. ``check`` raises AssertionError with the command that breaks one.
    """

    def __init__(self, limits: JointLimits, model: ArmModel) -> None:
        self.checked = 0
        self.moved = 0
        """Commands that were another position than the one before."""
        self._limits = limits
        self._model = model
        self._before: JointCommand | None = None
        self._not_running = 0

    def forget(self) -> None:
        """The next command need not follow on the one before: no drive held the arm."""
        self._before = None

    def check(self, command: JointCommand, *, t1: bool, running: bool) -> None:
        """Take the next command; ``running``: whether the program may run in its cycle."""
        before, self._before = self._before, command
        self.checked += 1
        assert math.isfinite(sum(map(sum, command[:3]))), command
        for axis, position in enumerate(command.position_rad):
            low, high = self._limits.position_min_rad[axis], self._limits.position_max_rad[axis]
            assert low - 1e-9 <= position <= high + 1e-9, (axis, position)
            fastest = self._limits.velocity_rad_s[axis]
            assert abs(command.velocity_rad_s[axis]) <= fastest * (1 + 1e-6), (axis, command.velocity_rad_s)
            if before is not None:
                step = abs(position - before.position_rad[axis])
                assert step <= fastest * 1e-3 * (1 + 1e-5), (axis, step)
        if t1:
            self._in_t1(command, before)
        if before is not None and command.position_rad != before.position_rad:
            self.moved += 1
        self._not_running = 0 if running else self._not_running + 1
        if self._not_running > BRAKING_CYCLES and before is not None:
            assert command.position_rad == before.position_rad, "an arm that may not move moves"

    def _in_t1(self, command: JointCommand, before: JointCommand | None) -> None:
        speed = self._model.flange_speed_mm_s(command.position_rad, command.velocity_rad_s)
        assert speed <= _T1_MM_S, speed
        if before is not None:
            steps = zip(before.position_rad, command.position_rad, strict=True)
            rate = seven([(there - here) * 1e3 for here, there in steps])
            # At the end of the step the arm is turned a little from where it began.
            assert self._model.flange_speed_mm_s(command.position_rad, rate) <= _T1_MM_S * (1 + 2e-3)
