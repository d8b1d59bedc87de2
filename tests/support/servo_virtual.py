"""A controller with a servo link, and applications spelt out packet by packet, in virtual time and one thread.

The applications here are not those of ``hil.client``: they say exactly what a test makes them say.
"""

from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import TypeAlias

from backends.base import InProcessBackend
from backends.robots import load_description, load_pinocchio
from hil.core.controller import Controller
from hil.core.events import Event
from hil.core.model import ArmModel
from hil.core.servo.link import SERVO_LINK, ServoLink
from hil.core.settings import (
    IDEAL_REACTION,
    ControllerSettings,
    FriSettings,
    ReactionSettings,
    SafetySettings,
    ServoSettings,
)
from hil.values.frames import FrameTree
from hil.values.fri import OperationMode, Release
from hil.values.link import Address, Source
from hil.values.load import NO_LOAD, Load
from hil.values.motion import MotionKind, MotionParameters
from hil.values.operator import PadKey, Press, SelectMode
from hil.values.outcomes import Outcome
from hil.values.pose import Pose
from hil.values.robot import RobotDescription
from hil.values.servo import (
    PROTOCOL_VERSION,
    Command,
    Ended,
    FromClient,
    FromController,
    GoalReached,
    Goodbye,
    Hello,
    MotionEnded,
    MotionState,
    Refused,
    Report,
    Request,
    RequestDone,
    Role,
    SetDestination,
    StartMotion,
    State,
    StopMotion,
    Vector,
    Welcome,
)
from tests.support.virtual import MS, UNIX_EPOCH_NS, RecordingBackend
from transport.fri import FriCodec
from transport.servo import ServoCodec

COMMANDER = Address("127.0.0.1", 40001)
OTHER = Address("127.0.0.1", 40002)
SECRET = bytes(range(32))
Make: TypeAlias = Callable[[int], Request]


