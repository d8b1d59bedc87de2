"""States: what the controller says of arm, motions and requests."""

from typing import Final

from hil.values.arm import MAX_CONTACTS, Contact
from hil.values.frames import MAX_FRAME_NAME_BYTES, MAX_FRAMES, Frame
from hil.values.operator import OperatorView
from hil.values.pose import Pose
from hil.values.servo import (
    MAX_COMMANDER_BYTES,
    MAX_DETAIL_BYTES,
    MAX_MOTIONS_IN_PACKET,
    MAX_REASON_BYTES,
    MAX_REPORTS_IN_PACKET,
    FlangeLocated,
    FrameDescribed,
    GoalReached,
    LoadValidated,
    MotionEnded,
    MotionState,
    Report,
    RequestDone,
    Snapshot,
    State,
)
from transport.servo import servo_pb2, usual
from transport.servo.fields import (
    CONTROL_MODES,
    ENDS,
    ERRORS,
    FRAME_KINDS,
    INTERPOLATORS,
    KINDS,
    MODES,
    MOST_OVERRIDE_PERCENT,
    PHASES,
    PROGRAMS,
    SAFETY_STATES,
    fitting,
    pose_numbers,
    read_counted,
    read_member,
    read_pose,
    read_text,
    read_vector,
    refuse_many,
    undecodable,
    wire_number,
    wire_text,
)
from transport.servo.layout import TAG_AND_LENGTH_BYTES, field
from transport.servo.loads import read_load, wire_load

_SNAPSHOT: Final = b"\x12"
_MOTION: Final = b"\x7a"
_CONTACT: Final = b"\xb2\x01"
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
    refuse_many(len(wire.contact), MAX_CONTACTS, "contacts")
    return Snapshot(
        wire.now_ns,
        wire.cycle,
        _read_operator(wire),
        read_vector(wire.measured_position),
        read_vector(wire.commanded_position),
        read_vector(wire.measured_torque),
        read_vector(wire.external_torque),
        read_pose(wire.flange_in_base),
        read_member(CONTROL_MODES, wire.control_mode, "control mode"),
        read_vector(wire.external_torque_variance),
        read_vector(wire.flange_force),
        read_vector(wire.flange_force_variance),
        read_text(wire.commander, MAX_COMMANDER_BYTES, "commander"),
        tuple([_read_motion(motion) for motion in wire.motion]),
        wire.flange_speed_mm_s,
        tuple([_read_contact(contact) for contact in wire.contact]),
    )


