"""Protobuf messages to values. An absent submessage is None, an absent number is None."""

from hil.values.errors import MalformedDatagram
from hil.values.fri_messages import (
    CommandData,
    CommandMessage,
    ConnectionInfo,
    EndOf,
    IOValue,
    IpoData,
    MonitorData,
    MonitoringMessage,
    Redundancy,
    RobotInfo,
    TimeStamp,
    Transformation,
    Vector,
)
from hil.values.outcomes import Outcome
from transport.fri import fri_pb2


def command(wire: fri_pb2.CommandMessage) -> CommandMessage:
    """Return the value of a parsed command message."""
    header = wire.header
    return CommandMessage(
        header.sequence_counter,
        header.reflected_sequence_counter,
        _command(wire.command) if wire.HasField("command") else None,
        _end_of(wire.end_of) if wire.HasField("end_of") else None,
        header.identifier,
    )


def monitoring(wire: fri_pb2.MonitoringMessage) -> MonitoringMessage:
    """Return the value of a parsed monitoring message."""
    header = wire.header
    return MonitoringMessage(
        header.sequence_counter,
        header.reflected_sequence_counter,
        _robot(wire.robot) if wire.HasField("robot") else None,
        _monitor(wire.monitor) if wire.HasField("monitor") else None,
        _connection(wire.connection) if wire.HasField("connection") else None,
        _ipo(wire.ipo) if wire.HasField("ipo") else None,
        tuple(_transformation(item) for item in wire.requested_transformation),
        _end_of(wire.end_of) if wire.HasField("end_of") else None,
        header.identifier,
    )


def _command(wire: fri_pb2.CommandData) -> CommandData:
    return CommandData(
        tuple(wire.position.value) if wire.HasField("position") else None,
        tuple(wire.wrench.value) if wire.HasField("wrench") else None,
        tuple(wire.torque.value) if wire.HasField("torque") else None,
        tuple(_transformation(item) for item in wire.transformation),
        tuple(_io(item) for item in wire.io),
        _transformation(wire.pose) if wire.HasField("pose") else None,
        _redundancy(wire.redundancy) if wire.HasField("redundancy") else None,
    )


def _robot(wire: fri_pb2.RobotInfo) -> RobotInfo:
    return RobotInfo(
        wire.joint_count if wire.HasField("joint_count") else None,
        wire.safety_state if wire.HasField("safety_state") else None,
        tuple(wire.drive_state),
        wire.operation_mode if wire.HasField("operation_mode") else None,
        wire.control_mode if wire.HasField("control_mode") else None,
    )


def _monitor(wire: fri_pb2.MonitorData) -> MonitorData:
    def joints(name: str, values: fri_pb2.JointValues) -> Vector | None:
        return tuple(values.value) if wire.HasField(name) else None

    return MonitorData(
        joints("measured_position", wire.measured_position),
        joints("measured_torque", wire.measured_torque),
        joints("commanded_position", wire.commanded_position),
        joints("commanded_torque", wire.commanded_torque),
        joints("external_torque", wire.external_torque),
        tuple(wire.external_force.value) if wire.HasField("external_force") else None,
        tuple(_io(item) for item in wire.io),
        _transformation(wire.measured_pose) if wire.HasField("measured_pose") else None,
        _redundancy(wire.redundancy) if wire.HasField("redundancy") else None,
        _time_stamp(wire.at) if wire.HasField("at") else None,
    )


def _connection(wire: fri_pb2.ConnectionInfo) -> ConnectionInfo:
    return ConnectionInfo(
        wire.session_state,
        wire.quality,
        wire.send_period_ms if wire.HasField("send_period_ms") else None,
        wire.receive_multiplier if wire.HasField("receive_multiplier") else None,
    )


def _ipo(wire: fri_pb2.IpoData) -> IpoData:
    return IpoData(
        tuple(wire.position.value) if wire.HasField("position") else None,
        _transformation(wire.pose) if wire.HasField("pose") else None,
        _redundancy(wire.redundancy) if wire.HasField("redundancy") else None,
        wire.client_command_mode if wire.HasField("client_command_mode") else None,
        wire.overlay_type if wire.HasField("overlay_type") else None,
        wire.tracking_performance if wire.HasField("tracking_performance") else None,
    )


def _transformation(
    wire: fri_pb2.Transformation | fri_pb2.CommandedTransformation,
) -> Transformation:
    return Transformation(_text(wire.name), tuple(wire.value), _time_stamp(wire.at) if wire.HasField("at") else None)


def _text(name: str | bytes) -> str:
    """Return a name; one that is no UTF-8, which the parser hands over as bytes, is no message."""
    if isinstance(name, bytes):
        raise MalformedDatagram(Outcome.UNDECODABLE, f"the name {name!r} is no UTF-8")
    return name


def _redundancy(wire: fri_pb2.RedundancyInformation) -> Redundancy:
    return Redundancy(wire.strategy, wire.value)


def _time_stamp(wire: fri_pb2.TimeStamp) -> TimeStamp:
    return TimeStamp(wire.seconds, wire.nanoseconds)


def _io(wire: fri_pb2.IOValue) -> IOValue:
    return IOValue(
        _text(wire.name),
        wire.type,
        wire.direction,
        wire.digital if wire.HasField("digital") else None,
        wire.analog if wire.HasField("analog") else None,
    )


def _end_of(wire: fri_pb2.EndOf) -> EndOf:
    return EndOf(
        wire.message_length if wire.HasField("message_length") else None,
        wire.checksum.crc if wire.HasField("checksum") else None,
    )
