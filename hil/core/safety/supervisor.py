"""What stands over the motions: the operator's side, the drives, the monitors, and the stops they make of it.

It is the only one who ends a motion for a reason that is not the application's, and it never begins one: motions go on
by themselves once nothing speaks against it any more.
"""

import math
from collections import deque
from collections.abc import Callable
from typing import Final

from hil.core.events import ArmStopped, DrivesChanged, Event, OperatorActed, RobotSideChanged
from hil.core.model import ArmModel
from hil.core.motion.executive import MotionExecutive, Phase
from hil.core.motion.flange_limit import FlangeLimit
from hil.core.motion.set_point import SetPoint
from hil.core.pushes import Pusher
from hil.core.safety.drives import Drives
from hil.core.safety.margins import closest
from hil.core.safety.monitors import PERMISSIVE, Monitors, Trip
from hil.core.safety.operator import EMERGENCY_STOP, Operator, checked, describe
from hil.core.safety.would_stop import WouldStopLog
from hil.core.settings import ControllerSettings
from hil.values.arm import AT_WORK, ArmState, Backend, Push, RobotSideCondition
from hil.values.errors import ConfigurationError
from hil.values.fri import OperationMode, SafetyState
from hil.values.motion import ErrorReason, Fault
from hil.values.operator import OperatorView, PadKey, Press, ProgramAction, ProgramState, SelectMode, StopCategory
from hil.values.robot import JOINT_NAMES, JointLimits

MAX_STOPS: Final = 1000
LOST_DRIVES: Final = "the drives stopped holding the arm"
STOPPED_THERE: Final = "the robot side is stopped"
NO_COMMANDS: Final = "the robot side takes no commands any more"
MOVED_RAD: Final = 2e-3
"""How far an arm may be off a paused motion that goes on with drives that were dropped meanwhile. Ours."""
_FIGURES: Final = str.maketrans("", "", "0123456789.+-")
"""A reason whose figures alone changed is the same one."""


