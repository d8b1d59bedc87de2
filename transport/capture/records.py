"""What a capture holds: datagrams, and what the recorder noted between them."""

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from transport.capture.endpoints import Endpoint


@dataclass(frozen=True, slots=True)
class CapturedDatagram:
    """A UDP datagram and when it passed."""

    at_unix_ns: int
    """When it was sent or received [ns since 1970-01-01 UTC]."""
    source: Endpoint
    """Sender: IPv4 address, port."""
    destination: Endpoint
    """Receiver: IPv4 address, port."""
    payload: bytes
    """What UDP carried, at most 65507 bytes."""


class Packet(NamedTuple):
    """A UDP datagram of a capture file, and where it is there. One is made for each that is read: it is flat."""

    number: int
    """Of the packet in the file, from 1, as Wireshark counts."""
    offset: int
    """Where its block begins in the file [bytes]."""
    at_unix_ns: int
    recorded_crc32: int | None
    """CRC-32 of the frame as the recorder noted it; None where it noted none."""
    source: Endpoint
    destination: Endpoint
    payload: bytes
    frame: bytes
    """The whole frame that was recorded."""
    payload_at: int
    """Where the payload begins in the frame [bytes]."""

    @property
    def datagram(self) -> CapturedDatagram:
        """What it carries, without its place in the file."""
        return CapturedDatagram(self.at_unix_ns, self.source, self.destination, self.payload)


class Notes(NamedTuple):
    """What the recorder noted at this place of the file: entries of :mod:`transport.capture.journal`."""

    offset: int
    """Where the block that holds them begins in the file [bytes]."""
    entries: bytes


CaptureRecord: TypeAlias = Packet | Notes
