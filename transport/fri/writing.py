"""Values to protobuf messages. Written out by hand, field by field: this runs once a cycle."""

from hil.values.fri import (
    CommandData,
    CommandMessage,
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


def monitoring(message: MonitoringMessage) -> fri_pb2.MonitoringMessage:
    """Return the protobuf form of a monitoring message."""
    wire = fri_pb2.MonitoringMessage()
    _header(wire.header, message)
    if message.robot is not None:
        wire.robot.SetInParent()
        _robot(wire.robot, message.robot)
    if message.monitor is not None:
        wire.monitor.SetInParent()
        _monitor(wire.monitor, message.monitor)
    connection = message.connection
    if connection is not None:
        target = wire.connection
        target.session_state = connection.session_state
        target.quality = connection.quality
        if connection.send_period_ms is not None:
            target.send_period_ms = connection.send_period_ms
        if connection.receive_multiplier is not None:
            target.receive_multiplier = connection.receive_multiplier
    if message.ipo is not None:
        wire.ipo.SetInParent()
        _ipo(wire.ipo, message.ipo)
    for requested in message.requested_transformations:
        _transformation(wire.requested_transformation.add(), requested)
    if message.end_of is not None:
        _end_of(wire.end_of, message.end_of)
    return wire


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


def _robot(wire: fri_pb2.RobotInfo, robot: RobotInfo) -> None:
    if robot.joint_count is not None:
        wire.joint_count = robot.joint_count
    if robot.safety_state is not None:
        wire.safety_state = robot.safety_state
    wire.drive_state.extend(robot.drive_states)
    if robot.operation_mode is not None:
        wire.operation_mode = robot.operation_mode
    if robot.control_mode is not None:
        wire.control_mode = robot.control_mode


def _vector(
    wire: fri_pb2.JointValues | fri_pb2.CartesianVector | fri_pb2.CommandedWrench, values: Vector | None
) -> None:
    if values:
        wire.value.extend(values)
    elif values is not None:
        wire.SetInParent()


def _monitor(wire: fri_pb2.MonitorData, monitor: MonitorData) -> None:
    _vector(wire.measured_position, monitor.measured_position)
    _vector(wire.measured_torque, monitor.measured_torque)
    _vector(wire.commanded_position, monitor.commanded_position)
    _vector(wire.commanded_torque, monitor.commanded_torque)
    _vector(wire.external_torque, monitor.external_torque)
    _vector(wire.external_force, monitor.external_force)
    for value in monitor.inputs_outputs:
        _io(wire.io.add(), value)
    if monitor.measured_pose is not None:
        _transformation(wire.measured_pose, monitor.measured_pose)
    if monitor.redundancy is not None:
        wire.redundancy.strategy, wire.redundancy.value = monitor.redundancy
    if monitor.at is not None:
        wire.at.seconds, wire.at.nanoseconds = monitor.at


def _ipo(wire: fri_pb2.IpoData, ipo: IpoData) -> None:
    _vector(wire.position, ipo.position)
    if ipo.pose is not None:
        _transformation(wire.pose, ipo.pose)
    if ipo.redundancy is not None:
        wire.redundancy.strategy, wire.redundancy.value = ipo.redundancy
    if ipo.client_command_mode is not None:
        wire.client_command_mode = ipo.client_command_mode
    if ipo.overlay_type is not None:
        wire.overlay_type = ipo.overlay_type
    if ipo.tracking_performance is not None:
        wire.tracking_performance = ipo.tracking_performance


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
