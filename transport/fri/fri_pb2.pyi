from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class JointValues(_message.Message):
    __slots__ = ("value",)
    VALUE_FIELD_NUMBER: _ClassVar[int]
    value: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, value: _Optional[_Iterable[float]] = ...) -> None: ...

class TimeStamp(_message.Message):
    __slots__ = ("seconds", "nanoseconds")
    SECONDS_FIELD_NUMBER: _ClassVar[int]
    NANOSECONDS_FIELD_NUMBER: _ClassVar[int]
    seconds: int
    nanoseconds: int
    def __init__(self, seconds: _Optional[int] = ..., nanoseconds: _Optional[int] = ...) -> None: ...

class CartesianVector(_message.Message):
    __slots__ = ("value",)
    VALUE_FIELD_NUMBER: _ClassVar[int]
    value: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, value: _Optional[_Iterable[float]] = ...) -> None: ...

class Transformation(_message.Message):
    __slots__ = ("name", "value", "at")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    AT_FIELD_NUMBER: _ClassVar[int]
    name: str
    value: _containers.RepeatedScalarFieldContainer[float]
    at: TimeStamp
    def __init__(self, name: _Optional[str] = ..., value: _Optional[_Iterable[float]] = ..., at: _Optional[_Union[TimeStamp, _Mapping]] = ...) -> None: ...

class CommandedWrench(_message.Message):
    __slots__ = ("value",)
    VALUE_FIELD_NUMBER: _ClassVar[int]
    value: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, value: _Optional[_Iterable[float]] = ...) -> None: ...

class CommandedTransformation(_message.Message):
    __slots__ = ("name", "value", "at")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    AT_FIELD_NUMBER: _ClassVar[int]
    name: str
    value: _containers.RepeatedScalarFieldContainer[float]
    at: TimeStamp
    def __init__(self, name: _Optional[str] = ..., value: _Optional[_Iterable[float]] = ..., at: _Optional[_Union[TimeStamp, _Mapping]] = ...) -> None: ...

class RedundancyInformation(_message.Message):
    __slots__ = ("strategy", "value")
    STRATEGY_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    strategy: int
    value: float
    def __init__(self, strategy: _Optional[int] = ..., value: _Optional[float] = ...) -> None: ...

class IOValue(_message.Message):
    __slots__ = ("name", "type", "direction", "digital", "analog")
    NAME_FIELD_NUMBER: _ClassVar[int]
    TYPE_FIELD_NUMBER: _ClassVar[int]
    DIRECTION_FIELD_NUMBER: _ClassVar[int]
    DIGITAL_FIELD_NUMBER: _ClassVar[int]
    ANALOG_FIELD_NUMBER: _ClassVar[int]
    name: str
    type: int
    direction: int
    digital: int
    analog: float
    def __init__(self, name: _Optional[str] = ..., type: _Optional[int] = ..., direction: _Optional[int] = ..., digital: _Optional[int] = ..., analog: _Optional[float] = ...) -> None: ...

class Header(_message.Message):
    __slots__ = ("identifier", "sequence_counter", "reflected_sequence_counter")
    IDENTIFIER_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_COUNTER_FIELD_NUMBER: _ClassVar[int]
    REFLECTED_SEQUENCE_COUNTER_FIELD_NUMBER: _ClassVar[int]
    identifier: int
    sequence_counter: int
    reflected_sequence_counter: int
    def __init__(self, identifier: _Optional[int] = ..., sequence_counter: _Optional[int] = ..., reflected_sequence_counter: _Optional[int] = ...) -> None: ...

class ConnectionInfo(_message.Message):
    __slots__ = ("session_state", "quality", "send_period_ms", "receive_multiplier")
    SESSION_STATE_FIELD_NUMBER: _ClassVar[int]
    QUALITY_FIELD_NUMBER: _ClassVar[int]
    SEND_PERIOD_MS_FIELD_NUMBER: _ClassVar[int]
    RECEIVE_MULTIPLIER_FIELD_NUMBER: _ClassVar[int]
    session_state: int
    quality: int
    send_period_ms: int
    receive_multiplier: int
    def __init__(self, session_state: _Optional[int] = ..., quality: _Optional[int] = ..., send_period_ms: _Optional[int] = ..., receive_multiplier: _Optional[int] = ...) -> None: ...

