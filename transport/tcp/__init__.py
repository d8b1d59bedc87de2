"""A TCP responder for measuring small messages. Messages and responder are bytes in, bytes and socket settings out.

The responder speaks first, so that a doctor never sends a byte to a server of another kind. Big endian throughout.

=========  =========================================================================================================
greeting   ``HIL-TCP-PROBE 1 <system> <software>`` and LF, ASCII, at most 200 bytes; blanks within are underscores
request    16 bytes: ``HTPq``, sequence (4), wishes (1), 3 zero bytes, body length (2), 2 zero bytes; then the body
reply      16 bytes: ``HTPr``, sequence (4), state (1), 3 zero bytes, body length (2), retransmissions (2); the body
refusal    ``HIL-TCP-PROBE refused: <sentence>`` and LF, at most 200 bytes; then the connection is closed
=========  =========================================================================================================

A body has 16 to 1024 bytes. That of a reply is as long as its request's and begins with two durations in nanoseconds,
8 bytes each, by the responder's clock: from the first part of the request to its last, and from there to the reply.
Where a reply goes out in two writes, the first one is its 16 byte head.

Wishes, two bits each from the lowest up (0: as it is, 1: yes, 2: no): reply in two writes, TCP_NODELAY on your socket,
an acknowledgement at once (TCP_QUICKACK on Linux, which it has to repeat after every receive). They hold for the
connection from then on. A responder need not do as it is asked; the state in its reply says what holds, with the same
bits. Retransmissions are those of the responder's side of the connection, modulo 65536.
"""

from transport.tcp.messages import (
    BODY_LEAST_BYTES,
    BODY_MOST_BYTES,
    HEAD_BYTES,
    Greeting,
    NotTheProbe,
    PeerSettings,
    ProbeRefused,
    Reply,
    ReplyReader,
    Request,
    Wishes,
    pack_refusal,
    read_greeting,
    shown,
)
from transport.tcp.responder import READ_MOST_BYTES, Allowance, Ending, Responder, Step

__all__ = [
    "BODY_LEAST_BYTES",
    "BODY_MOST_BYTES",
    "HEAD_BYTES",
    "READ_MOST_BYTES",
    "Allowance",
    "Ending",
    "Greeting",
    "NotTheProbe",
    "PeerSettings",
    "ProbeRefused",
    "Reply",
    "ReplyReader",
    "Request",
    "Responder",
    "Step",
    "Wishes",
    "pack_refusal",
    "read_greeting",
    "shown",
]
