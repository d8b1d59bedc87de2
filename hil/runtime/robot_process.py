"""One live robot: its controller, its sockets, its pacing. Supervised by :mod:`hil.runtime.run`."""

import asyncio
import os
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING

from hil.clock import Clock, elapsed_ns, let_others_run, unix_time_ns
from hil.config.station import Overrun, RobotConfig
from hil.core.controller import FRI_LINK, ROBOT_SIDE_LINK, Controller, operator_report
from hil.core.events import DrivesChanged, Event
from hil.core.servo.link import SERVO_LINK
from hil.core.settings import NS_PER_MS
from hil.runtime.assembly import (
    TOKEN_SECRET_BYTES,
    LinkAddresses,
    RobotParts,
    make_controller,
    open_parts,
    tell_first_message,
)
from hil.runtime.capture_header import FirstMessage, RobotStart
from hil.runtime.journal import Recorder, RobotJournal
from hil.runtime.measurements import RunMeasurements
from hil.runtime.pacer import Pacer, Tick, open_pacer
from hil.runtime.peer_pacer import PeerPacer
from hil.runtime.ports import FriPort, Port, RobotSidePort, ServoPort
from hil.values.arm import PeerBackend
from hil.values.errors import BackendError
from hil.values.fri import DriveState
from hil.values.link import Address, Source
from hil.values.operator import OperatorAction
from hil.values.surroundings import Surroundings
from transport.udp import Arrival, open_peer_endpoint, open_server_endpoint

if TYPE_CHECKING:
    from hil.runtime.kst import KstProcess

CATCH_UP_MOST = 20
LATE_NS = 300_000
"""A cycle that begins later than that first reads what arrived meanwhile."""
SOCKET_PASSES = 3
"""Passes of the event loop from a datagram in the kernel to the core: read, queued, taken."""
BELIEVED_WAIT_NS = 1_000_000_000
"""Longest wait in the kernel that is believed."""
_ROBOT_SIDE_IN_USE = "; another FRI client, or another `hil run` with this backend, may serve there"
CLOSING_CYCLES = 3000
"""Cycles an arm gets to brake at the end; the rated braking time is a tenth of that."""


