from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Role(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ROLE_NONE: _ClassVar[Role]
    ROLE_OBSERVER: _ClassVar[Role]
    ROLE_COMMANDER: _ClassVar[Role]
    ROLE_OPERATOR: _ClassVar[Role]

class MotionKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    KIND_NONE: _ClassVar[MotionKind]
    KIND_PTP: _ClassVar[MotionKind]
    KIND_SMART_SERVO: _ClassVar[MotionKind]
    KIND_DIRECT_SERVO: _ClassVar[MotionKind]

class OperationMode(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MODE_T1: _ClassVar[OperationMode]
    MODE_T2: _ClassVar[OperationMode]
    MODE_AUT: _ClassVar[OperationMode]

class SafetyState(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    SAFETY_NORMAL_OPERATION: _ClassVar[SafetyState]
    SAFETY_STOP_LEVEL_0: _ClassVar[SafetyState]
    SAFETY_STOP_LEVEL_1: _ClassVar[SafetyState]
    SAFETY_STOP_LEVEL_2: _ClassVar[SafetyState]

class ProgramState(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    PROGRAM_NONE: _ClassVar[ProgramState]
    PROGRAM_RUNNING: _ClassVar[ProgramState]
    PROGRAM_PAUSED: _ClassVar[ProgramState]
    PROGRAM_STOPPED: _ClassVar[ProgramState]
    PROGRAM_EMERGENCY_STOP: _ClassVar[ProgramState]

class ArmControlMode(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    CONTROL_POSITION: _ClassVar[ArmControlMode]
    CONTROL_CARTESIAN_IMPEDANCE: _ClassVar[ArmControlMode]
    CONTROL_JOINT_IMPEDANCE: _ClassVar[ArmControlMode]
    CONTROL_NONE: _ClassVar[ArmControlMode]

class MotionPhase(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    PHASE_NONE: _ClassVar[MotionPhase]
    PHASE_QUEUED: _ClassVar[MotionPhase]
    PHASE_TRANSFERRED: _ClassVar[MotionPhase]
    PHASE_ACTIVE: _ClassVar[MotionPhase]
    PHASE_ENDED: _ClassVar[MotionPhase]

class FineInterpolatorState(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    INTERPOLATOR_NONE: _ClassVar[FineInterpolatorState]
    INTERPOLATOR_MOVING: _ClassVar[FineInterpolatorState]
    INTERPOLATOR_VELOCITY_AFTER_GOAL_REACH: _ClassVar[FineInterpolatorState]
    INTERPOLATOR_RESTING: _ClassVar[FineInterpolatorState]
    INTERPOLATOR_ENDED: _ClassVar[FineInterpolatorState]

class RequestError(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ERROR_NONE: _ClassVar[RequestError]
    ERROR_ILLEGAL_ARGUMENT: _ClassVar[RequestError]
    ERROR_ILLEGAL_STATE: _ClassVar[RequestError]
    ERROR_COMMAND_INVALID: _ClassVar[RequestError]

class MotionEnd(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    END_NONE: _ClassVar[MotionEnd]
    END_FINISHED: _ClassVar[MotionEnd]
    END_STOPPED: _ClassVar[MotionEnd]
    END_FAILED: _ClassVar[MotionEnd]

class FrameKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    FRAME_NONE: _ClassVar[FrameKind]
    FRAME_WORLD: _ClassVar[FrameKind]
    FRAME_BASE: _ClassVar[FrameKind]
    FRAME_FLANGE: _ClassVar[FrameKind]
    FRAME_TOOL: _ClassVar[FrameKind]
    FRAME_TOOL_FRAME: _ClassVar[FrameKind]
    FRAME_REFERENCE: _ClassVar[FrameKind]
ROLE_NONE: Role
ROLE_OBSERVER: Role
ROLE_COMMANDER: Role
ROLE_OPERATOR: Role
KIND_NONE: MotionKind
KIND_PTP: MotionKind
KIND_SMART_SERVO: MotionKind
KIND_DIRECT_SERVO: MotionKind
MODE_T1: OperationMode
MODE_T2: OperationMode
MODE_AUT: OperationMode
SAFETY_NORMAL_OPERATION: SafetyState
SAFETY_STOP_LEVEL_0: SafetyState
SAFETY_STOP_LEVEL_1: SafetyState
SAFETY_STOP_LEVEL_2: SafetyState
PROGRAM_NONE: ProgramState
PROGRAM_RUNNING: ProgramState
PROGRAM_PAUSED: ProgramState
PROGRAM_STOPPED: ProgramState
PROGRAM_EMERGENCY_STOP: ProgramState
CONTROL_POSITION: ArmControlMode
CONTROL_CARTESIAN_IMPEDANCE: ArmControlMode
CONTROL_JOINT_IMPEDANCE: ArmControlMode
CONTROL_NONE: ArmControlMode
PHASE_NONE: MotionPhase
PHASE_QUEUED: MotionPhase
PHASE_TRANSFERRED: MotionPhase
PHASE_ACTIVE: MotionPhase
PHASE_ENDED: MotionPhase
INTERPOLATOR_NONE: FineInterpolatorState
INTERPOLATOR_MOVING: FineInterpolatorState
INTERPOLATOR_VELOCITY_AFTER_GOAL_REACH: FineInterpolatorState
INTERPOLATOR_RESTING: FineInterpolatorState
INTERPOLATOR_ENDED: FineInterpolatorState
ERROR_NONE: RequestError
ERROR_ILLEGAL_ARGUMENT: RequestError
ERROR_ILLEGAL_STATE: RequestError
ERROR_COMMAND_INVALID: RequestError
END_NONE: MotionEnd
END_FINISHED: MotionEnd
END_STOPPED: MotionEnd
END_FAILED: MotionEnd
FRAME_NONE: FrameKind
FRAME_WORLD: FrameKind
FRAME_BASE: FrameKind
FRAME_FLANGE: FrameKind
FRAME_TOOL: FrameKind
FRAME_TOOL_FRAME: FrameKind
FRAME_REFERENCE: FrameKind

class Packet(_message.Message):
    __slots__ = ("header", "hello", "welcome", "refused", "command", "goodbye", "state", "ended")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    HELLO_FIELD_NUMBER: _ClassVar[int]
    WELCOME_FIELD_NUMBER: _ClassVar[int]
    REFUSED_FIELD_NUMBER: _ClassVar[int]
    COMMAND_FIELD_NUMBER: _ClassVar[int]
    GOODBYE_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    ENDED_FIELD_NUMBER: _ClassVar[int]
    header: Header
    hello: Hello
    welcome: Welcome
    refused: Refused
    command: Command
    goodbye: Goodbye
    state: State
    ended: Ended
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., hello: _Optional[_Union[Hello, _Mapping]] = ..., welcome: _Optional[_Union[Welcome, _Mapping]] = ..., refused: _Optional[_Union[Refused, _Mapping]] = ..., command: _Optional[_Union[Command, _Mapping]] = ..., goodbye: _Optional[_Union[Goodbye, _Mapping]] = ..., state: _Optional[_Union[State, _Mapping]] = ..., ended: _Optional[_Union[Ended, _Mapping]] = ...) -> None: ...

class Header(_message.Message):
    __slots__ = ("version", "token", "sequence", "reflected_sequence")
    VERSION_FIELD_NUMBER: _ClassVar[int]
    TOKEN_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    REFLECTED_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    version: int
    token: int
    sequence: int
    reflected_sequence: int
    def __init__(self, version: _Optional[int] = ..., token: _Optional[int] = ..., sequence: _Optional[int] = ..., reflected_sequence: _Optional[int] = ...) -> None: ...

class AnyPacket(_message.Message):
    __slots__ = ("header", "hello", "welcome", "refused")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    HELLO_FIELD_NUMBER: _ClassVar[int]
    WELCOME_FIELD_NUMBER: _ClassVar[int]
    REFUSED_FIELD_NUMBER: _ClassVar[int]
    header: Header
    hello: AnyHello
    welcome: AnyAnswer
    refused: AnyAnswer
    def __init__(self, header: _Optional[_Union[Header, _Mapping]] = ..., hello: _Optional[_Union[AnyHello, _Mapping]] = ..., welcome: _Optional[_Union[AnyAnswer, _Mapping]] = ..., refused: _Optional[_Union[AnyAnswer, _Mapping]] = ...) -> None: ...

class AnyHello(_message.Message):
    __slots__ = ("nonce",)
    NONCE_FIELD_NUMBER: _ClassVar[int]
    nonce: int
    def __init__(self, nonce: _Optional[int] = ...) -> None: ...

class AnyAnswer(_message.Message):
    __slots__ = ("nonce", "text", "try_again")
    NONCE_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    TRY_AGAIN_FIELD_NUMBER: _ClassVar[int]
    nonce: int
    text: bytes
    try_again: bool
    def __init__(self, nonce: _Optional[int] = ..., text: _Optional[bytes] = ..., try_again: _Optional[bool] = ...) -> None: ...

class Hello(_message.Message):
    __slots__ = ("nonce", "role", "watchdog_ms", "state_period_ms", "name", "latency_budget_ms", "padding")
    NONCE_FIELD_NUMBER: _ClassVar[int]
    ROLE_FIELD_NUMBER: _ClassVar[int]
    WATCHDOG_MS_FIELD_NUMBER: _ClassVar[int]
    STATE_PERIOD_MS_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    LATENCY_BUDGET_MS_FIELD_NUMBER: _ClassVar[int]
    PADDING_FIELD_NUMBER: _ClassVar[int]
    nonce: int
    role: Role
    watchdog_ms: int
    state_period_ms: int
    name: str
    latency_budget_ms: int
    padding: bytes
    def __init__(self, nonce: _Optional[int] = ..., role: _Optional[_Union[Role, str]] = ..., watchdog_ms: _Optional[int] = ..., state_period_ms: _Optional[int] = ..., name: _Optional[str] = ..., latency_budget_ms: _Optional[int] = ..., padding: _Optional[bytes] = ...) -> None: ...

class Welcome(_message.Message):
    __slots__ = ("nonce", "software", "robot", "cycle_ms", "unix_epoch_ns")
    NONCE_FIELD_NUMBER: _ClassVar[int]
    SOFTWARE_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    CYCLE_MS_FIELD_NUMBER: _ClassVar[int]
    UNIX_EPOCH_NS_FIELD_NUMBER: _ClassVar[int]
    nonce: int
    software: str
    robot: str
    cycle_ms: int
    unix_epoch_ns: int
    def __init__(self, nonce: _Optional[int] = ..., software: _Optional[str] = ..., robot: _Optional[str] = ..., cycle_ms: _Optional[int] = ..., unix_epoch_ns: _Optional[int] = ...) -> None: ...

class Refused(_message.Message):
    __slots__ = ("nonce", "reason", "try_again")
    NONCE_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    TRY_AGAIN_FIELD_NUMBER: _ClassVar[int]
    nonce: int
    reason: str
    try_again: bool
    def __init__(self, nonce: _Optional[int] = ..., reason: _Optional[str] = ..., try_again: _Optional[bool] = ...) -> None: ...

class Goodbye(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class Ended(_message.Message):
    __slots__ = ("reason",)
    REASON_FIELD_NUMBER: _ClassVar[int]
    reason: str
    def __init__(self, reason: _Optional[str] = ...) -> None: ...

class Command(_message.Message):
    __slots__ = ("reports_seen", "wants_state", "request")
    REPORTS_SEEN_FIELD_NUMBER: _ClassVar[int]
    WANTS_STATE_FIELD_NUMBER: _ClassVar[int]
    REQUEST_FIELD_NUMBER: _ClassVar[int]
    reports_seen: int
    wants_state: bool
    request: _containers.RepeatedCompositeFieldContainer[Request]
    def __init__(self, reports_seen: _Optional[int] = ..., wants_state: _Optional[bool] = ..., request: _Optional[_Iterable[_Union[Request, _Mapping]]] = ...) -> None: ...

class Request(_message.Message):
    __slots__ = ("number", "start", "destination", "parameters", "stop", "describe", "locate", "mode", "validate", "push")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    DESTINATION_FIELD_NUMBER: _ClassVar[int]
    PARAMETERS_FIELD_NUMBER: _ClassVar[int]
    STOP_FIELD_NUMBER: _ClassVar[int]
    DESCRIBE_FIELD_NUMBER: _ClassVar[int]
    LOCATE_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    VALIDATE_FIELD_NUMBER: _ClassVar[int]
    PUSH_FIELD_NUMBER: _ClassVar[int]
    number: int
    start: StartMotion
    destination: SetDestination
    parameters: SetRuntimeParameters
    stop: StopMotion
    describe: DescribeFrame
    locate: LocateFlange
    mode: ChangeControlMode
    validate: ValidateLoad
    push: PushArm
    def __init__(self, number: _Optional[int] = ..., start: _Optional[_Union[StartMotion, _Mapping]] = ..., destination: _Optional[_Union[SetDestination, _Mapping]] = ..., parameters: _Optional[_Union[SetRuntimeParameters, _Mapping]] = ..., stop: _Optional[_Union[StopMotion, _Mapping]] = ..., describe: _Optional[_Union[DescribeFrame, _Mapping]] = ..., locate: _Optional[_Union[LocateFlange, _Mapping]] = ..., mode: _Optional[_Union[ChangeControlMode, _Mapping]] = ..., validate: _Optional[_Union[ValidateLoad, _Mapping]] = ..., push: _Optional[_Union[PushArm, _Mapping]] = ...) -> None: ...

class Vector(_message.Message):
    __slots__ = ("value",)
    VALUE_FIELD_NUMBER: _ClassVar[int]
    value: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, value: _Optional[_Iterable[float]] = ...) -> None: ...

class Pose(_message.Message):
    __slots__ = ("value",)
    VALUE_FIELD_NUMBER: _ClassVar[int]
    value: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, value: _Optional[_Iterable[float]] = ...) -> None: ...

class MotionParameters(_message.Message):
    __slots__ = ("joint_velocity_rel", "joint_acceleration_rel", "acceleration_override", "joint_jerk_percent", "minimum_execution_time_s", "speed_timeout_s", "timeout_after_goal_s", "blending_rel", "velocity_planning", "wait_for_pause")
    JOINT_VELOCITY_REL_FIELD_NUMBER: _ClassVar[int]
    JOINT_ACCELERATION_REL_FIELD_NUMBER: _ClassVar[int]
    ACCELERATION_OVERRIDE_FIELD_NUMBER: _ClassVar[int]
    JOINT_JERK_PERCENT_FIELD_NUMBER: _ClassVar[int]
    MINIMUM_EXECUTION_TIME_S_FIELD_NUMBER: _ClassVar[int]
    SPEED_TIMEOUT_S_FIELD_NUMBER: _ClassVar[int]
    TIMEOUT_AFTER_GOAL_S_FIELD_NUMBER: _ClassVar[int]
    BLENDING_REL_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_PLANNING_FIELD_NUMBER: _ClassVar[int]
    WAIT_FOR_PAUSE_FIELD_NUMBER: _ClassVar[int]
    joint_velocity_rel: float
    joint_acceleration_rel: float
    acceleration_override: float
    joint_jerk_percent: float
    minimum_execution_time_s: float
    speed_timeout_s: float
    timeout_after_goal_s: float
    blending_rel: float
    velocity_planning: bool
    wait_for_pause: bool
    def __init__(self, joint_velocity_rel: _Optional[float] = ..., joint_acceleration_rel: _Optional[float] = ..., acceleration_override: _Optional[float] = ..., joint_jerk_percent: _Optional[float] = ..., minimum_execution_time_s: _Optional[float] = ..., speed_timeout_s: _Optional[float] = ..., timeout_after_goal_s: _Optional[float] = ..., blending_rel: _Optional[float] = ..., velocity_planning: _Optional[bool] = ..., wait_for_pause: _Optional[bool] = ...) -> None: ...

class StartMotion(_message.Message):
    __slots__ = ("kind", "parameters", "destination", "flange_in_base", "mode", "frame", "tool")
    KIND_FIELD_NUMBER: _ClassVar[int]
    PARAMETERS_FIELD_NUMBER: _ClassVar[int]
    DESTINATION_FIELD_NUMBER: _ClassVar[int]
    FLANGE_IN_BASE_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    TOOL_FIELD_NUMBER: _ClassVar[int]
    kind: MotionKind
    parameters: MotionParameters
    destination: Vector
    flange_in_base: Pose
    mode: ControlMode
    frame: str
    tool: AttachedTool
    def __init__(self, kind: _Optional[_Union[MotionKind, str]] = ..., parameters: _Optional[_Union[MotionParameters, _Mapping]] = ..., destination: _Optional[_Union[Vector, _Mapping]] = ..., flange_in_base: _Optional[_Union[Pose, _Mapping]] = ..., mode: _Optional[_Union[ControlMode, _Mapping]] = ..., frame: _Optional[str] = ..., tool: _Optional[_Union[AttachedTool, _Mapping]] = ...) -> None: ...

class ChangeControlMode(_message.Message):
    __slots__ = ("motion", "mode")
    MOTION_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    motion: int
    mode: ControlMode
    def __init__(self, motion: _Optional[int] = ..., mode: _Optional[_Union[ControlMode, _Mapping]] = ...) -> None: ...

class ControlMode(_message.Message):
    __slots__ = ("joint", "cartesian")
    JOINT_FIELD_NUMBER: _ClassVar[int]
    CARTESIAN_FIELD_NUMBER: _ClassVar[int]
    joint: JointImpedance
    cartesian: CartesianImpedance
    def __init__(self, joint: _Optional[_Union[JointImpedance, _Mapping]] = ..., cartesian: _Optional[_Union[CartesianImpedance, _Mapping]] = ...) -> None: ...

class JointImpedance(_message.Message):
    __slots__ = ("stiffness", "damping")
    STIFFNESS_FIELD_NUMBER: _ClassVar[int]
    DAMPING_FIELD_NUMBER: _ClassVar[int]
    stiffness: _containers.RepeatedScalarFieldContainer[float]
    damping: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, stiffness: _Optional[_Iterable[float]] = ..., damping: _Optional[_Iterable[float]] = ...) -> None: ...

class CartesianImpedance(_message.Message):
    __slots__ = ("stiffness", "damping", "null_space_stiffness_nm_rad", "null_space_damping", "additional_control_force", "max_control_force", "stop_on_max_control_force", "max_cartesian_velocity", "max_path_deviation", "oscillation")
    STIFFNESS_FIELD_NUMBER: _ClassVar[int]
    DAMPING_FIELD_NUMBER: _ClassVar[int]
    NULL_SPACE_STIFFNESS_NM_RAD_FIELD_NUMBER: _ClassVar[int]
    NULL_SPACE_DAMPING_FIELD_NUMBER: _ClassVar[int]
    ADDITIONAL_CONTROL_FORCE_FIELD_NUMBER: _ClassVar[int]
    MAX_CONTROL_FORCE_FIELD_NUMBER: _ClassVar[int]
    STOP_ON_MAX_CONTROL_FORCE_FIELD_NUMBER: _ClassVar[int]
    MAX_CARTESIAN_VELOCITY_FIELD_NUMBER: _ClassVar[int]
    MAX_PATH_DEVIATION_FIELD_NUMBER: _ClassVar[int]
    OSCILLATION_FIELD_NUMBER: _ClassVar[int]
    stiffness: _containers.RepeatedScalarFieldContainer[float]
    damping: _containers.RepeatedScalarFieldContainer[float]
    null_space_stiffness_nm_rad: float
    null_space_damping: float
    additional_control_force: _containers.RepeatedScalarFieldContainer[float]
    max_control_force: _containers.RepeatedScalarFieldContainer[float]
    stop_on_max_control_force: bool
    max_cartesian_velocity: _containers.RepeatedScalarFieldContainer[float]
    max_path_deviation: _containers.RepeatedScalarFieldContainer[float]
    oscillation: ForceOscillation
    def __init__(self, stiffness: _Optional[_Iterable[float]] = ..., damping: _Optional[_Iterable[float]] = ..., null_space_stiffness_nm_rad: _Optional[float] = ..., null_space_damping: _Optional[float] = ..., additional_control_force: _Optional[_Iterable[float]] = ..., max_control_force: _Optional[_Iterable[float]] = ..., stop_on_max_control_force: _Optional[bool] = ..., max_cartesian_velocity: _Optional[_Iterable[float]] = ..., max_path_deviation: _Optional[_Iterable[float]] = ..., oscillation: _Optional[_Union[ForceOscillation, _Mapping]] = ...) -> None: ...

class ForceOscillation(_message.Message):
    __slots__ = ("amplitude", "frequency_hz", "phase_deg", "bias", "force_limit", "position_limit", "rise_time_s", "hold_time_s", "fall_time_s")
    AMPLITUDE_FIELD_NUMBER: _ClassVar[int]
    FREQUENCY_HZ_FIELD_NUMBER: _ClassVar[int]
    PHASE_DEG_FIELD_NUMBER: _ClassVar[int]
    BIAS_FIELD_NUMBER: _ClassVar[int]
    FORCE_LIMIT_FIELD_NUMBER: _ClassVar[int]
    POSITION_LIMIT_FIELD_NUMBER: _ClassVar[int]
    RISE_TIME_S_FIELD_NUMBER: _ClassVar[int]
    HOLD_TIME_S_FIELD_NUMBER: _ClassVar[int]
    FALL_TIME_S_FIELD_NUMBER: _ClassVar[int]
    amplitude: _containers.RepeatedScalarFieldContainer[float]
    frequency_hz: _containers.RepeatedScalarFieldContainer[float]
    phase_deg: _containers.RepeatedScalarFieldContainer[float]
    bias: _containers.RepeatedScalarFieldContainer[float]
    force_limit: _containers.RepeatedScalarFieldContainer[float]
    position_limit: _containers.RepeatedScalarFieldContainer[float]
    rise_time_s: float
    hold_time_s: float
    fall_time_s: float
    def __init__(self, amplitude: _Optional[_Iterable[float]] = ..., frequency_hz: _Optional[_Iterable[float]] = ..., phase_deg: _Optional[_Iterable[float]] = ..., bias: _Optional[_Iterable[float]] = ..., force_limit: _Optional[_Iterable[float]] = ..., position_limit: _Optional[_Iterable[float]] = ..., rise_time_s: _Optional[float] = ..., hold_time_s: _Optional[float] = ..., fall_time_s: _Optional[float] = ...) -> None: ...

class SetDestination(_message.Message):
    __slots__ = ("motion", "position", "velocity", "flange_in_base")
    MOTION_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_FIELD_NUMBER: _ClassVar[int]
    FLANGE_IN_BASE_FIELD_NUMBER: _ClassVar[int]
    motion: int
    position: Vector
    velocity: Vector
    flange_in_base: Pose
    def __init__(self, motion: _Optional[int] = ..., position: _Optional[_Union[Vector, _Mapping]] = ..., velocity: _Optional[_Union[Vector, _Mapping]] = ..., flange_in_base: _Optional[_Union[Pose, _Mapping]] = ...) -> None: ...

class SetRuntimeParameters(_message.Message):
    __slots__ = ("motion", "minimum_execution_time_s", "velocity_planning", "wait_for_pause")
    MOTION_FIELD_NUMBER: _ClassVar[int]
    MINIMUM_EXECUTION_TIME_S_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_PLANNING_FIELD_NUMBER: _ClassVar[int]
    WAIT_FOR_PAUSE_FIELD_NUMBER: _ClassVar[int]
    motion: int
    minimum_execution_time_s: float
    velocity_planning: bool
    wait_for_pause: bool
    def __init__(self, motion: _Optional[int] = ..., minimum_execution_time_s: _Optional[float] = ..., velocity_planning: _Optional[bool] = ..., wait_for_pause: _Optional[bool] = ...) -> None: ...

class StopMotion(_message.Message):
    __slots__ = ("motion",)
    MOTION_FIELD_NUMBER: _ClassVar[int]
    motion: int
    def __init__(self, motion: _Optional[int] = ...) -> None: ...

class DescribeFrame(_message.Message):
    __slots__ = ("place",)
    PLACE_FIELD_NUMBER: _ClassVar[int]
    place: int
    def __init__(self, place: _Optional[int] = ...) -> None: ...

class LocateFlange(_message.Message):
    __slots__ = ("position",)
    POSITION_FIELD_NUMBER: _ClassVar[int]
    position: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, position: _Optional[_Iterable[float]] = ...) -> None: ...

class ValidateLoad(_message.Message):
    __slots__ = ("frame", "tool")
    FRAME_FIELD_NUMBER: _ClassVar[int]
    TOOL_FIELD_NUMBER: _ClassVar[int]
    frame: str
    tool: AttachedTool
    def __init__(self, frame: _Optional[str] = ..., tool: _Optional[_Union[AttachedTool, _Mapping]] = ...) -> None: ...

class PushArm(_message.Message):
    __slots__ = ("link", "force_n", "moment_nm", "duration_s")
    LINK_FIELD_NUMBER: _ClassVar[int]
    FORCE_N_FIELD_NUMBER: _ClassVar[int]
    MOMENT_NM_FIELD_NUMBER: _ClassVar[int]
    DURATION_S_FIELD_NUMBER: _ClassVar[int]
    link: int
    force_n: _containers.RepeatedScalarFieldContainer[float]
    moment_nm: _containers.RepeatedScalarFieldContainer[float]
    duration_s: float
    def __init__(self, link: _Optional[int] = ..., force_n: _Optional[_Iterable[float]] = ..., moment_nm: _Optional[_Iterable[float]] = ..., duration_s: _Optional[float] = ...) -> None: ...

class State(_message.Message):
    __slots__ = ("requests_done", "snapshot", "report")
    REQUESTS_DONE_FIELD_NUMBER: _ClassVar[int]
    SNAPSHOT_FIELD_NUMBER: _ClassVar[int]
    REPORT_FIELD_NUMBER: _ClassVar[int]
    requests_done: int
    snapshot: Snapshot
    report: _containers.RepeatedCompositeFieldContainer[Report]
    def __init__(self, requests_done: _Optional[int] = ..., snapshot: _Optional[_Union[Snapshot, _Mapping]] = ..., report: _Optional[_Iterable[_Union[Report, _Mapping]]] = ...) -> None: ...

class Snapshot(_message.Message):
    __slots__ = ("now_ns", "cycle", "operation_mode", "program", "enabling", "override_percent", "safety_state", "permissive", "measured_position", "commanded_position", "measured_torque", "external_torque", "commander", "operator_reason", "motion", "flange_in_base", "control_mode", "external_torque_variance", "flange_force", "flange_force_variance", "flange_speed_mm_s", "contact")
    NOW_NS_FIELD_NUMBER: _ClassVar[int]
    CYCLE_FIELD_NUMBER: _ClassVar[int]
    OPERATION_MODE_FIELD_NUMBER: _ClassVar[int]
    PROGRAM_FIELD_NUMBER: _ClassVar[int]
    ENABLING_FIELD_NUMBER: _ClassVar[int]
    OVERRIDE_PERCENT_FIELD_NUMBER: _ClassVar[int]
    SAFETY_STATE_FIELD_NUMBER: _ClassVar[int]
    PERMISSIVE_FIELD_NUMBER: _ClassVar[int]
    MEASURED_POSITION_FIELD_NUMBER: _ClassVar[int]
    COMMANDED_POSITION_FIELD_NUMBER: _ClassVar[int]
    MEASURED_TORQUE_FIELD_NUMBER: _ClassVar[int]
    EXTERNAL_TORQUE_FIELD_NUMBER: _ClassVar[int]
    COMMANDER_FIELD_NUMBER: _ClassVar[int]
    OPERATOR_REASON_FIELD_NUMBER: _ClassVar[int]
    MOTION_FIELD_NUMBER: _ClassVar[int]
    FLANGE_IN_BASE_FIELD_NUMBER: _ClassVar[int]
    CONTROL_MODE_FIELD_NUMBER: _ClassVar[int]
    EXTERNAL_TORQUE_VARIANCE_FIELD_NUMBER: _ClassVar[int]
    FLANGE_FORCE_FIELD_NUMBER: _ClassVar[int]
    FLANGE_FORCE_VARIANCE_FIELD_NUMBER: _ClassVar[int]
    FLANGE_SPEED_MM_S_FIELD_NUMBER: _ClassVar[int]
    CONTACT_FIELD_NUMBER: _ClassVar[int]
    now_ns: int
    cycle: int
    operation_mode: OperationMode
    program: ProgramState
    enabling: bool
    override_percent: float
    safety_state: SafetyState
    permissive: bool
    measured_position: _containers.RepeatedScalarFieldContainer[float]
    commanded_position: _containers.RepeatedScalarFieldContainer[float]
    measured_torque: _containers.RepeatedScalarFieldContainer[float]
    external_torque: _containers.RepeatedScalarFieldContainer[float]
    commander: str
    operator_reason: str
    motion: _containers.RepeatedCompositeFieldContainer[MotionState]
    flange_in_base: Pose
    control_mode: ArmControlMode
    external_torque_variance: _containers.RepeatedScalarFieldContainer[float]
    flange_force: _containers.RepeatedScalarFieldContainer[float]
    flange_force_variance: _containers.RepeatedScalarFieldContainer[float]
    flange_speed_mm_s: float
    contact: _containers.RepeatedCompositeFieldContainer[Contact]
    def __init__(self, now_ns: _Optional[int] = ..., cycle: _Optional[int] = ..., operation_mode: _Optional[_Union[OperationMode, str]] = ..., program: _Optional[_Union[ProgramState, str]] = ..., enabling: _Optional[bool] = ..., override_percent: _Optional[float] = ..., safety_state: _Optional[_Union[SafetyState, str]] = ..., permissive: _Optional[bool] = ..., measured_position: _Optional[_Iterable[float]] = ..., commanded_position: _Optional[_Iterable[float]] = ..., measured_torque: _Optional[_Iterable[float]] = ..., external_torque: _Optional[_Iterable[float]] = ..., commander: _Optional[str] = ..., operator_reason: _Optional[str] = ..., motion: _Optional[_Iterable[_Union[MotionState, _Mapping]]] = ..., flange_in_base: _Optional[_Union[Pose, _Mapping]] = ..., control_mode: _Optional[_Union[ArmControlMode, str]] = ..., external_torque_variance: _Optional[_Iterable[float]] = ..., flange_force: _Optional[_Iterable[float]] = ..., flange_force_variance: _Optional[_Iterable[float]] = ..., flange_speed_mm_s: _Optional[float] = ..., contact: _Optional[_Iterable[_Union[Contact, _Mapping]]] = ...) -> None: ...

class Contact(_message.Message):
    __slots__ = ("point_m", "force_n")
    POINT_M_FIELD_NUMBER: _ClassVar[int]
    FORCE_N_FIELD_NUMBER: _ClassVar[int]
    point_m: _containers.RepeatedScalarFieldContainer[float]
    force_n: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, point_m: _Optional[_Iterable[float]] = ..., force_n: _Optional[_Iterable[float]] = ...) -> None: ...

class MotionState(_message.Message):
    __slots__ = ("motion", "kind", "phase", "interpolator", "destination", "destination_at_ns", "remaining_s", "goals_reached", "received", "superseded", "executed", "executed_at_ns")
    MOTION_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    PHASE_FIELD_NUMBER: _ClassVar[int]
    INTERPOLATOR_FIELD_NUMBER: _ClassVar[int]
    DESTINATION_FIELD_NUMBER: _ClassVar[int]
    DESTINATION_AT_NS_FIELD_NUMBER: _ClassVar[int]
    REMAINING_S_FIELD_NUMBER: _ClassVar[int]
    GOALS_REACHED_FIELD_NUMBER: _ClassVar[int]
    RECEIVED_FIELD_NUMBER: _ClassVar[int]
    SUPERSEDED_FIELD_NUMBER: _ClassVar[int]
    EXECUTED_FIELD_NUMBER: _ClassVar[int]
    EXECUTED_AT_NS_FIELD_NUMBER: _ClassVar[int]
    motion: int
    kind: MotionKind
    phase: MotionPhase
    interpolator: FineInterpolatorState
    destination: _containers.RepeatedScalarFieldContainer[float]
    destination_at_ns: int
    remaining_s: float
    goals_reached: int
    received: int
    superseded: int
    executed: int
    executed_at_ns: int
    def __init__(self, motion: _Optional[int] = ..., kind: _Optional[_Union[MotionKind, str]] = ..., phase: _Optional[_Union[MotionPhase, str]] = ..., interpolator: _Optional[_Union[FineInterpolatorState, str]] = ..., destination: _Optional[_Iterable[float]] = ..., destination_at_ns: _Optional[int] = ..., remaining_s: _Optional[float] = ..., goals_reached: _Optional[int] = ..., received: _Optional[int] = ..., superseded: _Optional[int] = ..., executed: _Optional[int] = ..., executed_at_ns: _Optional[int] = ...) -> None: ...

class Report(_message.Message):
    __slots__ = ("number", "at_ns", "done", "goal", "ended", "frame", "flange", "load")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    AT_NS_FIELD_NUMBER: _ClassVar[int]
    DONE_FIELD_NUMBER: _ClassVar[int]
    GOAL_FIELD_NUMBER: _ClassVar[int]
    ENDED_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    FLANGE_FIELD_NUMBER: _ClassVar[int]
    LOAD_FIELD_NUMBER: _ClassVar[int]
    number: int
    at_ns: int
    done: RequestDone
    goal: GoalReached
    ended: MotionEnded
    frame: FrameDescribed
    flange: FlangeLocated
    load: LoadValidated
    def __init__(self, number: _Optional[int] = ..., at_ns: _Optional[int] = ..., done: _Optional[_Union[RequestDone, _Mapping]] = ..., goal: _Optional[_Union[GoalReached, _Mapping]] = ..., ended: _Optional[_Union[MotionEnded, _Mapping]] = ..., frame: _Optional[_Union[FrameDescribed, _Mapping]] = ..., flange: _Optional[_Union[FlangeLocated, _Mapping]] = ..., load: _Optional[_Union[LoadValidated, _Mapping]] = ...) -> None: ...

class RequestDone(_message.Message):
    __slots__ = ("request", "error", "reason", "detail")
    REQUEST_FIELD_NUMBER: _ClassVar[int]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    request: int
    error: RequestError
    reason: str
    detail: str
    def __init__(self, request: _Optional[int] = ..., error: _Optional[_Union[RequestError, str]] = ..., reason: _Optional[str] = ..., detail: _Optional[str] = ...) -> None: ...

class GoalReached(_message.Message):
    __slots__ = ("motion", "state", "position")
    MOTION_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    motion: int
    state: FineInterpolatorState
    position: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, motion: _Optional[int] = ..., state: _Optional[_Union[FineInterpolatorState, str]] = ..., position: _Optional[_Iterable[float]] = ...) -> None: ...

class MotionEnded(_message.Message):
    __slots__ = ("motion", "end", "reason", "detail")
    MOTION_FIELD_NUMBER: _ClassVar[int]
    END_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    motion: int
    end: MotionEnd
    reason: str
    detail: str
    def __init__(self, motion: _Optional[int] = ..., end: _Optional[_Union[MotionEnd, str]] = ..., reason: _Optional[str] = ..., detail: _Optional[str] = ...) -> None: ...

class Load(_message.Message):
    __slots__ = ("mass_kg", "centre_m", "inertia_kg_m2")
    MASS_KG_FIELD_NUMBER: _ClassVar[int]
    CENTRE_M_FIELD_NUMBER: _ClassVar[int]
    INERTIA_KG_M2_FIELD_NUMBER: _ClassVar[int]
    mass_kg: float
    centre_m: _containers.RepeatedScalarFieldContainer[float]
    inertia_kg_m2: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, mass_kg: _Optional[float] = ..., centre_m: _Optional[_Iterable[float]] = ..., inertia_kg_m2: _Optional[_Iterable[float]] = ...) -> None: ...

class AttachedTool(_message.Message):
    __slots__ = ("load", "tcp_in_flange")
    LOAD_FIELD_NUMBER: _ClassVar[int]
    TCP_IN_FLANGE_FIELD_NUMBER: _ClassVar[int]
    load: Load
    tcp_in_flange: Pose
    def __init__(self, load: _Optional[_Union[Load, _Mapping]] = ..., tcp_in_flange: _Optional[_Union[Pose, _Mapping]] = ...) -> None: ...

class FrameDescribed(_message.Message):
    __slots__ = ("request", "of", "name", "kind", "parent", "in_parent", "load")
    REQUEST_FIELD_NUMBER: _ClassVar[int]
    OF_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    PARENT_FIELD_NUMBER: _ClassVar[int]
    IN_PARENT_FIELD_NUMBER: _ClassVar[int]
    LOAD_FIELD_NUMBER: _ClassVar[int]
    request: int
    of: int
    name: str
    kind: FrameKind
    parent: str
    in_parent: Pose
    load: Load
    def __init__(self, request: _Optional[int] = ..., of: _Optional[int] = ..., name: _Optional[str] = ..., kind: _Optional[_Union[FrameKind, str]] = ..., parent: _Optional[str] = ..., in_parent: _Optional[_Union[Pose, _Mapping]] = ..., load: _Optional[_Union[Load, _Mapping]] = ...) -> None: ...

class LoadValidated(_message.Message):
    __slots__ = ("request", "reason")
    REQUEST_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    request: int
    reason: str
    def __init__(self, request: _Optional[int] = ..., reason: _Optional[str] = ...) -> None: ...

class FlangeLocated(_message.Message):
    __slots__ = ("request", "flange_in_base")
    REQUEST_FIELD_NUMBER: _ClassVar[int]
    FLANGE_IN_BASE_FIELD_NUMBER: _ClassVar[int]
    request: int
    flange_in_base: Pose
    def __init__(self, request: _Optional[int] = ..., flange_in_base: _Optional[_Union[Pose, _Mapping]] = ...) -> None: ...
