"""A Cabinet that is watched while it runs: answered as by a client that never commands, and compared."""

import asyncio
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from backends.cabinet.backend import CabinetBackend
from backends.cabinet.options import CabinetOptions
from hil.clock import Clock, MonotonicClock
from hil.runtime.lifetime import repeated, stop_on_signals
from hil.values.errors import BackendError, MalformedDatagram
from hil.values.fri_messages import MonitoringMessage
from tools.shadow.comparison import ShadowComparison
from transport.udp import Arrival, EndpointClosed, ServerEndpoint, open_server_endpoint

_IN_USE = "; another FRI client, or a `hil run` with the backend cabinet, may serve there"
_NS_PER_MS = 1_000_000


async def watch(
    comparison: ShadowComparison,
    options: CabinetOptions,
    *,
    seconds: float | None,
    tell: Callable[[str], None],
    clock: Clock | None = None,
) -> CabinetBackend:
    """Watch for ``seconds`` (None: until a signal), and return the link with its figures.

    Raises :class:`BackendError` in one sentence where no Cabinet came, or none that can be watched.
    """
    link = CabinetBackend(options, cycle_ns=_NS_PER_MS)
    with ExitStack() as closing:
        closing.callback(comparison.close)
        closing.callback(link.close)
        endpoint = await open_server_endpoint(link.link.bind, in_use=_IN_USE)
        closing.callback(endpoint.close)
        tell(f"waiting for a Cabinet at UDP {endpoint.local}, {options.connect_s:g} s at most")
        watcher = _Watcher(link, endpoint, comparison, clock or MonotonicClock())
        await _watch(watcher, link, options, seconds=seconds, tell=tell)
    return link


async def _watch(
    watcher: "_Watcher",
    link: CabinetBackend,
    options: CabinetOptions,
    *,
    seconds: float | None,
    tell: Callable[[str], None],
) -> None:
    stop = asyncio.Event()
    reader = asyncio.create_task(watcher.read())
    stopped = asyncio.create_task(stop.wait())
    try:
        with stop_on_signals(stop.set), repeated(1.0, lambda: tell(watcher.line())):
            first: set[asyncio.Future[Any]] = {watcher.ready, reader, stopped}
            await asyncio.wait(first, timeout=options.connect_s, return_when=asyncio.FIRST_COMPLETED)
            if not watcher.ready.done() and not stop.is_set():
                if reader.done():
                    await reader
                raise BackendError(link.not_ready())
            await asyncio.wait({reader, stopped}, timeout=seconds, return_when=asyncio.FIRST_COMPLETED)
            if reader.done():
                await reader
    finally:
        for task in (reader, stopped):
            task.cancel()
        await asyncio.gather(reader, stopped, return_exceptions=True)
        watcher.ready.cancel()


class _Watcher:
    def __init__(
        self, link: CabinetBackend, endpoint: ServerEndpoint, comparison: ShadowComparison, clock: Clock
    ) -> None:
        self._link = link
        self._endpoint = endpoint
        self._comparison = comparison
        self._clock = clock
        self._period_ns = 0
        self.ready: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    def line(self) -> str:
        """Return how it goes."""
        if not self.ready.done():
            return "no Cabinet yet"
        report = self._link.report()
        return f"{report['session']}, quality {report['quality']}, {self._comparison.compared} messages compared"

    async def read(self) -> None:
        """Take and answer messages until the endpoint is closed."""
        while True:
            try:
                arrival = await self._endpoint.receive()
            except EndpointClosed:
                return
            await self._take(arrival)

    async def _take(self, arrival: Arrival) -> None:
        link, now_ns = self._link, self._clock.now_ns()
        try:
            message = link.decode(arrival.datagram, sent=False)
        except MalformedDatagram:
            message = None
        if not self.ready.done() and (period_ns := _period_ns(message)) != self._period_ns:
            # The Cabinet's period is the one to watch with, whatever it is.
            link.close()
            link.open(period_ns=period_ns)
            self._period_ns = period_ns
        link.advance(now_ns=now_ns)
        if not link.receive(arrival.datagram, arrival.sender, now_ns=now_ns):
            if not self.ready.done():
                link.not_ready()
            return
        link.step()
        for answer, cabinet in link.outgoing():
            await self._endpoint.send(answer, cabinet)
        if not self.ready.done():
            self.ready.set_result(None)
        if isinstance(message, MonitoringMessage):
            self._comparison.take(message, now_ns)


def _period_ns(message: object) -> int:
    """Return the send period, which is the Cabinet's own here."""
    connection = message.connection if isinstance(message, MonitoringMessage) else None
    period_ms = None if connection is None else connection.send_period_ms
    return (period_ms or 1) * _NS_PER_MS
