"""Beside which side a capture was taken, as far as the handshake tells."""

from collections.abc import Iterator
from enum import Enum, auto
from typing import Final

from tools.doctor.capture.tcp.connection import Connection
from tools.doctor.capture.tcp.sides import client_of, server_of

_CLEARLY_FURTHER: Final = 3.0
_TOO_NEAR_NS: Final = 150_000
"""Below this a system's own time to answer hides the wire."""


class Beside(Enum):
    """Where a capture was taken."""

    CLIENT = auto()
    SERVER = auto()
    BOTH = auto()
    """On the machine that both are on."""
    UNKNOWN = auto()


def beside(connection: Connection) -> Beside:
    """Return beside which side it was taken; in the middle, or with both near, nobody can tell."""
    if connection.client[0].startswith("127.") and connection.server[0].startswith("127."):
        return Beside.BOTH
    to_client, to_server = connection.handshake.to_initiator_ns, connection.handshake.to_acceptor_ns
    if to_client is None or to_server is None:
        return Beside.UNKNOWN
    far, near = max(to_client, to_server), min(to_client, to_server)
    if far < _TOO_NEAR_NS or far < _CLEARLY_FURTHER * near:
        return Beside.UNKNOWN
    return Beside.CLIENT if to_client < to_server else Beside.SERVER


def vantage_words(connection: Connection) -> Iterator[str]:
    """Yield one line on where the capture was taken, or on why it cannot be known."""
    where = beside(connection)
    if where is Beside.BOTH:
        yield "both sides are on the machine that captured (loopback)"
        return
    known = connection.handshake
    client, server = client_of(connection), server_of(connection)
    to_client, to_server = known.to_initiator_ns, known.to_acceptor_ns
    if to_client is None or to_server is None:
        missing = "not in it" if known.syn is None else "repeated or not all in it"
        yield f"where it was captured cannot be known: the connection's beginning is {missing}"
        return
    measured = (
        f"handshake: {client} and back {to_client / 1000:.0f} us, {server} and back {to_server / 1000:.0f} us from "
        f"where it was captured"
    )
    match where:
        case Beside.CLIENT:
            yield f"{measured}: beside {client}, so times of {server} include the wire"
        case Beside.SERVER:
            yield f"{measured}: beside {server}, so times of {client} include the wire"
        case _:
            yield f"{measured}: beside which side cannot be known"
