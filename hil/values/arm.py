"""What passes between the controller and its robot side each cycle, and the contract of a robot side."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, Protocol, runtime_checkable

from hil.values.errors import OutOfRange
from hil.values.fri import DriveState, OperationMode, OverlayKind, SafetyState
from hil.values.link import Address
from hil.values.robot import JOINT_COUNT, Seven, Six, Three

MAX_PUSH_N: Final = 500.0
MAX_PUSH_NM: Final = 100.0
DEFAULT_PUSH_S: Final = 1.0
MAX_PUSH_S: Final = 60.0
"""What a person can do to an arm, and a little more. Ours."""
MAX_CONTACTS: Final = 8
"""The strongest count; a flat face on a table alone makes four."""
MIN_CONTACT_N: Final = 0.5
"""Weaker ones are left out: what a hand would not notice. Both ours."""


class ArmState(NamedTuple):
    """Measured state of the arm.

    ``position_rad`` and ``velocity_rad_s`` in the robot's own sense of rotation. ``torque_nm`` is what the joint torque
    sensors show, in the sign of the facts (section 4.4): minus the actuation torque. ``external_torque_nm`` is positive
    when the environment pushes a joint towards plus; a robot side that does not estimate it reports zeros.
    ``commanded_torque_nm`` has the sign of ``torque_nm``; it is what the drives are asked for, before their own limits
    cut it. ``sample`` grows with each new measurement: the same number again is the same measurement again.
    """

    position_rad: Seven
    velocity_rad_s: Seven
    torque_nm: Seven
    external_torque_nm: Seven
    commanded_torque_nm: Seven
    drive_states: tuple[DriveState, ...]
    sample: int


class OverlayCommand(NamedTuple):
    """What an overlay adds, for a robot side that runs the control law itself (``passes_overlays``)."""

    torque_nm: Seven
    """On top of joint impedance."""
    wrench: Six
    """N and Nm at the flange, on top of Cartesian impedance."""


class JointCommand(NamedTuple):
    """What the arm is told for the next cycle: position in rad, its rate in rad/s, and the rate of that in rad/s2.

    The acceleration is 0 where it is not planned: a robot side may feed it forward, and must follow without it. With
    a torque the arm is not led to the position: its motors give that torque, gravity and all is in it. Only where
    ``takes_torque`` is true.
    """

    position_rad: Seven
    velocity_rad_s: Seven
    acceleration_rad_s2: Seven = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    torque_nm: Seven | None = None
    """Of the motors, positive towards plus."""
    overlay: OverlayCommand | None = None
    """Only where ``passes_overlays`` is not empty."""


class Push(NamedTuple):
    """What somebody does to a simulated arm: force and moment, axes of the robot base, at the outer end of a link."""

    link: int
    """1 to 7; the end of the last one is the flange."""
    force_n: Three
    moment_nm: Three
    duration_s: float

    def check(self) -> None:
        """Raise :class:`OutOfRange` with name, value and range."""
        if self.link not in range(1, JOINT_COUNT + 1):
            raise OutOfRange("link", self.link, f"1 ... {JOINT_COUNT}")
        for name, values, most, unit in (
            ("force", self.force_n, MAX_PUSH_N, "N"),
            ("moment", self.moment_nm, MAX_PUSH_NM, "Nm"),
        ):
            for axis, value in zip("xyz", values, strict=True):
                if not -most <= value <= most:
                    raise OutOfRange(f"{name} along {axis}", value, f"-{most:g} ... {most:g} {unit}")
        if not 0.0 <= self.duration_s <= MAX_PUSH_S:
            raise OutOfRange("duration of a push", self.duration_s, f"0 ... {MAX_PUSH_S:g} s")


class Contact(NamedTuple):
    """Something touches the arm: where, and with what force on the arm; m and N, axes of the robot base."""

    point_m: Three
    force_n: Three


class RobotSideCondition(NamedTuple):
    """What a robot side says of itself beside the measured arm; the same object as long as nothing changed."""

    takes_commands: bool = True
    """Whether what is written reaches the arm. Where not, ``reason`` says why, and motions wait."""
    reason: str = ""
    failure: str = ""
    """What failed and must be acknowledged before anything moves again; :meth:`Backend.resume` is that."""
    operation_mode: OperationMode | None = None
    """Where the selector of the robot side stands; None: the controller has its own."""
    safety_state: SafetyState = SafetyState.NORMAL_OPERATION
    held_position_rad: Seven | None = None
    """Where the robot side holds the arm by itself, as long as it takes no commands; None: where it is measured."""


AT_WORK: Final = RobotSideCondition()
"""Of a robot side that always takes commands and has nothing to say."""


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a robot side can do; told truthfully, because the controller refuses the rest."""

    joint_count: int
    takes_torque: bool
    """Whether its motors give torques that they are told, which every control mode but position control needs."""
    torque_sigma_nm: Seven | None
    """Standard deviation of its joint torque sensors, from which what pushes the arm is estimated; None: it has none,
    and says itself what pushes the arm."""
    can_be_pushed: bool
    """Whether :meth:`Backend.push` does something."""
    shortest_period_ns: int
    paces_the_cycle: bool
    moves_real_drives: bool
    switches_drives: bool
    """Whether the drives can be dropped from here; where they cannot, stops of category 0 and 1 brake and hold."""
    passes_overlays: frozenset[OverlayKind] = frozenset()
    """Overlays that it takes beside positions, because it runs their control law itself."""
    has_own_operator: bool = False
    """Whether mode selector and enabling switch are there, and the controller only follows them."""
    longest_period_ns: int = 5_000_000


