"""The messages of the servo link, as values: what its codec reads and writes, the core judges, the client asks for.

State synchronisation, not remote calls: a client's requests carry increasing numbers and travel again in every command
packet until a state packet says they are done; what the controller has to report carries increasing numbers too and
travels again in every state packet until a command packet says it was seen. So loss, duplicates and reordering below
100 % cost time and nothing else. A destination that was superseded is never sent again.

Vectors are tuples of floats in rad, rad/s or Nm; whether there are seven is the controller's question, not the codec's.
Times ``..._ns`` are nanoseconds on the controller's own axis, which starts at 0.
"""

from enum import IntEnum
from typing import Final, NamedTuple, Protocol, TypeAlias

from hil.values.arm import Contact
from hil.values.control import POSITION_CONTROL, ControlModeSettings
from hil.values.frames import FLANGE, Frame
from hil.values.fri import ControlMode
from hil.values.load import AttachedTool
from hil.values.motion import FineInterpolatorState, MotionEnd, MotionKind, MotionParameters, MotionPhase
from hil.values.operator import OperatorView
from hil.values.pose import Pose

PROTOCOL_VERSION: Final = 3
SERVO_PORT: Final = 30300
"""Ours; beside the FRI ports 30200 to 30209."""
MAX_SERVO_DATAGRAM_BYTES: Final = 1472
"""What one Ethernet frame of 1500 bytes carries."""
MIN_HELLO_BYTES: Final = 400
"""A hello is filled up to this size, so that no answer to one is longer than what asked for it."""
MAX_REQUESTS_IN_PACKET: Final = 6
MAX_REPORTS_IN_PACKET: Final = 6
"""Of both, a packet carries as many as there is room for, the oldest first; the others wait for a later one."""
MAX_MOTIONS_IN_PACKET: Final = 4
"""A state packet shows the motion that has the arm, the one transferred behind it, and the next ones that wait."""
MAX_VECTOR_NUMBERS: Final = 32
"""More numbers in one vector are no packet; up to there the controller judges how many it needs."""
MAX_NAME_BYTES: Final = 63
"""Of the names of applications, software and robots, in UTF-8."""
MAX_COMMANDER_BYTES: Final = 96
"""Of a snapshot's commander: a name, and an address."""
MAX_REASON_BYTES: Final = 200
MAX_DETAIL_BYTES: Final = 160
"""Texts that are longer travel cut, and end with an ellipsis."""
MIN_WATCHDOG_MS: Final = 20
MAX_WATCHDOG_MS: Final = 10_000
DEFAULT_WATCHDOG_MS: Final = 300
MIN_STATE_PERIOD_MS: Final = 1
MAX_STATE_PERIOD_MS: Final = 100
DEFAULT_STATE_PERIOD_MS: Final = 5

Vector = tuple[float, ...]


class Role(IntEnum):
    """What a session may do."""

    OBSERVER = 1
    COMMANDER = 2
    OPERATOR = 3
    """May push a simulated arm; any number of them."""


class RequestError(IntEnum):
    """Kind of a refusal, one for each of the manual's exception types (chapter 10.2)."""

    NONE = 0
    ILLEGAL_ARGUMENT = 1
    ILLEGAL_STATE = 2
    COMMAND_INVALID = 3


class StartMotion(NamedTuple):
    """Start a motion, or queue it behind the ones that are there; the motion is known by this ``number``.

    Without a ``destination`` it begins where the arm is when the motion takes over. ``flange_in_base`` is the
    destination as a pose, which the controller turns into the axis positions nearest to where the arm is then.
    """

    number: int
    kind: MotionKind
    parameters: MotionParameters
    destination: Vector | None
    flange_in_base: Pose | None = None
    mode: ControlModeSettings = POSITION_CONTROL
    frame: str = FLANGE
    """What is moved: the load of its tool is the one to reckon with, and impedance acts in it."""
    tool: AttachedTool | None = None
    """A tool of the application's own, which is moved instead of ``frame``."""


