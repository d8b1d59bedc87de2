"""Values to protobuf messages. Written out by hand, field by field: this runs once a cycle."""

from struct import Struct
from typing import Final

from hil.values.fri import MONITORING_IDENTIFIER, RedundancyStrategy
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
from transport.fri import fri_pb2
from transport.fri.vectors import LAST_ONE_BYTE, ONE_BYTE, pose_field, varint, vector_field

_HEADER: Final = b"\x0a"
_IDENTIFIED: Final = b"\x08" + varint(MONITORING_IDENTIFIER) + b"\x10"
"""The identifier of a monitoring message, and the tag of the counter behind it."""
_REFLECTED: Final = b"\x18"
_MONITOR: Final = b"\x1a"
_IPO: Final = b"\x2a"
_MEASURED_POSE: Final = b"\x4a"
_REDUNDANCY: Final = Struct("<4s" + "cd").pack
_REDUNDANCY_E1: Final = b"\x52\x0b\x08\x00"
_AT: Final = b"\x7a"
_SECONDS: Final = b"\x08"
_NANOSECONDS: Final = b"\x10"
_NUMBER: Final = b"\x11"
_MOST_UINT32: Final = 0xFFFFFFFF


class MonitoringWriter:
    """Writes monitoring messages in pieces, in field order: protobuf messages may be joined end to end.

    What changes with every message is packed without protobuf objects (:mod:`transport.fri.vectors`). The rest rarely
    differs between two messages, so its bytes are kept as long as the same objects come.
    """

    def __init__(self) -> None:
        self._robot_of: RobotInfo | None = None
        self._robot = b""
        self._connection_of: ConnectionInfo | None = None
        self._connection = b""
        self._ipo_of: IpoData | None = None
        self._ipo = b""
        self._external_of: Vector | None = None
        self._external = b""
        self._second = -1
        self._second_piece = b""
        self._signals_of: tuple[IOValue, ...] = ()
        self._signals = b""

    def monitoring(self, message: MonitoringMessage) -> bytes:
        """Return the bytes of a monitoring message."""
        counter, reflected, robot, monitor, connection, ipo, requested, end_of, identifier = message
        if robot is not self._robot_of:
            self._robot_of, self._robot = robot, _robot_piece(robot)
        if connection is not self._connection_of:
            self._connection_of, self._connection = connection, _connection_piece(connection)
        if ipo is not self._ipo_of:
            self._ipo_of, self._ipo = ipo, b"" if ipo is None else _field(_IPO, _ipo_bytes(ipo))
        pieces = (
            _header_piece(identifier, counter, reflected),
            self._robot,
            b"" if monitor is None else _field(_MONITOR, self._monitor(monitor)),
            self._connection,
            self._ipo,
            _tail(message) if requested or end_of is not None else b"",
        )
        return b"".join(pieces)

    def _monitor(self, monitor: MonitorData) -> bytes:
        (
            measured_position, measured_torque, commanded_position, commanded_torque, external_torque, external_force,
            signals, pose, redundancy, at,
        ) = monitor  # fmt: skip
        # An estimate is made less often than a message.
        if external_torque is not self._external_of:
            self._external_of, self._external = external_torque, vector_field(b"\x2a", external_torque)
        if signals is not self._signals_of:
            self._signals_of, self._signals = signals, _signals_bytes(signals)
        pieces = (
            vector_field(b"\x0a", measured_position),
            vector_field(b"\x12", measured_torque),
            b"" if commanded_position is None else vector_field(b"\x1a", commanded_position),
            vector_field(b"\x22", commanded_torque),
            self._external,
            b"" if external_force is None else vector_field(b"\x32", external_force),
            self._signals,
            b"" if pose is None else _pose_bytes(pose),
            b"" if redundancy is None else _redundancy_bytes(redundancy),
            b"" if at is None else self._time(at),
        )
        return b"".join(pieces)

    def _time(self, at: TimeStamp) -> bytes:
        seconds, nanoseconds = at
        if seconds != self._second:
            if not 0 <= seconds <= _MOST_UINT32:
                return _time_bytes(at)
            self._second, self._second_piece = seconds, _SECONDS + varint(seconds) + _NANOSECONDS
        if not 0 <= nanoseconds <= _MOST_UINT32:
            return _time_bytes(at)
        body = self._second_piece + varint(nanoseconds)
        return _AT + ONE_BYTE[len(body)] + body


def _header_piece(identifier: int, counter: int, reflected: int) -> bytes:
    if identifier == MONITORING_IDENTIFIER and 0 <= counter <= _MOST_UINT32 and 0 <= reflected <= _MOST_UINT32:
        body = _IDENTIFIED + varint(counter) + _REFLECTED + varint(reflected)
        return _HEADER + ONE_BYTE[len(body)] + body
    wire = fri_pb2.MonitoringMessage()
    wire.header.identifier = identifier
    wire.header.sequence_counter = counter
    wire.header.reflected_sequence_counter = reflected
    return wire.SerializePartialToString()


def _robot_piece(robot: RobotInfo | None) -> bytes:
    wire = fri_pb2.MonitoringMessage()
    if robot is not None:
        target = wire.robot
        target.SetInParent()
        if robot.joint_count is not None:
            target.joint_count = robot.joint_count
        if robot.safety_state is not None:
            target.safety_state = robot.safety_state
        target.drive_state.extend(robot.drive_states)
        if robot.operation_mode is not None:
            target.operation_mode = robot.operation_mode
        if robot.control_mode is not None:
            target.control_mode = robot.control_mode
    return wire.SerializePartialToString()


