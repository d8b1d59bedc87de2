"""One TCP connection of a capture: its handshake, what goes either way, and who waits for whose answer."""

from collections import deque
from dataclasses import dataclass
from typing import Final, NamedTuple

from tools.doctor.capture.tcp.direction import Direction, full_payload_bytes
from tools.doctor.capture.tcp.spread import Spread
from transport.capture.endpoints import Endpoint
from transport.capture.tcp import ACK, RST, SYN, Segment

_TWICE_NS: Final = 1_000_000
"""A packet that was recorded on two interfaces comes again within this time."""
_REMEMBERED: Final = 4


@dataclass(slots=True)
class Handshake:
    """How the connection began. All times are those of the capture."""

    syns: int = 0
    syn: Segment | None = None
    syn_ack: Segment | None = None
    to_acceptor_ns: int | None = None
    """From SYN to SYN/ACK: between where the capture was taken and the side that accepted, and back."""
    to_initiator_ns: int | None = None
    """From SYN/ACK to the ACK: between there and the side that connected."""
    refused: bool = False

    @property
    def round_trip_ns(self) -> int | None:
        """Return the round trip between the two sides."""
        if self.to_acceptor_ns is None or self.to_initiator_ns is None:
            return None
        return self.to_acceptor_ns + self.to_initiator_ns


class _Request(NamedTuple):
    """What the client asked for and when."""

    first_ns: int
    disturbances: int


class Connection:
    """Takes the segments of one connection in the order of the capture; bounded."""

    def __init__(self, first: Segment) -> None:
        self.first_ns = self.last_ns = first.at_unix_ns
        self.first_number = first.number
        self.handshake = Handshake()
        self.client, self.server = _client_and_server(first)
        self.requests = Direction()
        """What the client sends."""
        self.replies = Direction()
        """What the server sends."""
        self.first_answers = Spread()
        """From the first segment of a request to the first one of its answer."""
        self.whole_answers = Spread()
        """From the first segment of a request to the last one of its answer."""
        self.thinking = Spread()
        """From the last segment of a request to the first one of its answer, less the way; undisturbed ones only."""
        self.requests_in_parts = 0
        """Requests of two small segments or more that were answered."""
        self.replies_in_parts = 0
        """Answers of two small segments or more that another request followed."""
        self.recorded_twice = 0
        self._before: deque[Segment] = deque(maxlen=_REMEMBERED)
        self._request: _Request | None = None
        self._answered_ns: int | None = None
        self._parts = 0
        self._spoken_ns = 0

    @property
    def disturbances(self) -> int:
        """Count what went wrong on either way."""
        return self.requests.disturbances + self.replies.disturbances

    @property
    def segments(self) -> int:
        """Count segments with new data."""
        return self.requests.segments + self.replies.segments

    def take(self, segment: Segment) -> None:
        """Take the next segment of the capture."""
        if self._is_recorded_twice(segment):
            self.recorded_twice += 1
            return
        self.last_ns = max(self.last_ns, segment.at_unix_ns)
        from_client = segment.source == self.client
        there, back = (self.requests, self.replies) if from_client else (self.replies, self.requests)
        if segment.flags & (SYN | RST):
            self._begin_or_end(segment, there)
        elif self.handshake.syn_ack is not None and from_client and self.handshake.to_initiator_ns is None:
            self.handshake.to_initiator_ns = max(segment.at_unix_ns - self.handshake.syn_ack.at_unix_ns, 0)
            self.replies.measured(self.handshake.to_initiator_ns)
        back.answered(segment)
        # ``there.travel_ns`` leads to the side that acknowledges this data, ``back``'s to the side that sends it.
        if segment.size and not segment.flags & (SYN | RST) and there.sent(segment, back.travel_ns):
            self._speak(segment, there, from_client=from_client)

    def end(self) -> None:
        """Close the books with the last segment."""
        self._close_exchange()
        self.requests.end(self.last_ns)
        self.replies.end(self.last_ns)

    def _is_recorded_twice(self, segment: Segment) -> bool:
        for before in self._before:
            # The first comparison is one of numbers, and nearly always enough.
            if before.identification != segment.identification or before[2:] != segment[2:]:
                continue
            if 0 <= segment.at_unix_ns - before.at_unix_ns <= _TWICE_NS:
                return True
        self._before.append(segment)
        return False

    def _begin_or_end(self, segment: Segment, there: Direction) -> None:
        known = self.handshake
        if segment.flags & RST:
            if known.syn_ack is None and known.syn is not None and segment.source == self.server:
                known.refused = True
            elif not there.reset_by:
                there.reset_by = segment.number
        elif segment.flags & ACK:
            if known.syn is not None and known.syn_ack is None and known.syn.source == segment.destination:
                known.syn_ack = segment
                self._begin(known.syn, segment)
        elif known.syn_ack is None:
            known.syns += 1
            known.syn = segment

    def _begin(self, syn: Segment, syn_ack: Segment) -> None:
        if self.handshake.syns == 1:
            self.handshake.to_acceptor_ns = max(syn_ack.at_unix_ns - syn.at_unix_ns, 0)
            self.requests.measured(self.handshake.to_acceptor_ns)
        offered, accepted = syn.syn_options, syn_ack.syn_options
        if offered is None or accepted is None:
            return
        time_stamps = offered.has_timestamps and accepted.has_timestamps
        full = full_payload_bytes(
            offered.maximum_segment_bytes, accepted.maximum_segment_bytes, time_stamps=time_stamps
        )
        scaled = offered.window_shift is not None and accepted.window_shift is not None
        # A window is scaled by what its own sender offered: that of the replies' direction is the client's.
        client_shift = (offered.window_shift or 0) if scaled else 0
        server_shift = (accepted.window_shift or 0) if scaled else 0
        self.requests.begin(syn.sequence, full, server_shift)
        self.replies.begin(syn_ack.sequence, full, client_shift)

    def _speak(self, segment: Segment, there: Direction, *, from_client: bool) -> None:
        at_ns = segment.at_unix_ns
        small = there.is_small(segment.size)
        if from_client:
            if self._request is None or self._answered_ns is not None:
                self._close_exchange()
                self.replies_in_parts += self._parts > 1
                self._request, self._parts = _Request(at_ns, self.disturbances), 0
        elif self._request is not None:
            if self._answered_ns is None:
                self._answer(at_ns, self._request)
            self._answered_ns = at_ns
        self._parts += small
        self._spoken_ns = at_ns

    def _answer(self, at_ns: int, request: _Request) -> None:
        self.requests_in_parts += self._parts > 1
        self._parts = 0
        self.first_answers.add(at_ns - request.first_ns)
        if request.disturbances == self.disturbances:
            self.thinking.add(at_ns - self._spoken_ns - (self.requests.travel_ns or 0))

    def _close_exchange(self) -> None:
        if self._request is not None and self._answered_ns is not None:
            self.whole_answers.add(self._answered_ns - self._request.first_ns)
        self._request = self._answered_ns = None


def _client_and_server(first: Segment) -> tuple[Endpoint, Endpoint]:
    """Who connected, by the SYN; without one the side with the higher port, which is the one the system chose."""
    ends = first.source, first.destination
    if first.flags & SYN:
        return ends if not first.flags & ACK else (ends[1], ends[0])
    return ends if first.source[1] >= first.destination[1] else (ends[1], ends[0])
