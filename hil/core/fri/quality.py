"""Connection quality from what the answers really did.

Rule (ours, fri-wire page): over a sliding second of expected answers, share answered within the latency budget at
least 99 % and 95th percentile of the answer latency below half the budget: EXCELLENT; at least 95 %: GOOD; at least
75 %: FAIR; else POOR. It falls at once, and rises one level at a time after half a second at the better figure. A
window that holds less than half of what a second holds (the controller itself stood still) lowers nothing: the
watchdog, which counts unanswered messages, is there for that.
"""

from collections import deque

from hil.values.fri import Quality

_EXCELLENT = Quality.EXCELLENT
WINDOW_NS = 1_000_000_000
RISE_NS = 500_000_000


class QualityMeter:
    """Judges expected answers one by one; time is an argument, memory is bounded by the window."""

    def __init__(self, *, budget_ns: int, rise_ns: int = RISE_NS) -> None:
        self._budget_ns = budget_ns
        self._rise_ns = rise_ns
        self._full_window = WINDOW_NS // budget_ns
        self._window: deque[tuple[int, bool, bool]] = deque()
        """Of each expected answer: when it was judged, whether it came in time, whether in less than half of it."""
        self._answered = 0
        self._fast = 0
        self._better_since_ns: int | None = None
        self.quality = Quality.POOR
        self.missed_in_a_row = 0
        self.ever_answered = False
        self.fell_at_ns: int | None = None
        """When the answer was judged that lowered it last."""

    def answered(self, *, now_ns: int, latency_ns: int) -> None:
        """An expected answer came in time."""
        self.missed_in_a_row = 0
        self.ever_answered = True
        self._judge(now_ns, True, 2 * latency_ns < self._budget_ns)

    def missed(self, *, now_ns: int) -> None:
        """An expected answer did not come within its budget."""
        self.missed_in_a_row += 1
        self._judge(now_ns, False, False)

    @property
    def expected_count(self) -> int:
        """Expected answers in the window."""
        return len(self._window)

    @property
    def answered_count(self) -> int:
        """Answers in time in the window."""
        return self._answered

    @property
    def slow_count(self) -> int:
        """Answers in time in the window that took half the budget or more."""
        return self._answered - self._fast

    @property
    def rising(self) -> bool:
        """Whether the figure is better than the quality, which follows one level each half second."""
        return self._better_since_ns is not None

    def describe(self) -> str:
        """Return the figure in words."""
        if not self._window:
            return "no answer was due yet"
        text = f"{self._answered} of {len(self._window)} answers of the last second came within {self._budget_text()}"
        if self._answered == len(self._window) and not self._fast_enough():
            text += f", more than 5 % of them later than {self._budget_ns / 2e6:g} ms"
        return text

    def _budget_text(self) -> str:
        return f"the budget of {self._budget_ns / 1e6:g} ms"

    def _judge(self, at_ns: int, answered: bool, fast: bool) -> None:  # each cycle: keywords cost
        window = self._window
        window.append((at_ns, answered, fast))
        self._answered += answered
        self._fast += fast
        horizon_ns = at_ns - WINDOW_NS
        while window[0][0] <= horizon_ns:
            _, answered, fast = window.popleft()
            self._answered -= answered
            self._fast -= fast
        if self._fast == len(window) and self.quality is _EXCELLENT:
            return
        self._settle(self._figure(), at_ns)

    def _figure(self) -> Quality:
        expected, answered = len(self._window), self._answered
        if self._fast == expected:
            return Quality.EXCELLENT
        if answered * 100 >= 99 * expected and self._fast_enough():
            return Quality.EXCELLENT
        if answered * 100 >= 95 * expected:
            return Quality.GOOD
        if answered * 100 >= 75 * expected:
            return Quality.FAIR
        return Quality.POOR

    def _fast_enough(self) -> bool:
        """95th percentile (nearest rank) of the latencies below half the budget."""
        return self._fast * 100 >= 95 * self._answered and self._fast > 0

    def _settle(self, figure: Quality, now_ns: int) -> None:
        if figure < self.quality and 2 * len(self._window) < self._full_window:
            return
        if figure <= self.quality:
            if figure < self.quality:
                self.fell_at_ns = now_ns
            self.quality = figure
            self._better_since_ns = None
        elif self._better_since_ns is None:
            self._better_since_ns = now_ns
        elif now_ns - self._better_since_ns >= self._rise_ns:
            self.quality = Quality(self.quality + 1)
            self._better_since_ns = now_ns if figure > self.quality else None
