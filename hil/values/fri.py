"""FRI on the wire, as values: enumerations, releases and the two messages.

Source: fri-wire page, sections "Messages" and "Transport". Numbers are the wire's; names are ours. The messages are
named tuples because one is built every cycle: they are immutable and cost a tenth of a frozen dataclass.
Joint vectors are tuples of floats in rad or Nm; whether there are seven is admission's question, not the codec's.
"""

from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Final, NamedTuple, Protocol

MONITORING_IDENTIFIER: Final = 0x245142
COMMAND_IDENTIFIER: Final = 0x34001
MAX_DATAGRAM_BYTES: Final = 1500
SEQUENCE_MODULUS: Final = 1 << 32
CLIENT_PORT: Final = 30200
MIN_PERIOD_MS: Final = 1
MAX_PERIOD_MS: Final = 100

Vector = tuple[float, ...]


class Release(StrEnum):
    """The six releases of the client library that are served."""

    V1_11 = "1.11"
    V1_14 = "1.14"
    V1_15 = "1.15"
    V1_16 = "1.16"
    V2_5 = "2.5"
    V2_7 = "2.7"


class SessionState(IntEnum):
    """State of the FRI session."""

    IDLE = 0
    MONITORING_WAIT = 1
    MONITORING_READY = 2
    COMMANDING_WAIT = 3
    COMMANDING_ACTIVE = 4


class Quality(IntEnum):
    """Connection quality; GOOD is needed for commanding."""

    POOR = 0
    FAIR = 1
    GOOD = 2
    EXCELLENT = 3


class SafetyState(IntEnum):
    """What kind of stop is active."""

    NORMAL_OPERATION = 0
    SAFETY_STOP_LEVEL_0 = 1
    SAFETY_STOP_LEVEL_1 = 2
    SAFETY_STOP_LEVEL_2 = 3


class OperationMode(IntEnum):
    """Operation mode of the controller."""

    T1 = 0
    T2 = 1
    AUT = 2


class DriveState(IntEnum):
    """State of one drive."""

    OFF = 0
    TRANSITIONING = 1
    ACTIVE = 2


class ControlMode(IntEnum):
    """Control mode of the arm."""

    POSITION = 0
    CARTESIAN_IMPEDANCE = 1
    JOINT_IMPEDANCE = 2
    NO_CONTROL = 3


class ClientCommandMode(IntEnum):
    """What the client may command."""

    NONE = 0
    JOINT_POSITION = 1
    WRENCH = 2
    TORQUE = 3
    CARTESIAN_POSE = 4


class OverlayType(IntEnum):
    """Kind of the running overlay."""

    NONE = 0
    JOINT = 1
    CARTESIAN = 2


class IOType(IntEnum):
    """Type of an input or output."""

    BOOLEAN = 0
    DIGITAL = 1
    ANALOG = 2


class IODirection(IntEnum):
    """Direction of an input or output, seen from the robot."""

    INPUT = 0
    OUTPUT = 1


class RedundancyStrategy(IntEnum):
    """How the redundancy of a pose is given."""

    E1 = 0
    NONE = 4


@dataclass(frozen=True, slots=True)
class ReleaseTraits:
    """What tells one release from another on the wire."""

    framed: bool
    """Length prefix and CRC-32 around the message (2.7)."""
    commanded_position: bool
    """MonitorData carries the commanded position (1.x)."""
    pose: bool
    """Measured pose, redundancy, pose command mode (2.x)."""
    external_force: bool
    """MonitorData carries the external force (2.7)."""
    inputs_outputs: bool
    """Inputs and outputs exist (from 1.14)."""
    transformation_values: int
    """Numbers of a Transformation: 12 (3x4 matrix rows) or 7 (translation in mm, quaternion w x y z)."""


_ONE = ReleaseTraits(
    framed=False,
    commanded_position=True,
    pose=False,
    external_force=False,
    inputs_outputs=True,
    transformation_values=12,
)
_TWO = ReleaseTraits(
    framed=False,
    commanded_position=False,
    pose=True,
    external_force=False,
    inputs_outputs=True,
    transformation_values=7,
)