class SetDestination(NamedTuple):
    """A new destination for ``motion``: position in rad, velocity there in rad/s (SmartServo only); or a pose."""

    number: int
    motion: int
    position: Vector | None
    velocity: Vector | None = None
    flange_in_base: Pose | None = None


class SetRuntimeParameters(NamedTuple):
    """Change what may change while ``motion`` runs (manual 9.1.2); None leaves a parameter as it is."""

    number: int
    motion: int
    minimum_execution_time_s: float | None = None
    velocity_planning: bool | None = None
    wait_for_pause: bool | None = None


class ChangeControlMode(NamedTuple):
    """Change the parameters ``motion`` is controlled with (manual 7.10.3); the kind of control stays."""

    number: int
    motion: int
    mode: ControlModeSettings


class ValidateLoad(NamedTuple):
    """Compare the load of the tool of ``frame`` with what the torque sensors show at rest (manual 7.10.1)."""

    number: int
    frame: str
    tool: AttachedTool | None = None
    """A tool of the application's own, whose load is meant instead of that of ``frame``."""


class PushArm(NamedTuple):
    """Push a link (1 to 7) of a simulated arm at its outer end, the last one at the flange; operators only.

    Force in N and moment in Nm, axes of the robot base, for ``duration_s``; a new push replaces the one before.
    """

    number: int
    link: int
    force_n: Vector
    moment_nm: Vector
    duration_s: float


class StopMotion(NamedTuple):
    """Brake ``motion`` and end it."""

    number: int
    motion: int


class DescribeFrame(NamedTuple):
    """Ask for one frame of the robot's tree, by its place; anybody may ask."""

    number: int
    place: int


class LocateFlange(NamedTuple):
    """Ask where the flange is in the robot base at axis positions in rad; anybody may ask."""

    number: int
    position: Vector


Request: TypeAlias = (
    StartMotion
    | SetDestination
    | SetRuntimeParameters
    | ChangeControlMode
    | StopMotion
    | DescribeFrame
    | LocateFlange
    | ValidateLoad
    | PushArm
)


class RequestDone(NamedTuple):
    """What became of the request ``request``: taken at ``at_ns``, or refused for a ``reason``."""

    number: int
    request: int
    at_ns: int
    error: RequestError = RequestError.NONE
    reason: str = ""
    detail: str = ""


class GoalReached(NamedTuple):
    """The fine interpolator of ``motion`` reached its destination; ``position`` is the measured one in rad."""

    number: int
    motion: int
    at_ns: int
    state: FineInterpolatorState
    position: Vector


class MotionEnded(NamedTuple):
    """``motion`` ended at ``at_ns``; ``reason`` is public (manual 10.3 for an error), ``detail`` has figures."""

    number: int
    motion: int
    at_ns: int
    end: MotionEnd
    reason: str
    detail: str


class FrameDescribed(NamedTuple):
    """Answer to the :class:`DescribeFrame` ``request``: the frame of its place, and how many there are."""

    number: int
    request: int
    of: int
    frame: Frame


class FlangeLocated(NamedTuple):
    """Answer to the :class:`LocateFlange` ``request``."""

    number: int
    request: int
    flange_in_base: Pose


class LoadValidated(NamedTuple):
    """Answer to the :class:`ValidateLoad` ``request``; ``reason`` says why the load is not valid, else nothing."""

    number: int
    request: int
    reason: str


Report: TypeAlias = RequestDone | GoalReached | MotionEnded | FrameDescribed | FlangeLocated | LoadValidated


class Hello(NamedTuple):
    """A client asks for a session; ``nonce`` is its own random number, which the answer repeats."""

    version: int
    nonce: int
    role: Role
    watchdog_ms: int
    state_period_ms: int
    name: str
    latency_budget_ms: int = 0
    """How old the state may be that a command reflects; an older command is dropped. 0: as long as the watchdog."""


class Welcome(NamedTuple):
    """The session offered: it begins with the client's first packet that carries ``token``."""

    version: int
    nonce: int
    token: int
    software: str
    robot: str
    cycle_ms: int
    unix_epoch_ns: int
    """Unix time of the controller's time 0, by the controller's clock."""


