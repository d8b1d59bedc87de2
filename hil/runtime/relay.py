"""Datagrams between two real processes, through a network with faults."""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass
from typing import Final, cast

from hil.clock import Clock
from hil.core.statistics import Histogram
from hil.runtime.alarm import open_alarm
from hil.values.errors import ConfigurationError, EndpointError
from hil.values.link import Address
from transport.impairment import Delivery, Direction, Network
from transport.udp import Arrival, ServerEndpoint, default_bind, open_server_endpoint

MOST_SOURCES: Final = 64
"""So many speakers have a forwarding socket of their own at the same time."""
SILENT_NS: Final = 1_000_000_000
"""Who says nothing for so long may lose its forwarding socket to a new speaker."""
_TAKEN: Final = "; another program holds that port: choose another address"


@dataclass(slots=True)
class Line:
    """A speaker and the socket that speaks for it."""

    source: Address
    """Who spoke; answers go there. A new speaker takes the place of one who fell silent, where there is no other."""
    endpoint: ServerEndpoint
    heard_ns: int
    forwarded: int = 0
    answered: int = 0


class Relay:
    """Stands at ``listen`` for ``to``: what somebody sends there goes on to ``to``, its answers back to who spoke.

    What goes to ``to`` goes ``towards`` it in the network. ``forward_from`` is the address it is sent from; with a port
    there is one speaker at a time. The time of the network begins with the first datagram. Make it with
    :func:`open_relay`, run it, close it.
    """

    def __init__(
        self,
        network: Network,
        *,
        front: ServerEndpoint,
        fixed: ServerEndpoint | None,
        forward_from: Address,
        to: Address,
        towards: Direction,
        clock: Clock,
    ) -> None:
        self.network = network
        self.lateness = Histogram()
        """How much later than the network says a datagram was sent on."""
        self.turned_away = 0
        """Datagrams of speakers for whom there was no socket left."""
        self.strangers = 0
        """Datagrams for a forwarding socket that did not come from where we send to."""
        self.delivered = dict.fromkeys(Direction, 0)
        self.fault: str | None = None
        self.local = front.local
        """Where it listens."""
        self.forwards_from = forward_from
        """Where it sends from; port 0: from a free port for each speaker."""
        self._front, self._fixed, self._to = front, fixed, to
        self._towards = towards
        self._back = next(direction for direction in Direction if direction is not towards)
        self._clock = clock
        self._epoch_ns: int | None = None
        self._lines: dict[Address, Line] = {}
        self._stopped = asyncio.Event()
        self._alarm = open_alarm(clock)
        self._group = asyncio.TaskGroup()
        self._tasks: list[asyncio.Task[None]] = []

    @property
    def lines(self) -> list[Line]:
        """The speakers that have a socket."""
        return list(self._lines.values())

    @property
    def refused(self) -> int:
        """Datagrams that were answered with "nobody listens there" (ICMP), which is counted, not passed on."""
        return self._front.refused + sum(line.endpoint.refused for line in self._lines.values())

    async def run(self) -> None:
        """Pass datagrams on until :meth:`stop`."""
        async with self._group:
            self._start(self._take_all(self._front, self._speaker_sent), "speakers")
            self._start(self._deliver(), "delivery")
            await self._stopped.wait()
            for task in self._tasks:
                task.cancel()

    def stop(self) -> None:
        """Let :meth:`run` end; what is on the way then arrives nowhere."""
        self._stopped.set()

    def close(self) -> None:
        """Close all sockets."""
        for endpoint in (self._front, self._fixed, *(line.endpoint for line in self._lines.values())):
            if endpoint is not None:
                endpoint.close()
        self._alarm.close()

    def _start(self, work: Coroutine[None, None, None], name: str) -> None:
        self._tasks.append(self._group.create_task(work, name=f"impair {name}"))

    async def _take_all(self, endpoint: ServerEndpoint, take: Callable[[Arrival], Awaitable[None]]) -> None:
        try:
            while True:
                await take(await endpoint.receive())
        except EndpointError as error:
            self.fault = str(error)
            self.stop()

    async def _speaker_sent(self, arrival: Arrival) -> None:
        line = self._lines.get(arrival.sender) or await self._line_for(arrival.sender)
        if line is None:
            self.turned_away += 1
            return
        line.heard_ns = self._clock.now_ns()
        line.forwarded += 1
        self._enter(arrival.datagram, self._towards, line)

    def _answerer(self, line: Line) -> Callable[[Arrival], Awaitable[None]]:
        async def answered(arrival: Arrival) -> None:
            if arrival.sender != self._to:
                self.strangers += 1
                return
            line.answered += 1
            self._enter(arrival.datagram, self._back, line)

        return answered

    async def _line_for(self, source: Address) -> Line | None:
        """Return a line for a new speaker: a fresh one, or that of one who fell silent, or none."""
        if len(self._lines) < (MOST_SOURCES if self._fixed is None else 1):
            endpoint = self._fixed or await open_server_endpoint(self.forwards_from, in_use=_TAKEN)
            line = Line(source, endpoint, self._clock.now_ns())
            self._start(self._take_all(endpoint, self._answerer(line)), f"answers to {source}")
        else:
            line = min(self._lines.values(), key=lambda line: line.heard_ns)
            if self._clock.now_ns() - line.heard_ns < SILENT_NS:
                return None
            del self._lines[line.source]
            line.source = source
        self._lines[source] = line
        return line

    def _enter(self, datagram: bytes, direction: Direction, line: Line) -> None:
        now_ns = self._clock.now_ns()
        if self._epoch_ns is None:
            self._epoch_ns = now_ns
        self.network.send(datagram, direction, now_ns=now_ns - self._epoch_ns, route=line)
        if (due_ns := self._due_ns()) is not None:
            self._alarm.wake(due_ns)

    async def _deliver(self) -> None:
        while True:
            await self._alarm.wait(self._due_ns())
            if self._epoch_ns is not None:
                for delivery in self.network.due(now_ns=self._clock.now_ns() - self._epoch_ns):
                    self.lateness.add(self._clock.now_ns() - self._epoch_ns - delivery.at_ns)
                    await self._send_on(delivery)

    def _due_ns(self) -> int | None:
        """Return when the next datagram is to be sent on, on the clock."""
        due_ns = self.network.next_due_ns()
        return None if due_ns is None or self._epoch_ns is None else self._epoch_ns + due_ns

    async def _send_on(self, delivery: Delivery) -> None:
        line = cast("Line", delivery.route)
        self.delivered[delivery.direction] += 1
        if delivery.direction is self._towards:
            await line.endpoint.send(delivery.datagram, self._to)
        else:
            await self._front.send(delivery.datagram, line.source)


async def open_relay(
    network: Network, *, listen: Address, to: Address, towards: Direction, forward_from: Address | None, clock: Clock
) -> Relay:
    """Bind both sides; raise :class:`ConfigurationError` or :class:`EndpointError` in one sentence."""
    if to.port == 0:
        raise ConfigurationError(f"cannot send on to {to}: it needs a port of its own, 1..65535")
    if to in {listen, forward_from}:
        raise ConfigurationError(f"cannot send on to {to}: that is an address of our own")
    forward_from = forward_from or Address(default_bind(to).host, 0)
    front = await open_server_endpoint(listen, in_use=_TAKEN)
    try:
        # With a free port this shows only that the address is ours, before anybody speaks.
        endpoint = await open_server_endpoint(forward_from, in_use=_TAKEN)
    except BaseException:
        front.close()
        raise
    fixed = endpoint if forward_from.port else None
    if fixed is None:
        endpoint.close()
    return Relay(network, front=front, fixed=fixed, forward_from=forward_from, to=to, towards=towards, clock=clock)
