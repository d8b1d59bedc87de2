"""Virtual time: one controller, the network, and the sockets of the application, in one thread.

Time passes only while somebody waits: the application in a call of its client, in ``time.sleep`` or in its event loop,
or the test. Then datagrams arrive and control cycles run, each at its time; nothing depends on how fast the machine is.
"""

import math
import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

from hil.client._machine import DatagramSocket
from hil.client.servo._link import Link
from hil.config.station import RobotConfig
from hil.core.controller import FRI_LINK
from hil.core.events import Event
from hil.core.servo.link import SERVO_LINK
from hil.core.settings import NS_PER_MS
from hil.runtime.assembly import link_addresses, make_controller, open_parts
from hil.runtime.file_recorder import FileRecorder, record_one_robot
from hil.runtime.journal import RobotJournal
from hil.testkit._network import Arrived, VirtualNetwork
from hil.testkit._pump import VirtualPump
from hil.testkit._schedule import Order, Schedule
from hil.testkit._sockets import VirtualSocket
from hil.testkit.errors import VirtualTimeOver
from hil.values.errors import EndpointError, UsageError
from hil.values.link import Address, Outgoing, Source
from hil.values.operator import OperatorAction
from hil.values.robot import Seven
from transport.impairment import Direction
from transport.udp import ANY_HOST

UNIX_EPOCH_NS: Final = 1_767_225_600 * 10**9
"""Unix time of time 0: 2026-01-01, in every run."""
LATENCY_NS: Final = 100_000
"""Of the perfect network, one way: about what a loopback interface and two processes take."""
MOST_EVENTS: Final = 10_000
_TOKEN_SECRET: Final = bytes(range(32))
_FIRST_PORT: Final = 40_001
_FRI_BOUND_PORT: Final = 30_210
"""Where a recording has the controller's end of FRI, unless the station says."""

Route: TypeAlias = "Source | VirtualSocket"
"""Where a datagram goes: to the controller, from a source; or to a socket."""


class WorldClock(NamedTuple):
    """The world's time as a :class:`hil.clock.Clock`."""

    world: "World"

    def now_ns(self) -> int:
        """Return the present time."""
        return self.world.now_ns


