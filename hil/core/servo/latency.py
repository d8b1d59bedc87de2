"""How old the state is that a packet of an application reflects: the latency budget of one servo link session."""

from collections import OrderedDict
from typing import Final

MAX_REMEMBERED: Final = 1024
"""States whose time of sending is remembered: more than one second's at the shortest period."""


class LatencyBudget:
    """Judges packets by how long a newer state has been out than the one they reflect.

    So nobody is charged for a stall of ours: as long as there is no newer state, a packet is not late.
    """

    def __init__(self, *, budget_ns: int) -> None:
        self.budget_ns = budget_ns
        self._sent_ns: OrderedDict[int, int] = OrderedDict()
        self._newest = 0
        self.late_in_a_row = 0
        self.last_late = ""
        """How late the last one was, in words."""

    def sent(self, sequence: int, *, at_ns: int) -> None:
        """A state left."""
        self._newest = sequence
        self._sent_ns[sequence] = at_ns
        if len(self._sent_ns) > MAX_REMEMBERED:
            self._sent_ns.popitem(last=False)

    def late(self, reflected_sequence: int, *, now_ns: int) -> str:
        """Return by how much a packet that reflects a state is over the budget, in words; empty when it is not."""
        if reflected_sequence == self._newest:
            self.late_in_a_row = 0
            return ""
        newer_ns = self._sent_ns.get(reflected_sequence + 1)
        if newer_ns is None:
            problem = f"reflects state {reflected_sequence}, which was not sent, or too long ago to remember"
        else:
            age_ns = now_ns - newer_ns
            if age_ns <= self.budget_ns:
                self.late_in_a_row = 0
                return ""
            problem = (
                f"reflects state {reflected_sequence}, and the one after that was sent {age_ns / 1e6:.1f} ms ago, "
                f"{(age_ns - self.budget_ns) / 1e6:.1f} ms over the latency budget of {self.budget_ns / 1e6:g} ms"
            )
        self.late_in_a_row += 1
        self.last_late = problem
        return problem
