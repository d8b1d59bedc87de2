"""One socket for the tasks of an asyncio client: one task reads, keeps the session alive and tells goals reached."""

import asyncio
from collections.abc import Callable
from typing import TypeVar

import asyncio_dgram

from hil.client._machine import DatagramSocket
from hil.client.servo._link import FAREWELLS, Link
from hil.client.servo._operations import Operation, Wait
from hil.clock import Deadline

_T = TypeVar("_T")


class Reader:
    """Runs operations for any task of one event loop; make it with :meth:`open`."""

    def __init__(self, link: Link, stream: asyncio_dgram.aio.DatagramClient) -> None:
        self.link = link
        self._stream = stream
        self._waiting: dict[asyncio.Future[None], Callable[[], bool]] = {}
        self._task = asyncio.create_task(self._serve(), name="hil servo client")

    @classmethod
    async def open(cls, link: Link, sock: DatagramSocket) -> "Reader":
        """Return a reader of ``sock``, which does not block and is the reader's from now on."""
        try:
            return cls(link, await asyncio_dgram.from_socket(sock))
        except BaseException:
            sock.close()
            raise

    async def run(self, operation: Operation[_T]) -> _T:
        """Run an operation and return its result."""
        came: bool | None = None
        try:
            self.link.raise_kept()
            while True:
                wait = next(operation) if came is None else operation.send(came)
                came = await self._wait(wait)
        except StopIteration as stop:
            result: _T = stop.value
            return result
        finally:
            operation.close()

    async def close(self) -> None:
        """Say goodbye, end the session, end the task, close the socket."""
        try:
            for _ in range(FAREWELLS):
                await self._send(self.link.session.goodbye())
        finally:
            self.link.session.end("the application closed it")
            self._tell_news()
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
            self._stream.close()
            # The event loop closes the socket in its next pass: only after that it is gone.
            passed = asyncio.get_running_loop().create_future()
            asyncio.get_running_loop().call_soon(passed.set_result, None)
            await passed

    async def _wait(self, wait: Wait) -> bool:
        deadline = Deadline(wait.timeout_s)
        news = asyncio.get_running_loop().create_future()
        self._waiting[news] = wait.until
        try:
            await self._send(self.link.outgoing())
            if not wait.until():
                async with asyncio.timeout(deadline.left_s()):
                    await news
        except TimeoutError:
            return wait.until()
        finally:
            del self._waiting[news]
        return True

    async def _serve(self) -> None:
        try:
            while True:
                await self._turn()
        except Exception as error:
            self.link.session.end(f"the client's own task failed: {error!r}")
            self._tell_news()
            raise

    async def _turn(self) -> None:
        link = self.link
        try:
            async with asyncio.timeout(max(0.0, link.patience_s())):
                datagram, _ = await self._stream.recv()
        except TimeoutError:
            link.nothing_came()
        except OSError as error:
            # Reports what became of a packet sent earlier: nobody listens there, mostly.
            link.session.trouble = str(error.strerror)
        else:
            link.take(datagram)
        link.tell_goals()
        # Who is told may have something to say in a moment, and then the acknowledgement travels with it.
        if not self._tell_news():
            await self._send(link.outgoing())

    def _tell_news(self) -> bool:
        """Tell everybody whose wait came true; return whether there was somebody."""
        told = [news for news, until in self._waiting.items() if not news.done() and until()]
        for news in told:
            news.set_result(None)
        return bool(told)

    async def _send(self, datagram: bytes | None) -> None:
        """Send; what cannot be sent is lost, like what gets lost on the way: the session carries it again."""
        if datagram is None:
            return
        for _ in range(2):
            try:
                await self._stream.send(datagram)
            except OSError as error:
                # Reports an earlier packet, and this one is not sent. The report is gone now: send it again.
                self.link.session.trouble = str(error.strerror)
            except asyncio_dgram.TransportClosed:
                return
            else:
                return
