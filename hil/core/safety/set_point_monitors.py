"""What a set point must satisfy before the backend sees it, beside T1: axis range, axis velocity, step size.

Where the Euclidean length of a vector, which costs next to nothing, shows that no axis can be at a new maximum or over
its limit, the axes are not looked at one by one.
"""

import math
from operator import mul, sub
from typing import Final, Protocol

from hil.core.motion.set_point import SetPoint
from hil.core.safety.margins import Margin, worst
from hil.values.motion import ErrorReason, Fault
from hil.values.robot import JOINT_NAMES, JointLimits

RANGE_TOLERANCE_RAD: Final = 1e-9
TOLERANCE: Final = 1e-6
"""Relative; a set point that is at its limit must not fail on rounding."""
OUTSIDE: Final = "set point outside the axis range"


class SetPointMonitor(Protocol):
    """One limit of set points."""

    margin: Margin

    def check(self, set_point: SetPoint, before: SetPoint, now_ns: int) -> Fault | None:
        """Return why ``set_point`` must not follow ``before``, or None."""


class AxisRangeMonitor:
    """Axis positions within their ranges."""

    def __init__(self, limits: JointLimits) -> None:
        self._low, self._high = limits.position_min_rad, limits.position_max_rad
        ends = list(zip(self._low, self._high, strict=True))
        self._middle = [(low + high) / 2 for low, high in ends]
        self._per_range = [2.0 / (high - low) for low, high in ends]
        self._most = 1.0 + RANGE_TOLERANCE_RAD * max(self._per_range)
        self.margin = Margin()

    def check(self, set_point: SetPoint, before: SetPoint, now_ns: int) -> Fault | None:  # noqa: ARG002
        """Return which axis is outside its range, or None."""
        off = map(sub, set_point.position_rad, self._middle)
        shares = [*map(mul, off, self._per_range)]
        if max(map(abs, shares)) <= self.margin.no_news:
            return None
        if self.margin.note(shares, now_ns) <= self._most:
            return None
        axis = worst(shares)
        value, low, high = set_point.position_rad[axis], self._low[axis], self._high[axis]
        return Fault(OUTSIDE, f"set point of {JOINT_NAMES[axis]} {value:.4f} rad is outside {low:.4f}..{high:.4f} rad")


class AxisVelocityMonitor:
    """Axis velocities within their limits."""

    def __init__(self, limits: JointLimits) -> None:
        self._fastest = limits.velocity_rad_s
        self._per_velocity = [1.0 / velocity for velocity in self._fastest]
        self._per_slowest = max(self._per_velocity)
        self.margin = Margin()

    def check(self, set_point: SetPoint, before: SetPoint, now_ns: int) -> Fault | None:  # noqa: ARG002
        """Return which axis is told to be too fast, or None."""
        if math.hypot(*set_point.velocity_rad_s) * self._per_slowest <= self.margin.no_news:
            return None
        shares = [*map(mul, set_point.velocity_rad_s, self._per_velocity)]
        if self.margin.note(shares, now_ns) <= 1.0 + TOLERANCE:
            return None
        axis = worst(shares)
        return Fault(
            ErrorReason.SPEED_LIMIT,
            f"set point of {JOINT_NAMES[axis]} moves {set_point.velocity_rad_s[axis]:+.4f} rad/s, "
            f"its limit is {self._fastest[axis]:.4f} rad/s",
        )


class StepSizeMonitor:
    """No axis goes farther in a cycle than it may move, whatever the set point says of its velocity."""

    def __init__(self, limits: JointLimits, *, cycle_ms: int) -> None:
        self._cycle_ms = cycle_ms
        self._longest = [velocity * cycle_ms * 1e-3 for velocity in limits.velocity_rad_s]
        self._per_step = [1.0 / longest for longest in self._longest]
        self._per_shortest = max(self._per_step)
        # A set point may be rounded to the end of its range, so a step may be longer by that.
        self._most = 1.0 + TOLERANCE + 2.0 * RANGE_TOLERANCE_RAD * max(self._per_step)
        self.margin = Margin()

    def check(self, set_point: SetPoint, before: SetPoint, now_ns: int) -> Fault | None:
        """Return which axis steps too far, or None."""
        if math.dist(set_point.position_rad, before.position_rad) * self._per_shortest <= self.margin.no_news:
            return None
        shares = [*map(mul, map(sub, set_point.position_rad, before.position_rad), self._per_step)]
        if self.margin.note(shares, now_ns) <= self._most:
            return None
        axis = worst(shares)
        step = set_point.position_rad[axis] - before.position_rad[axis]
        return Fault(
            ErrorReason.SPEED_LIMIT,
            f"set point of {JOINT_NAMES[axis]} steps {step:+.6f} rad in {self._cycle_ms} ms, "
            f"{self._longest[axis]:.6f} rad are allowed",
        )