class RobotProcess:
    """Opens in ``open``, runs in ``run`` until ``stop`` was called and the arm rests, releases in ``close``."""

    def __init__(
        self,
        config: RobotConfig,
        *,
        addresses: LinkAddresses,
        clock: Clock,
        tell: Callable[[str, Event], None],
        on_fault: Callable[[], None],
        number: int = 0,
        say: Callable[[str], None] = lambda _line: None,
        surroundings: Surroundings | None = None,
        after_cycle: Callable[[int], None] | None = None,
    ) -> None:
        self.config = config
        self.addresses = addresses
        self.measurements = RunMeasurements()
        self.faulted: str | None = None
        self._clock = clock
        self._tell = tell
        self._journal = RobotJournal(number)
        self._on_fault = on_fault
        self._controller: Controller | None = None
        self._parts: RobotParts | None = None
        self._fri_port: FriPort | None = None
        self._robot_side_pacer: PeerPacer | None = None
        self._first_message: FirstMessage | None = None
        self._say = say
        self._surroundings = surroundings
        self._after_cycle = after_cycle
        """Told how many cycles there were, between each and the next."""
        self._ports: dict[str, Port] = {}
        self._stopping = asyncio.Event()
        self._drives = DriveState.ACTIVE
        self._period_ns = config.cycle_ms * NS_PER_MS
        self._epoch_ns = 0
        self._unix_epoch_ns = 0
        self._token_secret = b""
        self.kst: KstProcess | None = None
        """The KST server beside it, where it has one; whoever runs it tells."""

    @property
    def controller(self) -> Controller:
        """The core; there once :meth:`start` returned."""
        if self._controller is None:
            raise BackendError(f"robot {self.config.name} was not started")
        return self._controller

    @property
    def moves_real_drives(self) -> bool:
        """Whether the robot side does; known once it is open."""
        return self._parts is not None and self._parts.backend.capabilities.moves_real_drives

    def operate(self, action: OperatorAction) -> str:
        """Do what the operator did, now; return why that changes nothing, or an empty text."""
        now_ns = self._clock.now_ns() - self._epoch_ns
        self._journal.operated(action, at_ns=now_ns)
        return self.controller.operate(action, now_ns=now_ns)

    def record_to(self, recorder: Recorder | None) -> None:
        """Tell ``recorder`` everything that the core is told from now on; None: nobody."""
        self._journal.record_to(recorder, unix_epoch_ns=self._unix_epoch_ns)

    def recorded_start(self) -> RobotStart:
        """Return what a replay needs to know of the run, for a recording that begins now."""
        return RobotStart(
            name=self.config.name,
            unix_epoch_ns=self._unix_epoch_ns,
            fri_peer=None if self.addresses.fri is None else self.addresses.fri.peer,
            bound={link: port.local for link, port in self._ports.items()},
            token_secret=self._token_secret.hex(),
            robot_side=self._first_message,
            cycles_before=self.controller.ticks,
        )

    def operator_state(self) -> dict[str, object]:
        """Return what the operator's pad shows; times in seconds of the core's axis."""
        controller = self.controller
        fri, servo, stops = controller.fri, controller.servo, controller.stops
        stop = stops[-1] if stops else None
        return {
            **operator_report(controller.operator),
            "drives": self._drives.name,
            "session": None if fri is None else {"state": fri.state.name, "quality": fri.quality.name},
            "commander": (servo.commander or None) if servo is not None else None,
            "last_stop": None
            if stop is None
            else {
                "at_s": round(stop.at_ns / 1e9, 6),
                "category": None if stop.category is None else stop.category.value,
                "reason": stop.reason,
            },
            "closest": controller.closest,
            "margins": controller.margins,
            "latency": self._latency(),
            "io": controller.signals.report(),
            "time_s": round((self._clock.now_ns() - self._epoch_ns) / 1e9, 3),
            "cycles": controller.ticks,
        }

    def description(self) -> dict[str, object]:
        """Return what stays the same while it runs; ``servo`` is where applications and observers connect to."""
        servo, bound = self.config.servo, self.local_address(SERVO_LINK)
        key_file = None if servo is None or servo.key_file is None else str(servo.key_file.absolute())
        return {
            "model": self.config.model,
            "backend": self.config.backend,
            "cycle_ms": self.config.cycle_ms,
            "servo": None if bound is None else str(bound),
            "servo_key_file": key_file,
            "moves_real_drives": self.moves_real_drives,
        }

    def kst_report(self) -> dict[str, object] | None:
        """Return what the KST server beside it did; None where it has none."""
        return None if self.kst is None else self.kst.report()

    def _latency(self) -> dict[str, float | None]:
        """Return how long the client's last answer took, and how late the last cycle began; ms."""
        fri = self.controller.fri
        used = [] if fri is None else fri.path.used
        return {
            "answer_ms": round(used[-1][1] / 1e6, 4) if used else None,
            "cycle_ms": round(self.measurements.last_lateness_ns / 1e6, 4),
        }

    def local_address(self, link: str) -> Address | None:
        """Return where a link is served from; None for a link this robot has not."""
        port = self._ports.get(link)
        return None if port is None else port.local

    async def open(self) -> None:
        """Bind the sockets, load the models, open the robot side. Raises HilError."""
        fri, servo = self.addresses.fri, self.addresses.servo
        if fri is not None:
            self._fri_port = FriPort(await open_peer_endpoint(bind=fri.bind, peer=fri.peer))
            self._ports[FRI_LINK] = self._fri_port
        if servo is not None:
            self._ports[SERVO_LINK] = ServoPort(await open_server_endpoint(servo))
        self._parts = open_parts(self.config, surroundings=self._surroundings, live=True)
        if isinstance(self._parts.backend, PeerBackend):
            await self._meet_robot_side(self._parts.backend)

    def start(self, *, unix_epoch_ns: int, epoch_ns: int) -> None:
        """Make the controller; its core time 0 is ``epoch_ns`` of the clock, ``unix_epoch_ns`` in Unix time."""
        if self._parts is None:
            raise BackendError(f"robot {self.config.name} is not open")
        self._epoch_ns, self._unix_epoch_ns = epoch_ns, unix_epoch_ns
        self._token_secret = os.urandom(TOKEN_SECRET_BYTES)
        self._controller = make_controller(
            self.config,
            self._parts,
            unix_epoch_ns=unix_epoch_ns,
            fri_peer=None if self.addresses.fri is None else self.addresses.fri.peer,
            token_secret=self._token_secret,
        )

    @property
    def paced_by_robot_side(self) -> bool:
        """Whether the robot side is a network peer whose messages are the cycles, once it is open."""
        return self._parts is not None and isinstance(self._parts.backend, PeerBackend)

    def stop(self) -> None:
        """Ask for the end: the arm brakes, the session closes, then :meth:`run` returns."""
        self._stopping.set()

    async def run(self) -> None:
        """Serve until stopped. A robot side that fails ends the session at once, and is told in ``faulted``."""
        pacer = self._open_pacer()
        try:
            async with asyncio.TaskGroup() as group:
                listeners = self._listen(group)
                try:
                    await self._cycles(pacer)
                except BackendError as error:
                    self._fault(str(error))
                    now_ns = self._clock.now_ns() - self._epoch_ns
                    self._journal.failed(str(error), at_ns=now_ns)
                    self.controller.abandon(now_ns=now_ns)
                    await self._send_outgoing(now_ns)
                for listener in listeners:
                    listener.cancel()
        finally:
            pacer.close()

    def close(self) -> None:
        """Release sockets, robot side and what runs beside it."""
        with ExitStack() as closing:  # from the last line to the first, and all of it, also where one of them raises
            if self._parts is not None:
                closing.callback(self._parts.backend.close)
            for port in self._ports.values():
                closing.callback(port.close)
            if self.kst is not None:
                closing.callback(self.kst.close)

    def report(self) -> dict[str, object]:
        """Return this robot's part of the status file."""
        return {
            "model": self.config.model,
            "backend": self.config.backend,
            "mode": self.config.mode.value,
            **self.measurements.report(),
            **self.controller.report(),
            "fri": self._fri_report(),
            "kst": self.kst_report(),
            "untaken": {link: port.untaken for link, port in self._ports.items()},
            "servo_bound": str(bound) if (bound := self.local_address(SERVO_LINK)) is not None else None,
        }

    def _fri_report(self) -> dict[str, object] | None:
        fri, port = self.config.fri, self._fri_port
        if fri is None or port is None:
            return None
        return {
            "release": fri.release.value,
            "client": str(port.endpoint.peer),
            "bound": str(port.local),
            "send_period_ms": fri.send_period_ms,
            "receive_multiplier": fri.receive_multiplier,
            "refused_by_peer_machine": port.endpoint.refused,
        }

    async def _meet_robot_side(self, backend: PeerBackend) -> None:
        """Wait, for as long as the robot side is given, for the message that says where the arm is."""
        link = backend.link
        port = RobotSidePort(await open_server_endpoint(link.bind, in_use=_ROBOT_SIDE_IN_USE))
        self._ports[ROBOT_SIDE_LINK] = port
        self._say(
            f"{self.config.name}: waiting for the robot side's first message at UDP {port.local}, "
            f"{link.first_message_s:g} s at most"
        )

        def ready(arrival: Arrival) -> bool:
            if tell_first_message(backend, arrival.datagram, arrival.sender):
                return False
            self._first_message = FirstMessage(sender=arrival.sender, datagram=arrival.datagram.hex())
            return True

        await port.wait_until(ready, at_most_s=link.first_message_s, stopped=self._stopping)
        if self._first_message is None:
            raise BackendError(f"{self.config.name}: {backend.not_ready()}")

    def _open_pacer(self) -> Pacer | PeerPacer:
        backend = None if self._parts is None else self._parts.backend
        if not isinstance(backend, PeerBackend):
            return open_pacer(clock=self._clock, first_due_ns=self._epoch_ns, period_ns=self._period_ns)
        self._robot_side_pacer = PeerPacer(
            clock=self._clock,
            first_due_ns=self._epoch_ns,
            period_ns=self._period_ns,
            silence_ns=backend.link.silence_ns,
        )
        return self._robot_side_pacer

    async def _cycles(self, pacer: Pacer | PeerPacer) -> None:
        closing_cycles = 0
        while not self.controller.closed and closing_cycles < CLOSING_CYCLES:
            tick = await pacer.next_tick()
            if tick.missed or tick.lateness_ns > LATE_NS:
                # What came while we were held up is read before anybody is judged by what did not come.
                await let_others_run(SOCKET_PASSES)
            if tick.missed:
                await self._overrun(tick)
            if self._stopping.is_set():
                if not closing_cycles:
                    self._journal.closed(at_ns=tick.due_ns - self._epoch_ns)
                self.controller.close(now_ns=tick.due_ns - self._epoch_ns)
                closing_cycles += 1
            await self._one_cycle(tick.due_ns, tick.lateness_ns)
            for event in self.controller.events():
                if isinstance(event, DrivesChanged):
                    self._drives = event.state
                self._tell(self.config.name, event)
            if self._after_cycle is not None:
                self._after_cycle(self.controller.ticks)

    async def _one_cycle(self, due_ns: int, lateness_ns: int) -> None:
        before_ns = elapsed_ns()
        self.controller.tick(now_ns=due_ns - self._epoch_ns, lateness_ns=lateness_ns)
        departed_ns = self._clock.now_ns() - self._epoch_ns
        self._journal.ticked(due_ns=due_ns - self._epoch_ns, lateness_ns=lateness_ns, departed_ns=departed_ns)
        await self._send_outgoing(departed_ns)
        self.measurements.ticked(
            began_ns=due_ns + lateness_ns, lateness_ns=lateness_ns, cost_ns=elapsed_ns() - before_ns
        )

    async def _overrun(self, tick: Tick) -> None:
        self.measurements.missed(tick.missed)
        own_time = self._robot_side_pacer is not None or self.moves_real_drives
        if own_time and self.config.overrun is not Overrun.FAULT:
            # What the robot side was not told in time it is not told at all: its own time has gone on.
            return
        match self.config.overrun:
            case Overrun.SKIP:
                return
            case Overrun.FAULT:
                self._fault(f"{tick.missed} control cycles were missed, and the overrun policy is fault")
            case Overrun.CATCH_UP:
                for back in range(min(tick.missed, CATCH_UP_MOST), 0, -1):
                    due_ns = tick.due_ns - back * self._period_ns
                    await self._one_cycle(due_ns, self._clock.now_ns() - due_ns)
                    await let_others_run(SOCKET_PASSES)

    def _fault(self, reason: str) -> None:
        if self.faulted is None:
            self.faulted = f"{self.config.name}: {reason}"
        self._on_fault()

    async def _send_outgoing(self, now_ns: int) -> None:
        for datagram in self.controller.outgoing(now_ns=now_ns):
            port = self._ports.get(datagram.link)
            if port is None:
                continue
            destination = await port.send(datagram)
            # The time the core was told, not a later one: a replay must be able to tell it the same.
            self._journal.sent(datagram.payload, port.local, destination, at_ns=now_ns)

    def _listen(self, group: asyncio.TaskGroup) -> list[asyncio.Task[None]]:
        name = self.config.name
        return [task for port in self._ports.values() for task in port.listen(group, self._receive, robot=name)]

    def _receive(self, arrival: Arrival, source: Source) -> None:
        before_ns = elapsed_ns()
        waited_ns = 0 if arrival.at_unix_ns is None else unix_time_ns() - arrival.at_unix_ns
        # A clock that was set meanwhile, or a driver that makes up stamps, must not make answers timeless.
        if not 0 <= waited_ns <= BELIEVED_WAIT_NS:
            waited_ns = 0
        # What came before time 0, and waited, came at it: there is nothing before.
        now_ns = max(0, self._clock.now_ns() - self._epoch_ns - waited_ns)
        if self.controller.receive(arrival.datagram, source, now_ns=now_ns) and self._robot_side_pacer is not None:
            self._robot_side_pacer.message(at_ns=now_ns + self._epoch_ns)
        self._journal.received(arrival.datagram, source.address, self._ports[source.link].local, at_ns=now_ns)
        self.measurements.between_ticks(elapsed_ns() - before_ns)
