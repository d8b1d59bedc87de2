"""One datagram of a capture."""

from dataclasses import dataclass

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
