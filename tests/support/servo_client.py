"""The client's session in virtual time: joined to the stand-in controller by channels that may lose datagrams."""

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from hil.client.servo import Role, SmartServo
from hil.client.servo import _operations as operations
from hil.client.servo._operations import Operation, Wait
from hil.client.servo.session import ServoSession, SessionPhase
from hil.values.link import Address
from hil.values.servo import Command, FromController, Report, SetDestination
from tests.support.servo_controller import START, StandIn
from transport.servo import ServoCodec

CODEC = ServoCodec()
ADDRESS = Address("127.0.0.1", 30300)
NONCE = 77
KEEP_ALIVE_TICKS = 60
_T = TypeVar("_T")


class RecordingSession(ServoSession):
    """A session that remembers the reports it took."""

    def __init__(self, nonce: int = NONCE) -> None:
        super().__init__(CODEC, role=Role.COMMANDER, watchdog_ms=300, state_period_ms=5, name="a test", nonce=nonce)
        self.taken: list[Report] = []

    def _take_report(self, report: Report) -> None:
        self.taken.append(report)
        super()._take_report(report)


@dataclass
class Channel:
    """Loses, repeats and delays datagrams, and does so again the same way for the same seed."""

    seed: int
    loss: float = 0.3
    repeats: float = 0.2
    longest_delay: int = 6
    """In ticks; datagrams with different delays overtake each other."""
    _now: int = 0
    _flying: list[tuple[int, int, bytes]] = field(default_factory=list)
    _random: random.Random = field(init=False)

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def put(self, datagram: bytes) -> None:
        """Send a datagram on its way."""
        for _ in range(2 if self._random.random() < self.repeats else 1):
            if self._random.random() >= self.loss:
                arrival = self._now + self._random.randint(0, self.longest_delay)
                self._flying.append((arrival, len(self._flying), datagram))

    def get(self) -> list[bytes]:
        """Let a tick pass and return what arrives."""
        arrived = sorted(flying for flying in self._flying if flying[0] <= self._now)
        self._flying = [flying for flying in self._flying if flying[0] > self._now]
        self._now += 1
        return [datagram for _, _, datagram in arrived]


def perfect() -> Channel:
    return Channel(0, loss=0.0, repeats=0.0, longest_delay=0)


class VirtualShell:
    """Runs operations in virtual time, a millisecond a tick."""

    def __init__(self, there: Channel | None = None, back: Channel | None = None) -> None:
        self.session = RecordingSession()
        self.controller = StandIn(CODEC)
        self.there, self.back = there or perfect(), back or perfect()
        self.ticks = 0
        self.at: dict[int, Callable[[], None]] = {}
        """What happens at a tick."""
        self._silent_ticks = 0

    def tick(self) -> None:
        """A millisecond."""
        self.ticks += 1
        self.at.get(self.ticks, lambda: None)()
        self._silent_ticks += 1
        if self._silent_ticks >= KEEP_ALIVE_TICKS:
            self.session.keep_alive()
        datagram = self.session.outgoing()
        if datagram is not None:
            self._silent_ticks = 0
            self.there.put(datagram)
        for arrived in self.there.get():
            self.controller.receive(arrived)
        self.controller.tick()
        for sent in self.controller.fetch():
            self.back.put(sent)
        for arrived in self.back.get():
            self.session.receive(arrived)

    def run(self, operation: Operation[_T]) -> _T:
        """Run an operation to its end."""
        try:
            wait = next(operation)
            while True:
                wait = operation.send(self.wait(wait))
        except StopIteration as stop:
            result: _T = stop.value
            return result

    def wait(self, wait: Wait) -> bool:
        """Let time pass until the wait is over."""
        ends = None if wait.timeout_s is None else self.ticks + wait.timeout_s * 1000
        while not wait.until():
            if ends is not None and self.ticks >= ends:
                return False
            self.tick()
        return True

    def until(self, condition: Callable[[], bool]) -> None:
        """Let time pass until ``condition`` holds; fail if that takes a minute."""
        assert self.wait(Wait(condition, 60.0))

    def connect(self) -> None:
        """Begin the session."""
        self.run(operations.connect(self.session, controller=ADDRESS, timeout_s=5.0))

    def start(self) -> SmartServo:
        """Start a SmartServo."""
        motion = SmartServo()
        self.run(operations.start(self.session, motion))
        return motion


def connected() -> VirtualShell:
    shell = VirtualShell()
    shell.connect()
    return shell


def sent(session: ServoSession) -> Command:
    """Return the command the session sends now; fail if it sends none."""
    datagram = session.outgoing()
    assert datagram is not None
    packet = CODEC.decode_from_client(datagram)
    assert isinstance(packet, Command)
    return packet


def phase_of(session: ServoSession) -> SessionPhase:
    return session.phase


def tell(session: ServoSession, packet: FromController) -> None:
    session.receive(CODEC.encode_from_controller(packet))


def destination(motion: int, value: float) -> Callable[[int], SetDestination]:
    return lambda number: SetDestination(number, motion, (value, *START[1:]))
