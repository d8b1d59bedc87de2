"""Which sent messages wait for an answer, and what an answer's counters say of it.

A message is known by its sequence counter, which the client reflects. That is the order that counts: an answer is
fresh when it reflects a message later than the one answered last. The client's own counter only tells a restart.
Counters wrap at 2^32.
"""

from collections import deque
from typing import NamedTuple

from hil.values.fri import SEQUENCE_MODULUS
from hil.values.outcomes import Outcome

_HALF = SEQUENCE_MODULUS // 2
REMEMBERED = 256
"""Messages whose send time is remembered: at least 256 ms of them, more than any budget."""


class Verdict(NamedTuple):
    """What the counters say: ``outcome`` ACCEPTED with the age, or a drop with its words; REORDERED has an age too."""

    outcome: Outcome
    age_ns: int
    detail: str


class SequenceTracker:
    """Book of the last :data:`REMEMBERED` sent messages."""

    def __init__(self, *, first_counter: int = 0) -> None:
        self.next_counter = first_counter % SEQUENCE_MODULUS
        self.client_counter: int | None = None
        self.last_answered: int | None = None
        self._sent_ns: deque[int] = deque(maxlen=REMEMBERED)
        """When the last messages were sent, the newest last."""
        self._answered: deque[int] = deque(maxlen=REMEMBERED)

    def sent(self, *, at_ns: int) -> int:
        """Book the next message as sent and return its counter."""
        counter, last = self.next_counter, self.last_answered
        self._sent_ns.append(at_ns)
        self.next_counter = (counter + 1) % SEQUENCE_MODULUS
        # Too long ago to order anything by, and after 2^31 messages without an answer it would order them wrongly.
        if last is not None and (counter - last) % SEQUENCE_MODULUS > REMEMBERED:
            self.last_answered = None
        return counter

    def departed(self, *, at_ns: int) -> None:
        """Correct the send time of the message booked last."""
        if self._sent_ns:
            self._sent_ns[-1] = at_ns

    def fresh_age_ns(self, reflected: int, *, now_ns: int) -> int | None:
        """Return how old the message is that an accepted answer reflects; None where :meth:`judge` has more to say."""
        distance = (self.next_counter - 1 - reflected) % SEQUENCE_MODULUS
        if distance >= len(self._sent_ns):
            return None
        last = self.last_answered
        if last is not None and not 0 < (reflected - last) % SEQUENCE_MODULUS < _HALF:
            return None
        return now_ns - self._sent_ns[-1 - distance]

    def judge(self, reflected: int, *, now_ns: int) -> Verdict:
        """Say what an answer that reflects ``reflected`` is; changes nothing."""
        age_ns = self.fresh_age_ns(reflected, now_ns=now_ns)
        if age_ns is not None:
            return Verdict(Outcome.ACCEPTED, age_ns, "")
        distance = (self.next_counter - 1 - reflected) % SEQUENCE_MODULUS
        if not self._sent_ns or distance >= _HALF:
            return Verdict(Outcome.UNSENT_SEQUENCE, 0, f"reflects message {reflected}, which was never sent")
        last = self.last_answered
        if last is not None and not _is_before(last, reflected):
            return self._overtaken(reflected, last, distance, now_ns)
        return Verdict(
            Outcome.REPLAYED, 0, f"reflects message {reflected}, older than the last {len(self._sent_ns)} messages"
        )

    def _overtaken(self, reflected: int, last: int, distance: int, now_ns: int) -> Verdict:
        if reflected == last:
            return Verdict(Outcome.DUPLICATE, 0, f"message {reflected} was answered just before")
        if reflected in self._answered or counter_distance(reflected, last) >= REMEMBERED:
            return Verdict(Outcome.REPLAYED, 0, f"message {reflected} was answered before, or is long gone")
        age_ns = now_ns - self._sent_ns[-1 - distance] if distance < len(self._sent_ns) else 0
        return Verdict(Outcome.REORDERED, age_ns, f"reflects {reflected} after {last} was answered")

    def answered(self, reflected: int, client_counter: int) -> bool:
        """Book a fresh answer; return True when the client's own counter shows that it started anew."""
        before, self.client_counter = self.client_counter, client_counter
        self.last_answered = reflected
        self._answered.append(reflected)
        return before is not None and not 0 < (client_counter - before) % SEQUENCE_MODULUS < _HALF


def counter_distance(earlier: int, later: int) -> int:
    """Return how many steps ``later`` is after ``earlier``, modulo 2^32."""
    return (later - earlier) % SEQUENCE_MODULUS


def _is_before(first: int, second: int) -> bool:
    return 0 < (second - first) % SEQUENCE_MODULUS < _HALF