class RobotInfo(_message.Message):
    __slots__ = ("joint_count", "safety_state", "drive_state", "operation_mode", "control_mode")
    JOINT_COUNT_FIELD_NUMBER: _ClassVar[int]
    SAFETY_STATE_FIELD_NUMBER: _ClassVar[int]
    DRIVE_STATE_FIELD_NUMBER: _ClassVar[int]
    OPERATION_MODE_FIELD_NUMBER: _ClassVar[int]
    CONTROL_MODE_FIELD_NUMBER: _ClassVar[int]
    joint_count: int
    safety_state: int
    drive_state: _containers.RepeatedScalarFieldContainer[int]
    operation_mode: int
    control_mode: int
    def __init__(self, joint_count: _Optional[int] = ..., safety_state: _Optional[int] = ..., drive_state: _Optional[_Iterable[int]] = ..., operation_mode: _Optional[int] = ..., control_mode: _Optional[int] = ...) -> None: ...

class MonitorData(_message.Message):
    __slots__ = ("measured_position", "measured_torque", "commanded_position", "commanded_torque", "external_torque", "external_force", "io", "measured_pose", "redundancy", "at")
    MEASURED_POSITION_FIELD_NUMBER: _ClassVar[int]
    MEASURED_TORQUE_FIELD_NUMBER: _ClassVar[int]
    COMMANDED_POSITION_FIELD_NUMBER: _ClassVar[int]
    COMMANDED_TORQUE_FIELD_NUMBER: _ClassVar[int]
    EXTERNAL_TORQUE_FIELD_NUMBER: _ClassVar[int]
    EXTERNAL_FORCE_FIELD_NUMBER: _ClassVar[int]
    IO_FIELD_NUMBER: _ClassVar[int]
    MEASURED_POSE_FIELD_NUMBER: _ClassVar[int]
    REDUNDANCY_FIELD_NUMBER: _ClassVar[int]
    AT_FIELD_NUMBER: _ClassVar[int]
    measured_position: JointValues
    measured_torque: JointValues
    commanded_position: JointValues
    commanded_torque: JointValues
    external_torque: JointValues
    external_force: CartesianVector
    io: _containers.RepeatedCompositeFieldContainer[IOValue]
    measured_pose: Transformation
    redundancy: RedundancyInformation
    at: TimeStamp
    def __init__(self, measured_position: _Optional[_Union[JointValues, _Mapping]] = ..., measured_torque: _Optional[_Union[JointValues, _Mapping]] = ..., commanded_position: _Optional[_Union[JointValues, _Mapping]] = ..., commanded_torque: _Optional[_Union[JointValues, _Mapping]] = ..., external_torque: _Optional[_Union[JointValues, _Mapping]] = ..., external_force: _Optional[_Union[CartesianVector, _Mapping]] = ..., io: _Optional[_Iterable[_Union[IOValue, _Mapping]]] = ..., measured_pose: _Optional[_Union[Transformation, _Mapping]] = ..., redundancy: _Optional[_Union[RedundancyInformation, _Mapping]] = ..., at: _Optional[_Union[TimeStamp, _Mapping]] = ...) -> None: ...

class IpoData(_message.Message):
    __slots__ = ("position", "pose", "redundancy", "client_command_mode", "overlay_type", "tracking_performance")
    POSITION_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    REDUNDANCY_FIELD_NUMBER: _ClassVar[int]
    CLIENT_COMMAND_MODE_FIELD_NUMBER: _ClassVar[int]
    OVERLAY_TYPE_FIELD_NUMBER: _ClassVar[int]
    TRACKING_PERFORMANCE_FIELD_NUMBER: _ClassVar[int]
    position: JointValues
    pose: Transformation
    redundancy: RedundancyInformation
    client_command_mode: int
    overlay_type: int
    tracking_performance: float
    def __init__(self, position: _Optional[_Union[JointValues, _Mapping]] = ..., pose: _Optional[_Union[Transformation, _Mapping]] = ..., redundancy: _Optional[_Union[RedundancyInformation, _Mapping]] = ..., client_command_mode: _Optional[int] = ..., overlay_type: _Optional[int] = ..., tracking_performance: _Optional[float] = ...) -> None: ...