TRAITS: Final[dict[Release, ReleaseTraits]] = {
    Release.V1_11: ReleaseTraits(
        framed=False,
        commanded_position=True,
        pose=False,
        external_force=False,
        inputs_outputs=False,
        transformation_values=12,
    ),
    Release.V1_14: _ONE,
    Release.V1_15: _ONE,
    Release.V1_16: _ONE,
    Release.V2_5: _TWO,
    Release.V2_7: ReleaseTraits(
        framed=True,
        commanded_position=False,
        pose=True,
        external_force=True,
        inputs_outputs=True,
        transformation_values=7,
    ),
}


class TimeStamp(NamedTuple):
    """Unix time."""

    seconds: int
    nanoseconds: int


class Transformation(NamedTuple):
    """A named transformation; ``values`` has 12 (1.x) or 7 (2.x) numbers, translation in mm."""

    name: str
    values: Vector
    at: TimeStamp | None = None


class Redundancy(NamedTuple):
    """Redundancy information of a pose; for E1 ``value`` is the position of A3 in rad."""

    strategy: int
    value: float


class IOValue(NamedTuple):
    """One input or output, ``Group.Name``; exactly one of ``digital`` and ``analog`` is set, by type."""

    name: str
    type: int
    direction: int
    digital: int | None = None
    analog: float | None = None


class EndOf(NamedTuple):
    """Trailer that 1.x and 2.5 allow and no client sends."""

    message_length: int | None
    crc: int | None


class RobotInfo(NamedTuple):
    """Number of joints, safety state, drive states (one a joint), operation and control mode."""

    joint_count: int | None
    safety_state: int | None
    drive_states: tuple[int, ...]
    operation_mode: int | None
    control_mode: int | None


class MonitorData(NamedTuple):
    """What the arm measures; positions in rad, torques in Nm, force in N and Nm."""

    measured_position: Vector | None
    measured_torque: Vector | None
    commanded_position: Vector | None
    commanded_torque: Vector | None
    external_torque: Vector | None
    external_force: Vector | None
    inputs_outputs: tuple[IOValue, ...]
    measured_pose: Transformation | None
    redundancy: Redundancy | None
    at: TimeStamp | None


class ConnectionInfo(NamedTuple):
    """Session state, quality, send period in ms, receive multiplier."""

    session_state: int
    quality: int
    send_period_ms: int | None
    receive_multiplier: int | None


class IpoData(NamedTuple):
    """Interpolator output the client mirrors or overlays; present from COMMANDING_WAIT on."""

    position: Vector | None
    pose: Transformation | None
    redundancy: Redundancy | None
    client_command_mode: int | None
    overlay_type: int | None
    tracking_performance: float | None


class MonitoringMessage(NamedTuple):
    """Controller to client."""

    sequence_counter: int
    reflected_sequence_counter: int
    robot: RobotInfo | None
    monitor: MonitorData | None
    connection: ConnectionInfo | None
    ipo: IpoData | None
    requested_transformations: tuple[Transformation, ...] = ()
    end_of: EndOf | None = None
    identifier: int = MONITORING_IDENTIFIER


class CommandData(NamedTuple):
    """What the client commands; position in rad, torque in Nm, wrench in N and Nm."""

    position: Vector | None = None
    wrench: Vector | None = None
    torque: Vector | None = None
    transformations: tuple[Transformation, ...] = ()
    inputs_outputs: tuple[IOValue, ...] = ()
    pose: Transformation | None = None
    redundancy: Redundancy | None = None


class CommandMessage(NamedTuple):
    """Client to controller."""

    sequence_counter: int
    reflected_sequence_counter: int
    command: CommandData | None = None
    end_of: EndOf | None = None
    identifier: int = COMMAND_IDENTIFIER


class ControllerCodec(Protocol):
    """The controller's side of a codec: what the core is given. Decoding is total: a message or one error type."""

    @property
    def release(self) -> Release:
        """Release this codec speaks."""

    def encode_monitoring(self, message: MonitoringMessage) -> bytes:
        """Return the datagram of ``message``."""

    def decode_command(self, datagram: bytes) -> CommandMessage:
        """Return the message in ``datagram``; raise :class:`hil.values.errors.MalformedDatagram`."""
