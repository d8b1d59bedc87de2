"""Commands: what an application asks for."""

from collections.abc import Callable, Mapping
from typing import Final

from hil.values.frames import FLANGE, MAX_FRAME_NAME_BYTES
from hil.values.motion import MotionParameters
from hil.values.servo import (
    MAX_REQUESTS_IN_PACKET,
    ChangeControlMode,
    Command,
    DescribeFrame,
    LocateFlange,
    PushArm,
    Request,
    SetDestination,
    SetRuntimeParameters,
    StartMotion,
    StopMotion,
    ValidateLoad,
)
from transport.servo import servo_pb2, usual
from transport.servo.fields import (
    KINDS,
    fitting,
    read_member,
    read_pose,
    read_text,
    read_vector,
    refuse_many,
    undecodable,
    wire_number,
    wire_pose,
    wire_text,
    wire_vector,
)
from transport.servo.layout import TAG_AND_LENGTH_BYTES, field
from transport.servo.loads import read_tool, wire_tool
from transport.servo.modes import read_mode, wire_mode

_COMMAND: Final = b"\x2a"
_REQUEST: Final = b"\x1a"


def read_command(wire: servo_pb2.Packet) -> Command:
    """Return a command; raise :class:`MalformedDatagram`."""
    header, command = wire.header, wire.command
    refuse_many(len(command.request), MAX_REQUESTS_IN_PACKET, "requests")
    return Command(
        header.token,
        header.sequence,
        header.reflected_sequence,
        command.reports_seen,
        command.wants_state,
        tuple([_read_request(request) for request in command.request]),
    )


def _read_request(wire: servo_pb2.Request) -> Request:
    what = wire.WhichOneof("what")
    if what == "destination":
        return _read_set_destination(wire.number, wire.destination)
    read = None if what is None else _READERS.get(what)
    if read is None:
        raise undecodable(f"request {wire.number} asks for nothing")
    return read(wire)


def _read_start(number: int, wire: servo_pb2.StartMotion) -> StartMotion:
    if not wire.HasField("parameters"):
        raise undecodable(f"request {number} starts a motion without parameters")
    parameters = wire.parameters
    return StartMotion(
        number,
        read_member(KINDS, wire.kind, "motion kind"),
        MotionParameters(
            joint_velocity_rel=parameters.joint_velocity_rel,
            joint_acceleration_rel=parameters.joint_acceleration_rel,
            acceleration_override=parameters.acceleration_override,
            joint_jerk_percent=parameters.joint_jerk_percent,
            minimum_execution_time_s=parameters.minimum_execution_time_s,
            speed_timeout_s=parameters.speed_timeout_s,
            timeout_after_goal_s=parameters.timeout_after_goal_s,
            blending_rel=parameters.blending_rel,
            velocity_planning=parameters.velocity_planning,
            wait_for_pause=parameters.wait_for_pause,
        ),
        read_vector(wire.destination.value) if wire.HasField("destination") else None,
        read_pose(wire.flange_in_base) if wire.HasField("flange_in_base") else None,
        read_mode(wire),
        read_text(wire.frame, MAX_FRAME_NAME_BYTES, "name of a frame") or FLANGE,
        read_tool(wire),
    )


def _read_change_mode(wire: servo_pb2.Request) -> ChangeControlMode:
    return ChangeControlMode(wire.number, wire.mode.motion, read_mode(wire.mode))


def _read_validate(wire: servo_pb2.Request) -> ValidateLoad:
    frame = read_text(wire.validate.frame, MAX_FRAME_NAME_BYTES, "name of a frame")
    return ValidateLoad(wire.number, frame, read_tool(wire.validate))


def _read_push(wire: servo_pb2.Request) -> PushArm:
    push = wire.push
    return PushArm(wire.number, push.link, read_vector(push.force_n), read_vector(push.moment_nm), push.duration_s)


def _read_set_destination(number: int, wire: servo_pb2.SetDestination) -> SetDestination:
    return SetDestination(
        number,
        wire.motion,
        read_vector(wire.position.value) if wire.HasField("position") else None,
        read_vector(wire.velocity.value) if wire.HasField("velocity") else None,
        read_pose(wire.flange_in_base) if wire.HasField("flange_in_base") else None,
    )


def _read_set_parameters(number: int, wire: servo_pb2.SetRuntimeParameters) -> SetRuntimeParameters:
    return SetRuntimeParameters(
        number,
        wire.motion,
        wire.minimum_execution_time_s if wire.HasField("minimum_execution_time_s") else None,
        wire.velocity_planning if wire.HasField("velocity_planning") else None,
        wire.wait_for_pause if wire.HasField("wait_for_pause") else None,
    )


