"""What a TCP socket can be told, and what its kernel knows of the connection."""

import errno
import socket
import struct
import sys
from typing import Final, NamedTuple

from hil.values.errors import ConfigurationError, EndpointError
from hil.values.link import Address
from transport.udp import parse_address

CAN_QUICK_ACK: Final = hasattr(socket, "TCP_QUICKACK")
"""Linux only."""
_TCP_INFO_BYTES: Final = 104
_UNACKNOWLEDGED_AT: Final = 24
_RTT_AT: Final = 68
_TOTAL_RETRANSMISSIONS_AT: Final = 100
_U32 = struct.Struct("@I")


class Kernel(NamedTuple):
    """What the kernel measured by itself (struct tcp_info of Linux)."""

    round_trip_ms: float
    """Smoothed; it includes what an acknowledgement was delayed by."""
    retransmissions: int
    """Segments of this side that were sent again, since the connection began."""
    unacknowledged: int = 0
    """Segments of this side that the other one has not acknowledged."""


def set_no_delay(sock: socket.socket, on: bool) -> None:
    """Switch Nagle's algorithm off (``on``) or on."""
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, on)


def set_quick_ack(sock: socket.socket, on: bool) -> None:
    """Acknowledge what was received now, or late; Linux forgets it with the next reply. Nothing elsewhere."""
    if sys.platform == "linux":
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, on)


def kernel_facts(sock: socket.socket) -> Kernel | None:
    """Return what the kernel knows of a connection; None where it does not say."""
    if sys.platform != "linux":
        return None
    try:
        info = sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _TCP_INFO_BYTES)
    except OSError:
        return None
    if len(info) < _TCP_INFO_BYTES:
        return None
    (round_trip_us,) = _U32.unpack_from(info, _RTT_AT)
    (retransmissions,) = _U32.unpack_from(info, _TOTAL_RETRANSMISSIONS_AT)
    (unacknowledged,) = _U32.unpack_from(info, _UNACKNOWLEDGED_AT)
    return Kernel(round_trip_us / 1000.0, retransmissions, unacknowledged)


def parse_tcp_address(text: str, *, resolve: bool = True, port_0: bool = False) -> Address:
    """Return ``HOST:PORT``, the port given and not 0 unless allowed; raise :class:`ConfigurationError`."""
    host, colon, port = text.partition(":")
    if not host or not colon or not port:
        raise ConfigurationError(f"{text!r} is no HOST:PORT; give both, as 192.168.0.10:30400")
    address = parse_address(text, default_port=0, resolve=resolve)
    if address.port == 0 and not port_0:
        raise ConfigurationError(f"{text!r}: port 0 is outside 1..65535")
    return address


def listen(address: Address, *, backlog: int) -> socket.socket:
    """Return a listening socket that does not block; raise :class:`EndpointError` in one sentence."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        if sys.platform != "win32":
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind(address)
        sock.listen(backlog)
        sock.setblocking(False)
    except OSError as error:
        sock.close()
        hint = "; another program listens there: choose another port" if error.errno == errno.EADDRINUSE else ""
        raise EndpointError(f"cannot listen at TCP {address}: {error.strerror}{hint}") from error
    return sock
