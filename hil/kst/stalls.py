"""Which side makes a KST connection stall: told from when things came and from what TCP knew then.

Nagle's algorithm (RFC 896) holds a small segment back while an earlier one is not acknowledged; an acknowledgement is
delayed (RFC 1122) in the hope that a reply carries it, 40 ms on Linux. Where one side writes twice and the other has
nothing to say in between, the two meet:

- A client writes a request in parts, or streams what has no reply: the rest comes when this side's acknowledgement of
  the part before has left, late and without data. The kernel counts such segments, so a late one is *seen*, and it is
  not taken for granted because some 40 ms went by.
- This server writes a reply soon after another one with Nagle on: the kernel tells that bytes of it have not left.

What else makes a message late is counted by its name and never called a stall: a wire as long as the gap, segments that
were sent again, a program's own pace, this process reading late. In doubt it is no stall.
"""

from collections import deque
from dataclasses import dataclass, field
from enum import StrEnum
from statistics import median
from typing import Final, NamedTuple

from hil.kst.spread import Spread
from hil.kst.stall_findings import Seen, Waits, findings_of
from hil.values.finding import Finding, Severity
from transport.tcp.sockets import Kernel

_NS_PER_MS: Final = 1_000_000
BURST_LINES: Final = 3
"""Requests in one read that make it a burst; two may be what a program writes together."""
PROMPT_NS: Final = 5 * _NS_PER_MS
"""A part that comes within this time was not held for long enough to matter."""
DELAYED_NS: Final = 20 * _NS_PER_MS
"""Half of the shortest delay of an acknowledgement that a known system has."""
LONGEST_DELAY_NS: Final = 600 * _NS_PER_MS
"""What RFC 1122 allows, and the resolution of a timer."""
OUR_DELAY_MS: Final = 40.0
"""Linux's shortest delay."""
_TIMER_MS: Final = 12.0
"""What a kernel's timer adds to it, with a tick of 10 ms."""
_RELEASE_MS: Final = 0.7
"""From the acknowledgement that was seen to what it released, beyond twice the way: no program has a part in it."""
_LATE_HERE_MS: Final = 8
"""Data that lay in the kernel for so long was read late by this process."""
FULL_LEAST_BYTES: Final = 536
"""The smallest size of a full segment; no request is as long."""
_NAGLE_MOST_BYTES: Final = 1460
"""Nagle's algorithm holds less than a full segment."""
SAMPLE_FROM_NS: Final = 34 * _NS_PER_MS
SAMPLE_EVERY_NS: Final = _NS_PER_MS
SAMPLE_UNTIL_NS: Final = 100 * _NS_PER_MS
FULL_MOST_NS: Final = 200 * _NS_PER_MS
"""A stream that fills a segment does so within this time."""
_WINDOW_NS: Final = 1_000_000_000
_KEPT: Final = 256
TOLD_AGAIN: Final = 10
"""A finding is told again when it was made so many times as often."""


class Stall(StrEnum):
    """What was held back."""

    PARTS = "request in parts"
    BURST = "stream in bursts"
    FULL = "bursts of full segments"
    """Held, or written so: a full segment waits for no acknowledgement, so nothing tells."""
    REPLY = "reply held"


class NoStall(StrEnum):
    """Why something that looked like one at first is none."""

    PROMPT = "prompt"
    """It came too soon for that."""
    OWN_PACE = "own pace"
    """No late acknowledgement released it: the program sent it then."""
    NETWORK = "network"
    """The wire's own round trip, or segments that were sent again."""
    LATE_HERE = "late here"
    """This process read it late."""
    UNCLEAR = "unclear"
    """Nothing tells."""


@dataclass(slots=True)
class _Tally:
    """What was judged of one kind."""

    count: int = 0
    lines: int = 0
    waits_ms: deque[float] = field(default_factory=lambda: deque(maxlen=_KEPT))
    delays_ms: deque[float] = field(default_factory=lambda: deque(maxlen=_KEPT))
    longest_ms: float = 0.0
    none: dict[NoStall, int] = field(default_factory=lambda: dict.fromkeys(NoStall, 0))

    def stalled(self, wait_ns: int, delay_ns: int, lines: int = 0) -> None:
        self.count += 1
        self.lines += lines
        self.waits_ms.append(wait_ns / _NS_PER_MS)
        self.delays_ms.append(delay_ns / _NS_PER_MS)
        self.longest_ms = max(self.longest_ms, self.waits_ms[-1])

    def waits(self) -> Waits:
        return Waits(
            count=self.count,
            median_ms=median(self.waits_ms) if self.waits_ms else 0.0,
            longest_ms=self.longest_ms,
            delay_ms=median(self.delays_ms) if self.delays_ms else 0.0,
            lines=self.lines,
            prompt=self.none[NoStall.PROMPT],
            # A program that comes at its own pace as often as not is not held: what fitted did so by chance.
            against=self.none[NoStall.OWN_PACE],
        )

    def report(self) -> dict[str, object]:
        waits = self.waits()
        return {
            "count": self.count,
            "median_ms": round(waits.median_ms, 3),
            "max_ms": round(self.longest_ms, 3),
            "not_stalls": {why.value: count for why, count in self.none.items() if count},
        }


