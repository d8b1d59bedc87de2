"""Datagrams to link-layer frames, by dpkt, and back, by hand: dpkt makes some twenty objects of a frame that is read.

A replay of 15 times real time has 30 000 frames a second to read.
"""

import struct
from typing import Any, Final, NamedTuple

from dpkt.ethernet import ETH_TYPE_IP, Ethernet
from dpkt.ip import IP, IP_PROTO_UDP
from dpkt.udp import UDP

from hil.values.errors import UsageError
from transport.capture.endpoints import MAX_PAYLOAD_BYTES, Endpoint, pack_endpoint, unpack_endpoint
from transport.capture.records import CapturedDatagram

LINK_ETHERNET: Final = 1

_UDP_HEAD_BYTES: Final = 8
_IP_HEAD_BYTES: Final = 20
_MORE_FRAGMENTS_OR_OFFSET: Final = 0x3FFF
_IP: Final = struct.Struct("!BxHxxHxB")
_UDP_LENGTH: Final = struct.Struct("!4xH")
_VLAN_TAGS: Final = (b"\x81\x00", b"\x88\xa8", b"\x91\x00")
_IPV4: Final = b"\x08\x00"
_MAX_VLAN_TAGS: Final = 3
_MAX_ROUTES: Final = 1024

# Bit 0x02 marks the address as locally administered: it can belong to no vendor's hardware.
_LOCAL_MAC = b"\x02\x00"


class FrameEncoder:
    """Wraps datagrams into Ethernet, IPv4 and UDP with valid checksums.

    The headers of a pair of endpoints are built once and filled in per datagram.
    """

    def __init__(self) -> None:
        self._headers: dict[tuple[Endpoint, Endpoint], Any] = {}

    def encode(self, datagram: CapturedDatagram) -> bytes:
        """The frame of ``datagram``; raises ``UsageError`` for what IPv4 and UDP cannot carry."""
        if len(datagram.payload) > MAX_PAYLOAD_BYTES:
            raise UsageError(f"a datagram of {len(datagram.payload)} bytes; UDP carries at most {MAX_PAYLOAD_BYTES}")
        route = datagram.source, datagram.destination
        frame = self._headers.get(route)
        if frame is None:
            frame = self._headers[route] = _headers(*route)
        udp = frame.data.data
        udp.data = datagram.payload
        udp.ulen = _UDP_HEAD_BYTES + len(datagram.payload)
        frame.data.sum = udp.sum = 0  # zero is dpkt's request to compute both anew
        return bytes(frame)


def _headers(source: Endpoint, destination: Endpoint) -> Any:
    sender, receiver = pack_endpoint(source), pack_endpoint(destination)
    udp = UDP(sport=source[1], dport=destination[1])
    ip = IP(p=IP_PROTO_UDP, src=sender[:4], dst=receiver[:4], data=udp)
    return Ethernet(src=_LOCAL_MAC + sender[:4], dst=_LOCAL_MAC + receiver[:4], type=ETH_TYPE_IP, data=ip)


class Located(NamedTuple):
    """Where a datagram is in its frame."""

    source: Endpoint
    destination: Endpoint
    start: int
    end: int


class FrameDecoder:
    """Finds the whole UDP datagrams over IPv4 in frames; remembers endpoints, which come again and again."""

    def __init__(self) -> None:
        self._routes: dict[bytes, tuple[Endpoint, Endpoint]] = {}

    def locate(self, link_type: int, frame: bytes) -> Located | None:
        """Return where the datagram of a frame is, None where there is none.

        Checksums are not looked at: a capture taken on the sending host has those the network card fills in later.
        """
        at = ip_offset(link_type, frame)
        if at < 0 or at + _IP_HEAD_BYTES + _UDP_HEAD_BYTES > len(frame):
            return None
        version, total, fragment, protocol = _IP.unpack_from(frame, at)
        head = (version & 0x0F) * 4
        if version >> 4 != 4 or head < _IP_HEAD_BYTES or protocol != IP_PROTO_UDP:
            return None
        if fragment & _MORE_FRAGMENTS_OR_OFFSET or total < head + _UDP_HEAD_BYTES or at + total > len(frame):
            return None
        udp = at + head
        (length,) = _UDP_LENGTH.unpack_from(frame, udp)
        if not _UDP_HEAD_BYTES <= length <= total - head:
            return None
        route = frame[at + 12 : at + 20] + frame[udp : udp + 4]
        ends = self._routes.get(route)
        if ends is None:
            if len(self._routes) >= _MAX_ROUTES:
                self._routes.clear()
            ends = self._routes[route] = endpoints_of(route)
        return Located(*ends, udp + _UDP_HEAD_BYTES, udp + length)


def endpoints_of(route: bytes) -> tuple[Endpoint, Endpoint]:
    """Return source and destination of two addresses and two ports, in the order of their headers."""
    return unpack_endpoint(route[0:4] + route[8:10]), unpack_endpoint(route[4:8] + route[10:12])


def ip_offset(link_type: int, frame: bytes) -> int:
    """Return where IPv4 begins; -1 where there is none. A robot's network is recorded on wires, tunnels and "any"."""
    match link_type:
        case 1:  # Ethernet, with VLAN tags or without
            at = 12
            for _ in range(_MAX_VLAN_TAGS):
                if frame[at : at + 2] not in _VLAN_TAGS:
                    break
                at += 4
            return at + 2 if frame[at : at + 2] == _IPV4 else -1
        case 101 | 228:  # raw IP
            return 0
        case 113:  # Linux "any"
            return 16 if frame[14:16] == _IPV4 else -1
        case 276:  # Linux "any", version 2
            return 20 if frame[0:2] == _IPV4 else -1
        case 0 | 108:  # BSD and macOS loopback: the address family in the byte order of the host, or of the network
            return 4 if frame[0:4] in {b"\x02\0\0\0", b"\0\0\0\x02"} else -1
        case _:
            return -1


def decode_frame(link_type: int, frame: bytes) -> tuple[Endpoint, Endpoint, bytes] | None:
    """Source, destination and payload of a frame that holds one whole UDP datagram over IPv4, else ``None``."""
    found = FrameDecoder().locate(link_type, frame)
    return None if found is None else (found.source, found.destination, frame[found.start : found.end])
