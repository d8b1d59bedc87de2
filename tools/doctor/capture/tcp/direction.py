"""What one side of a TCP connection sends and the other one acknowledges, in bounded memory.

A small segment is *held* by Nagle's algorithm (RFC 896) while an earlier small one is not acknowledged. In a capture
that is: nothing leaves until the acknowledgement comes, and then at once. One small segment that leaves before is proof
that nothing is held. An acknowledgement without data that comes 20 ms or more after what it acknowledges, less the
time it travels, was *delayed* (RFC 1122 allows 500 ms; Linux takes 40 ms and more, Windows 200 ms). Held and delayed
together make a stall.
"""

from dataclasses import dataclass, field
from typing import Final, NamedTuple

from hil.client.servo.statistic_timer import StatisticTimer
from tools.doctor.capture.tcp.ranges import MissingRanges, nearest
from transport.capture.tcp import ACK, FIN, RST, SYN, Segment

_NS_PER_MS: Final = 1_000_000
DELAYED_NS: Final = 20 * _NS_PER_MS
"""Half of the shortest delay that a known system takes."""
_LONGEST_DELAY_NS: Final = 600 * _NS_PER_MS
"""What RFC 1122 allows, and the resolution of a timer."""
_RELEASE_NS: Final = 2 * _NS_PER_MS
"""What a system takes from the acknowledgement to the segment it held."""
_AT_ONCE_NS: Final = 150_000
"""The same where no delay beforehand makes it plain: a program that sends every millisecond is not held."""
_JITTER: Final = 1.1
"""Of the way that a release has to be captured."""
_MOST_TRAVEL_NS: Final = 5 * _NS_PER_MS
"""Of a release whose way was never measured from a handshake."""
_REORDERED_NS: Final = 3 * _NS_PER_MS
"""What comes this late was overtaken on the way; what comes later was sent again. Wireshark's figure."""
_TIMEOUT_NS: Final = 150 * _NS_PER_MS
"""Silence before a second sending that only a timer explains: the shortest of known systems is 200 ms."""
_ANOTHER_STREAM_BYTES: Final = 1 << 26
"""A sequence number this far away belongs to no window."""
_SMALL_FOR_ALL_BYTES: Final = 524
"""A segment below the smallest maximum a host may have (536), less time stamps."""
_SMALL_AT_MOST_BYTES: Final = 1460
"""Ethernet's full segment. Where more would fit (loopback, jumbo frames) half a window may leave unasked."""
_TIME_STAMP_BYTES: Final = 12
_EXAMPLES: Final = 3


class Sent(NamedTuple):
    """A segment with data, when it was captured for the first time."""

    number: int
    at_unix_ns: int
    size: int
    end: int
    """Sequence number behind it, not wrapped."""


class Acknowledged(NamedTuple):
    """An acknowledgement without data that left nothing unacknowledged."""

    number: int
    at_unix_ns: int
    waited_ns: int
    window_before: int | None


class Stall(NamedTuple):
    """One segment that was held until a delayed acknowledgement came."""

    before: Sent
    acknowledged: Acknowledged
    number: int
    """Packet of the segment that was held."""
    released_ns: int
    """How long after the acknowledgement it left."""
    size: int