_READERS: Final[Mapping[str, Callable[[servo_pb2.Request], Request]]] = {
    "start": lambda wire: _read_start(wire.number, wire.start),
    "parameters": lambda wire: _read_set_parameters(wire.number, wire.parameters),
    "stop": lambda wire: StopMotion(wire.number, wire.stop.motion),
    "describe": lambda wire: DescribeFrame(wire.number, wire.describe.place),
    "locate": lambda wire: LocateFlange(wire.number, read_vector(wire.locate.position)),
    "mode": _read_change_mode,
    "validate": _read_validate,
    "push": _read_push,
}


def write_command(packet: Command, *, most_bytes: int) -> bytes:
    """Return a command of at most ``most_bytes``, with its first requests."""
    usual_bytes = usual.write_command(packet)
    if usual_bytes is not None:
        return usual_bytes
    header = usual.write_header(packet)
    head = servo_pb2.Command(reports_seen=packet.reports_seen, wants_state=packet.wants_state).SerializeToString()
    room_bytes = most_bytes - len(header) - len(head) - TAG_AND_LENGTH_BYTES
    requests = fitting(map(_write_request, packet.requests[:MAX_REQUESTS_IN_PACKET]), room_bytes)
    return header + field(_COMMAND, head + requests)


def _write_request(request: Request) -> bytes:
    return field(_REQUEST, _wire_request(request).SerializeToString())


def _wire_request(request: Request) -> servo_pb2.Request:
    if isinstance(request, SetDestination):
        destination = servo_pb2.SetDestination(
            motion=request.motion,
            position=wire_vector(request.position),
            velocity=wire_vector(request.velocity),
            flange_in_base=wire_pose(request.flange_in_base),
        )
        return servo_pb2.Request(number=request.number, destination=destination)
    if isinstance(request, StartMotion):
        start = servo_pb2.StartMotion(
            kind=wire_number(request.kind),
            parameters=_wire_parameters(request.parameters),
            destination=wire_vector(request.destination),
            flange_in_base=wire_pose(request.flange_in_base),
            mode=wire_mode(request.mode),
            frame="" if request.frame == FLANGE else wire_text(request.frame, MAX_FRAME_NAME_BYTES),
            tool=wire_tool(request.tool),
        )
        return servo_pb2.Request(number=request.number, start=start)
    if isinstance(request, SetRuntimeParameters):
        changed = servo_pb2.SetRuntimeParameters(
            motion=request.motion,
            minimum_execution_time_s=request.minimum_execution_time_s,
            velocity_planning=request.velocity_planning,
            wait_for_pause=request.wait_for_pause,
        )
        return servo_pb2.Request(number=request.number, parameters=changed)
    if isinstance(request, DescribeFrame):
        return servo_pb2.Request(number=request.number, describe=servo_pb2.DescribeFrame(place=request.place))
    if isinstance(request, LocateFlange):
        asked = wire_vector(request.position)
        locate = servo_pb2.LocateFlange(position=() if asked is None else asked.value)
        return servo_pb2.Request(number=request.number, locate=locate)
    return _wire_rarer(request)


def _wire_rarer(request: ChangeControlMode | ValidateLoad | PushArm | StopMotion) -> servo_pb2.Request:
    if isinstance(request, ChangeControlMode):
        mode = servo_pb2.ChangeControlMode(motion=request.motion, mode=wire_mode(request.mode))
        return servo_pb2.Request(number=request.number, mode=mode)
    if isinstance(request, ValidateLoad):
        frame = wire_text(request.frame, MAX_FRAME_NAME_BYTES)
        validate = servo_pb2.ValidateLoad(frame=frame, tool=wire_tool(request.tool))
        return servo_pb2.Request(number=request.number, validate=validate)
    if isinstance(request, PushArm):
        push = servo_pb2.PushArm(
            link=request.link, force_n=request.force_n, moment_nm=request.moment_nm, duration_s=request.duration_s
        )
        return servo_pb2.Request(number=request.number, push=push)
    return servo_pb2.Request(number=request.number, stop=servo_pb2.StopMotion(motion=request.motion))


def _wire_parameters(parameters: MotionParameters) -> servo_pb2.MotionParameters:
    return servo_pb2.MotionParameters(
        joint_velocity_rel=parameters.joint_velocity_rel,
        joint_acceleration_rel=parameters.joint_acceleration_rel,
        acceleration_override=parameters.acceleration_override,
        joint_jerk_percent=parameters.joint_jerk_percent,
        minimum_execution_time_s=parameters.minimum_execution_time_s,
        speed_timeout_s=parameters.speed_timeout_s,
        timeout_after_goal_s=parameters.timeout_after_goal_s,
        blending_rel=parameters.blending_rel,
        velocity_planning=parameters.velocity_planning,
        wait_for_pause=parameters.wait_for_pause,
    )
