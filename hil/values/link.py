"""Datagrams at the door of the core: where they came from and where they go."""

from typing import NamedTuple


class Address(NamedTuple):
    """An IPv4 address and UDP port."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


class Source(NamedTuple):
    """Who sent a datagram, and which link of the robot it arrived at."""

    link: str
    address: Address


class Outgoing(NamedTuple):
    """A datagram that leaves through ``link``: for its one peer, or for ``destination`` where it has many."""

    link: str
    payload: bytes
    destination: Address | None = None
