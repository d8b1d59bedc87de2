"""What packets alone show of a controller: for recordings from elsewhere, and for those of ours that miss their start.

Nothing of the inside is known: no reason of a change, no margin. The flange's speed comes from the measured positions
of two messages and the kinematics of a robot model, which the packets do not name.
"""

from collections.abc import Mapping
from enum import IntEnum
from operator import sub
from typing import Final

from hil.core.model import ArmModel
from hil.replay.guess import Flow
from hil.values.errors import MalformedDatagram
from hil.values.fri import (
    SEQUENCE_MODULUS,
    DriveState,
    OperationMode,
    Quality,
    SafetyState,
    SessionState,
)
from hil.values.fri_messages import MonitoringMessage
from hil.values.robot import JOINT_COUNT, Seven
from tools.doctor.capture.flow import FlowDiagnosis
from tools.doctor.capture.tables import slowest_table, split_table
from tools.report.record import NOT_KNOWN, MarkKind, RobotRecord
from transport.capture.records import Packet
from transport.fri import FriCodec

_SLOWEST: Final = 10
_REMEMBERED: Final = 1024
_LONGEST_STEP: Final = 1000
"""Of the sequence counter; positions that are further apart say nothing of a speed."""
_LARGEST_ANGLE_RAD: Final = 100.0


