"""Beside which side a capture was taken, as far as the handshake tells."""

from collections.abc import Iterator
from typing import Final

from tools.doctor.capture.tcp.connection import Connection
from tools.doctor.capture.tcp.sides import client_of, server_of

_CLEARLY_FURTHER: Final = 3.0
_TOO_NEAR_NS: Final = 150_000
"""Below this a system's own time to answer hides the wire."""


def vantage_words(connection: Connection) -> Iterator[str]:
    """Yield one line on where the capture was taken, or on why it cannot be known."""
    known = connection.handshake
    client, server = client_of(connection), server_of(connection)
    if connection.client[0].startswith("127.") and connection.server[0].startswith("127."):
        yield "both sides are on the machine that captured (loopback)"
        return
    to_client, to_server = known.to_initiator_ns, known.to_acceptor_ns
    if to_client is None or to_server is None:
        yield (
            "where it was captured cannot be known: the connection's beginning is not in it"
            if known.syn is None
            else "where it was captured cannot be known: the connection's beginning was repeated or is not all in it"
        )
        return
    measured = (
        f"handshake: {client} and back {to_client / 1000:.0f} us, {server} and back {to_server / 1000:.0f} us from "
        f"where it was captured"
    )
    far, near = max(to_client, to_server), min(to_client, to_server)
    if far >= _TOO_NEAR_NS and far >= _CLEARLY_FURTHER * near:
        beside, other = (client, server) if to_client < to_server else (server, client)
        yield f"{measured}: beside {beside}, so times of {other} include the wire"
    else:
        yield f"{measured}: beside which side cannot be known"
