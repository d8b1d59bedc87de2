"""Packets as our writer lays them out, read in a third of the time: a replay has two of them a control cycle.

Ethernet without tags, IPv4 without options and in one piece, UDP, the CRC-32 and then the notes. What is laid out
otherwise is left to :mod:`transport.capture.reading`, and a test compares the two.
"""

import struct
from typing import Final

from hil.values.tuples import new_tuple
from transport.capture import options
from transport.capture.endpoints import Endpoint
from transport.capture.frames import endpoints_of
from transport.capture.records import Packet

_FRAME_AT: Final = 28
"""Where the frame begins in its block."""
_ETHERNET_BYTES: Final = 14
_IP_BYTES: Final = 20
_PAYLOAD_AT: Final = _ETHERNET_BYTES + _IP_BYTES + 8
_BLOCK: Final = struct.Struct("<8xIIIII")
_HEADERS: Final = struct.Struct("!12xHBxHxxHxB14xH")
_ROUTE: Final = slice(_FRAME_AT + 26, _FRAME_AT + 38)
"""Addresses and ports, which lie side by side."""
_IPV4: Final = 0x0800
_IPV4_NO_OPTIONS: Final = 0x45
_UDP: Final = 17
_SHORTEST: Final = _FRAME_AT + _PAYLOAD_AT + 4
_CRC32: Final = struct.Struct(">I")
_HASH_AT: Final = len(options.OWN_HASH)
_HASH_BYTES: Final = 12
_END_BYTES: Final = 8
"""The option that ends them, and the length at the end of the block."""
_MAX_ROUTES: Final = 1024


class UsualPackets:
    """Remembers endpoints, which come again and again."""

    def __init__(self) -> None:
        self._routes: dict[bytes, tuple[Endpoint, Endpoint]] = {}

    def read(self, block: bytes, offset: int, number: int) -> tuple[Packet, bytes] | None:
        """Return the datagram of a little-endian block and the notes before it; None: read it otherwise.

        Interface 0 must be Ethernet and count nanoseconds since 1970.
        """
        if len(block) < _SHORTEST:
            return None
        interface, high, low, captured, full = _BLOCK.unpack_from(block)
        ethertype, version, total, fragment, protocol, length = _HEADERS.unpack_from(block, _FRAME_AT)
        if ethertype != _IPV4 or version != _IPV4_NO_OPTIONS or fragment or protocol != _UDP or interface:
            return None
        if captured != full or captured != total + _ETHERNET_BYTES or total != length + _IP_BYTES:
            return None
        at = _FRAME_AT + captured + -captured % 4
        if not block.startswith(options.OWN_HASH, at) or len(block) < at + _HASH_BYTES + _END_BYTES:
            return None
        (crc32,) = _CRC32.unpack_from(block, at + _HASH_AT)
        notes_at = at + _HASH_BYTES
        if len(block) == notes_at + _END_BYTES:
            notes = b""
        elif (found := options.own_notes(block, notes_at, end=len(block) - _END_BYTES)) is not None:
            notes = found
        else:
            return None
        route = block[_ROUTE]
        ends = self._routes.get(route)
        if ends is None:
            if len(self._routes) >= _MAX_ROUTES:
                self._routes.clear()
            ends = self._routes[route] = endpoints_of(route)
        frame = block[_FRAME_AT : _FRAME_AT + captured]
        source, destination = ends
        packet: Packet = new_tuple(
            Packet,
            (
                number,
                offset,
                high << 32 | low,
                crc32,
                source,
                destination,
                frame[_PAYLOAD_AT:],
                frame,
                _PAYLOAD_AT,
            ),
        )
        return packet, notes
