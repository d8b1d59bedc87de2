"""One client's TCP connection: reads, one write a reply, and what TCP itself knows of it."""

import asyncio
import contextlib
import socket
import sys
from collections.abc import Callable
from typing import Final

from hil.client.servo import HilError
from hil.kst.session import KstSession
from hil.kst.stalls import StallWatch
from transport.tcp.sockets import kernel_facts, set_no_delay

READ_MOST_BYTES: Final = 1 << 12
"""At once; a client that floods must not keep the session at the controller waiting for its turn."""
BUSY_NS: Final = 2_000_000
"""As much as can come at once, and it took longer: a flood. Nothing more is read for as long as it took."""
UNREAD_MOST_BYTES: Final = 1 << 16
"""Replies a client has not read; with more of them the connection ends."""
LOOK_AGAIN_S: Final = 0.005
"""For a reply that waits until the one before it was acknowledged."""
HELD_MOST_NS: Final = 2_000_000_000
"""How long it waits for that at most."""
KEEP_ALIVE: Final = {"TCP_KEEPIDLE": 5, "TCP_KEEPINTVL": 1, "TCP_KEEPCNT": 5, "TCP_USER_TIMEOUT": 10_000}
"""A client that is gone without a word is missed after ten seconds."""


class Connection:
    """Serves ``session`` to the client behind ``sock`` until :attr:`over` is set. For the running event loop."""

    def __init__(
        self,
        sock: socket.socket,
        session: KstSession,
        *,
        now_ns: Callable[[], int],
        answers_eof: bool = True,
    ) -> None:
        self.session = session
        self.watch = StallWatch(session.settings.nagle)
        self.over = asyncio.Event()
        self.why = ""
        """Why it is over."""
        self._socket = sock
        self._now_ns = now_ns
        self._answers_eof = answers_eof
        self._loop = asyncio.get_running_loop()
        self._unsent = bytearray()
        self._timer: asyncio.TimerHandle | None = None
        self._sampling: asyncio.TimerHandle | None = None
        self._resting: asyncio.TimerHandle | None = None
        self._loop.add_reader(sock, self._readable)

    def work(self) -> None:
        """Send what is due, and look again when the next reply is."""
        try:
            self._work()
        except HilError as error:
            self.end(str(error))

    def _work(self) -> None:
        if self.over.is_set():
            return
        now_ns = self._now_ns()
        for reply in self.session.replies(now_ns=now_ns, all_acknowledged=self._all_acknowledged(now_ns)):
            self._send(reply)
        if self.session.over:
            self.end("the client ended it")
            return
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._sample_when_due()
        due_ns = self.session.due_ns
        if due_ns is not None:
            left_s = max((due_ns - now_ns) * 1e-9, LOOK_AGAIN_S)
            self._timer = self._loop.call_later(left_s, self.work)

    def end(self, why: str) -> None:
        """Serve no more; idempotent."""
        if self.over.is_set():
            return
        self.why = why
        for timer in (self._timer, self._sampling, self._resting):
            if timer is not None:
                timer.cancel()
        self._loop.remove_reader(self._socket)
        self._loop.remove_writer(self._socket)
        self.over.set()

    def _readable(self) -> None:
        try:
            data = self._socket.recv(READ_MOST_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self.end(f"the connection broke: {error.strerror}")
            return
        if not data:
            self.session.closed()
            if self._answers_eof:
                self.end("the client closed the connection without a word (end)")
            else:
                self._loop.remove_reader(self._socket)
            return
        now_ns, kernel, before = self._now_ns(), kernel_facts(self._socket), self.session.requests
        try:
            self.session.receive(data, now_ns=now_ns)
        except HilError as error:
            self.end(str(error))
            return
        self.watch.received(
            now_ns,
            bytes_read=len(data),
            lines=self.session.requests - before,
            replies_due=self.session.replies_due,
            line_open=self.session.line_open,
            kernel=kernel,
        )
        self.work()
        self._sample_when_due()
        if len(data) == READ_MOST_BYTES:
            self._rest_after(self._now_ns() - now_ns)

    def _rest_after(self, spent_ns: int) -> None:
        """Leave what a flood brings in the kernel for a while: states of the controller are read one in each pass."""
        if spent_ns > BUSY_NS and not self.over.is_set():
            self._loop.remove_reader(self._socket)
            self._resting = self._loop.call_later(spent_ns * 1e-9, self._read_again)

    def _read_again(self) -> None:
        self._resting = None
        self._loop.add_reader(self._socket, self._readable)

    def _sample_when_due(self) -> None:
        """A timer that runs is left alone: what came meanwhile has put off what it is for, and it looks again."""
        due_ns = self.watch.due_ns
        if due_ns is not None and self._sampling is None and not self.over.is_set():
            self._sampling = self._loop.call_later((due_ns - self._now_ns()) * 1e-9, self._sample)

    def _sample(self) -> None:
        self._sampling = None
        due_ns, now_ns = self.watch.due_ns, self._now_ns()
        if due_ns is not None and now_ns >= due_ns:
            self.watch.sampled(now_ns, kernel_facts(self._socket))
        self._sample_when_due()

    def _send(self, reply: bytes) -> None:
        if self._unsent:
            self._unsent += reply
        else:
            try:
                sent = self._socket.send(reply)
            except BlockingIOError:
                sent = 0
            except OSError as error:
                self.end(f"the connection broke: {error.strerror}")
                return
            self.watch.written(self._now_ns(), size=sent, kernel=kernel_facts(self._socket))
            if sent < len(reply):
                self._unsent += reply[sent:]
                self._loop.add_writer(self._socket, self._writable)
        if len(self._unsent) > UNREAD_MOST_BYTES:
            self.end(f"the client does not read its replies: {len(self._unsent)} bytes of them wait")

    def _writable(self) -> None:
        try:
            sent = self._socket.send(self._unsent)
        except BlockingIOError:
            return
        except OSError as error:
            self.end(f"the connection broke: {error.strerror}")
            return
        del self._unsent[:sent]
        if not self._unsent:
            self._loop.remove_writer(self._socket)

    def _all_acknowledged(self, now_ns: int) -> bool:
        due_ns = self.session.due_ns
        if due_ns is None or now_ns < due_ns or self.session.settings.nagle:
            # With Nagle's algorithm on the kernel holds it back by itself, as it does a published server's.
            return True
        facts = kernel_facts(self._socket)
        return facts is None or not facts.unacknowledged or now_ns > due_ns + HELD_MOST_NS


def prepare(sock: socket.socket, *, nagle: bool, keep_alive: bool) -> None:
    """Set what a connection needs; what a system does not know is left out."""
    sock.setblocking(False)
    set_no_delay(sock, not nagle)
    if keep_alive:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        if sys.platform == "linux":
            for name, value in KEEP_ALIVE.items():
                with contextlib.suppress(OSError):
                    sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
