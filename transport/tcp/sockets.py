"""What a TCP socket can be told, and what its kernel knows of the connection."""

import errno
import socket
import struct
import sys
from typing import Final, NamedTuple

from hil.values.errors import ConfigurationError, EndpointError
from hil.values.link import Address
from transport.holders import held_by
from transport.udp import parse_address

CAN_QUICK_ACK: Final = hasattr(socket, "TCP_QUICKACK")
"""Linux only."""
_OLD_INFO: Final = struct.Struct("@12xI4xII24xII8xI28xI")
"""struct tcp_info of every Linux: tcpi_ato, rcv_mss, unacked, last_data_recv, last_ack_recv, rtt, total_retrans."""
_INFO: Final = struct.Struct("@12xI4xII24xII8xI28xI32xI4xIIII")
"""From Linux 4.6 on: segs_out, notsent_bytes, min_rtt, data_segs_in and data_segs_out too."""
_NEVER: Final = (1 << 32) - 1


class Kernel(NamedTuple):
    """What the kernel measured by itself (struct tcp_info of Linux); None: this Linux is too old to tell."""

    round_trip_ms: float
    """Smoothed; it includes what an acknowledgement was delayed by."""
    retransmissions: int
    """Segments of this side that were sent again, since the connection began."""
    unacknowledged: int = 0
    """Segments of this side that the other one has not acknowledged."""
    not_sent_bytes: int | None = None
    """What was written here and has not left: Nagle's algorithm holds it, or the other side's window is closed."""
    least_round_trip_ms: float | None = None
    """The handshake's or a prompt answer's: no delayed acknowledgement is in it."""
    bare_acknowledgements: int | None = None
    """Segments without data that this side sent, since the connection began; its SYN is one."""
    segments_received: int | None = None
    """Segments with data of the other side, since the connection began."""
    delay_ms: float = 0.0
    """How long this kernel waits for a reply that could carry its acknowledgement (ATO)."""
    full_bytes: int = 0
    """The largest segment that the other side seems to send."""
    since_received_ms: int = 0
    """Since the last data of the other side arrived."""
    since_acknowledged_ms: int = 0
    """Since the last acknowledgement of the other side arrived."""


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
        info = sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _INFO.size)
    except OSError:
        return None
    if len(info) < _INFO.size:
        return _old_facts(info)
    ato_us, full, unacknowledged, received_ms, acknowledged_ms, round_trip_us, again, *more = _INFO.unpack(info)
    segments, not_sent, least_us, data_in, data_out = more
    return Kernel(
        round_trip_us / 1000.0,
        again,
        unacknowledged,
        not_sent,
        # All bits set where none was measured yet.
        None if least_us == _NEVER else least_us / 1000.0,
        (segments - data_out) & _NEVER,
        data_in,
        ato_us / 1000.0,
        full,
        received_ms,
        acknowledged_ms,
    )


def _old_facts(info: bytes) -> Kernel | None:
    if len(info) < _OLD_INFO.size:
        return None
    ato_us, full, unacknowledged, received_ms, acknowledged_ms, round_trip_us, again = _OLD_INFO.unpack_from(info)
    return Kernel(
        round_trip_us / 1000.0,
        again,
        unacknowledged,
        delay_ms=ato_us / 1000.0,
        full_bytes=full,
        since_received_ms=received_ms,
        since_acknowledged_ms=acknowledged_ms,
    )


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
        hint = ""
        if error.errno == errno.EADDRINUSE:
            hint = "; another program listens there: choose another port" + held_by("tcp", address)
        raise EndpointError(f"cannot listen at TCP {address}: {error.strerror}{hint}") from error
    return sock
