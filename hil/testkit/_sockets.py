"""What stands for a UDP socket in virtual time: waiting on it lets time pass."""

import socket
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from hil.values.errors import UsageError
from hil.values.link import Address

if TYPE_CHECKING:
    from hil.testkit._world import World

MOST_WAITING: Final = 256
"""Datagrams that wait to be read; about what the kernel's buffer holds of these. What comes on top is lost."""
POLL_NS: Final = 20_000
"""What looking for a datagram without waiting costs, so that a loop that only looks comes to an end."""
FIRST_FILE_NUMBER: Final = 1 << 20
"""Of the virtual sockets; a process has no such files."""


def whole_ns(seconds: float) -> int:
    """Return a wait in ns; one that is not over takes at least 1 ns, so that it comes to an end."""
    return 0 if seconds <= 0.0 else max(1, round(seconds * 1e9))


class VirtualSocket:
    """Bound to ``local``; ``send`` takes what it sends, and where to."""

    family = socket.AF_INET
    type = socket.SOCK_DGRAM
    proto = 0

    def __init__(
        self,
        world: "World",
        number: int,
        *,
        local: Address,
        peer: Address,
        connected: bool,
        send: Callable[["VirtualSocket", bytes], None],
    ) -> None:
        self.local = local
        self.overflowed = 0
        """Datagrams lost because nobody read those before."""
        self._world = world
        self.number = FIRST_FILE_NUMBER + number
        self._peer = peer
        self._connected = connected
        self._send = send
        self._waiting: deque[bytes] = deque()
        self._timeout_s: float | None = None
        self.closed = False

    @property
    def readable(self) -> bool:
        """Whether a datagram waits."""
        return bool(self._waiting)

    def put(self, datagram: bytes) -> None:
        """Take a datagram from the network."""
        if len(self._waiting) >= MOST_WAITING:
            self.overflowed += 1
        else:
            self._waiting.append(datagram)

    def take(self) -> bytes | None:
        """Return the next datagram; None when none waits."""
        return self._waiting.popleft() if self._waiting else None

    def settimeout(self, timeout_s: float | None, /) -> None:
        """Wait at most so long in ``recvfrom``; None: for ever."""
        self._timeout_s = timeout_s

    def setblocking(self, blocks: bool, /) -> None:
        """Wait for ever, or not at all; raise :class:`UsageError` for an event loop in which time stands still."""
        if not (blocks or self._world.in_virtual_loop):
            raise UsageError(
                "an asyncio client was opened in an ordinary event loop, where virtual time does not pass; "
                "run it with controller.run_async(...)"
            )
        self._timeout_s = None if blocks else 0.0

    def recvfrom(self, most_bytes: int, /) -> tuple[bytes, tuple[str, int]]:
        """Return the next datagram and its sender, after the time that takes; raise TimeoutError."""
        self._require_open()
        if self._timeout_s is None:
            self._world.wait(lambda: self.readable, until_ns=None)
        elif self._timeout_s > 0.0:
            until_ns = self._world.now_ns + whole_ns(self._timeout_s)
            if not self._world.wait(lambda: self.readable, until_ns=until_ns):
                raise TimeoutError("timed out")
        elif not self.readable:
            self._world.pass_ns(POLL_NS)
        datagram = self.take()
        if datagram is None:
            raise BlockingIOError("no datagram waits")
        return datagram[:most_bytes], (self._peer.host, self._peer.port)

    def send(self, datagram: bytes, /) -> int:
        """Send to the controller."""
        self._require_open()
        self._send(self, datagram)
        return len(datagram)

    def sendto(self, datagram: bytes, address: tuple[str, int] | None = None, /) -> int:
        """Send to ``address``; nobody is there but the controller."""
        if address is None or self._connected or Address(*address) == self._peer:
            return self.send(datagram)
        return len(datagram)

    def getsockname(self) -> tuple[str, int]:
        """Return host and port it is bound to."""
        return (self.local.host, self.local.port)

    def getpeername(self) -> tuple[str, int]:
        """Return the controller's; raise OSError when it is not connected."""
        if not self._connected:
            raise OSError("the socket is not connected")
        return (self._peer.host, self._peer.port)

    def fileno(self) -> int:
        """Return a number that only the virtual event loop knows."""
        return self.number

    def close(self) -> None:
        """Close it; nothing reaches it any more."""
        if not self.closed:
            self.closed = True
            self._waiting.clear()
            self._world.forget(self)

    def _require_open(self) -> None:
        if self.closed:
            raise OSError("the socket is closed")