class Checksum(_message.Message):
    __slots__ = ("crc",)
    CRC_FIELD_NUMBER: _ClassVar[int]
    crc: int
    def __init__(self, crc: _Optional[int] = ...) -> None: ...

class EndOf(_message.Message):
    __slots__ = ("message_length", "checksum")
    MESSAGE_LENGTH_FIELD_NUMBER: _ClassVar[int]
    CHECKSUM_FIELD_NUMBER: _ClassVar[int]
    message_length: int
    checksum: Checksum
    def __init__(self, message_length: _Optional[int] = ..., checksum: _Optional[_Union[Checksum, _Mapping]] = ...) -> None: ...

class MonitoringMessage(_message.Message):
    __slots__ = ("header", "robot", "monitor", "connection", "ipo", "requested_transformation", "end_of")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    MONITOR_FIELD_NUMBER: _ClassVar[int]
    CONNECTION_FIELD_NUMBER: _ClassVar[int]
    IPO_FIELD_NUMBER: _ClassVar[int]
    REQUESTED_TRANSFORMATION_FIELD_NUMBER: _ClassVar[int]
    END_OF_FIELD_NUMBER: _ClassVar[int]
    header: Header
    robot: RobotInfo
    monitor: MonitorData
    connection: ConnectionInfo
    ipo: IpoData
    requested_transformation: _containers.RepeatedCompositeFieldContainer[Transformation]
    end_of: EndOf
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., robot: _Optional[_Union[RobotInfo, _Mapping]] = ..., monitor: _Optional[_Union[MonitorData, _Mapping]] = ..., connection: _Optional[_Union[ConnectionInfo, _Mapping]] = ..., ipo: _Optional[_Union[IpoData, _Mapping]] = ..., requested_transformation: _Optional[_Iterable[_Union[Transformation, _Mapping]]] = ..., end_of: _Optional[_Union[EndOf, _Mapping]] = ...) -> None: ...

class CommandData(_message.Message):
    __slots__ = ("position", "wrench", "torque", "transformation", "io", "pose", "redundancy")
    POSITION_FIELD_NUMBER: _ClassVar[int]
    WRENCH_FIELD_NUMBER: _ClassVar[int]
    TORQUE_FIELD_NUMBER: _ClassVar[int]
    TRANSFORMATION_FIELD_NUMBER: _ClassVar[int]
    IO_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    REDUNDANCY_FIELD_NUMBER: _ClassVar[int]
    position: JointValues
    wrench: CommandedWrench
    torque: JointValues
    transformation: _containers.RepeatedCompositeFieldContainer[CommandedTransformation]
    io: _containers.RepeatedCompositeFieldContainer[IOValue]
    pose: CommandedTransformation
    redundancy: RedundancyInformation
    def __init__(self, position: _Optional[_Union[JointValues, _Mapping]] = ..., wrench: _Optional[_Union[CommandedWrench, _Mapping]] = ..., torque: _Optional[_Union[JointValues, _Mapping]] = ..., transformation: _Optional[_Iterable[_Union[CommandedTransformation, _Mapping]]] = ..., io: _Optional[_Iterable[_Union[IOValue, _Mapping]]] = ..., pose: _Optional[_Union[CommandedTransformation, _Mapping]] = ..., redundancy: _Optional[_Union[RedundancyInformation, _Mapping]] = ...) -> None: ...

class CommandMessage(_message.Message):
    __slots__ = ("header", "command", "end_of")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    COMMAND_FIELD_NUMBER: _ClassVar[int]
    END_OF_FIELD_NUMBER: _ClassVar[int]
    header: Header
    command: CommandData
    end_of: EndOf
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., command: _Optional[_Union[CommandData, _Mapping]] = ..., end_of: _Optional[_Union[EndOf, _Mapping]] = ...) -> None: ...
