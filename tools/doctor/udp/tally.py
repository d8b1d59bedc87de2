"""What came through in each direction, with times: bytes nowhere, clocks nowhere.

A request travels in one packet only, and the controller says of each it has when it got it, by its own clock and its
own kernel (``RequestDone.at_ns``). So there are four times: sent here, arrived there, state due there, arrived here.
"""

from array import array
from collections import OrderedDict, deque
from typing import Final, NamedTuple

from hil.core.statistics import Histogram
from hil.values.fri import SEQUENCE_MODULUS
from hil.values.servo import RequestDone, State

MOST_MISSING: Final = 4096
"""Numbers of states that may still come late; an older one that comes after all counts as a duplicate."""
MOST_OPEN: Final = 2
"""Requests on the way. Each makes two reports, and a state has room for six."""


class Answered(NamedTuple):
    """A request that came through. Ours: ``sent_ns`` and ``answered_ns``; the controller's: the other two."""

    sent_ns: int
    arrived_ns: int
    due_ns: int
    answered_ns: int


class _Open(NamedTuple):
    number: int
    sequence: int
    sent_ns: int


class States:
    """State packets by their numbers: what is missing, came twice, or late."""

    def __init__(self) -> None:
        self.first = 0
        self.newest = 0
        self.received = 0
        self.duplicates = 0
        self.reordered = 0
        self._missing: OrderedDict[int, None] = OrderedDict()

    def book(self, number: int) -> bool:
        """Book one; return whether it is one that did not come before."""
        if not self.received:
            self.first = self.newest = number
        elif number > self.newest:
            for missing in range(max(self.newest + 1, number - MOST_MISSING), number):
                self._missing[missing] = None
            while len(self._missing) > MOST_MISSING:
                self._missing.popitem(last=False)
            self.newest = number
        elif number in self._missing:
            del self._missing[number]
            self.reordered += 1
        else:
            self.duplicates += 1
            return False
        self.received += 1
        return True

    @property
    def sent(self) -> int:
        """How many the controller sent, as far as their numbers tell."""
        return self.newest - self.first + 1 if self.received else 0

    @property
    def lost(self) -> int:
        """How many of them did not come."""
        return self.sent - self.received


class FriTally:
    """Monitoring messages and the answers to them. It grows with the measurement, which the command line bounds."""

    def __init__(self) -> None:
        self.states = States()
        self.numbers, self.stamps_ns, self.arrived_ns = array("q"), array("q"), array("q")
        """Of each message: its number, its time stamp by the controller's clock (0: none), its arrival by ours."""
        self.waited = Histogram()
        self.confirmed_after = Histogram()
        """From sending an answer to the first message that says the controller took it."""
        self.confirmed = 0
        self.lost = 0
        """Answers the controller never took, though the next message came well after they were sent."""
        self.overtaken = 0
        """Answers it never took, and the next message came so soon that the next answer may have been there too."""
        self.dropped_here: int | None = 0
        self.ended_because = ""
        self._sent: OrderedDict[int, int] = OrderedDict()
        self._crowded: set[int] = set()
        self._last_number: int | None = None

    def heard(
        self, counter: int, *, reflected: int, period_ns: int, stamp_ns: int, arrived_ns: int, waited_ns: int | None
    ) -> None:
        """A monitoring message arrived; counters are modulo 2^32."""
        last = counter if self._last_number is None else self._last_number
        number = last + (counter - last + SEQUENCE_MODULUS // 2) % SEQUENCE_MODULUS - SEQUENCE_MODULUS // 2
        gap = number - last > 1
        self._last_number = max(last, number)
        if not self.states.book(number):
            return
        self.numbers.append(number)
        self.stamps_ns.append(stamp_ns)
        self.arrived_ns.append(arrived_ns)
        if waited_ns is not None:
            self.waited.add(waited_ns)
        if self._sent:
            newest, sent_ns = next(reversed(self._sent.items()))
            if arrived_ns - sent_ns < period_ns // 2:
                self._crowded.add(newest)
        if reflected in self._sent:
            self._confirm(reflected, arrived_ns, unknown_before=gap)

    def answered(self, number: int, *, sent_ns: int) -> None:
        """The answer ``number`` left."""
        self._sent[number] = sent_ns
        if len(self._sent) > MOST_MISSING:
            forgotten, _ = self._sent.popitem(last=False)
            self._crowded.discard(forgotten)
            self.lost += 1

    def _confirm(self, reflected: int, arrived_ns: int, *, unknown_before: bool) -> None:
        while self._sent:
            number, sent_ns = self._sent.popitem(last=False)
            crowded = number in self._crowded
            self._crowded.discard(number)
            if number == reflected:
                self.confirmed += 1
                self.confirmed_after.add(arrived_ns - sent_ns)
                return
            # A message that did not come may have been the one that confirmed it.
            self.overtaken += crowded
            self.lost += not crowded and not unknown_before


class Tally:
    """All of a measurement. It grows with the measurement, which the command line bounds."""

    def __init__(self, token: int) -> None:
        self.states = States()
        self.due_ns, self.arrived_ns = array("q"), array("q")
        """Of each state: when it was due by the controller's clock, when it arrived by ours."""
        self.waited = Histogram()
        """How long datagrams waited here, from the kernel to this program."""
        self.send_late = Histogram()
        """How late this program woke to send."""
        self.requests_sent = 0
        self.requests_lost = 0
        """Lost, or overtaken by a newer packet, which the controller takes for the same."""
        self.answered = array("q")
        """Four numbers each, see :class:`Answered`."""
        self.dropped_here: int | None = 0
        """States the kernel had no room for in our socket; None: it does not say."""
        self.ended_because = ""
        """Why it is over before its time."""
        self.reports_seen = 0
        self._token = token
        self._open: deque[_Open] = deque(maxlen=MOST_OPEN)

    @property
    def may_ask(self) -> bool:
        """Whether another request may be on the way."""
        return len(self._open) < MOST_OPEN

    @property
    def requests_open(self) -> int:
        """Requests of which is not known what became of them."""
        return len(self._open)

    def asked(self, *, number: int, sequence: int, sent_ns: int) -> None:
        """The request ``number`` left in the packet ``sequence``."""
        self.requests_sent += 1
        self._open.append(_Open(number, sequence, sent_ns))

    def heard(self, state: State, *, arrived_ns: int, waited_ns: int | None) -> None:
        """A state arrived."""
        if state.token != self._token or not self.states.book(state.sequence):
            return
        self.due_ns.append(state.snapshot.now_ns)
        self.arrived_ns.append(arrived_ns)
        if waited_ns is not None:
            self.waited.add(waited_ns)
        for report in state.reports:
            if report.number <= self.reports_seen:
                continue
            self.reports_seen = report.number
            if isinstance(report, RequestDone):
                self._done(report, state, arrived_ns)
        # A packet older than the newest one is not taken any more: what it carried and is not done is lost.
        while (
            self._open
            and self._open[0].sequence <= state.reflected_sequence
            and self._open[0].number > state.requests_done
        ):
            self._open.popleft()
            self.requests_lost += 1

    def answers(self) -> list[Answered]:
        """Return the requests that came through."""
        return [Answered(*self.answered[place : place + 4]) for place in range(0, len(self.answered), 4)]

    def _done(self, done: RequestDone, state: State, arrived_ns: int) -> None:
        while self._open and self._open[0].number <= done.request:
            asked = self._open.popleft()
            if asked.number == done.request:
                self.answered.extend((asked.sent_ns, done.at_ns, state.snapshot.now_ns, arrived_ns))
            else:
                self.requests_lost += 1