class World:
    """The controller of ``config``, and everything the application meets. Also a :class:`hil.client._machine.Machine`.

    Raises :class:`VirtualTimeOver` in whoever waits longer than ``limit_s`` allows. Of one thread.
    """

    def __init__(
        self,
        config: RobotConfig,
        *,
        limit_s: float,
        capture: Path | None = None,
        initial_position_rad: Seven | None = None,
    ) -> None:
        addresses = link_addresses(config)
        self.config = config
        self.parts = open_parts(config, initial_position_rad=initial_position_rad)
        self.core = make_controller(
            config,
            self.parts,
            unix_epoch_ns=UNIX_EPOCH_NS,
            fri_peer=None if addresses.fri is None else addresses.fri.peer,
            token_secret=_TOKEN_SECRET,
        )
        self.now_ns = 0
        self.network: VirtualNetwork[Route] = VirtualNetwork(latency_ns=LATENCY_NS, seed=config.seed)
        self.events: deque[Event] = deque(maxlen=MOST_EVENTS)
        self.orders = Schedule()
        self.in_virtual_loop = False
        self.fri_peer = None if addresses.fri is None else addresses.fri.peer
        self.servo_address = addresses.servo
        self.journal = RobotJournal(0)
        self._bound: dict[str, Address] = {}
        if addresses.fri is not None:
            self._bound[FRI_LINK] = addresses.fri.bind._replace(port=addresses.fri.bind.port or _FRI_BOUND_PORT)
        if addresses.servo is not None:
            self._bound[SERVO_LINK] = addresses.servo
        self._recorder: FileRecorder | None = None
        if capture is not None:
            self._recorder = record_one_robot(
                self.journal,
                capture,
                config,
                unix_epoch_ns=UNIX_EPOCH_NS,
                fri_peer=self.fri_peer,
                bound=self._bound,
                token_secret=_TOKEN_SECRET,
            )
        self._cycle_ns = config.cycle_ms * NS_PER_MS
        self._next_cycle_ns = 0
        self._limit_ns = math.ceil(limit_s * 1e9)
        self._sockets: dict[tuple[str, Address], VirtualSocket] = {}
        self._services: list[Callable[[], None]] = []
        self._numbers = 0
        self._thread = threading.get_ident()
        self._at_work = ""
        """What runs that may not wait; empty when waiting is fine."""

    def pass_ns(self, duration_ns: int) -> None:
        """Let so much time pass."""
        self.wait(_never, until_ns=self.now_ns + duration_ns)

    def wait(self, condition: Callable[[], bool], *, until_ns: int | None) -> bool:
        """Let time pass until ``condition`` holds, and return True; False when ``until_ns`` comes before."""
        self._check_may_wait()
        while not condition():
            if until_ns is not None and self.now_ns >= until_ns:
                return False
            self._next(until_ns)
        return True

    def in_its_thread(self) -> bool:
        """Whether the caller is in the thread that time passes in."""
        return threading.get_ident() == self._thread

    def may_wait(self) -> bool:
        """Whether the caller may let time pass."""
        return not self._at_work and self.in_its_thread() and self.now_ns <= self._limit_ns

    def serve(self, service: Callable[[], None]) -> None:
        """Call ``service`` after everything that happens, until :meth:`leave`. It may wait."""
        self._services.append(service)

    def leave(self, service: Callable[[], None]) -> None:
        """Call it no more."""
        self._services.remove(service)

    def order(self, order: Order) -> None:
        """Carry out ``order`` when it is due."""
        self.orders.waiting.append(order)

    def bind(self, address: Address, *, controller: str | None) -> DatagramSocket:
        """Return the socket of an FRI client."""
        self._check_may_wait()
        peer = Address("127.0.0.1" if controller is None else controller.rpartition(":")[0] or controller, address.port)
        if address.port == 0:
            address = address._replace(port=_FIRST_PORT + self._numbers)
        everywhere = "127.0.0.1" if self.fri_peer is None else self.fri_peer.host
        local = Address(everywhere if address.host == ANY_HOST else address.host, address.port)
        if any(link == FRI_LINK and at.port == address.port for link, at in self._sockets):
            raise EndpointError(f"UDP port {address.port} is in use by another FRI client of this test")
        return self._open(FRI_LINK, local, peer, connected=controller is not None)

    def connect(self, controller: Address) -> VirtualSocket:
        """Return the socket of a servo client."""
        self._check_may_wait()
        return self._open(SERVO_LINK, Address("127.0.0.1", _FIRST_PORT + self._numbers), controller, connected=True)

    def pump(self, link: Link, controller: Address) -> VirtualPump:
        """Return the pump of a blocking servo client."""
        return VirtualPump(self, link, self.connect(controller))

    def random_bits(self, count: int) -> int:
        """Return another number each time, the same ones in each run."""
        self._numbers += 1
        return self._numbers % (1 << count)

    def socket_of(self, number: int) -> VirtualSocket | None:
        """Return the open socket with that file number."""
        return next((sock for sock in self._sockets.values() if sock.number == number), None)

    def forget(self, sock: VirtualSocket) -> None:
        """A socket was closed."""
        self._sockets = {at: other for at, other in self._sockets.items() if other is not sock}

    def close(self) -> None:
        """Release everything."""
        for sock in list(self._sockets.values()):
            sock.close()
        self._services.clear()
        self.parts.backend.close()
        if self._recorder is not None:
            self._recorder.close()
            self._recorder = None

    def operate(self, action: OperatorAction) -> str:
        """Do what the operator does, now; return why that changes nothing, or an empty text."""
        self.journal.operated(action, at_ns=self.now_ns)
        return self.core.operate(action, now_ns=self.now_ns)

    def shut_down(self) -> None:
        """Ask the controller to end."""
        self.journal.closed(at_ns=self.now_ns)
        self.core.close(now_ns=self.now_ns)

    def _open(self, link: str, local: Address, peer: Address, *, connected: bool) -> VirtualSocket:
        self._numbers += 1

        def send(sock: VirtualSocket, datagram: bytes) -> None:
            # A controller elsewhere, or a link this one has not: nobody is there.
            if link == FRI_LINK or (self.servo_address is not None and peer.port == self.servo_address.port):
                source = Source(link, sock.local)
                self.network.send(datagram, Direction.TO_CONTROLLER, source, now_ns=self.now_ns)

        sock = VirtualSocket(self, self._numbers, local=local, peer=peer, connected=connected, send=send)
        self._sockets[link, local] = sock
        return sock

    def _next(self, until_ns: int | None) -> None:
        """Go to what happens next, at ``until_ns`` at the latest."""
        arrival_ns = self.network.next_due_ns()
        cycle_ns = self._next_cycle_ns
        at_ns = cycle_ns if arrival_ns is None else min(cycle_ns, arrival_ns)
        if until_ns is not None and until_ns < at_ns:
            self.now_ns = until_ns
        else:
            self.now_ns = max(self.now_ns, at_ns)
            if self.now_ns > self._limit_ns:
                raise VirtualTimeOver(self._limit_ns, list(self.events))
            if arrival_ns is not None and arrival_ns <= self.now_ns:
                self.network.deliver(self._take, now_ns=self.now_ns)
            else:
                self._cycle()
        for service in tuple(self._services):
            if service in self._services:
                service()

    def _cycle(self) -> None:
        now_ns, core = self._next_cycle_ns, self.core
        self._next_cycle_ns += self._cycle_ns
        self._carry_out()
        core.tick(now_ns=now_ns)
        self.journal.ticked(due_ns=now_ns, lateness_ns=0, departed_ns=now_ns)
        for outgoing in core.outgoing(now_ns=now_ns):
            link, destination = self._destination(outgoing)
            self.journal.sent(outgoing.payload, self._bound[link], destination, at_ns=now_ns)
            sock = self._sockets.get((link, destination))
            # What nobody hears is no packet of the application's, and no fault should be spent on it.
            if sock is not None:
                self.network.send(outgoing.payload, Direction.TO_PEER, sock, now_ns=now_ns)
        self.events += core.events()

    def _destination(self, outgoing: Outgoing) -> tuple[str, Address]:
        address = outgoing.destination if outgoing.link == SERVO_LINK else self.fri_peer
        return outgoing.link, Address("", 0) if address is None else address

    def _take(self, _direction: Direction, arrived: Arrived[Route]) -> None:
        route = arrived.route
        if isinstance(route, Source):
            self.core.receive(arrived.datagram, route, now_ns=arrived.at_ns)
            self.journal.received(arrived.datagram, route.address, self._bound[route.link], at_ns=arrived.at_ns)
        elif not route.closed:
            route.put(arrived.datagram)

    def _carry_out(self) -> None:
        if self.orders.waiting:
            before, self._at_work = self._at_work, "an action or a condition of after() or when()"
            try:
                self.orders.carry_out(now_ns=self.now_ns)
            finally:
                self._at_work = before

    def _check_may_wait(self) -> None:
        if not self.in_its_thread():
            raise UsageError(
                "virtual time passes in one thread, that of the test; an application with threads of its own is "
                "tested against a controller process: hil_process"
            )
        if self._at_work:
            raise UsageError(f"{self._at_work} cannot wait, nor let time pass: do so in the test, or in another action")


def _never() -> bool:
    return False
