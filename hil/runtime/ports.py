"""A robot's sockets, one port a link: each listens for the core and sends what the core has for it."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Protocol, TypeAlias

from hil.core.controller import FRI_LINK, ROBOT_SIDE_LINK
from hil.core.servo.link import SERVO_LINK
from hil.values.link import Address, Outgoing, Source
from transport.udp import Arrival, EndpointClosed, PeerEndpoint, ServerEndpoint

Taker: TypeAlias = Callable[[Arrival, Source], None]


class Port(Protocol):
    """One link's socket."""

    @property
    def local(self) -> Address:
        """Where it is bound."""

    @property
    def untaken(self) -> int:
        """Datagrams that were dropped because too many came before the core took them."""

    def listen(self, group: asyncio.TaskGroup, take: Taker, *, robot: str) -> list[asyncio.Task[None]]:
        """Start the tasks that hand every datagram to ``take``, until the port is closed."""

    async def send(self, outgoing: Outgoing) -> Address:
        """Send a datagram and return where it went; an unreachable peer is counted, not raised."""

    def close(self) -> None:
        """Release the socket."""


class FriPort:
    """The socket for one FRI client, and the ear for everybody else who sends to the same address."""

    def __init__(self, endpoint: PeerEndpoint) -> None:
        self.endpoint = endpoint

    @property
    def local(self) -> Address:
        """Where the client is served from."""
        return self.endpoint.local

    @property
    def untaken(self) -> int:
        """Datagrams that were dropped because too many came before the core took them."""
        return self.endpoint.untaken

    def listen(self, group: asyncio.TaskGroup, take: Taker, *, robot: str) -> list[asyncio.Task[None]]:
        """Listen to the client and to strangers."""
        return [
            group.create_task(_hand_over(self.endpoint.receive, FRI_LINK, take), name=f"{robot} FRI client"),
            group.create_task(
                _hand_over(self.endpoint.receive_stranger, FRI_LINK, take), name=f"{robot} FRI strangers"
            ),
        ]

    async def send(self, outgoing: Outgoing) -> Address:
        """Send to the client."""
        await self.endpoint.send(outgoing.payload)
        return self.endpoint.peer

    def close(self) -> None:
        """Release both sockets."""
        self.endpoint.close()


class _ServerPort:
    """One socket for ``link``, to which whoever likes sends, and that answers whom the core says."""

    def __init__(self, endpoint: ServerEndpoint, link: str) -> None:
        self.endpoint = endpoint
        self._link = link

    @property
    def local(self) -> Address:
        """Where it is bound."""
        return self.endpoint.local

    @property
    def untaken(self) -> int:
        """Datagrams that were dropped because too many came before the core took them."""
        return self.endpoint.untaken

    def listen(self, group: asyncio.TaskGroup, take: Taker, *, robot: str) -> list[asyncio.Task[None]]:
        """Listen to whoever sends; the core knows who is believed."""
        hand_over = _hand_over(self.endpoint.receive, self._link, take)
        return [group.create_task(hand_over, name=f"{robot} {self._link}")]

    async def send(self, outgoing: Outgoing) -> Address:
        """Send to whom the datagram is for."""
        destination = outgoing.destination or self.endpoint.local
        await self.endpoint.send(outgoing.payload, destination)
        return destination

    def close(self) -> None:
        """Release the socket."""
        self.endpoint.close()


class ServoPort(_ServerPort):
    """The socket all applications of a robot send to."""

    def __init__(self, endpoint: ServerEndpoint) -> None:
        super().__init__(endpoint, SERVO_LINK)


class RobotSidePort(_ServerPort):
    """The socket towards a robot side that is a network peer, which is the one who begins."""

    def __init__(self, endpoint: ServerEndpoint) -> None:
        super().__init__(endpoint, ROBOT_SIDE_LINK)

    async def wait_until(self, ready: Callable[[Arrival], bool], *, at_most_s: float, stopped: asyncio.Event) -> None:
        """Hand datagrams to ``ready`` until it says so, the time is over, or ``stopped`` is set."""
        stop = asyncio.ensure_future(stopped.wait())
        try:
            async with asyncio.timeout(at_most_s):
                while not stop.done():
                    arrival = asyncio.ensure_future(self.endpoint.receive())
                    try:
                        await asyncio.wait({arrival, stop}, return_when=asyncio.FIRST_COMPLETED)
                        if arrival.done() and ready(arrival.result()):
                            return
                    finally:
                        arrival.cancel()
        except TimeoutError:
            return
        finally:
            stop.cancel()


async def _hand_over(receive: Callable[[], Awaitable[Arrival]], link: str, take: Taker) -> None:
    while True:
        try:
            arrival = await receive()
        except EndpointClosed:
            return
        take(arrival, Source(link, arrival.sender))
