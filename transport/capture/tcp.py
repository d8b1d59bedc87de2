"""TCP segments over IPv4 in link-layer frames: their headers only, of whole and of cut frames."""

import struct
from typing import Final, NamedTuple

from hil.values.tuples import new_tuple
from transport.capture.endpoints import Endpoint
from transport.capture.frames import endpoints_of, ip_offset

FIN: Final = 0x01
SYN: Final = 0x02
RST: Final = 0x04
ACK: Final = 0x10

_TCP: Final = 6
_IP_HEAD_BYTES: Final = 20
_TCP_HEAD_BYTES: Final = 20
_MORE_FRAGMENTS_OR_OFFSET: Final = 0x3FFF
_IP: Final = struct.Struct("!BxHHHxB")
_HEAD: Final = struct.Struct("!4xIIBBH")
_END_OF_OPTIONS, _NO_OPERATION, _MAXIMUM_SIZE, _WINDOW_SCALE, _TIMESTAMPS = 0, 1, 2, 3, 8
_MAX_WINDOW_SHIFT: Final = 14
"""RFC 7323, section 2.3."""
_MAX_ROUTES: Final = 1024


class SynOptions(NamedTuple):
    """What one side offers at the beginning of a connection."""

    maximum_segment_bytes: int | None
    window_shift: int | None
    has_timestamps: bool


class Segment(NamedTuple):
    """The headers of one TCP segment."""

    number: int
    """Of the packet in the file, from 1, as Wireshark counts."""
    at_unix_ns: int
    source: Endpoint
    destination: Endpoint
    sequence: int
    """Of its first byte, 32 bits."""
    acknowledged: int
    """Sequence number the sender expects next, 32 bits; without meaning where ACK is not set."""
    flags: int
    """``FIN``, ``SYN``, ``RST``, ``ACK`` and others."""
    window: int
    """As it is in the header, not scaled."""
    size: int
    """Payload [bytes], also where the recorder cut it."""
    identification: int
    """Of the IP packet: one packet that was recorded twice has it twice."""
    syn_options: SynOptions | None
    """None in segments without SYN."""


class SegmentDecoder:
    """Finds TCP segments in frames; remembers endpoints, which come again and again."""

    def __init__(self) -> None:
        self._routes: dict[bytes, tuple[Endpoint, Endpoint]] = {}
        self.skipped = 0
        """TCP segments that cannot be read: fragments, and frames cut within the headers."""

    def decode(self, number: int, at_unix_ns: int, link_type: int, frame: bytes, full_bytes: int) -> Segment | None:
        """Return the segment of a frame that had ``full_bytes``, of which ``frame`` was recorded; None: there is none.

        Checksums are not looked at: a capture taken on the sending host has those the network card fills in later.
        """
        at = ip_offset(link_type, frame)
        if at < 0 or at + _IP_HEAD_BYTES > len(frame):
            return None
        version, total, identification, fragment, protocol = _IP.unpack_from(frame, at)
        if version >> 4 != 4 or protocol != _TCP:
            return None
        head = (version & 0x0F) * 4
        tcp = at + head
        if head < _IP_HEAD_BYTES or fragment & _MORE_FRAGMENTS_OR_OFFSET or tcp + _TCP_HEAD_BYTES > len(frame):
            self.skipped += 1
            return None
        if total == 0:  # left to the network card, which cuts what the host hands it as one packet
            total = full_bytes - at
        sequence, acknowledged, offset, flags, window = _HEAD.unpack_from(frame, tcp)
        tcp_head = (offset >> 4) * 4
        size = total - head - tcp_head
        if tcp_head < _TCP_HEAD_BYTES or size < 0:
            self.skipped += 1
            return None
        route = frame[at + 12 : at + 20] + frame[tcp : tcp + 4]
        ends = self._routes.get(route)
        if ends is None:
            if len(self._routes) >= _MAX_ROUTES:
                self._routes.clear()
            ends = self._routes[route] = endpoints_of(route)
        offered = _syn_options(frame[tcp + _TCP_HEAD_BYTES : tcp + tcp_head]) if flags & SYN else None
        source, destination = ends
        segment: Segment = new_tuple(
            Segment,
            (
                number,
                at_unix_ns,
                source,
                destination,
                sequence,
                acknowledged,
                flags,
                window,
                size,
                identification,
                offered,
            ),
        )
        return segment


def _syn_options(data: bytes) -> SynOptions:
    largest: int | None = None
    shift: int | None = None
    has_timestamps = False
    at = 0
    while at < len(data) and (kind := data[at]) != _END_OF_OPTIONS:
        if kind == _NO_OPERATION:
            at += 1
            continue
        size = data[at + 1] if at + 1 < len(data) else 0
        content = data[at + 2 : at + size]
        if size < 2 or len(content) != size - 2:
            break
        if kind == _MAXIMUM_SIZE and len(content) == 2:
            largest = int.from_bytes(content, "big")
        elif kind == _WINDOW_SCALE and len(content) == 1:
            shift = min(content[0], _MAX_WINDOW_SHIFT)
        elif kind == _TIMESTAMPS:
            has_timestamps = True
        at += size
    return SynOptions(largest, shift, has_timestamps)
