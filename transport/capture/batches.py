"""What the recorder's parent sends its child: one opening message, then batches of records.

A record is a fixed head (time stamp [ns], the six bytes of either endpoint, payload size) and the payload.
"""

import struct
from collections.abc import Iterator

from transport.capture.endpoints import ENDPOINT_BYTES, Endpoint, unpack_endpoint
from transport.capture.records import CapturedDatagram

RECORD_HEAD = struct.Struct(f"<Q{2 * ENDPOINT_BYTES}sH")

# Together with the longest datagram that may still join a batch this stays below 208 KiB, the send buffer
# a stock Linux grants: a longer message could never be sent.
FULL_BATCH_BYTES = 60_000
FULL_BATCH_RECORDS = 64
MAX_MESSAGE_BYTES = 1 << 17

# An empty message would read as the end of the stream, so the comment never travels bare.
_OPENING = b"comment:"


def pack_opening(comment: bytes) -> bytes:
    """The first message: the UTF-8 ``comment`` of the section."""
    return _OPENING + comment


def unpack_opening(message: bytes) -> str:
    """The comment of the first message."""
    return message.removeprefix(_OPENING).decode()


def unpack_batch(message: bytes | memoryview) -> Iterator[CapturedDatagram]:
    """The records of a batch, oldest first."""
    view = memoryview(message)
    routes: dict[bytes, tuple[Endpoint, Endpoint]] = {}
    at = 0
    while at < len(view):
        at_unix_ns, route, size = RECORD_HEAD.unpack_from(view, at)
        at += RECORD_HEAD.size
        if route not in routes:
            routes[route] = unpack_endpoint(route[:ENDPOINT_BYTES]), unpack_endpoint(route[ENDPOINT_BYTES:])
        source, destination = routes[route]
        yield CapturedDatagram(at_unix_ns, source, destination, bytes(view[at : at + size]))
        at += size