class Refused(NamedTuple):
    """No session, and why. ``try_again`` is true where time may change it."""

    version: int
    nonce: int
    reason: str
    try_again: bool


class Command(NamedTuple):
    """A client's packet: keeps its session alive, and carries what is not done yet.

    ``reports_seen`` is the number of the last report seen, ``wants_state`` asks for a state packet at once.
    """

    token: int
    sequence: int
    reflected_sequence: int
    reports_seen: int = 0
    wants_state: bool = False
    requests: tuple[Request, ...] = ()


class Goodbye(NamedTuple):
    """The client leaves; what it commanded brakes."""

    token: int
    sequence: int


class Ended(NamedTuple):
    """The controller ended the session, and why."""

    token: int
    reason: str


class MotionState(NamedTuple):
    """One motion as a state packet shows it."""

    motion: int
    kind: MotionKind
    phase: MotionPhase
    interpolator: FineInterpolatorState
    destination: Vector
    """Last destination taken; empty while the motion waits without one."""
    destination_at_ns: int
    """When that arrived at the controller."""
    remaining_s: float
    goals_reached: int
    received: int
    """Destinations received."""
    superseded: int
    """Destinations that were replaced by a newer one before the interpolator had them."""
    executed: int
    """Destinations the interpolator went for."""
    executed_at_ns: int
    """When the cycle began in which the interpolator had the last of them."""


class Snapshot(NamedTuple):
    """What a state packet says of controller, arm and motions; the same for all sessions."""

    now_ns: int
    cycle: int
    operator: OperatorView
    measured_position: Vector
    commanded_position: Vector
    """Set point of the interpolator."""
    measured_torque: Vector
    external_torque: Vector
    flange_in_base: Pose
    """Measured, by the controller's kinematics."""
    control_mode: ControlMode
    external_torque_variance: Vector
    """Nm2. This and the estimates at the flange travel in single precision."""
    flange_force: Vector
    """Estimated from the external torque: Fx, Fy, Fz in N, Mx, My, Mz in Nm at the flange, axes of the robot base."""
    flange_force_variance: Vector
    """N2 and Nm2."""
    commander: str
    """Who commands, for a person; empty when nobody does."""
    motions: tuple[MotionState, ...]
    flange_speed_mm_s: float = 0.0
    """Measured, of the flange's origin, as the limit in T1 has it. Single precision, as the contacts.

    0 too where a controller, or a recording, is older than this field.
    """
    contacts: tuple[Contact, ...] = ()
    """What touches the arm, at most ``MAX_CONTACTS``, the strongest first; of a simulated arm that can be touched.

    The last ones are left out where a packet has no room for them.
    """


class State(NamedTuple):
    """The controller's packet. ``requests_done`` is the number of the last request the controller has.

    It need not be sent again; what became of it is told by a report, at once or when the program goes on.
    """

    token: int
    sequence: int
    reflected_sequence: int
    requests_done: int
    snapshot: Snapshot
    reports: tuple[Report, ...] = ()


FromClient: TypeAlias = Hello | Command | Goodbye
FromController: TypeAlias = Welcome | Refused | State | Ended


class ServoControllerCodec(Protocol):
    """What the controller needs of a servo link codec. Decoding is total: a value, or MalformedDatagram."""

    def decode_from_client(self, datagram: bytes) -> FromClient:
        """Return the packet in ``datagram``; raise :class:`hil.values.errors.MalformedDatagram`."""

    def encode_from_controller(self, packet: FromController) -> bytes:
        """Return the datagram of a packet."""


class ServoClientCodec(Protocol):
    """What a client needs of a servo link codec."""

    def decode_from_controller(self, datagram: bytes) -> FromController:
        """Return the packet in ``datagram``; raise :class:`hil.values.errors.MalformedDatagram`."""

    def encode_from_client(self, packet: FromClient) -> bytes:
        """Return the datagram of a packet."""
