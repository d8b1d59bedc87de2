"""The two FRI messages, as values: what a codec reads and writes, and what the core builds and judges.

Source: fri-wire page, section "Messages". The messages are named tuples because one is built every cycle: they are
immutable and cost a tenth of a frozen dataclass. Joint vectors are tuples of floats in rad or Nm; whether there are
seven is admission's question, not the codec's.
"""

from typing import NamedTuple, Protocol

from hil.values.fri import COMMAND_IDENTIFIER, MONITORING_IDENTIFIER, Release

Vector = tuple[float, ...]


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