class ServoBench:
    """Ticks a controller and carries packets to and from its applications."""

    def __init__(
        self,
        *,
        robot: str = "lbr-iiwa-14-r820",
        backend: Callable[[RobotDescription], InProcessBackend] = RecordingBackend,
        mode: OperationMode = OperationMode.AUT,
        enabled: bool = True,
        safety: SafetySettings | None = None,
        cycle_ms: int = 1,
        reaction: ReactionSettings = IDEAL_REACTION,
        key: bytes | None = None,
        fri: FriSettings | None = None,
        frames: FrameTree | None = None,
        load: Load = NO_LOAD,
    ) -> None:
        self.description = load_description(robot)
        self.backend = backend(self.description)
        self.settings = ControllerSettings(
            operation_mode=mode,
            cycle_ms=cycle_ms,
            unix_epoch_ns=UNIX_EPOCH_NS,
            fri=fri,
            servo=ServoSettings(software="fri-hil test", robot=robot, token_secret=SECRET),
            reaction=reaction,
            safety=safety or SafetySettings(),
            enabled=enabled,
            frames=FrameTree() if frames is None else frames,
            load=load,
        )
        self.backend.open(period_ns=self.settings.cycle_ns)
        self.codec = ServoCodec(key)
        self.controller = Controller(
            self.settings,
            description=self.description,
            model=ArmModel(load_pinocchio(robot)),
            backend=self.backend,
            codec=FriCodec(Release.V1_15) if fri is not None else None,
            servo_codec=self.codec,
        )
        self.now_ns = -self.settings.cycle_ns
        self.events: list[Event] = []
        self.sent: dict[Address, list[FromController]] = defaultdict(list)
        self.fri_sent: list[bytes] = []

    @property
    def link(self) -> ServoLink:
        """The servo link."""
        assert self.controller.servo is not None
        return self.controller.servo

    def press(self, *keys: PadKey) -> list[str]:
        """Use keys of the pad, and return the refusals."""
        answers = [self.controller.operate(Press(key), now_ns=max(self.now_ns, 0)) for key in keys]
        return [answer for answer in answers if answer]

    def select(self, mode: OperationMode) -> None:
        """Turn the mode selector."""
        assert not self.controller.operate(SelectMode(mode), now_ns=max(self.now_ns, 0))

    def run(self, seconds: float) -> None:
        """Let virtual time pass."""
        for _ in range(round(seconds * 1e9) // self.settings.cycle_ns):
            self.cycle()

    def cycle(self, *, lateness_ns: int = 0) -> None:
        """One control cycle; what it sends is kept by destination."""
        self.now_ns += self.settings.cycle_ns
        self.controller.tick(now_ns=self.now_ns, lateness_ns=lateness_ns)
        for link, payload, destination in self.controller.outgoing():
            if link == SERVO_LINK:
                assert destination is not None
                self.sent[destination].append(self.codec.decode_from_controller(payload))
            else:
                self.fri_sent.append(payload)
        self.events += self.controller.events()

    def deliver(self, packet: FromClient | bytes, sender: Address) -> None:
        """Hand the core a packet now."""
        payload = packet if isinstance(packet, bytes) else self.codec.encode_from_client(packet)
        self.controller.receive(payload, Source(SERVO_LINK, sender), now_ns=max(self.now_ns, 0))

    def dropped(self, outcome: Outcome) -> int:
        """How often a drop was counted."""
        return self.link.counters.by_outcome[outcome]

    def told(self) -> list[str]:
        """All events in words."""
        return [str(event) for event in self.events]

    def commanded(self, axis: int) -> list[float]:
        """Set points the backend was given, of one axis."""
        assert isinstance(self.backend, RecordingBackend)
        return [command.position_rad[axis] for command in self.backend.commands]


class Application:
    """One client of the bench; ``keeps_alive`` sends an empty command every cycle of :meth:`run`."""

    def __init__(
        self,
        bench: ServoBench,
        *,
        address: Address = COMMANDER,
        role: Role = Role.COMMANDER,
        watchdog_ms: int = 100,
        state_period_ms: int = 5,
        name: str = "test",
        nonce: int = 7,
    ) -> None:
        self.bench = bench
        self.address = address
        self.hello_packet = Hello(PROTOCOL_VERSION, nonce, role, watchdog_ms, state_period_ms, name)
        self.token = 0
        self.sequence = 0
        self.number = 0
        self._absorbed = 0
        self._states: list[State] = []
        self._reports: dict[int, Report] = {}

    def hello(self) -> Welcome | Refused:
        """Say hello and return the answer, which comes with the next cycle."""
        self.bench.deliver(self.hello_packet, self.address)
        self.bench.cycle()
        answer = self.bench.sent[self.address][-1]
        assert isinstance(answer, Welcome | Refused), answer
        if isinstance(answer, Welcome):
            self.token = answer.token
        return answer

    def join(self) -> None:
        """Say hello and take up the offer."""
        answer = self.hello()
        assert isinstance(answer, Welcome), answer
        self.command()
        self.bench.cycle()

    def knock(self) -> None:
        """Say hello, and wait for nothing."""
        self.bench.deliver(self.hello_packet, self.address)

    def take_up(self) -> bool:
        """Take up the offer, if the last packet was one; return whether it was."""
        packets = self.packets
        if not packets or not isinstance(packets[-1], Welcome):
            return False
        self.token = packets[-1].token
        self.command()
        return True

    def command(self, *requests: Request, wants_state: bool = False, reports_seen: int | None = None) -> None:
        """Send a command packet with ``requests``; by default all reports that came so far are seen."""
        self.sequence += 1
        states = self.states
        last_state = states[-1].sequence if states else 0
        if reports_seen is None:
            reports_seen = max(self._reports, default=0)
        self.bench.deliver(
            Command(self.token, self.sequence, last_state, reports_seen, wants_state, requests), self.address
        )

    def ask(self, *makers: Make) -> list[RequestDone]:
        """Send requests (each made for its number), run one cycle, and return what became of them."""
        requests = []
        for make in makers:
            self.number += 1
            requests.append(make(self.number))
        self.command(*requests)
        self.bench.cycle()
        numbers = [request.number for request in requests]
        return [done for done in self.done if done.request in numbers]

    def start(
        self, kind: MotionKind, destination: Vector | Pose | None = None, parameters: MotionParameters | None = None
    ) -> int:
        """Start a motion, to axis positions or a pose of the flange, and return its number; fail if it is refused."""
        chosen = parameters or MotionParameters()
        position, flange_in_base = (None, destination) if isinstance(destination, Pose) else (destination, None)
        [done] = self.ask(lambda number: StartMotion(number, kind, chosen, position, flange_in_base))
        assert not done.error, done
        return done.request

    def set_destination(
        self, motion: int, destination: Vector | Pose | None, velocity: Vector | None = None
    ) -> RequestDone:
        """Set a destination, axis positions or a pose of the flange, and return what became of it."""
        position, flange_in_base = (None, destination) if isinstance(destination, Pose) else (destination, None)
        [done] = self.ask(lambda number: SetDestination(number, motion, position, velocity, flange_in_base))
        return done

    def stop(self, motion: int) -> RequestDone:
        """Stop a motion and return what became of it."""
        [done] = self.ask(lambda number: StopMotion(number, motion))
        return done

    def goodbye(self) -> None:
        """Leave."""
        self.sequence += 1
        self.bench.deliver(Goodbye(self.token, self.sequence), self.address)

    def run(self, seconds: float) -> None:
        """Let time pass while the application keeps its session alive."""
        for _ in range(round(seconds * 1e9) // self.bench.settings.cycle_ns):
            self.command()
            self.bench.cycle()

    def run_until(self, condition: Callable[[], bool], *, at_most_s: float = 30.0) -> None:
        """Let time pass until ``condition`` holds; fail if that does not happen."""
        for _ in range(round(at_most_s * 1e9) // self.bench.settings.cycle_ns):
            if condition():
                return
            self.command()
            self.bench.cycle()
        raise AssertionError(f"did not happen in {at_most_s} s: {self.bench.told()[-5:]}")

    @property
    def packets(self) -> list[FromController]:
        """Everything the controller sent to this address."""
        return self.bench.sent[self.address]

    @property
    def states(self) -> list[State]:
        """State packets, in order."""
        packets = self.packets
        for packet in packets[self._absorbed :]:
            if isinstance(packet, State):
                self._states.append(packet)
                self._reports.update((report.number, report) for report in packet.reports)
        self._absorbed = len(packets)
        return self._states

    @property
    def ended(self) -> list[Ended]:
        """Ends of sessions it was told."""
        return [packet for packet in self.packets if isinstance(packet, Ended)]

    @property
    def reports(self) -> list[Report]:
        """Reports, each once, in order."""
        assert self.states is self._states
        return [self._reports[number] for number in sorted(self._reports)]

    @property
    def done(self) -> list[RequestDone]:
        """What became of the requests."""
        return [report for report in self.reports if isinstance(report, RequestDone)]

    @property
    def goals(self) -> list[GoalReached]:
        """Goals reached."""
        return [report for report in self.reports if isinstance(report, GoalReached)]

    @property
    def ends(self) -> list[MotionEnded]:
        """Ends of motions."""
        return [report for report in self.reports if isinstance(report, MotionEnded)]

    def motion(self, number: int) -> MotionState:
        """Return how the newest state packet shows a motion."""
        return next(motion for motion in self.states[-1].snapshot.motions if motion.motion == number)


def offset(position: Sequence[float], **axes: float) -> Vector:
    """Return ``position`` with the named axes (``A1`` to ``A7``) moved by so many rad."""
    return tuple(value + axes.get(f"A{axis}", 0.0) for axis, value in enumerate(position, start=1))


__all__ = ["COMMANDER", "MS", "OTHER", "Application", "ServoBench", "offset"]
