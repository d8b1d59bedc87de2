"""The link to a Cabinet, message by message: a backend, and a Cabinet that says what a test makes it say."""

from typing import Any

from backends.cabinet.backend import CabinetBackend
from backends.cabinet.options import parse_options
from hil.values.arm import JointCommand, RobotSideCondition, seven
from hil.values.fri import (
    TRAITS,
    ClientCommandMode,
    ControlMode,
    DriveState,
    OperationMode,
    OverlayType,
    Quality,
    Release,
    SafetyState,
    SessionState,
)
from hil.values.fri_messages import (
    CommandMessage,
    ConnectionInfo,
    IpoData,
    MonitorData,
    MonitoringMessage,
    RobotInfo,
    Vector,
)
from hil.values.link import Address
from hil.values.robot import Seven
from transport.fri import FriCodec

MS = 1_000_000
CABINET = Address("192.168.0.5", 30200)
STRANGER = Address("192.168.0.9", 30200)
STILL: Seven = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
HERE: Seven = (0.1, 0.2, 0.3, -0.4, 0.5, 0.6, 0.7)
COMMANDED: Seven = seven([value + 1e-3 for value in HERE])
ACTIVE = (DriveState.ACTIVE,) * 7


class Link:
    """A backend, and a Cabinet that says what a test makes it say."""

    def __init__(self, release: Release = Release.V1_15, *, cycle_ms: int = 1, **options: Any) -> None:
        chosen = {"release": release.value, "bind": "127.0.0.1:0", **options}
        self.release = release
        self.backend = CabinetBackend(parse_options(chosen), cycle_ns=cycle_ms * MS)
        self.backend.open(period_ns=cycle_ms * MS)
        self.codec = FriCodec(release)
        self.cycle_ms = cycle_ms
        self.counter = 100
        self.now_ns = 0

    def message(self, state: SessionState = SessionState.MONITORING_READY, **changes: Any) -> MonitoringMessage:
        """A message of a well-behaved Cabinet, with ``changes`` by field name."""
        told: dict[str, Any] = {
            "position": HERE,
            "interpolator": HERE,
            "mode": ClientCommandMode.JOINT_POSITION,
            "period_ms": self.cycle_ms,
            "multiplier": 1,
            "quality": Quality.GOOD,
            "operation_mode": OperationMode.AUT,
            "safety": SafetyState.NORMAL_OPERATION,
            "drives": ACTIVE,
            **changes,
        }
        ipo = IpoData(told["interpolator"], None, None, told["mode"], OverlayType.JOINT, 0.0)
        one = TRAITS[self.release].commanded_position
        return MonitoringMessage(
            self.counter,
            0,
            RobotInfo(7, told["safety"], told["drives"], told["operation_mode"], ControlMode.POSITION),
            MonitorData(told["position"], STILL, COMMANDED if one else None, STILL, STILL, None, (), None, None, None),
            ConnectionInfo(state, told["quality"], told["period_ms"], told["multiplier"]),
            ipo if state >= SessionState.COMMANDING_WAIT else None,
        )

    def hear(self, message: MonitoringMessage, *, sender: Address = CABINET, periods: int = 1) -> bool:
        """Let a message come, ``periods`` after the last one."""
        self.now_ns += periods * self.cycle_ms * MS
        return self.backend.receive(self.codec.encode_monitoring(message), sender, now_ns=self.now_ns)

    def say(self, state: SessionState = SessionState.MONITORING_READY, *, periods: int = 1, **changes: Any) -> bool:
        """Let the next message come; one that is ``periods`` after the last one."""
        self.counter = (self.counter + periods) % 2**32
        return self.hear(self.message(state, **changes), periods=periods)

    def answer(self, position: Seven, velocity: Seven = STILL, **rest: Any) -> CommandMessage | None:
        """Write a set point, and return the answer."""
        self.backend.advance(now_ns=self.now_ns)
        self.backend.write(JointCommand(position, velocity, **rest))
        self.backend.step()
        sent = self.backend.outgoing()
        assert len(sent) <= 1
        if not sent:
            return None
        assert sent[0][1] == CABINET
        return self.codec.decode_command(sent[0][0])

    def position(self, position: Seven, velocity: Seven = STILL) -> Vector | None:
        """Write a set point, and return the position that is answered."""
        answer = self.answer(position, velocity)
        assert answer is not None
        return None if answer.command is None else answer.command.position

    def command(self, **changes: Any) -> None:
        """Bring it to where set points count."""
        for state in (SessionState.MONITORING_READY, SessionState.COMMANDING_WAIT, SessionState.COMMANDING_ACTIVE):
            self.say(state, **changes)
            self.answer(HERE)
        assert self.condition().takes_commands, self.condition().reason

    def condition(self) -> RobotSideCondition:
        """What it says of itself."""
        return self.backend.condition()

    def count(self, name: str) -> object:
        """A figure of the report."""
        return self.backend.report()[name]