class PacketObserver:
    """Fills the record of one recorded controller from its messages and its client's answers."""

    def __init__(self, flow: Flow, *, name: str, model_name: str, model: ArmModel, first_unix_ns: int) -> None:
        connection = flow.first.connection
        self._period_ms = (1 if connection is None else connection.send_period_ms) or 1
        multiplier = (1 if connection is None else connection.receive_multiplier) or 1
        self.record = RobotRecord(
            name,
            model_name,
            commanded_is="",
            speed_is=(
                f"worked out from the measured positions of two messages; assumed robot model: {model_name} "
                f"(the packets do not name it; --robot chooses another)"
            ),
            inside_known=False,
            budget_ms=float(self._period_ms * multiplier),
            configuration={
                "controller": str(flow.controller),
                "client": str(flow.client),
                "release": f"{flow.release}" + ("" if flow.sure else " (guessed)"),
                "send period [ms]": self._period_ms,
                "receive multiplier": multiplier,
                "assumed robot model": model_name,
            },
            notes=list(flow.notes),
        )
        self._diagnosis = FlowDiagnosis(flow, period_ms=None)
        self._codec = FriCodec(flow.release)
        self._model = model
        self._first_unix_ns = first_unix_ns
        self._sent_ns: dict[int, int] = {}
        self._before: tuple[int, Seven] | None = None
        """Counter and measured positions of the message before."""
        self._commanded: tuple[float, ...] = NOT_KNOWN
        self._from_client: tuple[float, ...] = NOT_KNOWN
        self._session = SessionState.IDLE
        self._quality: Quality | None = None
        self.messages = 0
        self.answers = 0
        self.not_understood = 0
        for lane in ("session", "quality", "mode", "safety", "drives"):
            self.record.lane(lane)

    def sent(self, packet: Packet) -> None:
        """Take a datagram of the controller."""
        self._diagnosis.sent(packet)
        try:
            message = self._codec.decode_monitoring(packet.payload)
        except MalformedDatagram as error:
            self._not_understood(packet, error)
            return
        at_s = self._at_s(packet)
        self.record.end_s = max(self.record.end_s, at_s)
        self.messages += 1
        self._sent_ns[message.sequence_counter] = packet.at_unix_ns
        if len(self._sent_ns) > _REMEMBERED:
            del self._sent_ns[next(iter(self._sent_ns))]
        self._take_states(message, at_s)
        self._take_positions(message, at_s)

    def answered(self, packet: Packet) -> None:
        """Take a datagram of the client."""
        self._diagnosis.answered(packet)
        try:
            message = self._codec.decode_command(packet.payload)
        except MalformedDatagram as error:
            self._not_understood(packet, error)
            return
        self.answers += 1
        at_s = self._at_s(packet)
        self.record.end_s = max(self.record.end_s, at_s)
        sent_ns = self._sent_ns.get(message.reflected_sequence_counter)
        if sent_ns is not None:
            latency_ms = (packet.at_unix_ns - sent_ns) / 1e6
            self.record.latencies.add(at_s, latency_ms, budget_ms=self.record.budget_ms or 0.0)
        command = message.command
        position = None if command is None else command.position
        if position is not None and len(position) == JOINT_COUNT and self._session is SessionState.COMMANDING_ACTIVE:
            self._from_client = position

    def finish(self) -> None:
        """The recording is over."""
        record = self.record
        told = record.commanded_is or "known: the messages carry no commanded positions, and no client commanded any"
        record.commanded_is = told
        self._diagnosis.finish()
        path = self._diagnosis.path
        record.evidence = [
            split_table("each part, over all answers", path.histograms, own=False),
            slowest_table("the slowest answers [ms]", path.worst, _SLOWEST, own=False),
        ]
        record.report = {
            "findings": self._diagnosis.findings.report(),
            "packets": {
                "messages of the controller": self.messages,
                "answers of the client": self.answers,
                "not understood": self.not_understood,
            },
        }
        record.finish()

    def _at_s(self, packet: Packet) -> float:
        return (packet.at_unix_ns - self._first_unix_ns) / 1e9

    def _not_understood(self, packet: Packet, error: MalformedDatagram) -> None:
        self.not_understood += 1
        at_s = self._at_s(packet)
        before = self.record.drops.get(error.outcome.value, (0, 0.0, ""))[0]
        self.record.drops[error.outcome.value] = (before + 1, at_s, f"packet {packet.number}: {error.detail}")

    def _take_states(self, message: MonitoringMessage, at_s: float) -> None:
        record, connection, robot = self.record, message.connection, message.robot
        if connection is not None:
            record.lane("session").change(at_s, _named(connection.session_state, SessionState))
            record.lane("quality").change(at_s, _named(connection.quality, Quality))
            self._judge(connection.session_state, connection.quality, at_s)
        if robot is None:
            return
        if robot.operation_mode is not None:
            record.lane("mode").change(at_s, _named(robot.operation_mode, OperationMode))
        if robot.safety_state is not None:
            name = _named(robot.safety_state, SafetyState)
            news = name != record.lane("safety").label
            record.lane("safety").change(at_s, name)
            if news and robot.safety_state != SafetyState.NORMAL_OPERATION:
                record.stopped(at_s, f"the controller tells of {name}")
        if robot.drive_states:
            record.lane("drives").change(at_s, _named(min(robot.drive_states), DriveState))

    def _judge(self, state: int, quality: int, at_s: float) -> None:
        """Note when commanding ended, and when the connection became worse than GOOD."""
        before, known = self._session, self._quality
        self._session = SessionState(state) if state in set(SessionState) else SessionState.IDLE
        self._quality = Quality(quality) if quality in set(Quality) else None
        if before is SessionState.COMMANDING_ACTIVE and self._session is not before:
            what = f"commanding ended: COMMANDING_ACTIVE -> {self._session.name}, quality {_named(quality, Quality)}"
            self.record.mark(at_s, MarkKind.WARNING, what)
            self.record.tell(at_s, what)
            self._from_client = NOT_KNOWN
        elif self._session is not before:
            self.record.tell(at_s, f"{before.name} -> {self._session.name}")
        if self._session is SessionState.IDLE:
            return  # A session that was closed has no quality.
        if known is not None and self._quality is not None and self._quality < Quality.GOOD <= known:
            text = f"quality {known.name} -> {self._quality.name}"
            self.record.quality_fell(at_s, text)
            self.record.tell(at_s, text)

    def _take_positions(self, message: MonitoringMessage, at_s: float) -> None:
        monitor = message.monitor
        measured = None if monitor is None else _seven(monitor.measured_position)
        if monitor is None or measured is None:
            return
        self.record.sample(at_s, self._commanded, measured, self._speed_mm_s(message.sequence_counter, measured))
        told = _seven(monitor.commanded_position)
        if told is not None:
            self._commanded = told
            self.record.commanded_is = "what the controller told as commanded, one message before"
        else:
            self._commanded = self._from_client
            if self._from_client is not NOT_KNOWN:
                self.record.commanded_is = "what the client commanded last in COMMANDING_ACTIVE"

    def _speed_mm_s(self, counter: int, measured: Seven) -> float:
        before, self._before = self._before, (counter, measured)
        if before is None:
            return float("nan")
        steps = (counter - before[0]) % SEQUENCE_MODULUS
        if not 0 < steps <= _LONGEST_STEP:
            return float("nan")
        per_s = 1e3 / (steps * self._period_ms)
        a1, a2, a3, a4, a5, a6, a7 = (step * per_s for step in map(sub, measured, before[1]))
        return self._model.flange_speed_mm_s(measured, (a1, a2, a3, a4, a5, a6, a7))


def _named(number: int, kind: type[IntEnum]) -> str:
    known: Mapping[int, str] = {int(one): one.name for one in kind}
    return known.get(number, f"unknown ({number})")


def _seven(values: tuple[float, ...] | None) -> Seven | None:
    """Return positions an arm can have."""
    if values is None or len(values) != JOINT_COUNT or not all(abs(one) <= _LARGEST_ANGLE_RAD for one in values):
        return None
    a1, a2, a3, a4, a5, a6, a7 = values
    return (a1, a2, a3, a4, a5, a6, a7)