class Supervisor:
    """Stops, pauses and resumes one arm. ``emit`` takes events.

    Raises :class:`ConfigurationError` for monitors that only report over a robot side that moves real drives.
    """

    def __init__(
        self,
        *,
        settings: ControllerSettings,
        limits: JointLimits,
        model: ArmModel,
        backend: Backend,
        pusher: Pusher,
        motion: MotionExecutive,
        emit: Callable[[Event], None],
    ) -> None:
        safety = settings.safety
        if safety.permissive and backend.capabilities.moves_real_drives:
            raise ConfigurationError("permissive monitors only report, and this robot side moves real drives")
        self._backend = backend
        self._condition = AT_WORK
        self._follows_operator_there = backend.capabilities.has_own_operator
        self._motion = motion
        self._pusher = pusher
        self._emit = emit
        self._operator = Operator(
            mode=settings.operation_mode,
            enabled=settings.enabled,
            permissive=safety.permissive,
            enabling_there=self._follows_operator_there,
        )
        self._would_stop = WouldStopLog(emit)
        self.monitors = Monitors(
            limits=limits,
            model=model,
            safety=safety,
            cycle_ms=settings.cycle_ms,
            reported=self._would_stop.add,
            only_report=PERMISSIVE if safety.permissive else frozenset(),
        )
        self.flange = FlangeLimit(model.flange_speed_mm_s)
        """What a PTP has to plan for."""
        self._t1_flange_speed_mm_s = safety.t1_flange_speed_mm_s
        self.drives = Drives(backend)
        self._dropped_in_pause = False
        self._arm: ArmState | None = None
        self._ran_under: OperatorView | None = None
        """View under which motions run and all is done that it asks for; None while something is still to be done."""
        self.end_overlay: Callable[[Fault, int], None] = lambda _fault, _now_ns: None
        """Told of every end of all motions; the FRI link leaves commanding then."""
        self.stops: deque[ArmStopped] = deque(maxlen=MAX_STOPS)
        self._turn_selector()

    @property
    def view(self) -> OperatorView:
        """What the pad shows."""
        return self._operator.view

    @property
    def bars_motions(self) -> str:
        """Return why no motion may even wait: a stop that was not acknowledged; empty when there is none."""
        return self._operator.view.reason if self._operator.stop is not None else ""

    @property
    def closest(self) -> str:
        """Smallest margin of the run so far, in words."""
        return closest(self.monitors.report())

    def operate(self, action: ProgramAction, *, commanding: bool, now_ns: int) -> str:
        """Do what the operator did; ``commanding``: an FRI client is. Return why that changes nothing, or nothing."""
        refusal = checked(action) or self._operate(action, commanding, now_ns)
        self._emit(OperatorActed(now_ns, describe(action), self._operator.view, refusal))
        return refusal

    def read(self, arm: ArmState, *, now_ns: int) -> None:
        """Look at the drives of a measured state, and at what the robot side says of itself."""
        first, self._arm = self._arm is None, arm
        condition = self._backend.condition()
        state = self.drives.read(arm)
        if condition is not self._condition:
            before, self._condition = self._condition, condition
            self._note_condition(before, condition, now_ns)
        if state is None:
            return
        self._emit(DrivesChanged(now_ns, state))
        if self._follows_operator_there:
            self._follow_enabling_there()
            # Drives that the operator there switches off between motions are no failure.
            if self._motion.at_rest:
                return
        # What did not hold the arm from the start is not lost.
        if self.drives.lost and not first:
            self.stop(Fault(LOST_DRIVES, f"they are {state.name}"), now_ns, StopCategory.DROP)

    def follow_operator(self, arm: ArmState, *, commanding: bool, closing: bool, now_ns: int) -> str:
        """Once a cycle: pause and resume, drop and switch on the drives; return why nothing may move, or nothing."""
        operator, motion, drives, condition = self._operator, self._motion, self.drives, self._condition
        if operator.view is self._ran_under and drives.hold:
            return ""
        waits = operator.view.reason or condition.reason or drives.waits_because()
        if waits:
            if not motion.paused:
                motion.pause(now_ns=now_ns)
            if commanding or motion.phase is Phase.OVERLAY:
                self.stop(Fault("paused", waits), now_ns)
        elif motion.paused and not closing:
            self._resume(arm, now_ns)
        stands = motion.stands
        if stands and not self.monitors.t1 and operator.mode is OperationMode.T1:
            self.monitors.t1 = True
        drives.follow(operator.drops_drives, stands=stands, arm=arm, now_ns=now_ns)
        if drives.dropped or not drives.hold or not condition.takes_commands:
            self._dropped_in_pause = True
            held_rad = condition.held_position_rad or arm.position_rad
            # What waits for a robot side that takes no commands begins where the arm is held by then.
            rests = motion.at_rest if condition.takes_commands else motion.phase is Phase.HOLDING
            if rests and math.isfinite(sum(held_rad)):
                motion.follow(held_rad)
        runs = not (waits or motion.paused or drives.dropped)
        t1_counts = self.monitors.t1 or operator.mode is not OperationMode.T1
        self._ran_under = operator.view if runs and t1_counts else None
        return waits

    def check_set_point(self, set_point: SetPoint, *, now_ns: int) -> Trip | None:
        """Return why a set point must not reach the arm, or None; what no drive follows is not checked."""
        if self.drives.dropped or not self._condition.takes_commands:
            return None
        return self.monitors.set_point(set_point, self._motion.set_point, now_ns=now_ns)

    def check_measured(self, arm: ArmState, told: SetPoint, *, yields: bool, now_ns: int) -> None:
        """Stop for what the measured state shows; ``told`` is the set point of the cycle before.

        An arm that ``yields`` need not be there.
        """
        holds = self.drives.hold and not self.drives.dropped and self._condition.takes_commands
        trip = self.monitors.measured(arm, None if yields else told, drives_hold=holds, now_ns=now_ns)
        if trip is not None:
            self.stop(trip.fault, now_ns, trip.category)

    def stop(self, fault: Fault, now_ns: int, category: StopCategory | None = None) -> bool:
        """End all motions for ``fault``; return whether the arm began to brake with it.

        With a category it is a stop that must be acknowledged; else an end of the motion that asks for a new one.
        """
        news = category is not None and self._operator.stopped(category, fault)
        braking = self._end_motions(fault, now_ns, drop=category is StopCategory.DROP)
        if braking or news:
            self.note_stop(fault, now_ns, category)
        return braking

    def note_stop(self, fault: Fault, now_ns: int, category: StopCategory | None = None) -> None:
        """Book that the arm brakes on its own, or is stopped."""
        stop = ArmStopped(now_ns, category, str(fault))
        self.stops.append(stop)
        self._emit(stop)

    def report(self) -> dict[str, object]:
        """Return stops, operator's side and margins, for the status file."""
        margins = self.monitors.report()
        return {
            "stops": [
                {
                    "at_s": round(stop.at_ns / 1e9, 6),
                    "category": None if stop.category is None else stop.category.value,
                    "reason": stop.reason,
                }
                for stop in self.stops
            ],
            "operator": operator_report(self.view),
            "margins": margins,
            "closest": closest(margins),
            "would_have_stopped": dict(self._would_stop.counts),
            "max_flange_speed_mm_s": self.monitors.max_flange_speed_mm_s,
        }

    def _operate(self, action: ProgramAction, commanding: bool, now_ns: int) -> str:
        operator = self._operator
        if isinstance(action, Press):
            if refusal := self._refused(action.key):
                return refusal
            pressed_before = operator.view.program is ProgramState.EMERGENCY_STOP
            refusal = operator.press(action.key)
            if action.key is PadKey.EMERGENCY_STOP and not pressed_before:
                self._stopped_by_operator(Fault(EMERGENCY_STOP), now_ns)
            return refusal
        if isinstance(action, SelectMode):
            if self._follows_operator_there:
                return f"the mode selector is at the robot side, in {operator.mode.name}: turn it there"
            fault = operator.select(action.mode, moving=commanding or not self._motion.at_rest)
            if fault is not None:
                self._stopped_by_operator(fault, now_ns)
            self._turn_selector()
            return ""
        if isinstance(action, Push):
            return self._pusher.push(action)
        operator.set_override(action.percent)
        self._motion.set_override(action.percent / 100.0)
        return ""

    def _refused(self, key: PadKey) -> str:
        """Return why a key does nothing now, as far as the arm and the robot side are concerned."""
        if self._follows_operator_there and key in {PadKey.ENABLE, PadKey.RELEASE}:
            return "the enabling switch is at the robot side: use it there"
        stop = self._operator.stop
        if key is not PadKey.RESET or stop is None:
            return ""
        if not self._stopped(stop.category):
            if self._condition.failure:
                return f"the arm is not known to stand still yet: {self._condition.failure}"
            return "the arm still brakes; acknowledge the stop when it stands still"
        state = self._backend.condition().safety_state
        if state is not SafetyState.NORMAL_OPERATION:
            return f"the robot side is stopped ({state.name}): clear that there first"
        self._backend.resume()
        failure = self._backend.condition().failure
        return f"the robot side has not recovered: {failure}" if failure else ""

    def _note_condition(self, before: RobotSideCondition, now: RobotSideCondition, now_ns: int) -> None:
        """Follow what the robot side says of itself: its selector, its stops, its failures."""
        self._ran_under = None
        # A failure is told as the stop that it is.
        if not now.failure and now.reason.translate(_FIGURES) != before.reason.translate(_FIGURES):
            self._emit(RobotSideChanged(now_ns, now.reason))
        mode = now.operation_mode
        if mode is not None and mode is not self._operator.mode:
            fault = self._operator.select(mode, moving=not self._motion.at_rest)
            if fault is not None:
                self._stopped_by_operator(fault, now_ns)
            self._turn_selector()
        stopped_there = now.safety_state is not SafetyState.NORMAL_OPERATION
        if stopped_there and now.safety_state is not before.safety_state:
            level_2 = now.safety_state is SafetyState.SAFETY_STOP_LEVEL_2
            category = StopCategory.BRAKE_AND_HOLD if level_2 else StopCategory.BRAKE_AND_DROP
            self.stop(Fault(STOPPED_THERE, now.safety_state.name), now_ns, category)
        if now.failure and now.failure != before.failure:
            self.stop(Fault(now.failure), now_ns, StopCategory.DROP)
        elif before.takes_commands and not now.takes_commands and not self._motion.at_rest:
            self.stop(Fault(NO_COMMANDS, now.reason), now_ns, StopCategory.DROP)
        if self._follows_operator_there:
            self._follow_enabling_there()

    def _follow_enabling_there(self) -> None:
        operator = self._operator
        enabled = self.drives.hold and self._condition.safety_state is SafetyState.NORMAL_OPERATION
        if enabled is not operator.enabling:
            operator.press(PadKey.ENABLE if enabled else PadKey.RELEASE)

    def _stopped(self, category: StopCategory) -> bool:
        """Whether what a stop of ``category`` does is done."""
        if not self._motion.stands:
            return False
        return category is StopCategory.BRAKE_AND_HOLD or self._arm is None or self.drives.off_or_at_rest(self._arm)

    def _stopped_by_operator(self, fault: Fault, now_ns: int) -> None:
        self._end_motions(fault, now_ns)
        self.note_stop(fault, now_ns, StopCategory.BRAKE_AND_DROP)

    def _turn_selector(self) -> None:
        t1 = self._operator.mode is OperationMode.T1
        self.flange.limit_mm_s = self._t1_flange_speed_mm_s if t1 else None
        # What still brakes from a faster mode is not judged by T1: it would be braked within one cycle.
        self.monitors.t1 = t1 and self._motion.stands

    def _resume(self, arm: ArmState, now_ns: int) -> None:
        """Let motions go on, unless the arm was moved meanwhile."""
        motion = self._motion
        if self._dropped_in_pause and motion.phase is Phase.APPLICATION and not motion.control.yields:
            wanted = motion.set_point.position_rad
            off = [here - there for here, there in zip(arm.position_rad, wanted, strict=True)]
            axis = max(range(len(off)), key=lambda place: abs(off[place]))
            if abs(off[axis]) > MOVED_RAD:
                detail = f"{JOINT_NAMES[axis]} was moved by {off[axis]:+.4f} rad while its drives were off"
                self.stop(Fault(ErrorReason.TRACKING_ERROR, detail), now_ns, StopCategory.BRAKE_AND_DROP)
                return
        self._dropped_in_pause = False
        motion.resume(now_ns=now_ns)

    def _end_motions(self, fault: Fault, now_ns: int, *, drop: bool = False) -> bool:
        braking = False
        if drop:
            self._motion.drop(fault, now_ns=now_ns)
        else:
            braking = self._motion.brake(fault, now_ns=now_ns)
        self.end_overlay(fault, now_ns)
        return braking


def operator_report(view: OperatorView) -> dict[str, object]:
    """Return what the pad shows, for the status file and the pad itself."""
    return {
        "mode": view.mode.name,
        "program": view.program.name,
        "enabling": view.enabling,
        "override_percent": view.override_percent,
        "safety_state": view.safety_state.name,
        "reason": view.reason,
        "permissive": view.permissive,
    }
