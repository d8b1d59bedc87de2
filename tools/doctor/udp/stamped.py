"""A UDP socket to one peer that tells when the kernel got a datagram, and how many it had no room for."""

import select
import socket
import struct
import sys
from types import TracebackType
from typing import Final, NamedTuple, Protocol, Self

from hil.clock import Clock, unix_time_ns
from hil.values.errors import EndpointError
from hil.values.link import Address
from transport.udp import RECEIVE_BUFFER_BYTES, bind_socket

_SO_TIMESTAMPNS: Final = 35
_SO_RXQ_OVFL: Final = 40
_TIMESPEC: Final = struct.Struct("@ll")
_COUNT: Final = struct.Struct("@I")
_MOST_BYTES: Final = 1 << 16
_BELIEVED_WAIT_NS: Final = 10_000_000_000
_IN_USE: Final = "; another program, maybe the FRI client, holds that port: end it, or choose another port"


class Heard(NamedTuple):
    """A datagram; when it arrived by the machine's monotonic clock, and how long it waited to be read.

    Without a stamp of the kernel's it arrived when it was read, and how long it waited is not known.
    """

    datagram: bytes
    arrived_ns: int
    waited_ns: int | None


class Gone(EndpointError):
    """Nothing listens there, or no way leads there."""


class TimedSocket(Protocol):
    """What a measurement needs of a socket to one peer."""

    peer: Address
    dropped: int | None
    """Datagrams the kernel had no room for, as far as a later one told of them; None: it does not say."""

    def send(self, datagram: bytes) -> bool:
        """Send to the peer; return whether it left, as it does unless our own buffer is full. Raises :class:`Gone`."""

    def receive(self, within_s: float) -> Heard | None:
        """Return the peer's next datagram; None when the time is up. Raises :class:`Gone`."""


class StampedSocket:
    """The machine's own :class:`TimedSocket`, to be used in a ``with`` block.

    Connected to ``peer``; or, given where to ``bind``, it hears whoever is on the peer's host and answers where the
    last datagram came from. Raises :class:`EndpointError`.
    """

    def __init__(self, peer: Address, clock: Clock, *, bind: Address | None = None) -> None:
        self.peer = peer
        self.dropped: int | None = None
        self._clock = clock
        self._connected = bind is None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setblocking(False)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
            if sys.platform == "linux":
                self._socket.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
                self._socket.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
                self.dropped = 0
            if bind is None:
                self._socket.connect(peer)
            else:
                bind_socket(self._socket, bind, in_use=_IN_USE)
        except OSError as error:
            self._socket.close()
            raise Gone(f"cannot reach UDP {peer}: {error.strerror}") from error
        except EndpointError:
            self._socket.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._socket.close()

    def send(self, datagram: bytes) -> bool:
        """Send to the peer; return whether it left, as it does unless our own buffer is full. Raises :class:`Gone`."""
        try:
            if self._connected:
                self._socket.send(datagram)
            else:
                self._socket.sendto(datagram, self.peer)
        except BlockingIOError:
            return False
        except OSError as error:
            raise self._gone(error) from error
        return True

    def receive(self, within_s: float) -> Heard | None:
        """Return the peer's next datagram; None when the time is up. Raises :class:`Gone`."""
        # Not poll, whose timeout is rounded up to whole milliseconds.
        ready, _, _ = select.select([self._socket], [], [], max(0.0, within_s))
        return self._read() if ready else None

    def _read(self) -> Heard | None:
        try:
            if not hasattr(self._socket, "recvmsg"):
                datagram, sender = self._socket.recvfrom(_MOST_BYTES)
                return Heard(datagram, self._clock.now_ns(), None) if self._is_of_peer(sender) else None
            datagram, notes, _, sender = self._socket.recvmsg(_MOST_BYTES, 128)
        except BlockingIOError:
            return None
        except OSError as error:
            raise self._gone(error) from error
        now_ns, waited_ns = self._clock.now_ns(), None
        for level, kind, data in notes:
            if level != socket.SOL_SOCKET:
                continue
            if kind == _SO_TIMESTAMPNS and len(data) == _TIMESPEC.size:
                seconds, nanoseconds = _TIMESPEC.unpack(data)
                waited_ns = unix_time_ns() - seconds * 1_000_000_000 - nanoseconds
            elif kind == _SO_RXQ_OVFL and len(data) == _COUNT.size:
                self.dropped = _COUNT.unpack(data)[0]
        # A clock that was set meanwhile makes no datagram old.
        if waited_ns is not None and not 0 <= waited_ns <= _BELIEVED_WAIT_NS:
            waited_ns = None
        return Heard(datagram, now_ns - (waited_ns or 0), waited_ns) if self._is_of_peer(sender) else None

    def _is_of_peer(self, sender: tuple[str, int]) -> bool:
        if not self._connected and sender[0] == self.peer.host:
            self.peer = Address(*sender)
        return self._connected or sender[0] == self.peer.host

    def _gone(self, error: OSError) -> Gone:
        if isinstance(error, ConnectionRefusedError):
            return Gone(f"nothing listens at UDP {self.peer}: its machine answers that the port is closed")
        return Gone(f"cannot reach UDP {self.peer}: {error.strerror}")
