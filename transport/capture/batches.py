"""What the recorder sends its writer: one opening message, then batches of records.

A record is a fixed head and what follows: of a datagram its time stamp [ns], the six bytes of either endpoint and the
payload; of an entry of the journal only its bytes.
"""

import struct
from collections.abc import Iterator
from typing import Final, NamedTuple, TypeAlias

from transport.capture.endpoints import ENDPOINT_BYTES, Endpoint, unpack_endpoint
from transport.capture.records import CapturedDatagram

RECORD_HEAD: Final = struct.Struct(f"<BHQ{2 * ENDPOINT_BYTES}s")
NOTE_HEAD: Final = struct.Struct("<BH")
DATAGRAM: Final = 0
NOTE: Final = 1

# Together with the longest datagram that may still join a batch this stays below 208 KiB, the send buffer
# a stock Linux grants: a longer message could never be sent.
FULL_BATCH_BYTES = 60_000
FULL_BATCH_DATAGRAMS = 64
MAX_MESSAGE_BYTES = 1 << 17

_OPENING: Final = struct.Struct("<IQ")

BatchRecord: TypeAlias = CapturedDatagram | bytes
"""A datagram, or an entry of the journal."""


class Ring(NamedTuple):
    """Files that are kept: the newest ``files`` of about ``file_bytes`` each."""

    files: int
    file_bytes: int


class Opening(NamedTuple):
    """The first message: the UTF-8 comment of every section, and the ring; None for a single file."""

    comment: bytes
    ring: Ring | None = None


def pack_opening(opening: Opening) -> bytes:
    """Return the first message; never empty, which would read as the end of the stream."""
    return _OPENING.pack(*(opening.ring or (0, 0))) + opening.comment


def unpack_opening(message: bytes) -> Opening:
    """Return what the first message says."""
    files, file_bytes = _OPENING.unpack_from(message)
    return Opening(message[_OPENING.size :], Ring(files, file_bytes) if files else None)


def unpack_batch(message: bytes | memoryview) -> Iterator[BatchRecord]:
    """The records of a batch, oldest first."""
    view = memoryview(message)
    routes: dict[bytes, tuple[Endpoint, Endpoint]] = {}
    at = 0
    while at < len(view):
        if view[at] == NOTE:
            _, size = NOTE_HEAD.unpack_from(view, at)
            at += NOTE_HEAD.size
            yield bytes(view[at : at + size])
        else:
            _, size, at_unix_ns, route = RECORD_HEAD.unpack_from(view, at)
            at += RECORD_HEAD.size
            if route not in routes:
                routes[route] = unpack_endpoint(route[:ENDPOINT_BYTES]), unpack_endpoint(route[ENDPOINT_BYTES:])
            source, destination = routes[route]
            yield CapturedDatagram(at_unix_ns, source, destination, bytes(view[at : at + size]))
        at += size
