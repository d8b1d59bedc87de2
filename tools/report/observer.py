"""Watches a fresh controller while it is told a recording again: all that is inside is known then, cycle by cycle."""

from typing import Final

from hil.config.station import RobotConfig
from hil.core.controller import SHUTS_DOWN, Controller
from hil.core.events import (
    ApplicationJoined,
    ApplicationLeft,
    ArmStopped,
    Diagnosed,
    DrivesChanged,
    Event,
    InputSet,
    MotionBegan,
    MotionOver,
    OperatorActed,
    PacketDropped,
    QualityChanged,
    StateChanged,
    WouldHaveStopped,
)
from hil.core.fri.link import FriLink
from hil.core.model import ArmModel
from hil.core.motion.executive import Phase
from hil.core.settings import NS_PER_MS
from hil.runtime.assembly import RobotParts
from hil.runtime.capture_header import RobotStart
from hil.values.fri import DriveState, Quality
from hil.values.operator import OperatorView
from hil.values.servo import Role
from tools.doctor.capture.tables import slowest_table, split_table
from tools.report.record import MarkKind, RobotRecord

_HOLDING: Final = Phase.HOLDING
_NS: Final = 1e-9
_SLOWEST: Final = 10
_NS_AS_MS: Final = 1e-6


class RobotObserver:
    """Fills the record of one robot. ``model`` is not the controller's: a look changes nothing inside."""

    def __init__(
        self, start: RobotStart, config: RobotConfig, parts: RobotParts, controller: Controller, *, model: ArmModel
    ) -> None:
        fri = config.fri
        self.record = RobotRecord(
            start.name,
            parts.description.name,
            commanded_is="the set point, as the controller told the arm one cycle before",
            speed_is="worked out from the measured positions and velocities",
            inside_known=True,
            budget_ms=None if fri is None else float(fri.send_period_ms * fri.receive_multiplier),
            t1_mm_s=config.limits.settings(permissive=config.permissive).t1_flange_speed_mm_s,
            configuration=config.model_dump(mode="json", exclude_none=True),
        )
        self._controller = controller
        self._model = model
        self._told = controller.motion.set_point
        self._answers: object = None
        """Those that the last cycle used that had any; another list whenever a cycle has some."""
        if controller.fri is not None:
            self.record.lane("session").change(0.0, controller.fri.state.name)
            self.record.lane("quality").change(0.0, controller.fri.quality.name)
        if controller.servo is not None:
            self.record.lane("application")
            self.record.lane("motion")
        self._cycle_ns = config.cycle_ms * NS_PER_MS
        self._phase = _HOLDING
        self.record.lane("arm").change(0.0, _HOLDING.value)
        self._view: OperatorView | None = None
        for name in ("mode", "program", "override"):
            self.record.lane(name)
        self.record.lane("drives").change(0.0, DriveState.ACTIVE.name)

    def cycle(self, now_ns: int) -> None:
        """Look at the controller after a cycle."""
        controller, record, at_s = self._controller, self.record, now_ns * _NS
        arm = controller.arm
        speed_mm_s = self._model.flange_speed_mm_s(arm.position_rad, arm.velocity_rad_s)
        record.sample(at_s, self._told.position_rad, arm.position_rad, speed_mm_s)
        record.end_s = at_s
        motion = controller.motion
        self._told = motion.set_point
        if controller.fri is not None:
            self._look_at_answers(controller.fri)
        if motion.phase is not self._phase:
            self._phase = motion.phase
            record.lane("arm").change(at_s, motion.phase.value)
        if controller.operator is not self._view:
            self._look_at_pad(controller.operator, at_s)
        for event in controller.events():
            self._take(event)

    def finish(self) -> None:
        """Take what the controller says of itself at the end."""
        controller, fri = self._controller, self._controller.fri
        if fri is not None:
            fri.diagnosis.tell(controller.ticks * self._cycle_ns, over=True)
            for event in controller.events():
                self._take(event)
            self.record.evidence = [
                split_table("each part, over all answers", fri.path.histograms, own=True),
                slowest_table("the slowest answers [ms]", fri.path.worst, _SLOWEST, own=True),
            ]
        self.record.report = controller.report()
        self.record.finish()

    def _look_at_answers(self, fri: FriLink) -> None:
        if not fri.path.used or fri.path.used is self._answers:
            return
        self._answers = fri.path.used
        record = self.record
        for received_ns, age_ns, _ in fri.path.used:
            record.latencies.add(received_ns * _NS, age_ns * _NS_AS_MS, budget_ms=record.budget_ms or 0.0)

    def _look_at_pad(self, view: OperatorView, at_s: float) -> None:
        self._view = view
        self.record.lane("mode").change(at_s, view.mode.name)
        self.record.lane("program").change(at_s, view.program.name, view.reason)
        self.record.lane("override").change(at_s, f"{view.override_percent:g} %")

    def _take(self, event: Event) -> None:
        record, at_s = self.record, event.at_ns * _NS
        record.tell(at_s, str(event))
        match event:
            case StateChanged():
                record.lane("session").change(at_s, event.new.name, event.reason)
            case QualityChanged():
                record.lane("quality").change(at_s, event.new.name, event.reason)
                if event.new < Quality.GOOD <= event.old:
                    record.quality_fell(at_s, str(event))
            case DrivesChanged():
                record.lane("drives").change(at_s, event.state.name)
            case PacketDropped():
                before = record.drops.get(event.outcome.value, (0, 0.0, ""))[0]
                record.drops[event.outcome.value] = (before + event.count, at_s, event.detail)
            case _:
                self._take_mark(event, at_s)
                self._take_of_application(event, at_s)

    def _take_mark(self, event: Event, at_s: float) -> None:
        record = self.record
        match event:
            case ArmStopped() if event.category is None and event.reason.startswith(SHUTS_DOWN.reason):
                record.mark(at_s, MarkKind.OPERATOR, f"the run ends: {SHUTS_DOWN}")
            case ArmStopped():
                record.stopped(at_s, str(event))
            case Diagnosed():
                record.mark(at_s, MarkKind.FINDING, event.finding.sentence)
            case OperatorActed() | InputSet():
                record.mark(at_s, MarkKind.OPERATOR, str(event))
            case WouldHaveStopped():
                record.mark(at_s, MarkKind.WARNING, str(event))
            case _:
                return

    def _take_of_application(self, event: Event, at_s: float) -> None:
        record = self.record
        match event:
            case ApplicationJoined() if event.role is Role.COMMANDER:
                record.lane("application").change(at_s, event.who, "it commands the arm over the servo link")
            case ApplicationLeft() if event.role is Role.COMMANDER:
                record.lane("application").change(at_s, "", event.reason)
            case MotionBegan():
                record.lane("motion").change(at_s, f"{event.number} {event.kind.name}")
            case MotionOver():
                lane = record.lane("motion")
                if lane.label == f"{event.number} {event.kind.name}":
                    lane.change(at_s, "", str(event))
            case _:
                return