@dataclass(slots=True)
class Direction:
    """Data from one side, and what the other one says to it. All times are those of the capture."""

    travel_ns: int | None = None
    """Shortest round trip between where the capture was taken and the side that acknowledges."""
    handshake_seen: bool = False
    full_bytes: int | None = None
    """The largest payload of a segment; None where the capture does not have the beginning."""
    segments: int = 0
    stalls: StatisticTimer = field(default_factory=StatisticTimer)
    """From the segment before to the one that was held [ms]."""
    delays: StatisticTimer = field(default_factory=StatisticTimer)
    """Of the acknowledgements in stalls [ms]."""
    examples: list[Stall] = field(default_factory=list)
    unclear: StatisticTimer = field(default_factory=StatisticTimer)
    """As stalls, where nothing tells a slow acknowledgement from a long wire [ms]."""
    unheld: int = 0
    """Small segments that left while a small one was not acknowledged: Nagle's algorithm is off."""
    unheld_before_stall: int = 0
    """Those of them before the last stall."""
    first_unheld: int = 0
    """Packet of the first of them."""
    held: StatisticTimer = field(default_factory=StatisticTimer)
    """As stalls, where the acknowledgement that was waited for was prompt [ms]."""
    own_pace: int = 0
    """Segments that left some time after a delayed acknowledgement: nothing held them."""
    resent: StatisticTimer = field(default_factory=StatisticTimer)
    """Silence before segments that were sent again [ms]."""
    timeouts: int = 0
    """Those of them that a timer sent."""
    resent_unseen: int = 0
    """Those of them whose first sending was lost before it came to where the capture was taken."""
    first_resent: int = 0
    """Packet of the first of them."""
    overtaken: int = 0
    missed: int = 0
    """Times that more was acknowledged than was captured."""
    closed_windows: StatisticTimer = field(default_factory=StatisticTimer)
    """How long the other side took nothing more [ms]."""
    first_closed: int = 0
    """Packet of the first such."""
    reset_by: int = 0
    """Packet with which the side that sends ended the connection at once."""
    _next: int | None = None
    _acknowledged: int | None = None
    _last: Sent | None = None
    _small_end: int | None = None
    _free: Acknowledged | None = None
    _disturbed: bool = False
    _active_ns: int = 0
    _window: int | None = None
    _window_shift: int | None = None
    _closed_at_ns: int | None = None
    _missing: MissingRanges = field(default_factory=MissingRanges)

    @property
    def disturbances(self) -> int:
        """Count what makes a reply late that is not the program that replies."""
        return self.stalls.count + self.unclear.count + self.resent.count + self.closed_windows.count

    @property
    def holds(self) -> bool:
        """Whether the side was seen to hold small segments back, and not to let them go."""
        return self.unheld_before_stall * 20 <= self.stalls.count and self.stalls.count > 0

    def is_small(self, size: int) -> bool:
        """Whether a payload leaves room in its segment: Nagle's algorithm is for those."""
        return size < (_SMALL_FOR_ALL_BYTES if self.full_bytes is None else min(self.full_bytes, _SMALL_AT_MOST_BYTES))

    def begin(self, sequence: int, full_bytes: int | None, window_shift: int | None) -> None:
        """Take what both SYN segments say: the first sequence number, the largest payload, the window's scale."""
        if self._next is None:
            self._next = self._acknowledged = sequence + 1
        self.full_bytes, self._window_shift, self.handshake_seen = full_bytes, window_shift, True

    def measured(self, round_trip_ns: int) -> None:
        """Take the time between a segment of this direction and its prompt answer."""
        if self.travel_ns is None or round_trip_ns < self.travel_ns:
            self.travel_ns = max(round_trip_ns, 0)

    def sent(self, segment: Segment, back_ns: int | None) -> bool:
        """Take a segment with data; ``back_ns``: as ``travel_ns``, to the side that sends. Return whether it is new."""
        size, at_ns = segment.size, segment.at_unix_ns
        start = segment.sequence if self._next is None else nearest(segment.sequence, self._next)
        if self._next is None or abs(start - self._next) > _ANOTHER_STREAM_BYTES:
            self._follow(start)
        expected = self._next or 0
        end = start + size
        if start < expected:
            self._sent_before(segment, start, end)
            self._active_ns = at_ns
            if end <= expected:
                return False
        elif start > expected:
            self._missing.add(expected, start, at_ns)
        self.segments += 1
        small = self.is_small(size)
        collected = self.full_bytes is not None and size < self.full_bytes
        if (small or collected) and not segment.flags & FIN and start >= expected:
            self._judge(segment, back_ns, small=small)
        self._last = Sent(segment.number, at_ns, size, end)
        self._next = end
        if small:
            self._small_end = end
        self._free, self._disturbed, self._active_ns = None, start < expected, at_ns
        return True

    def answered(self, segment: Segment) -> None:
        """Take a segment of the other side: its acknowledgement, its window, and that it has data."""
        if not segment.flags & ACK or segment.flags & RST:
            return
        window_before = self._window
        if not segment.flags & SYN:
            self._take_window(segment)
        upto = segment.acknowledged if self._next is None else nearest(segment.acknowledged, self._next)
        if self._next is None or abs(upto - self._next) > _ANOTHER_STREAM_BYTES:
            self._follow(upto)
        if self._next is not None and upto > self._next:
            # A FIN counts as a byte and is not looked at here: one more is not missing.
            self.missed += upto > self._next + 1
            self._next = upto
        if self._acknowledged is None or upto > self._acknowledged:
            self._acknowledged = upto
            self._freed(segment, upto, window_before)
        if segment.size:
            self._free = None

    def end(self, at_unix_ns: int) -> None:
        """Count what is not over with the last segment."""
        if self._closed_at_ns is not None:
            self.closed_windows.add((at_unix_ns - self._closed_at_ns) / _NS_PER_MS)
            self._closed_at_ns = None

    def _follow(self, sequence: int) -> None:
        self._next, self._acknowledged = sequence, None
        self._last = self._free = self._small_end = None
        self._missing = MissingRanges()

    def _freed(self, segment: Segment, upto: int, window_before: int | None) -> None:
        last = self._last
        if last is None or upto < last.end:
            return
        waited_ns = segment.at_unix_ns - last.at_unix_ns
        if self._disturbed:
            return
        self.measured(waited_ns)
        if not segment.size and not segment.flags & (SYN | FIN):
            self._free = Acknowledged(segment.number, segment.at_unix_ns, waited_ns, window_before)

    def _judge(self, segment: Segment, back_ns: int | None, *, small: bool) -> None:
        """Say of a new segment that is not full whether it was held until an acknowledgement came."""
        if self._acknowledged is None:
            return
        if self._small_end is not None and self._small_end > self._acknowledged:
            if small:
                self.unheld += 1
                self.first_unheld = self.first_unheld or segment.number
            return
        free, last = self._free, self._last
        if free is None or last is None or last.end != self._small_end or self._disturbed:
            return
        window_allows = free.window_before is None or free.window_before >= last.size + segment.size
        if window_allows and free.waited_ns <= _LONGEST_DELAY_NS + (self.travel_ns or 0):
            self._judge_release(segment, last, free, back_ns or 0)

    def _judge_release(self, segment: Segment, last: Sent, free: Acknowledged, back_ns: int) -> None:
        """Say whether it left because of the acknowledgement ``free``, and whether that one was delayed."""
        released_ns = segment.at_unix_ns - free.at_unix_ns
        travel_ns = back_ns if self.handshake_seen else min(back_ns, _MOST_TRAVEL_NS)
        delay_ns = free.waited_ns - (self.travel_ns or 0)
        held_ms = (segment.at_unix_ns - last.at_unix_ns) / _NS_PER_MS
        if free.waited_ns < DELAYED_NS or (delay_ns < DELAYED_NS and self.handshake_seen):
            if 0 <= released_ns <= travel_ns * _JITTER + _AT_ONCE_NS:
                self.held.add(held_ms)
        elif not 0 <= released_ns <= travel_ns + _RELEASE_NS:
            self.own_pace += 1
        elif delay_ns >= DELAYED_NS:
            self.delays.add(delay_ns / _NS_PER_MS)
            self._stalled(Stall(last, free, segment.number, released_ns, segment.size), held_ms)
        else:
            self.unclear.add(held_ms)

    def _stalled(self, stall: Stall, held_ms: float) -> None:
        self.stalls.add(held_ms)
        self.unheld_before_stall = self.unheld
        if len(self.examples) < _EXAMPLES:
            self.examples.append(stall)

    def _sent_before(self, segment: Segment, start: int, end: int) -> None:
        """Tell a segment that is sent again from one that was overtaken, and from a question whether one is there."""
        at_ns = segment.at_unix_ns
        asks_only = self._closed_at_ns is not None or end == self._next == self._acknowledged
        if segment.size <= 1 and asks_only:
            return
        late_ns = self._missing.fill(start, end, at_ns)
        if late_ns is not None and late_ns < _REORDERED_NS:
            self.overtaken += 1
            return
        silent_ns = max(at_ns - self._active_ns, 0)
        self.resent.add(silent_ns / _NS_PER_MS)
        self.resent_unseen += late_ns is not None
        self.timeouts += silent_ns >= _TIMEOUT_NS
        self.first_resent = self.first_resent or segment.number
        self._disturbed = True

    def _take_window(self, segment: Segment) -> None:
        shift = self._window_shift
        self._window = None if shift is None else segment.window << shift
        if segment.window == 0:
            if self._closed_at_ns is None:
                self._closed_at_ns = segment.at_unix_ns
                self.first_closed = self.first_closed or segment.number
            self._disturbed = True
        elif self._closed_at_ns is not None:
            self.closed_windows.add(max(segment.at_unix_ns - self._closed_at_ns, 0) / _NS_PER_MS)
            self._closed_at_ns = None


def full_payload_bytes(offered: int | None, other: int | None, *, time_stamps: bool) -> int | None:
    """Return the largest payload after two SYN segments that offered ``offered`` and ``other``; None: they did not."""
    known = [size for size in (offered, other) if size is not None]
    if not known:
        return None
    return max(min(known) - (_TIME_STAMP_BYTES if time_stamps else 0), 1)
