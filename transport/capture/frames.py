"""Datagrams to link-layer frames and back, by dpkt."""

import struct
from collections.abc import Callable
from typing import Any

from dpkt.dpkt import Error as DpktError
from dpkt.ethernet import ETH_TYPE_IP, Ethernet
from dpkt.ip import IP, IP_PROTO_UDP
from dpkt.sll import SLL
from dpkt.sll2 import SLL2
from dpkt.udp import UDP

from hil.values.errors import UsageError
from transport.capture.endpoints import MAX_PAYLOAD_BYTES, Endpoint, pack_endpoint, unpack_endpoint
from transport.capture.records import CapturedDatagram

LINK_ETHERNET = 1

# The link types a robot's network is recorded with: a wire, raw IP (tunnels), and "-i any" of tcpdump.
_LINK_LAYERS: dict[int, Callable[[bytes], Any]] = {LINK_ETHERNET: Ethernet, 101: IP, 113: SLL, 276: SLL2}

_UDP_HEAD_BYTES = 8

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


def decode_frame(link_type: int, frame: bytes) -> tuple[Endpoint, Endpoint, bytes] | None:
    """Source, destination and payload of a frame that holds one whole UDP datagram over IPv4, else ``None``.

    Checksums are not looked at: a capture taken on the sending host has those the network card fills in later.
    """
    link_layer = _LINK_LAYERS.get(link_type)
    if link_layer is None:
        return None
    try:
        packet = link_layer(frame)
    except (DpktError, ValueError, IndexError, struct.error):
        return None  # dpkt tries the inner protocols too, and those of a stranger's frame may be broken
    ip = packet if isinstance(packet, IP) else packet.data
    if not isinstance(ip, IP) or not isinstance(ip.data, UDP) or ip.mf:
        return None
    udp = ip.data
    size = udp.ulen - _UDP_HEAD_BYTES
    if not 0 <= size <= len(udp.data):
        return None
    source = unpack_endpoint(ip.src + udp.sport.to_bytes(2, "big"))
    destination = unpack_endpoint(ip.dst + udp.dport.to_bytes(2, "big"))
    return source, destination, udp.data[:size]
