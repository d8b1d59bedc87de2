"""States: what the controller says of arm, motions and requests."""

from typing import Final

from hil.values.servo import (
    MAX_COMMANDER_BYTES,
    MAX_DETAIL_BYTES,
    MAX_MOTIONS_IN_PACKET,
    MAX_REASON_BYTES,
    MAX_REPORTS_IN_PACKET,
    GoalReached,
    MotionEnded,
    MotionState,
    Report,
    RequestDone,
    Snapshot,
    State,
)
from transport.servo import servo_pb2, usual
from transport.servo.fields import (
    ENDS,
    ERRORS,
    INTERPOLATORS,
    KINDS,
    PHASES,
    fitting,
    read_member,
    read_text,
    read_vector,
    refuse_many,
    undecodable,
    wire_number,
    wire_text,
)
from transport.servo.layout import field

_SNAPSHOT: Final = b"\x12"
_MOTION: Final = b"\x4a"
_REPORT: Final = b"\x1a"


def read_state(wire: servo_pb2.Packet) -> State:
    """Return a state; raise :class:`MalformedDatagram`."""
    header, state = wire.header, wire.state
    if not state.HasField("snapshot"):
        raise undecodable("a state that shows nothing")
    refuse_many(len(state.report), MAX_REPORTS_IN_PACKET, "reports")
    return State(
        header.token,
        header.sequence,
        header.reflected_sequence,
        state.requests_done,
        _read_snapshot(state.snapshot),
        tuple([_read_report(report) for report in state.report]),
    )


def _read_snapshot(wire: servo_pb2.Snapshot) -> Snapshot:
    refuse_many(len(wire.motion), MAX_MOTIONS_IN_PACKET, "motions")
    return Snapshot(
        wire.now_ns,
        wire.cycle,
        wire.operation_mode,
        read_vector(wire.measured_position),
        read_vector(wire.commanded_position),
        read_vector(wire.measured_torque),
        read_vector(wire.external_torque),
        read_text(wire.commander, MAX_COMMANDER_BYTES, "commander"),
        tuple([_read_motion(motion) for motion in wire.motion]),
    )


def _read_motion(wire: servo_pb2.MotionState) -> MotionState:
    return MotionState(
        wire.motion,
        read_member(KINDS, wire.kind, "motion kind"),
        read_member(PHASES, wire.phase, "motion phase"),
        read_member(INTERPOLATORS, wire.interpolator, "fine interpolator state"),
        read_vector(wire.destination),
        wire.destination_at_ns,
        wire.remaining_s,
        wire.goals_reached,
        wire.received,
        wire.superseded,
        wire.executed,
        wire.executed_at_ns,
    )


def _read_report(wire: servo_pb2.Report) -> Report:
    what = wire.WhichOneof("what")
    if what == "done":
        done = wire.done
        return RequestDone(
            wire.number,
            done.request,
            wire.at_ns,
            read_member(ERRORS, done.error, "request error"),
            read_text(done.reason, MAX_REASON_BYTES, "reason"),
            read_text(done.detail, MAX_DETAIL_BYTES, "detail"),
        )
    if what == "goal":
        state = read_member(INTERPOLATORS, wire.goal.state, "fine interpolator state")
        return GoalReached(wire.number, wire.goal.motion, wire.at_ns, state, read_vector(wire.goal.position))
    if what == "ended":
        ended = wire.ended
        return MotionEnded(
            wire.number,
            ended.motion,
            wire.at_ns,
            read_member(ENDS, ended.end, "end of a motion"),
            read_text(ended.reason, MAX_REASON_BYTES, "reason"),
            read_text(ended.detail, MAX_DETAIL_BYTES, "detail"),
        )
    raise undecodable(f"report {wire.number} says nothing")


class StateWriter:
    """Writes states. The snapshot is the same for all sessions of a cycle: its bytes are kept as long as it comes."""

    def __init__(self) -> None:
        self._snapshot_of: Snapshot | None = None
        self._snapshot = b""

    def write(self, packet: State, *, most_bytes: int) -> bytes:
        """Return a state of at most ``most_bytes``, with its first reports."""
        if packet.snapshot is not self._snapshot_of:
            self._snapshot = field(_SNAPSHOT, _write_snapshot(packet.snapshot))
            self._snapshot_of = packet.snapshot
        reports = b""
        if packet.reports:
            room_bytes = most_bytes - usual.STATE_HEAD_BYTES - len(self._snapshot)
            reports = fitting(map(_write_report, packet.reports[:MAX_REPORTS_IN_PACKET]), room_bytes)
        return usual.write_state(packet, self._snapshot, reports)


def _write_snapshot(snapshot: Snapshot) -> bytes:
    commander = b""
    if snapshot.commander:
        commander = field(usual.COMMANDER, wire_text(snapshot.commander, MAX_COMMANDER_BYTES).encode())
    motions = [_write_motion(motion) for motion in snapshot.motions[:MAX_MOTIONS_IN_PACKET]]
    return b"".join((_write_snapshot_head(snapshot), commander, *motions))


def _write_snapshot_head(snapshot: Snapshot) -> bytes:
    head = usual.write_snapshot(snapshot)
    if head is not None:
        return head
    wire = servo_pb2.Snapshot(
        now_ns=snapshot.now_ns,
        cycle=snapshot.cycle,
        operation_mode=snapshot.operation_mode,
        measured_position=snapshot.measured_position,
        commanded_position=snapshot.commanded_position,
        measured_torque=snapshot.measured_torque,
        external_torque=snapshot.external_torque,
    )
    return wire.SerializeToString()


def _write_motion(motion: MotionState) -> bytes:
    usual_bytes = usual.write_motion(motion)
    if usual_bytes is not None:
        return usual_bytes
    wire = servo_pb2.MotionState(
        motion=motion.motion,
        kind=wire_number(motion.kind),
        phase=wire_number(motion.phase),
        interpolator=wire_number(motion.interpolator),
        destination=motion.destination,
        destination_at_ns=motion.destination_at_ns,
        remaining_s=motion.remaining_s,
        goals_reached=motion.goals_reached,
        received=motion.received,
        superseded=motion.superseded,
        executed=motion.executed,
        executed_at_ns=motion.executed_at_ns,
    )
    return field(_MOTION, wire.SerializeToString())


def _write_report(report: Report) -> bytes:
    if isinstance(report, RequestDone):
        taken = usual.write_request_taken(report)
        if taken is not None:
            return taken
        done = servo_pb2.RequestDone(
            request=report.request,
            error=wire_number(report.error),
            reason=wire_text(report.reason, MAX_REASON_BYTES),
            detail=wire_text(report.detail, MAX_DETAIL_BYTES),
        )
        wire = servo_pb2.Report(number=report.number, at_ns=report.at_ns, done=done)
    elif isinstance(report, GoalReached):
        goal = servo_pb2.GoalReached(motion=report.motion, state=wire_number(report.state), position=report.position)
        wire = servo_pb2.Report(number=report.number, at_ns=report.at_ns, goal=goal)
    else:
        ended = servo_pb2.MotionEnded(
            motion=report.motion,
            end=wire_number(report.end),
            reason=wire_text(report.reason, MAX_REASON_BYTES),
            detail=wire_text(report.detail, MAX_DETAIL_BYTES),
        )
        wire = servo_pb2.Report(number=report.number, at_ns=report.at_ns, ended=ended)
    return field(_REPORT, wire.SerializeToString())
