"""All TCP connections of a capture, in bounded memory."""

from collections.abc import Iterable
from typing import Final

from tools.doctor.capture.tcp.connection import Connection
from transport.capture.endpoints import Endpoint
from transport.capture.tcp import ACK, SYN, Segment

MAX_CONNECTIONS: Final = 256
_GIVEN_UP_AT_ONCE: Final = 32
"""Making room costs a look at all of them."""

_Ends = tuple[Endpoint, Endpoint]


class Connections:
    """Hands each segment to its connection. Beyond :data:`MAX_CONNECTIONS` the least telling ones are left out."""

    def __init__(self, most: int = MAX_CONNECTIONS) -> None:
        self._most = most
        self._open: dict[_Ends, Connection] = {}
        self._over: list[Connection] = []
        self.left_out = 0
        """Connections that were looked at and given up for room."""

    def take(self, segments: Iterable[Segment]) -> None:
        """Take segments in the order of the capture."""
        known = self._open
        for segment in segments:
            source, destination = segment.source, segment.destination
            ends = (source, destination) if source <= destination else (destination, source)
            connection = known.get(ends)
            if connection is None or self._begins_anew(segment, connection):
                if connection is not None:
                    self._over.append(connection)
                if len(known) + len(self._over) >= self._most:
                    self._make_room()
                connection = known[ends] = Connection(segment)
            connection.take(segment)

    def end(self) -> list[Connection]:
        """Return all of them, in the order of their beginning; no segment may follow."""
        found = sorted([*self._over, *self._open.values()], key=lambda one: one.first_number)
        for connection in found:
            connection.end()
        return found

    @staticmethod
    def _begins_anew(segment: Segment, connection: Connection) -> bool:
        """Tell a new connection between the same two ports from a SYN that is sent again."""
        if segment.flags & (SYN | ACK) != SYN:
            return False
        syn = connection.handshake.syn
        return connection.segments > 0 or (syn is not None and syn.sequence != segment.sequence)

    def _make_room(self) -> None:
        """Give up those without a disturbance first, then those with the fewest segments, then the oldest."""

        def telling(entry: tuple[_Ends | None, Connection]) -> tuple[bool, int, int]:
            connection = entry[1]
            return connection.disturbances > 0, connection.segments, connection.last_ns

        entries: list[tuple[_Ends | None, Connection]] = [(None, one) for one in self._over]
        entries.extend(self._open.items())
        entries.sort(key=telling)
        given_up = entries[: min(_GIVEN_UP_AT_ONCE, len(entries))]
        self.left_out += len(given_up)
        gone = {id(connection) for _, connection in given_up}
        self._over = [one for one in self._over if id(one) not in gone]
        for ends, _ in given_up:
            if ends is not None:
                del self._open[ends]
