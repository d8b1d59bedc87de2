"""What the measured state must satisfy, beside T1: fresh, near its set point, not overloaded."""

import math
from operator import mul, sub
from typing import Final

from hil.core.motion.set_point import SetPoint
from hil.core.safety.margins import Margin, worst
from hil.core.safety.set_point_monitors import TOLERANCE
from hil.values.arm import ArmState
from hil.values.motion import ErrorReason, Fault
from hil.values.robot import JOINT_NAMES, JointLimits, Seven

STALE_TIME_MS: Final = 10
"""How old a measured state may be. Ours: about the shortest reaction of the arm to a command (manual 3.1.1: 12 ms)."""
TORQUE_TIME_MS: Final = 10
"""How long an axis torque may be above its limit. Ours: a peak of a few control cycles is no overload."""
SILENT: Final = "the robot side is silent"


class FreshStateMonitor:
    """A robot side that gives the same measurement again and again is silent."""

    def __init__(self, *, cycle_ms: int) -> None:
        self._cycle_ms = cycle_ms
        self._sample: int | None = None
        self._age_ms = 0
        self.margin = Margin()

    def check(self, state: ArmState, now_ns: int) -> Fault | None:
        """Return how old the state is if that is too old, or None."""
        if state.sample != self._sample:
            self._sample, self._age_ms = state.sample, 0
            return None
        self._age_ms += self._cycle_ms
        if self.margin.note((self._age_ms / STALE_TIME_MS,), now_ns) <= 1.0:
            return None
        return Fault(SILENT, f"its last state is {self._age_ms} ms old, {STALE_TIME_MS} ms are allowed")


class TrackingMonitor:
    """Every axis near the set point of the cycle before."""

    def __init__(self, *, limit_rad: float) -> None:
        self._limit_rad = limit_rad
        self._per_limit = 1.0 / limit_rad
        self.margin = Margin()

    def check(self, state: ArmState, told: SetPoint, now_ns: int) -> Fault | None:
        """Return which axis is too far off, or None."""
        # No axis is farther off than all of them together.
        if math.dist(state.position_rad, told.position_rad) * self._per_limit <= self.margin.no_news:
            return None
        off = [*map(sub, state.position_rad, told.position_rad)]
        if self.margin.note([value * self._per_limit for value in off], now_ns) <= 1.0:
            return None
        axis = worst(off)
        return Fault(
            ErrorReason.TRACKING_ERROR,
            f"{JOINT_NAMES[axis]} is {-off[axis]:+.4f} rad off its set point, {self._limit_rad:g} rad are allowed",
        )


class AxisTorqueMonitor:
    """No drive is asked for more than its torque for longer than :data:`TORQUE_TIME_MS`."""

    def __init__(self, limits: JointLimits, *, cycle_ms: int) -> None:
        self._limits = limits.torque_nm
        self._per_torque = [1.0 / torque for torque in limits.torque_nm]
        self._cycle_ms = cycle_ms
        self._overloaded_ms = 0
        self._fine: Seven | None = None
        """Torques that were looked at last and found within the limits: an arm without motors has no others."""
        self.margin = Margin()

    def check(self, state: ArmState, now_ns: int) -> Fault | None:
        """Return which axis is overloaded for too long, or None."""
        torque = state.commanded_torque_nm
        if torque is self._fine:
            return None
        used = max(map(abs, map(mul, torque, self._per_torque)))
        # A peak that is allowed to be is no use of the limit.
        if used <= 1.0 + TOLERANCE:
            if used > self.margin.used:
                self.margin.note([*map(mul, torque, self._per_torque)], now_ns)
            self._overloaded_ms = 0
            self._fine = torque
            return None
        self._fine = None
        self._overloaded_ms += self._cycle_ms
        if self._overloaded_ms < TORQUE_TIME_MS:
            return None
        shares = [*map(mul, torque, self._per_torque)]
        self.margin.note(shares, now_ns)
        axis = worst(shares)
        return Fault(
            ErrorReason.AXIS_TORQUE_LIMIT,
            f"{JOINT_NAMES[axis]} is asked for {state.commanded_torque_nm[axis]:+.1f} Nm, its limit is "
            f"{self._limits[axis]:g} Nm; {TORQUE_TIME_MS} ms above it are too long",
        )
