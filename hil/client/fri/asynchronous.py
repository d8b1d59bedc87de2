"""The asyncio shell: the same client for a program that has an event loop."""

import asyncio
from types import TracebackType
from typing import Self, TypeAlias

import asyncio_dgram

from hil.client.fri._shell import ClientShell, cannot_answer, not_open, open_socket, timeouts
from hil.values.link import Address

_Stream: TypeAlias = asyncio_dgram.aio.DatagramClient | asyncio_dgram.aio.DatagramServer


class AsyncFriClient(ClientShell):
    """:class:`hil.client.fri.FriClient` with ``async with``, ``await step()`` and ``await run()``; see there."""

    _stream: _Stream | None = None

    async def __aenter__(self) -> Self:
        """Bind; raise :class:`hil.values.errors.EndpointError` when the port is taken."""
        await self.close()
        sock = open_socket(bind=self._bind, controller=self._controller)
        try:
            sock.setblocking(False)
            self._stream = await asyncio_dgram.from_socket(sock)
        except BaseException:
            sock.close()
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.close()

    @property
    def local(self) -> Address:
        """Where the client is bound."""
        return Address(*self._open().sockname)

    async def step(self, timeout_s: float | None = None) -> bool:
        """Take one datagram and answer it; return False when none came within ``timeout_s`` seconds.

        It also returns False, early, when the controller's machine reports that nobody listens there.
        """
        stream = self._open()
        try:
            async with asyncio.timeout(timeout_s):
                datagram, controller = await stream.recv()
        except (TimeoutError, ConnectionRefusedError):
            return False
        except asyncio_dgram.TransportClosed:
            raise not_open() from None
        answer = self.session.receive(datagram)
        if answer is not None:
            await _answer(stream, answer, controller)
        return True

    async def run(self, duration_s: float | None = None, silence_s: float | None = None) -> None:
        """Answer until the controller closes the session, ``duration_s`` is over or no message came for ``silence_s``.

        Both in seconds, None for no limit. Ctrl-C ends ``asyncio.run`` with ``KeyboardInterrupt``.
        """
        for timeout_s in timeouts(self.session, duration_s=duration_s, silence_s=silence_s):
            await self.step(timeout_s)

    async def close(self) -> None:
        """Close the socket; does nothing when it is closed."""
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()
            # The event loop closes the socket in its next pass: only after that is the port free again.
            passed = asyncio.get_running_loop().create_future()
            asyncio.get_running_loop().call_soon(passed.set_result, None)
            await passed

    def _open(self) -> _Stream:
        if self._stream is None:
            raise not_open()
        return self._stream


async def _answer(stream: _Stream, answer: bytes, controller: tuple[str, int]) -> None:
    while True:
        try:
            if isinstance(stream, asyncio_dgram.aio.DatagramClient):
                await stream.send(answer)
            else:
                await stream.send(answer, controller)
        except ConnectionRefusedError:
            # Reports an earlier answer, and this one is not sent. Each report is raised once: send it again.
            continue
        except OSError as error:
            raise cannot_answer(Address(*controller), error) from error
        return
