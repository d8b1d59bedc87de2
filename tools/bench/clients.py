"""The clients of ``hil bench cycle``: what each sends for each cycle of a controller."""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import Final, Protocol, TypeAlias

from apps.fri_joint_sine import JointSine
from apps.fri_torque_sine import TorqueSine
from apps.fri_wrench_sine import WrenchSine
from hil.client.fri import ClientSession, FriHandler
from hil.config.control import ControlName
from hil.config.station import FriConfig, RobotConfig
from hil.core.controller import FRI_LINK, Controller
from hil.core.servo.link import SERVO_LINK
from hil.values.errors import ConfigurationError
from hil.values.fri import OverlayKind, SessionState
from hil.values.link import Address, Outgoing, Source
from hil.values.motion import MotionKind, MotionParameters
from hil.values.servo import (
    PROTOCOL_VERSION,
    Command,
    FromClient,
    Hello,
    Request,
    Role,
    SetDestination,
    StartMotion,
    State,
    Welcome,
)
from transport.servo import ServoCodec

PEER = Address("127.0.0.1", 30200)
_APPLICATION = Address("127.0.0.1", 40000)
_AMPLITUDE_RAD = 0.04
_FREQUENCY_HZ = 0.25
Datagrams: TypeAlias = tuple[tuple[Source, bytes], ...]


class BenchMotion(StrEnum):
    """What moves the arm meanwhile."""

    FRI_OVERLAY = "fri-overlay"
    SMART_SERVO = "smart-servo"
    DIRECT_SERVO = "direct-servo"


class RecordedClient(Protocol):
    """A client in virtual time."""

    def answer(self, outgoing: Sequence[Outgoing]) -> Datagrams:
        """Return what it sends for what the controller sent in a cycle."""

    def check(self, controller: Controller) -> None:
        """Raise :class:`ConfigurationError` unless the arm is moved as it should be."""


def recorded_client(config: RobotConfig, motion: BenchMotion) -> RecordedClient:
    """Return the client that moves the arm by ``motion``."""
    if motion is BenchMotion.FRI_OVERLAY:
        if config.fri is None:
            raise ConfigurationError("the FRI overlay needs an FRI link")
        return _FriSine(config.fri)
    kind = MotionKind.SMART_SERVO if motion is BenchMotion.SMART_SERVO else MotionKind.DIRECT_SERVO
    return _ServoSine(kind, state_period_ms=config.cycle_ms)


OVERLAY_UNDER: Final = {
    ControlName.POSITION: OverlayKind.JOINT_POSITION,
    ControlName.JOINT_IMPEDANCE: OverlayKind.TORQUE,
    ControlName.CARTESIAN_IMPEDANCE: OverlayKind.WRENCH,
}
"""What is laid over the hold under each control mode: what needs that mode."""
_SINES: Final[dict[OverlayKind, type[FriHandler]]] = {
    OverlayKind.JOINT_POSITION: JointSine,
    OverlayKind.TORQUE: TorqueSine,
    OverlayKind.WRENCH: WrenchSine,
}


class _FriSine:
    """The FRI sine of an overlay; one answer a cycle."""

    def __init__(self, fri: FriConfig) -> None:
        self._session = ClientSession(fri.release, _SINES[fri.overlay]())

    def answer(self, outgoing: Sequence[Outgoing]) -> Datagrams:
        answers = [self._session.receive(datagram.payload) for datagram in outgoing if datagram.link == FRI_LINK]
        return tuple((Source(FRI_LINK, PEER), answer) for answer in answers if answer is not None)

    def check(self, controller: Controller) -> None:
        if controller.fri is None or controller.fri.state is not SessionState.COMMANDING_ACTIVE:
            raise ConfigurationError("the benchmark did not reach COMMANDING_ACTIVE; use a send period of one cycle")


class _ServoSine:
    """An application that sets a new destination each cycle: a sine on A4. States come each cycle too."""

    def __init__(self, kind: MotionKind, *, state_period_ms: int) -> None:
        self._kind = kind
        self._state_period_ms = state_period_ms
        self._codec = ServoCodec()
        self._token = 0
        self._sequence = 0
        self._state_sequence = 0
        self._reports_seen = 0
        self._start: tuple[float, ...] = ()

    def answer(self, outgoing: Sequence[Outgoing]) -> Datagrams:
        packets = [self._codec.decode_from_controller(out.payload) for out in outgoing if out.link == SERVO_LINK]
        if not self._token and not packets:
            return self._say(Hello(PROTOCOL_VERSION, 1, Role.COMMANDER, 1000, self._state_period_ms, "bench"))
        for packet in packets:
            if isinstance(packet, Welcome):
                self._token = packet.token
            elif isinstance(packet, State):
                self._state_sequence = packet.sequence
                self._start = self._start or packet.snapshot.measured_position
                self._reports_seen = max([self._reports_seen, *(report.number for report in packet.reports)])
        self._sequence += 1
        requests: tuple[Request, ...] = ()
        if self._sequence == 1:
            requests = (StartMotion(1, self._kind, MotionParameters(), None),)
        elif self._start:
            requests = (SetDestination(self._sequence, 1, self._destination()),)
        return self._say(
            Command(self._token, self._sequence, self._state_sequence, self._reports_seen, requests=requests)
        )

    def check(self, controller: Controller) -> None:
        active = controller.motion.applications.active
        if active is None or active.motion.kind is not self._kind or controller.stops:
            raise ConfigurationError(f"the benchmark's {self._kind.name} does not run: {list(controller.stops)}")

    def _destination(self) -> tuple[float, ...]:
        swing_rad = _AMPLITUDE_RAD * math.sin(2 * math.pi * _FREQUENCY_HZ * self._sequence * 1e-3)
        return (*self._start[:3], self._start[3] + swing_rad, *self._start[4:])

    def _say(self, packet: FromClient) -> Datagrams:
        return ((Source(SERVO_LINK, _APPLICATION), self._codec.encode_from_client(packet)),)
