"""Where the time of each FRI answer goes: our sending, wire and peer, our receiving. Fed every cycle, so kept cheap.

::

    due ──(1)── departed ──(2)── received ──(3)── next cycle is due ──(4)── it begins

(1) is this controller's lateness in sending; (2) is wire and peer, up to the kernel's stamp; (3) is by design, a cycle
uses what came before it; (4) is this controller's lateness in using it. Nanoseconds of the core's axis.
"""

import heapq
from collections import deque
from typing import Final, NamedTuple

from hil.core.statistics import FINE_SHIFT, CycleHistogram, Histogram

REMEMBERED: Final = 256
"""Messages whose due time is remembered, as the sequence tracker remembers when they left."""
WORST: Final = 20
"""Slowest answers that are kept."""
_LATE_CYCLES: Final = 1000
PARTS: Final = ("send_lateness", "peer_and_wire", "wait", "use_lateness")


class SlowAnswer(NamedTuple):
    """One answer and its split."""

    age_ns: int
    """From the message's departure to the answer in the kernel; the order of these."""
    counter: int
    received_ns: int
    send_lateness_ns: int
    wait_ns: int
    """From the kernel to the due time of the cycle that used it; 0 when that was due before."""
    use_lateness_ns: int
    cycle: int
    """That used it, from 0."""

    def as_dict(self) -> dict[str, object]:
        """Return it for JSON; microseconds, seconds of the core's axis."""
        return {
            "message": self.counter,
            "received_s": round(self.received_ns / 1e9, 6),
            "send_lateness_us": round(self.send_lateness_ns / 1e3, 1),
            "peer_and_wire_us": round(self.age_ns / 1e3, 1),
            "wait_us": round(self.wait_ns / 1e3, 1),
            "use_lateness_us": round(self.use_lateness_ns / 1e3, 1),
            "cycle": self.cycle,
        }


class LateCycle(NamedTuple):
    """A control cycle that began late."""

    due_ns: int
    lateness_ns: int


class AnswerPath:
    """Of one FRI link. A cycle is late when it began more than a quarter of the answers' budget after it was due.

    What runs in every cycle is written out, and some of it in :class:`hil.core.fri.link.FriLink`: a call costs more.
    """

    def __init__(self, *, budget_ns: int) -> None:
        self._late_from_ns = budget_ns // 4
        self._due_ns: deque[int] = deque(maxlen=REMEMBERED)
        self._send, self._peer, self._wait, self._use = (CycleHistogram() for _ in PARTS)
        self.arrived: list[tuple[int, int, int]] = []
        """Answers that no cycle used yet: when each came, its message's age then, its message."""
        self.used: list[tuple[int, int, int]] = []
        """Those that the last cycle used that had any."""
        self._worst: list[SlowAnswer] = []
        self._worst_enough_ns = -1
        self._last_counter = -1
        self.departed_ns = 0
        """When the message left that was sent last; its lateness is counted when the next one is sent."""
        self.late_cycles: deque[LateCycle] = deque(maxlen=_LATE_CYCLES)
        self.cycle = -1
        """The one that runs, from 0."""
        self.skipped = 0
        """Messages that were never sent because cycles were missed."""
        self.last_skip_ns: int | None = None

    def began(self, now_ns: int, started_ns: int) -> None:
        """A control cycle began: it uses what arrived since the one before."""
        self.cycle += 1
        lateness_ns = started_ns - now_ns
        if lateness_ns > self._late_from_ns:
            self.late_cycles.append(LateCycle(now_ns, lateness_ns))
        arrived = self.arrived
        if not arrived:
            return
        for received_ns, age_ns, counter in arrived:
            waited_ns = now_ns - received_ns
            if age_ns < 0 or waited_ns < 0 or lateness_ns < 0:
                self._add_unusual(received_ns, age_ns, now_ns, started_ns)
            else:
                try:
                    self._peer.fine[age_ns >> FINE_SHIFT] += 1
                except IndexError:
                    self._peer.add_long(age_ns)
                try:
                    self._wait.fine[waited_ns >> FINE_SHIFT] += 1
                except IndexError:
                    self._wait.add_long(waited_ns)
                try:
                    self._use.fine[lateness_ns >> FINE_SHIFT] += 1
                except IndexError:
                    self._use.add_long(lateness_ns)
            if age_ns > self._worst_enough_ns:
                self._note_worst(age_ns, counter, received_ns, now_ns, started_ns)
        self.arrived = self.used
        self.arrived.clear()
        self.used = arrived

    def sent(self, counter: int, due_ns: int, sent_ns: int) -> None:
        """A message goes out; ``due_ns`` is the nominal time of its cycle. It may still be corrected when it left."""
        known = self._due_ns
        if known:
            self._send.add(self.departed_ns - known[-1])
        known.append(due_ns)
        self.departed_ns = sent_ns
        self._last_counter = counter

    def skip(self, messages: int, *, now_ns: int) -> None:
        """So many messages are not sent, because cycles were missed before the one that is due at ``now_ns``."""
        self.skipped += messages
        self.last_skip_ns = now_ns

    def due_ns(self, counter: int) -> int | None:
        """Return when a message was due; None where that is forgotten."""
        distance = self._last_counter - counter
        if distance < 0:
            distance %= 1 << 32
        return self._due_ns[-1 - distance] if distance < len(self._due_ns) else None

    def lateness_between(self, begin_ns: int, end_ns: int) -> int:
        """Return how late the latest of the late cycles was that were due or began in that time; 0 where none was."""
        found = 0
        for due_ns, lateness_ns in reversed(self.late_cycles):
            if due_ns + lateness_ns < begin_ns:
                break
            if due_ns <= end_ns:
                found = max(found, lateness_ns)
        return found

    @property
    def peer_and_wire(self) -> Histogram:
        """From a message's departure to its answer in the kernel; late answers too."""
        return self._peer.whole()

    @property
    def histograms(self) -> dict[str, Histogram]:
        """The four parts, in the order of their time."""
        parts = self._send, self._peer, self._wait, self._use
        return {name: part.whole() for name, part in zip(PARTS, parts, strict=True)}

    @property
    def worst(self) -> list[SlowAnswer]:
        """The answers that took longest, the worst first."""
        return sorted(self._worst, reverse=True)

    def report(self) -> dict[str, object]:
        """Return the parts for the status file."""
        return {name: histogram.summary_us() for name, histogram in self.histograms.items()}

    def _add_unusual(self, received_ns: int, age_ns: int, now_ns: int, started_ns: int) -> None:
        """Count an answer that came while its cycle was already late: only the rest of the lateness held it up."""
        self._peer.add(age_ns)
        self._wait.add(now_ns - received_ns)
        self._use.add(started_ns - max(received_ns, now_ns))

    def _note_worst(self, age_ns: int, counter: int, received_ns: int, now_ns: int, started_ns: int) -> None:
        due_ns = self.due_ns(counter)
        one = SlowAnswer(
            age_ns,
            counter,
            received_ns,
            send_lateness_ns=0 if due_ns is None else received_ns - age_ns - due_ns,
            wait_ns=max(now_ns - received_ns, 0),
            use_lateness_ns=started_ns - max(received_ns, now_ns),
            cycle=self.cycle,
        )
        if len(self._worst) < WORST:
            heapq.heappush(self._worst, one)
        else:
            heapq.heapreplace(self._worst, one)
        if len(self._worst) == WORST:
            self._worst_enough_ns = self._worst[0].age_ns
