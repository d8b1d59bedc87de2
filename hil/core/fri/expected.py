"""Which answers are due: one for every ``receive_multiplier`` messages, whichever of them the client picks."""

from collections import deque
from collections.abc import Callable

from hil.core.fri.quality import QualityMeter
from hil.core.fri.sequence import counter_distance
from hil.values.fri import SEQUENCE_MODULUS


class ExpectedAnswers:
    """Feeds the quality meter: a window of messages is answered in time once, or missed when its budget is over."""

    def __init__(
        self,
        *,
        receive_multiplier: int,
        budget_ns: int,
        meter: QualityMeter,
        on_missed: Callable[[int, int, int], None] = lambda _counter, _departed_ns, _now_ns: None,
    ) -> None:
        """``on_missed`` is told of a window that is missed: its first message, when its last one left, and now."""
        self._multiplier = receive_multiplier
        self._budget_ns = budget_ns
        self._meter = meter
        self._on_missed = on_missed
        self._pending: deque[tuple[int, int]] = deque()
        """Of each complete window: the counter of its first message, and when its last one was sent."""
        self._first_counter: int | None = None
        self._open_count = 0
        self._open_answered = False
        self._closed_by_last = False

    def sent(self, counter: int, *, at_ns: int) -> None:
        """A message went out."""
        if self._multiplier == 1:
            self._pending.append((counter, at_ns))
            self._closed_by_last = True
            return
        if self._open_count == 0:
            self._first_counter = counter
            self._open_answered = False
        self._open_count += 1
        self._closed_by_last = False
        if self._open_count == self._multiplier:
            self._open_count = 0
            if not self._open_answered and self._first_counter is not None:
                self._pending.append((self._first_counter, at_ns))
                self._closed_by_last = True

    def departed(self, *, at_ns: int) -> None:
        """Correct the send time of the message booked last."""
        if self._closed_by_last and self._pending:
            self._pending[-1] = (self._pending[-1][0], at_ns)

    def answered(self, reflected: int, *, age_ns: int, now_ns: int) -> bool:
        """A fresh answer came; only one within the budget counts for its window, and only the first: whether it did."""
        if age_ns > self._budget_ns:
            return False
        pending = self._pending
        for place, (first, _) in enumerate(pending):
            if (reflected - first) % SEQUENCE_MODULUS < self._multiplier:
                del pending[place]
                self._meter.answered(now_ns=now_ns, latency_ns=age_ns)
                return True
        if self._in_open_window(reflected) and not self._open_answered:
            self._open_answered = True
            self._meter.answered(now_ns=now_ns, latency_ns=age_ns)
            return True
        return False

    def expire(self, *, now_ns: int) -> None:
        """Count the windows whose time is over as missed."""
        while self._pending and now_ns - self._pending[0][1] >= self._budget_ns:
            counter, departed_ns = self._pending.popleft()
            self._meter.missed(now_ns=now_ns)
            self._on_missed(counter, departed_ns, now_ns)

    def _in_open_window(self, reflected: int) -> bool:
        return (
            self._open_count > 0
            and self._first_counter is not None
            and counter_distance(self._first_counter, reflected) < self._multiplier
        )
