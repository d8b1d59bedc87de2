"""What the two sides of a connection are called."""

from typing import NamedTuple

from tools.doctor.capture.tcp.connection import Connection
from transport.capture.endpoints import Endpoint


class Side(NamedTuple):
    """One side of a connection."""

    role: str
    endpoint: Endpoint

    @property
    def address(self) -> str:
        """Return its address and port as people write them."""
        return f"{self.endpoint[0]}:{self.endpoint[1]}"

    def __str__(self) -> str:
        return f"the {self.role} {self.address}"


def client_of(connection: Connection) -> Side:
    """Return the side that connected."""
    return Side("client", connection.client)


def server_of(connection: Connection) -> Side:
    """Return the side that accepted."""
    return Side("server", connection.server)