def _read_operator(wire: servo_pb2.Snapshot) -> OperatorView:
    if not 0.0 <= wire.override_percent <= MOST_OVERRIDE_PERCENT:
        raise undecodable(f"an override of {wire.override_percent:g} %, 0 ... 100 % are possible")
    return OperatorView(
        read_member(MODES, wire.operation_mode, "operation mode"),
        read_member(PROGRAMS, wire.program, "state of the program"),
        wire.enabling,
        wire.override_percent,
        read_member(SAFETY_STATES, wire.safety_state, "safety state"),
        read_text(wire.operator_reason, MAX_REASON_BYTES, "reason of the operator"),
        wire.permissive,
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


def _read_contact(wire: servo_pb2.Contact) -> Contact:
    x, y, z = read_counted(wire.point_m, 3, "a point of contact")
    fx, fy, fz = read_counted(wire.force_n, 3, "a contact force")
    return Contact((x, y, z), (fx, fy, fz))


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
    if what == "frame":
        return FrameDescribed(wire.number, wire.frame.request, _read_of(wire.frame.of), _read_frame(wire.frame))
    if what == "flange":
        return FlangeLocated(wire.number, wire.flange.request, read_pose(wire.flange.flange_in_base))
    if what == "load":
        return LoadValidated(wire.number, wire.load.request, read_text(wire.load.reason, MAX_REASON_BYTES, "reason"))
    raise undecodable(f"report {wire.number} says nothing")


def _read_of(count: int) -> int:
    if not 1 <= count <= MAX_FRAMES:
        raise undecodable(f"a frame of {count}, there are 1 ... {MAX_FRAMES}")
    return count


def _read_frame(wire: servo_pb2.FrameDescribed) -> Frame:
    load = wire.load
    return Frame(
        read_text(wire.name, MAX_FRAME_NAME_BYTES, "name of a frame"),
        read_member(FRAME_KINDS, wire.kind, "frame kind"),
        read_text(wire.parent, MAX_FRAME_NAME_BYTES, "name of a parent frame"),
        read_pose(wire.in_parent),
        read_load(load) if wire.HasField("load") else None,
    )


class StateWriter:
    """Writes states. The snapshot is the same for all sessions of a cycle: its bytes are kept as long as it comes."""

    def __init__(self) -> None:
        self._snapshot_of: Snapshot | None = None
        self._snapshot = b""

    def write(self, packet: State, *, most_bytes: int) -> bytes:
        """Return a state of at most ``most_bytes``, with its first reports."""
        if packet.snapshot is not self._snapshot_of:
            self._snapshot = _write_snapshot(packet.snapshot, most_bytes=most_bytes)
            self._snapshot_of = packet.snapshot
        room_bytes = most_bytes - usual.STATE_HEAD_BYTES
        snapshot, reports = self._snapshot, b""
        if packet.reports:
            pieces = [_write_report(report) for report in packet.reports[:MAX_REPORTS_IN_PACKET]]
            if len(snapshot) + len(pieces[0]) > room_bytes:
                # The longest texts at once: contacts and the motions that wait last give way, a report never does.
                snapshot = _write_snapshot(packet.snapshot, most_bytes=room_bytes - len(pieces[0]))
            reports = fitting(pieces, room_bytes - len(snapshot))
        return usual.write_state(packet, snapshot, reports)


def _write_snapshot(snapshot: Snapshot, *, most_bytes: int) -> bytes:
    """Return the field of a snapshot of at most ``most_bytes``, with its first motions, then its first contacts."""
    told = _write_snapshot_head(snapshot)
    if snapshot.commander:
        told += field(usual.COMMANDER, wire_text(snapshot.commander, MAX_COMMANDER_BYTES).encode())
    if snapshot.operator.reason:
        told += field(usual.OPERATOR_REASON, wire_text(snapshot.operator.reason, MAX_REASON_BYTES).encode())
    room_bytes = most_bytes - TAG_AND_LENGTH_BYTES - len(told)
    motions = fitting(map(_write_motion, snapshot.motions[:MAX_MOTIONS_IN_PACKET]), room_bytes)
    if not snapshot.contacts:
        return field(_SNAPSHOT, told + motions)
    contacts = fitting(map(_write_contact, snapshot.contacts[:MAX_CONTACTS]), room_bytes - len(motions))
    return field(_SNAPSHOT, told + motions + contacts)


def _write_snapshot_head(snapshot: Snapshot) -> bytes:
    head = usual.write_snapshot(snapshot)
    if head is not None:
        return head
    operator = snapshot.operator
    wire = servo_pb2.Snapshot(
        now_ns=snapshot.now_ns,
        cycle=snapshot.cycle,
        operation_mode=wire_number(operator.mode),
        program=wire_number(operator.program),
        enabling=operator.enabling,
        override_percent=operator.override_percent,
        safety_state=wire_number(operator.safety_state),
        permissive=operator.permissive,
        measured_position=snapshot.measured_position,
        commanded_position=snapshot.commanded_position,
        measured_torque=snapshot.measured_torque,
        external_torque=snapshot.external_torque,
        flange_in_base=_wire_pose(snapshot.flange_in_base),
        control_mode=wire_number(snapshot.control_mode),
        external_torque_variance=snapshot.external_torque_variance,
        flange_force=snapshot.flange_force,
        flange_force_variance=snapshot.flange_force_variance,
        flange_speed_mm_s=snapshot.flange_speed_mm_s,
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


def _write_contact(contact: Contact) -> bytes:
    usual_bytes = usual.write_contact(contact)
    if usual_bytes is not None:
        return usual_bytes
    wire = servo_pb2.Contact(point_m=contact.point_m, force_n=contact.force_n)
    return field(_CONTACT, wire.SerializeToString())


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
    elif isinstance(report, FrameDescribed):
        wire = servo_pb2.Report(number=report.number, frame=_wire_frame(report))
    elif isinstance(report, FlangeLocated):
        flange = servo_pb2.FlangeLocated(request=report.request, flange_in_base=_wire_pose(report.flange_in_base))
        wire = servo_pb2.Report(number=report.number, flange=flange)
    elif isinstance(report, LoadValidated):
        load = servo_pb2.LoadValidated(request=report.request, reason=wire_text(report.reason, MAX_REASON_BYTES))
        wire = servo_pb2.Report(number=report.number, load=load)
    else:
        ended = servo_pb2.MotionEnded(
            motion=report.motion,
            end=wire_number(report.end),
            reason=wire_text(report.reason, MAX_REASON_BYTES),
            detail=wire_text(report.detail, MAX_DETAIL_BYTES),
        )
        wire = servo_pb2.Report(number=report.number, at_ns=report.at_ns, ended=ended)
    return field(_REPORT, wire.SerializeToString())


def _wire_frame(report: FrameDescribed) -> servo_pb2.FrameDescribed:
    frame = report.frame
    load = None
    if frame.load is not None:
        load = wire_load(frame.load)
    return servo_pb2.FrameDescribed(
        request=report.request,
        of=report.of,
        name=wire_text(frame.name, MAX_FRAME_NAME_BYTES),
        kind=wire_number(frame.kind),
        parent=wire_text(frame.parent, MAX_FRAME_NAME_BYTES),
        in_parent=_wire_pose(frame.in_parent),
        load=load,
    )


def _wire_pose(pose: Pose) -> servo_pb2.Pose:
    return servo_pb2.Pose(value=pose_numbers(pose))
