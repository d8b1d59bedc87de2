"""Values to protobuf messages. Written out by hand, field by field: this runs once a cycle."""

from hil.values.fri_messages import (
    CommandData,
    CommandMessage,
    ConnectionInfo,
    EndOf,
    IOValue,
    IpoData,
    MonitorData,
    MonitoringMessage,
    RobotInfo,
    Transformation,
    Vector,
)
from transport.fri import fri_pb2
from transport.fri.vectors import pose_field, varint, vector_field

_MONITOR = b"\x1a"
_MEASURED_POSE = b"\x4a"
_IPO = b"\x2a"


class MonitoringWriter:
    """Writes monitoring messages in pieces, in field order: protobuf messages may be joined end to end.

    Joint vectors, most of the message, are packed without protobuf objects (:mod:`transport.fri.vectors`). Robot and
    connection rarely change between two messages, so their bytes are kept as long as the same objects come.
    """

    def __init__(self) -> None:
        self._robot_of: RobotInfo | None = None
        self._robot = b""
        self._connection_of: ConnectionInfo | None = None
        self._connection = b""

    def monitoring(self, message: MonitoringMessage) -> bytes:
        """Return the bytes of a monitoring message."""
        head = fri_pb2.MonitoringMessage()
        _header(head.header, message)
        if message.robot is not self._robot_of:
            self._robot_of, self._robot = message.robot, _robot_piece(message.robot)
        monitored = b"" if message.monitor is None else _field(_MONITOR, _monitor_bytes(message.monitor))
        if message.connection is not self._connection_of:
            self._connection_of, self._connection = message.connection, _connection_piece(message.connection)
        return b"".join((head.SerializeToString(), self._robot, monitored, self._connection, _tail(message)))


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
    told = b"" if message.ipo is None else _field(_IPO, _ipo_bytes(message.ipo))
    if not message.requested_transformations and message.end_of is None:
        return told
    wire = fri_pb2.MonitoringMessage()
    for requested in message.requested_transformations:
        _transformation(wire.requested_transformation.add(), requested)
    if message.end_of is not None:
        _end_of(wire.end_of, message.end_of)
    return told + wire.SerializePartialToString()


def _monitor_bytes(monitor: MonitorData) -> bytes:
    rest = fri_pb2.MonitorData()
    pose = None
    if monitor.measured_pose is not None:
        if monitor.measured_pose.at is None and not monitor.inputs_outputs:
            pose = pose_field(_MEASURED_POSE, monitor.measured_pose.name, monitor.measured_pose.values)
        if pose is None:
            _transformation(rest.measured_pose, monitor.measured_pose)
    for value in monitor.inputs_outputs:
        _io(rest.io.add(), value)
    if monitor.redundancy is not None:
        rest.redundancy.strategy, rest.redundancy.value = monitor.redundancy
    if monitor.at is not None:
        rest.at.seconds, rest.at.nanoseconds = monitor.at
    return b"".join(
        (
            vector_field(b"\x0a", monitor.measured_position),
            vector_field(b"\x12", monitor.measured_torque),
            vector_field(b"\x1a", monitor.commanded_position),
            vector_field(b"\x22", monitor.commanded_torque),
            vector_field(b"\x2a", monitor.external_torque),
            vector_field(b"\x32", monitor.external_force),
            pose or b"",
            rest.SerializeToString(),
        )
    )


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
    return b"".join((tag, varint(len(body)), body))


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
