"""Monitors on the set point before the backend sees it, and on the measured state after.

Texts: manual, chapter 10.3. Limits and their sources: docs/safety.md. These are an emulator's monitors, not certified
safety functions.
"""

import math
from collections.abc import Callable
from operator import mul, sub
from typing import Final, NamedTuple

from hil.core.model import ArmModel
from hil.core.motion.set_point import STILL, SetPoint
from hil.core.safety.flange_speed import FlangeSpeedMonitor
from hil.core.safety.margins import MonitorName, report
from hil.core.safety.set_point_monitors import (
    AxisRangeMonitor,
    AxisVelocityMonitor,
    SetPointMonitor,
    StepSizeMonitor,
)
from hil.core.safety.state_monitors import AxisTorqueMonitor, FreshStateMonitor, TrackingMonitor
from hil.core.settings import SafetySettings
from hil.values.arm import ArmState
from hil.values.motion import ErrorReason, Fault
from hil.values.operator import StopCategory
from hil.values.robot import JOINT_COUNT, JointLimits, Seven

NOT_FINITE: Final = "the robot side reports a state that is not finite"

CATEGORIES: Final = {
    MonitorName.FINITE: StopCategory.BRAKE_AND_HOLD,
    MonitorName.AXIS_RANGE: StopCategory.BRAKE_AND_HOLD,
    MonitorName.AXIS_VELOCITY: StopCategory.BRAKE_AND_HOLD,
    MonitorName.STEP_SIZE: StopCategory.BRAKE_AND_HOLD,
    MonitorName.COMMANDED_T1: StopCategory.BRAKE_AND_HOLD,
    MonitorName.STATE: StopCategory.DROP,
    MonitorName.FRESH: StopCategory.DROP,
    MonitorName.TRACKING: StopCategory.BRAKE_AND_DROP,
    MonitorName.AXIS_TORQUE: StopCategory.BRAKE_AND_DROP,
    MonitorName.MEASURED_T1: StopCategory.BRAKE_AND_DROP,
}
"""Reaction of each monitor. A wrong set point never reached the arm, so the drives may hold it; an arm that does not do
what it is told is braked and dropped; one nobody knows anything of is dropped at once. Ours: no public figure."""

# A member of an enumeration costs a search each time it is named by its class, and these are named in every cycle.
_FRESH: Final = MonitorName.FRESH
_TRACKING: Final = MonitorName.TRACKING
_AXIS_TORQUE: Final = MonitorName.AXIS_TORQUE
_WITHOUT_MARGIN: Final = frozenset({MonitorName.FINITE, MonitorName.STATE})
PERMISSIVE: Final = frozenset(MonitorName) - _WITHOUT_MARGIN
"""What ``--permissive`` switches to reporting: all but those without which there is nothing to compute with."""


class Trip(NamedTuple):
    """Why the arm must stop, and how."""

    monitor: MonitorName
    fault: Fault

    @property
    def category(self) -> StopCategory:
        """How the arm is to be stopped."""
        return CATEGORIES[self.monitor]