def _connection_piece(connection: ConnectionInfo | None) -> bytes:
    wire = fri_pb2.MonitoringMessage()
    if connection is not None:
        target = wire.connection
        target.session_state = connection.session_state
        target.quality = connection.quality
        if connection.send_period_ms is not None:
            target.send_period_ms = connection.send_period_ms
        if connection.receive_multiplier is not None:
            target.receive_multiplier = connection.receive_multiplier
    return wire.SerializePartialToString()


def _tail(message: MonitoringMessage) -> bytes:
    wire = fri_pb2.MonitoringMessage()
    for requested in message.requested_transformations:
        _transformation(wire.requested_transformation.add(), requested)
    if message.end_of is not None:
        _end_of(wire.end_of, message.end_of)
    return wire.SerializePartialToString()


def _signals_bytes(signals: tuple[IOValue, ...]) -> bytes:
    wire = fri_pb2.MonitorData()
    for signal in signals:
        _io(wire.io.add(), signal)
    return wire.SerializeToString()


def _pose_bytes(pose: Transformation) -> bytes:
    usual = pose_field(_MEASURED_POSE, pose.name, pose.values) if pose.at is None else None
    if usual is not None:
        return usual
    wire = fri_pb2.MonitorData()
    _transformation(wire.measured_pose, pose)
    return wire.SerializeToString()


def _redundancy_bytes(redundancy: Redundancy) -> bytes:
    if redundancy.strategy == RedundancyStrategy.E1:
        return _REDUNDANCY(_REDUNDANCY_E1, _NUMBER, redundancy.value)
    wire = fri_pb2.MonitorData()
    wire.redundancy.strategy, wire.redundancy.value = redundancy
    return wire.SerializeToString()


def _time_bytes(at: TimeStamp) -> bytes:
    wire = fri_pb2.MonitorData()
    wire.at.seconds, wire.at.nanoseconds = at
    return wire.SerializeToString()


def _ipo_bytes(ipo: IpoData) -> bytes:
    rest = fri_pb2.IpoData()
    if ipo.pose is not None:
        _transformation(rest.pose, ipo.pose)
    if ipo.redundancy is not None:
        rest.redundancy.strategy, rest.redundancy.value = ipo.redundancy
    if ipo.client_command_mode is not None:
        rest.client_command_mode = ipo.client_command_mode
    if ipo.overlay_type is not None:
        rest.overlay_type = ipo.overlay_type
    if ipo.tracking_performance is not None:
        rest.tracking_performance = ipo.tracking_performance
    return vector_field(b"\x0a", ipo.position) + rest.SerializeToString()


def _field(tag: bytes, body: bytes) -> bytes:
    size = len(body)
    return b"".join((tag, ONE_BYTE[size] if size <= LAST_ONE_BYTE else varint(size), body))


def command(message: CommandMessage) -> fri_pb2.CommandMessage:
    """Return the protobuf form of a command message."""
    wire = fri_pb2.CommandMessage()
    _header(wire.header, message)
    if message.command is not None:
        wire.command.SetInParent()
        _command(wire.command, message.command)
    if message.end_of is not None:
        _end_of(wire.end_of, message.end_of)
    return wire


def _header(wire: fri_pb2.Header, message: MonitoringMessage | CommandMessage) -> None:
    wire.identifier = message.identifier
    wire.sequence_counter = message.sequence_counter
    wire.reflected_sequence_counter = message.reflected_sequence_counter


def _vector(wire: fri_pb2.JointValues | fri_pb2.CommandedWrench, values: Vector | None) -> None:
    if values is not None:
        wire.SetInParent()
        wire.value.extend(values)


def _command(wire: fri_pb2.CommandData, data: CommandData) -> None:
    _vector(wire.position, data.position)
    _vector(wire.wrench, data.wrench)
    _vector(wire.torque, data.torque)
    for transformation in data.transformations:
        _transformation(wire.transformation.add(), transformation)
    for value in data.inputs_outputs:
        _io(wire.io.add(), value)
    if data.pose is not None:
        _transformation(wire.pose, data.pose)
    if data.redundancy is not None:
        wire.redundancy.strategy, wire.redundancy.value = data.redundancy


def _transformation(
    wire: fri_pb2.Transformation | fri_pb2.CommandedTransformation, transformation: Transformation
) -> None:
    wire.name = transformation.name
    wire.value.extend(transformation.values)
    if transformation.at is not None:
        wire.at.seconds, wire.at.nanoseconds = transformation.at


def _io(wire: fri_pb2.IOValue, value: IOValue) -> None:
    wire.name, wire.type, wire.direction = value.name, value.type, value.direction
    if value.digital is not None:
        wire.digital = value.digital
    if value.analog is not None:
        wire.analog = value.analog


def _end_of(wire: fri_pb2.EndOf, end_of: EndOf) -> None:
    wire.SetInParent()
    if end_of.message_length is not None:
        wire.message_length = end_of.message_length
    if end_of.crc is not None:
        wire.checksum.crc = end_of.crc
