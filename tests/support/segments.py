"""TCP conversations put together by hand: segments with sequence numbers as two hosts would count them."""

from typing import Final

from transport.capture.endpoints import Endpoint
from transport.capture.tcp import ACK, SYN, Segment, SynOptions

CLIENT: Final[Endpoint] = ("172.31.1.100", 51234)
SERVER: Final[Endpoint] = ("172.31.1.147", 30001)
_WRAP: Final = 1 << 32
_NS_PER_MS: Final = 1_000_000
_ETHERNET: Final = SynOptions(1460, 7, has_timestamps=False)


class Talk:
    """What one connection's capture holds; times are in ms and may be given in any order."""

    def __init__(
        self,
        *,
        client: Endpoint = CLIENT,
        server: Endpoint = SERVER,
        client_sequence: int = 1000,
        server_sequence: int = 9000,
        window: int = 500,
    ) -> None:
        self.segments: list[Segment] = []
        self.window = window
        self._ends = {True: client, False: server}
        self._next = {True: client_sequence, False: server_sequence}

    def handshake(
        self, *, to_server_ms: float = 0.2, to_client_ms: float = 0.02, options: SynOptions = _ETHERNET
    ) -> "Talk":
        """Begin at 0 ms."""
        self._add(True, 0.0, 0, SYN, options=options)
        self._next[True] += 1
        self._add(False, to_server_ms, 0, SYN | ACK, options=options)
        self._next[False] += 1
        self._add(True, to_server_ms + to_client_ms, 0, ACK)
        return self

    def client(self, at_ms: float, size: int = 0, flags: int = ACK, window: int | None = None) -> Segment:
        """Let the client send ``size`` bytes and acknowledge all that came."""
        return self._send(True, at_ms, size, flags, window)

    def server(self, at_ms: float, size: int = 0, flags: int = ACK, window: int | None = None) -> Segment:
        """Let the server send ``size`` bytes and acknowledge all that came."""
        return self._send(False, at_ms, size, flags, window)

    def again(self, segment: Segment, at_ms: float) -> Segment:
        """Send a segment once more."""
        number = len(self.segments) + 1
        repeated = segment._replace(number=number, at_unix_ns=round(at_ms * _NS_PER_MS), identification=number)
        self.segments.append(repeated)
        return repeated

    def lose(self, segment: Segment) -> Segment:
        """Take a segment out of the capture: it was lost before it came there."""
        self.segments.remove(segment)
        return segment

    def _send(self, from_client: bool, at_ms: float, size: int, flags: int, window: int | None) -> Segment:
        segment = self._add(from_client, at_ms, size, flags, window=window)
        self._next[from_client] += size
        return segment

    def _add(
        self,
        from_client: bool,
        at_ms: float,
        size: int,
        flags: int,
        *,
        window: int | None = None,
        options: SynOptions | None = None,
    ) -> Segment:
        number = len(self.segments) + 1
        segment = Segment(
            number=number,
            at_unix_ns=round(at_ms * _NS_PER_MS),
            source=self._ends[from_client],
            destination=self._ends[not from_client],
            sequence=self._next[from_client] % _WRAP,
            acknowledged=self._next[not from_client] % _WRAP if flags & ACK else 0,
            flags=flags,
            window=self.window if window is None else window,
            size=size,
            identification=number,
            syn_options=options,
        )
        self.segments.append(segment)
        return segment