class Monitors:
    """Return why the arm must stop, or None, and keep how near it came to that.

    Trips of monitors in ``only_report`` go to ``reported`` instead, and the check goes on. :attr:`t1` is whether the
    speed limit of T1 counts now.
    """

    def __init__(
        self,
        *,
        limits: JointLimits,
        model: ArmModel,
        safety: SafetySettings,
        cycle_ms: int,
        reported: Callable[[Trip, int], None],
        only_report: frozenset[MonitorName] = frozenset(),
    ) -> None:
        self._model = model
        self._reported = reported
        self._only_report = only_report
        monitors: dict[MonitorName, SetPointMonitor] = {
            MonitorName.AXIS_RANGE: AxisRangeMonitor(limits),
            MonitorName.AXIS_VELOCITY: AxisVelocityMonitor(limits),
            MonitorName.STEP_SIZE: StepSizeMonitor(limits, cycle_ms=cycle_ms),
        }
        self._checks = [(name, monitor.check) for name, monitor in monitors.items()]
        self._commanded_t1 = FlangeSpeedMonitor(model, limit_mm_s=safety.t1_flange_speed_mm_s)
        self._fresh = FreshStateMonitor(cycle_ms=cycle_ms)
        self._tracking = TrackingMonitor(limit_rad=safety.tracking_rad)
        self._torque = AxisTorqueMonitor(limits, cycle_ms=cycle_ms)
        self._measured_t1 = FlangeSpeedMonitor(model, limit_mm_s=safety.t1_flange_speed_mm_s)
        self._rates = (1e3 / cycle_ms,) * JOINT_COUNT
        self._legal: SetPoint | None = None
        self.t1 = False
        self.margins = {
            **{name: monitor.margin for name, monitor in monitors.items()},
            MonitorName.COMMANDED_T1: self._commanded_t1.margin,
            MonitorName.FRESH: self._fresh.margin,
            MonitorName.TRACKING: self._tracking.margin,
            MonitorName.AXIS_TORQUE: self._torque.margin,
            MonitorName.MEASURED_T1: self._measured_t1.margin,
        }
        self.max_flange_speed_mm_s = 0.0

    def set_point(self, set_point: SetPoint, before: SetPoint, *, now_ns: int) -> Trip | None:
        """Check a set point that is about to be handed to the backend, after ``before``."""
        if set_point is self._legal is before:
            return None
        position, velocity, acceleration = set_point
        # Most set points say that they do not accelerate, with this very tuple.
        total = sum(position) + sum(velocity) + (0.0 if acceleration is STILL else sum(acceleration))
        if not math.isfinite(total):
            return Trip(MonitorName.FINITE, Fault(ErrorReason.INVALID_INPUT_VALUES, "a set point is not finite"))
        for name, check in self._checks:
            fault = check(set_point, before, now_ns)
            if fault is not None and (trip := self._tripped(name, fault, now_ns)) is not None:
                return trip
        if self.t1 and (words := self._too_fast_in_t1(set_point, before, now_ns)):
            trip = self._tripped(MonitorName.COMMANDED_T1, Fault(ErrorReason.COMMANDED_T1, words), now_ns)
            if trip is not None:
                return trip
        self._legal = set_point
        return None

    def measured(self, state: ArmState, told: SetPoint | None, *, drives_hold: bool, now_ns: int) -> Trip | None:
        """Check the measured state after ``told``, the set point of the cycle before; None: the arm yields.

        Without ``drives_hold`` nothing follows that set point, and only the state itself is looked at.
        """
        position, velocity, torque = state.position_rad, state.velocity_rad_s, state.commanded_torque_nm
        if not math.isfinite(sum(position) + sum(velocity) + sum(torque)):
            return Trip(MonitorName.STATE, Fault(NOT_FINITE))
        name, fault = _FRESH, self._fresh.check(state, now_ns)
        if fault is None and drives_hold:
            if told is not None:
                name, fault = _TRACKING, self._tracking.check(state, told, now_ns)
            if fault is None:
                name, fault = _AXIS_TORQUE, self._torque.check(state, now_ns)
        if fault is not None and (trip := self._tripped(name, fault, now_ns)) is not None:
            return trip
        if words := self._too_fast(position, velocity, now_ns):
            return self._tripped(MonitorName.MEASURED_T1, Fault(ErrorReason.MEASURED_T1, words), now_ns)
        return None

    def report(self) -> dict[str, dict[str, object]]:
        """Return what was used of each limit, for the status file."""
        return report(self.margins, main_axis=self._model.main_axis)

    def _too_fast_in_t1(self, set_point: SetPoint, before: SetPoint, now_ns: int) -> str:
        """Judge the velocity a set point says, and the step it makes: the one need not be that of the other."""
        position, velocity, _ = set_point
        if words := self._commanded_t1.too_fast(position, velocity, now_ns=now_ns):
            return words
        step = tuple(map(mul, map(sub, position, before.position_rad), self._rates))
        return self._commanded_t1.too_fast(position, step, now_ns=now_ns)

    def _too_fast(self, position: Seven, velocity: Seven, now_ns: int) -> str:
        # The largest speed of a run is a figure of every mode, so the speed is worked out for a new maximum too.
        if self._model.flange_keeps_below(self.max_flange_speed_mm_s, position, velocity):
            return self._measured_t1.too_fast(position, velocity, now_ns=now_ns) if self.t1 else ""
        speed = self._model.flange_speed_mm_s(position, velocity)
        self.max_flange_speed_mm_s = max(self.max_flange_speed_mm_s, speed)
        return self._measured_t1.judge(speed, position, velocity, now_ns=now_ns) if self.t1 else ""

    def _tripped(self, monitor: MonitorName, fault: Fault, now_ns: int) -> Trip | None:
        trip = Trip(monitor, fault)
        if monitor not in self._only_report:
            return trip
        self._reported(trip, now_ns)
        return None