class Backend(Protocol):
    """A robot side. ``read`` never blocks; ``open`` never moves the arm; ``open`` and ``close`` are idempotent."""

    @property
    def capabilities(self) -> Capabilities:
        """What this robot side can do."""

    def open(self, *, period_ns: int) -> None:
        """Get ready to be read and stepped every ``period_ns``; raise BackendError or ConfigurationError."""

    def read(self) -> ArmState:
        """Return the newest measured state."""

    def write(self, command: JointCommand) -> None:
        """Take the command of this cycle."""

    def step(self) -> None:
        """Let one period pass on the robot side (a simulation advances, a bus exchanges)."""

    def switch_drives(self, *, on: bool) -> None:
        """Let the drives hold the arm, or drop them, so that the brakes stop and hold it; on from the start.

        Idempotent, and returns at once: the drive states of :meth:`read` say when it is done. With dropped drives
        commands mean nothing; drives that come back hold the newest one. Only where ``switches_drives`` is true.
        """

    def condition(self) -> RobotSideCondition:
        """Return what the robot side says of itself now; the same object as long as nothing changed."""

    def resume(self) -> None:
        """Take commands again after a failure; nothing moves by it, and :meth:`condition` says whether it worked."""

    def push(self, push: Push) -> None:
        """Push the arm from the next step on, instead of the push before. Only where ``can_be_pushed`` is true."""

    def contacts(self) -> tuple[Contact, ...]:
        """Return what touches the arm, as of the last step: at most ``MAX_CONTACTS``, the strongest first.

        None weaker than ``MIN_CONTACT_N``, and none at all where a robot side feels none. It is asked for only in a
        cycle in which somebody is told, so it may cost a little; it changes nothing.
        """

    def close(self) -> None:
        """Release everything."""


class PeerLink(NamedTuple):
    """Where a robot side that is a network peer is met, resolved."""

    bind: Address
    peer: Address | None
    """Who is believed; None: the first one that sends something that can be read."""
    first_message_s: float
    """How long to wait for the first message."""
    silence_ns: int = 10_000_000
    """Without a message for so long, cycles go by the clock, so that somebody notices."""


@runtime_checkable
class PeerBackend(Backend, Protocol):
    """A robot side that is a network peer, and paces the cycle with its messages. It has no socket and no clock.

    Datagrams come in with their time and go out through the controller, like those of every link; so a recording holds
    them, and they replay.
    """

    @property
    def link(self) -> PeerLink:
        """Where the peer is met."""

    def receive(self, datagram: bytes, sender: Address, *, now_ns: int) -> bool:
        """Take a datagram; return whether it is one that a cycle is due for. Nothing a peer sends raises."""

    def advance(self, *, now_ns: int) -> None:
        """Notice how much time has passed; once a cycle, before :meth:`read`."""

    def outgoing(self) -> list[tuple[bytes, Address]]:
        """Return and forget what is to be sent; after :meth:`step`."""

    def not_ready(self) -> str:
        """Return why there is no measured state yet, empty once there is one; :meth:`read` works from then on.

        Raises :class:`BackendError` where what came shows that there will never be one.
        """

    def decode(self, datagram: bytes, *, sent: bool) -> object:
        """Return the message in a datagram that was ``sent`` from here, or came; raise MalformedDatagram.

        For those who look at recordings; it leaves everything as it is.
        """

    def report(self) -> dict[str, object]:
        """Return figures of the link, for the status file."""


def seven(values: Sequence[float]) -> Seven:
    """Return ``values`` as a tuple of seven floats; raise ValueError for another count."""
    if len(values) != 7:
        raise ValueError(f"{len(values)} values given, an arm has 7 joints")
    return tuple(values)  # type: ignore[return-value]  # the length was checked just above