class _Read(NamedTuple):
    """The last read."""

    at_ns: int
    part: bool
    """Whether it ended within a line, by the client's wish: not where a segment was full."""
    kernel: Kernel | None


class _Held(NamedTuple):
    """A reply that has not left."""

    at_ns: int
    before_ns: int
    """When the one was written whose acknowledgement it waits for."""
    retransmissions: int


class StallWatch:
    """Watches one TCP connection of the server; make a new one for the next. In bounded memory; never raises.

    The shell tells :meth:`received` after every read and :meth:`written` after every write, each with what
    :func:`transport.tcp.sockets.kernel_facts` says right then (None where a system does not say: then nothing is called
    a stall). When :attr:`due_ns` comes, and nothing else did, it tells :meth:`sampled`; that is seldom more than a few
    times for each stall, and never while messages come every few milliseconds. ``nagle``: whether it is on here.
    """

    def __init__(self, nagle: bool) -> None:
        self.due_ns: int | None = None
        """When :meth:`sampled` is wanted; None: not."""
        self._nagle = nagle
        self._tallies = {kind: _Tally() for kind in Stall}
        self._gaps, self._pace = Spread(), Spread()
        self._reads = self._requests = self._unanswered = self._replies = 0
        self._first_ns: int | None = None
        self._last_ns = 0
        self._request_ns: int | None = None
        self._replied_ns: int | None = None
        self._written_ns = 0
        self._last: _Read | None = None
        self._acknowledged_ns: int | None = None
        self._held: _Held | None = None
        self._kernel: Kernel | None = None
        self._least_way_ns: int | None = None
        self._window_ns = self._window_requests = 0
        self._rate_per_s = self._most_per_s = 0.0
        self._told: dict[str, tuple[Severity, int]] = {}

    def received(
        self, now_ns: int, *, bytes_read: int, lines: int, replies_due: int, line_open: bool, kernel: Kernel | None
    ) -> None:
        """One read gave ``bytes_read`` bytes and completed ``lines`` requests, to which ``replies_due`` replies follow.

        ``line_open``: what was read ends within a line. Blank lines are no requests. ``kernel`` is asked after the
        read and before a reply is written.
        """
        self._take(now_ns, kernel)
        self._reads += 1
        last = self._last
        if last is not None:
            self._judge(now_ns, last, bytes_read=bytes_read, lines=lines, line_open=line_open, kernel=kernel)
        if lines > 0:
            self._count_requests(now_ns, lines, unanswered=max(0, lines - replies_due))
        self._last, self._acknowledged_ns = _Read(now_ns, line_open and bytes_read < FULL_LEAST_BYTES, kernel), None
        watched = kernel is not None and (line_open or replies_due <= 0)
        self.due_ns = now_ns + SAMPLE_FROM_NS if watched else None
        self._watch_held(now_ns)

    def written(self, now_ns: int, *, size: int, kernel: Kernel | None) -> None:
        """One reply of ``size`` bytes was handed to the kernel, which is asked after that."""
        self._take(now_ns, kernel)
        if size <= 0:
            return
        self._replies += 1
        # It carries the acknowledgement of what was read: what comes next was not held for want of one.
        self._last = self.due_ns = None
        if kernel is not None and self._held is None and kernel.unacknowledged:
            held_bytes = kernel.not_sent_bytes or 0
            if 0 < held_bytes <= _NAGLE_MOST_BYTES:
                self._held = _Held(now_ns, self._written_ns, kernel.retransmissions)
        self._replied_ns = self._written_ns = now_ns
        self._watch_held(now_ns)

    def sampled(self, now_ns: int, kernel: Kernel | None) -> None:
        """:attr:`due_ns` has come, and this is what the kernel says."""
        self.due_ns = None
        self._take(now_ns, kernel)
        last = self._last
        if last is not None and kernel is not None and self._acknowledged_ns is None:
            before = last.kernel
            if before is not None and _more(before.bare_acknowledgements, kernel.bare_acknowledgements):
                self._acknowledged_ns = now_ns
            elif now_ns < last.at_ns + SAMPLE_UNTIL_NS:
                self.due_ns = max(now_ns, last.at_ns + SAMPLE_FROM_NS - SAMPLE_EVERY_NS) + SAMPLE_EVERY_NS
        self._watch_held(now_ns)

    def findings(self) -> list[Finding]:
        """Return what can be said by now, the worst first; nothing where all is well."""
        return findings_of(self._seen())

    def news(self) -> list[Finding]:
        """Return what is wrong and was not told yet, or became much worse since."""
        new = []
        for finding in self.findings():
            if not finding.is_wrong:
                continue
            severity, count = self._told.get(finding.kind, (Severity.GOOD, 0))
            times = finding.figures.get("count", 1)
            now = times if isinstance(times, int) else 1
            if finding.severity.value > severity.value or now >= count * TOLD_AGAIN:
                self._told[finding.kind] = finding.severity, now
                new.append(finding)
        return new

    def report(self) -> dict[str, object]:
        """Return all of it for JSON. Times in ms unless their name says otherwise."""
        kernel = self._kernel
        seconds = 0.0 if self._first_ns is None else (self._last_ns - self._first_ns) / 1e9
        return {
            "seconds": round(seconds, 3),
            "nagle": self._nagle,
            "reads": self._reads,
            "requests": self._requests,
            "requests_without_reply": self._unanswered,
            "replies": self._replies,
            "requests_per_s": round(self._rate_per_s, 1),
            "requests_per_s_most": round(self._most_per_s, 1),
            "request_gap_ms": self._gaps.report(),
            "client_pace_ms": self._pace.report(),
            "round_trip_ms": None if kernel is None else round(kernel.round_trip_ms, 3),
            "least_round_trip_ms": None if self._least_way_ns is None else self._least_way_ns / _NS_PER_MS,
            "retransmissions": None if kernel is None else kernel.retransmissions,
            "kernel_tells": kernel is not None and kernel.bare_acknowledgements is not None,
            "stalls": {kind.value: tally.report() for kind, tally in self._tallies.items()},
            "findings": [finding.as_dict() for finding in self.findings()],
        }

    def _seen(self) -> Seen:
        kernel = self._kernel
        return Seen(
            parts=self._tallies[Stall.PARTS].waits(),
            bursts=self._tallies[Stall.BURST].waits(),
            full=self._tallies[Stall.FULL].waits(),
            held=self._tallies[Stall.REPLY].waits(),
            nagle=self._nagle,
            requests=self._requests,
            replies=self._replies,
            least_round_trip_ms=self._way_ns / _NS_PER_MS,
            retransmissions=0 if kernel is None else kernel.retransmissions,
            pace_count=self._pace.count,
            pace_median_ms=self._pace.quantile_ms(0.5),
        )

    @property
    def _way_ns(self) -> int:
        return self._least_way_ns or 0

    def _take(self, now_ns: int, kernel: Kernel | None) -> None:
        if self._first_ns is None:
            self._first_ns = self._window_ns = now_ns
        self._last_ns = now_ns
        if kernel is None:
            return
        self._kernel = kernel
        if kernel.least_round_trip_ms is not None:
            # The kernel's own least one is that of some minutes, and may be a delayed one's in the end.
            way_ns = round(kernel.least_round_trip_ms * _NS_PER_MS)
            self._least_way_ns = way_ns if self._least_way_ns is None else min(way_ns, self._least_way_ns)
        if self._held is not None and not kernel.not_sent_bytes:
            self._released(now_ns, self._held, kernel)
            self._held = None

    def _count_requests(self, now_ns: int, lines: int, *, unanswered: int) -> None:
        self._requests += lines
        self._unanswered += unanswered
        if self._request_ns is not None:
            self._gaps.add(now_ns - self._request_ns)
        self._request_ns = now_ns
        if self._replied_ns is not None:
            self._pace.add(now_ns - self._replied_ns)
            self._replied_ns = None
        self._window_requests += lines
        passed_ns = now_ns - self._window_ns
        if passed_ns >= _WINDOW_NS:
            self._rate_per_s = self._window_requests * 1e9 / passed_ns
            self._most_per_s = max(self._most_per_s, self._rate_per_s)
            self._window_ns, self._window_requests = now_ns, 0

    def _judge(
        self, now_ns: int, last: _Read, *, bytes_read: int, lines: int, line_open: bool, kernel: Kernel | None
    ) -> None:
        """Say of a read that no reply came before whether this side's late acknowledgement had held it."""
        before = last.kernel
        arrived = _difference(before and before.segments_received, kernel and kernel.segments_received)
        if last.part:
            tally = self._tallies[Stall.PARTS]
        elif lines >= BURST_LINES and (arrived is None or arrived < lines):
            # As many segments as lines: they left one by one, and were read late.
            tally = self._tallies[Stall.BURST]
        else:
            return
        gap_ns = now_ns - last.at_ns
        if gap_ns < PROMPT_NS:
            tally.none[NoStall.PROMPT] += 1
            return
        acknowledged = _difference(before and before.bare_acknowledgements, kernel and kernel.bare_acknowledgements)
        if before is None or kernel is None or acknowledged is None or arrived is None or arrived < 1:
            tally.none[NoStall.UNCLEAR] += 1
            return
        late = acknowledged > arrived
        # TCP has cut it where a segment was full; a program ends what it writes with a line.
        full = (arrived > 1 or line_open) and FULL_LEAST_BYTES < kernel.full_bytes <= bytes_read
        if (
            full
            and not late
            and kernel.since_received_ms < _LATE_HERE_MS
            and lines >= BURST_LINES
            and DELAYED_NS <= gap_ns <= FULL_MOST_NS
        ):
            self._tallies[Stall.FULL].stalled(gap_ns, gap_ns, lines)
            return
        why = self._why_not(now_ns, gap_ns, kernel, late=late)
        if kernel.retransmissions != before.retransmissions:
            why = NoStall.NETWORK
        if why is None:
            tally.stalled(gap_ns, gap_ns - self._way_ns, lines)
        else:
            tally.none[why] += 1

    def _why_not(self, now_ns: int, gap_ns: int, kernel: Kernel, *, late: bool) -> NoStall | None:
        """Return why a gap is no stall. ``late``: more bare acknowledgements left than what came is worth."""
        way_ms = self._way_ns / _NS_PER_MS
        delay_ms = gap_ns / _NS_PER_MS - way_ms
        if kernel.since_received_ms >= _LATE_HERE_MS:
            return NoStall.LATE_HERE
        if way_ms >= PROMPT_NS / _NS_PER_MS and delay_ms < DELAYED_NS / _NS_PER_MS:
            return NoStall.NETWORK
        if not late:
            return NoStall.OWN_PACE
        longest_ms = max(OUR_DELAY_MS, min(kernel.delay_ms, kernel.round_trip_ms)) + _TIMER_MS
        if not DELAYED_NS / _NS_PER_MS <= delay_ms <= longest_ms:
            return NoStall.OWN_PACE
        if self._acknowledged_ns is not None:
            released_ms = (now_ns - self._acknowledged_ns) / _NS_PER_MS
            if released_ms > 2.0 * way_ms + _RELEASE_MS:
                return NoStall.OWN_PACE
        return None

    def _released(self, now_ns: int, held: _Held, kernel: Kernel) -> None:
        """Say of a reply that has left by now why it had not before."""
        tally = self._tallies[Stall.REPLY]
        wait_ns, since_ns = now_ns - held.at_ns, now_ns - held.before_ns
        delay_ns = since_ns - self._way_ns
        if kernel.retransmissions != held.retransmissions:
            tally.none[NoStall.NETWORK] += 1
        elif wait_ns < DELAYED_NS:
            tally.none[NoStall.PROMPT] += 1
        elif delay_ns < DELAYED_NS:
            tally.none[NoStall.NETWORK] += 1
        elif not self._nagle or delay_ns > LONGEST_DELAY_NS:
            tally.none[NoStall.UNCLEAR] += 1
        else:
            tally.stalled(wait_ns, delay_ns)

    def _watch_held(self, now_ns: int) -> None:
        if self._held is not None:
            if now_ns - self._held.at_ns > LONGEST_DELAY_NS:
                # A client that is gone, or does not read: whatever it is, no acknowledgement is delayed for so long.
                self._tallies[Stall.REPLY].none[NoStall.UNCLEAR] += 1
                self._held = None
            else:
                self.due_ns = now_ns + SAMPLE_EVERY_NS


def _difference(before: int | None, after: int | None) -> int | None:
    return None if before is None or after is None else after - before


def _more(before: int | None, after: int | None) -> bool:
    return before is not None and after is not None and after > before
