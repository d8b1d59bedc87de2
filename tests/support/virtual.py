"""A controller and a client of our own making, in virtual time and one thread: the bench every core test stands on."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from backends.base import InProcessBackend
from backends.ideal import IdealBackend
from backends.robots import load_description, load_pinocchio
from hil.core.controller import FRI_LINK, Controller
from hil.core.events import Event
from hil.core.model import ArmModel
from hil.core.settings import ControllerSettings, FriSettings, SafetySettings
from hil.values.arm import JointCommand
from hil.values.fri import OperationMode, Release, SessionState
from hil.values.fri_messages import CommandData, CommandMessage, MonitoringMessage
from hil.values.link import Address, Source
from hil.values.operator import PadKey, Press, SelectMode
from hil.values.outcomes import Outcome
from hil.values.robot import RobotDescription
from hil.values.signals import Signal
from transport.fri import FriCodec

PEER = Address("127.0.0.1", 30200)
SOURCE = Source(FRI_LINK, PEER)
MS = 1_000_000
UNIX_EPOCH_NS = 1_795_322_390 * 10**9


class RecordingBackend(IdealBackend):
    """The ideal arm, which also remembers every command it was given."""

    def __init__(self, description: RobotDescription) -> None:
        super().__init__(description)
        self.commands: list[JointCommand] = []

    def _write(self, command: JointCommand) -> None:
        self.commands.append(command)
        super()._write(command)


@dataclass
class Client:
    """Answers like the vendor's joint sine, which begins anew in each session; every knob makes it misbehave."""

    codec: FriCodec
    amplitude_rad: float = 0.04
    frequency_hz: float = 0.25
    delay_ns: int = 200_000
    answers: Callable[[int], bool] = lambda _: True
    change: Callable[[CommandMessage, MonitoringMessage], CommandMessage] = lambda command, _: command
    sequence: int = 0
    received: int = 0
    states: list[SessionState] = field(default_factory=list)
    heard: deque[bytes] = field(default_factory=lambda: deque(maxlen=5000))
    said: deque[bytes] = field(default_factory=lambda: deque(maxlen=5000))
    phase: float = 0.0
    offset: float = 0.0

    def answer(self, datagram: bytes) -> bytes | None:
        """Return the answer to a monitoring message, or None."""
        self.heard.append(datagram)
        message = self.codec.decode_monitoring(datagram)
        connection = message.connection
        assert connection is not None
        assert message.monitor is not None
        state = SessionState(connection.session_state)
        if not self.states or self.states[-1] is not state:
            self.states.append(state)
            self.phase = self.offset = 0.0
        self.received += 1
        multiplier = connection.receive_multiplier or 1
        if state is SessionState.IDLE or self.received % multiplier or not self.answers(self.received):
            return None
        data = None
        if message.ipo is not None and message.ipo.position is not None:
            position = list(message.ipo.position)
            if state is SessionState.COMMANDING_ACTIVE:
                self.offset = 0.99 * self.offset + 0.01 * self.amplitude_rad * math.sin(self.phase)
                self.phase += 2 * math.pi * self.frequency_hz * (connection.send_period_ms or 0) * 1e-3 * multiplier
                position[3] += self.offset
            data = CommandData(position=tuple(position))
        elif message.monitor.commanded_position is not None:
            data = CommandData(position=message.monitor.commanded_position)
        command = self.change(CommandMessage(self.sequence, message.sequence_counter, data), message)
        self.sequence = (self.sequence + 1) % 2**32
        self.said.append(self.codec.encode_command(command))
        return self.said[-1]


class Bench:
    """Ticks a controller and carries datagrams to and from its client."""

    def __init__(
        self,
        release: Release = Release.V1_15,
        *,
        robot: str = "lbr-iiwa-14-r820",
        backend: Callable[[RobotDescription], InProcessBackend] = RecordingBackend,
        mode: OperationMode = OperationMode.AUT,
        enabled: bool = True,
        safety: SafetySettings | None = None,
        cycle_ms: int = 1,
        fri: FriSettings | None = None,
        signals: tuple[Signal, ...] = (),
    ) -> None:
        description = load_description(robot)
        self.description = description
        self.backend = backend(description)
        self.settings = ControllerSettings(
            operation_mode=mode,
            cycle_ms=cycle_ms,
            unix_epoch_ns=UNIX_EPOCH_NS,
            fri=fri or FriSettings(peer=PEER),
            safety=safety or SafetySettings(),
            enabled=enabled,
            signals=signals,
        )
        self.backend.open(period_ns=self.settings.cycle_ns)
        self.codec = FriCodec(release)
        self.controller = Controller(
            self.settings,
            description=description,
            model=ArmModel(load_pinocchio(robot)),
            backend=self.backend,
            codec=self.codec,
        )
        self.client = Client(self.codec)
        self.now_ns = -self.settings.cycle_ns
        self.events: list[Event] = []
        self.monitoring: list[MonitoringMessage] = []
        self.keep_messages = False
        self.lateness_ns = 0
        self._on_the_way: list[tuple[int, bytes]] = []

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

    def run_until(self, state: SessionState, *, at_most_s: float = 10.0) -> None:
        """Let time pass until the session is in ``state``; fail if that does not happen."""
        for _ in range(round(at_most_s * 1e9) // self.settings.cycle_ns):
            self.cycle()
            if self.state is state:
                return
        raise AssertionError(f"{state.name} not reached in {at_most_s} s: {self.report()['session']}")

    def cycle(self) -> None:
        """One control cycle, with the answers that arrive before it."""
        self.now_ns += self.settings.cycle_ns
        due = [item for item in self._on_the_way if item[0] <= self.now_ns]
        self._on_the_way = [item for item in self._on_the_way if item[0] > self.now_ns]
        for at_ns, payload in sorted(due, key=lambda item: item[0]):
            self.controller.receive(payload, SOURCE, now_ns=at_ns)
        self.controller.tick(now_ns=self.now_ns, lateness_ns=self.lateness_ns)
        for datagram in self.controller.outgoing():
            if self.keep_messages:
                self.monitoring.append(self.codec.decode_monitoring(datagram.payload))
            answer = self.client.answer(datagram.payload)
            if answer is not None:
                self._on_the_way.append((self.now_ns + self.client.delay_ns, answer))
        self.events += self.controller.events()

    def inject(self, payload: bytes, source: Source = SOURCE) -> None:
        """Hand the core a datagram now."""
        self.controller.receive(payload, source, now_ns=self.now_ns)

    @property
    def state(self) -> SessionState:
        """Session state."""
        assert self.controller.fri is not None
        return self.controller.fri.state

    def dropped(self, outcome: Outcome) -> int:
        """How often a drop was counted."""
        assert self.controller.fri is not None
        return self.controller.fri.counters.by_outcome[outcome]

    def report(self) -> dict[str, object]:
        """The core's part of the status file."""
        return self.controller.report()

    def reasons(self) -> list[str]:
        """Reasons of all stops."""
        return [stop.reason for stop in self.controller.stops]
