"""What a motion follows cycle by cycle: a planned way, or the velocity it has at its destination."""

from typing import Protocol

from hil.core.motion.planner import Plan
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.robot import Seven

_TIME_TOLERANCE_S = 1e-9
"""A duration that is a whole number of cycles may be a little more than their sum."""


class Course(Protocol):
    """A way through time, one cycle a step."""

    done: bool

    def advance(self) -> SetPoint:
        """Return the set point of the next cycle."""

    def ahead(self, cycles: int) -> SetPoint:
        """Return the set point so many cycles from now, without going there."""

    @property
    def remaining_s(self) -> float:
        """Time until it is done."""


class PlannedCourse:
    """Follows a plan and stands exactly at ``end`` when it is over."""

    __slots__ = ("_cycle_s", "_cycles", "_end", "_plan", "done")

    def __init__(self, plan: Plan, end: SetPoint, *, cycle_s: float) -> None:
        self._plan = plan
        self._end = end
        self._cycle_s = cycle_s
        self._cycles = 0
        self.done = False

    def advance(self) -> SetPoint:
        """Return the set point of the next cycle."""
        self._cycles += 1
        time_s = self._cycles * self._cycle_s
        if time_s < self._plan.duration_s - _TIME_TOLERANCE_S:
            return self._plan.at(time_s)
        self.done = True
        return self._end

    def ahead(self, cycles: int) -> SetPoint:
        """Return the set point so many cycles from now; its end when it is over by then."""
        time_s = (self._cycles + cycles) * self._cycle_s
        return self._plan.at(time_s) if time_s < self._plan.duration_s - _TIME_TOLERANCE_S else self._end

    @property
    def remaining_s(self) -> float:
        """Time until the end."""
        return max(0.0, self._plan.duration_s - self._cycles * self._cycle_s)


class CoastingCourse:
    """Goes on with a constant velocity for ``cycles`` cycles."""

    __slots__ = ("_cycle_s", "_cycles", "_left", "_start", "done")

    def __init__(self, start: SetPoint, cycles: int, *, cycle_s: float) -> None:
        self._start = start
        self._cycle_s = cycle_s
        self._cycles = 0
        self._left = cycles
        self.done = cycles == 0

    def advance(self) -> SetPoint:
        """Return the set point of the next cycle."""
        self._cycles += 1
        self._left -= 1
        self.done = self._left == 0
        return self.ahead(0)

    def ahead(self, cycles: int) -> SetPoint:
        """Return the set point so many cycles from now; the last one when it is over by then."""
        time_s = (self._cycles + min(cycles, self._left)) * self._cycle_s
        position: Seven = tuple(
            here + velocity * time_s
            for here, velocity in zip(self._start.position_rad, self._start.velocity_rad_s, strict=True)
        )  # type: ignore[assignment]
        return SetPoint(position, self._start.velocity_rad_s, STILL)

    @property
    def remaining_s(self) -> float:
        """Time until it is over."""
        return self._left * self._cycle_s
