"""An application in virtual time: a controller and a session of the servo link, joined without a network."""

from collections.abc import Callable
from types import TracebackType
from typing import Self

from hil.client.servo.session import ServoSession
from hil.config.station import RobotConfig
from hil.core.controller import Controller
from hil.core.servo.link import SERVO_LINK
from hil.runtime.assembly import make_controller, open_parts
from hil.values.arm import ArmState
from hil.values.errors import ConfigurationError
from hil.values.link import Address, Source
from hil.values.servo import Request, RequestDone, RequestError, Role, Snapshot
from transport.servo import ServoCodec

_APPLICATION = Source(SERVO_LINK, Address("127.0.0.1", 40000))


class VirtualApplication:
    """Commands the arm of ``config`` as fast as the machine can; a context manager that opens the robot side."""

    def __init__(self, config: RobotConfig) -> None:
        self._parts = open_parts(config)
        self.controller: Controller = make_controller(
            config, self._parts, unix_epoch_ns=0, fri_peer=None, token_secret=b"virtual"
        )
        self._period_ns = config.cycle_ms * 1_000_000
        self.now_ns = -self._period_ns
        self._session = ServoSession(
            ServoCodec(), role=Role.COMMANDER, watchdog_ms=1000, state_period_ms=config.cycle_ms, name="bench", nonce=1
        )
        self._session.knock()
        while not self._session.running:
            self.cycle()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._parts.backend.close()

    @property
    def arm(self) -> ArmState:
        """What the robot side measures now."""
        return self._parts.backend.read()

    @property
    def snapshot(self) -> Snapshot:
        """The latest state packet's."""
        if self._session.snapshot is None:
            raise ConfigurationError("no state packet came yet")
        return self._session.snapshot

    def ask(self, make: Callable[[int], Request]) -> RequestDone:
        """Ask for the request ``make`` returns for its number; raise if it is refused."""
        pending = self._session.ask(make)
        while pending.done is None:
            self.cycle()
        if pending.done.error is not RequestError.NONE:
            raise ConfigurationError(f"the controller refused: {pending.done.reason} {pending.done.detail}")
        return pending.done

    def run(self, seconds: float) -> None:
        """Let time pass."""
        for _ in range(round(seconds * 1e9) // self._period_ns):
            self.cycle()

    def cycle(self) -> None:
        """One control cycle; what the application says arrives a tenth of a millisecond before it."""
        self.now_ns += self._period_ns
        if (datagram := self._session.outgoing()) is not None:
            self.controller.receive(datagram, _APPLICATION, now_ns=max(0, self.now_ns - 100_000))
        self.controller.tick(now_ns=self.now_ns)
        self.controller.events()
        for out in self.controller.outgoing():
            self._session.receive(out.payload)
        if self.controller.ticks % 100 == 0:
            self._session.keep_alive()
