"""How old the state is that a packet of an application reflects: the latency budget of one servo link session."""

from collections import deque


class LatencyBudget:
    """Judges packets by how long a newer state has been out than the one they reflect.

    So nobody is charged for a stall of ours: as long as there is no newer state, a packet is not late.
    """

    def __init__(self, *, budget_ns: int, cycle_ns: int) -> None:
        self.budget_ns = budget_ns
        # At most one state leaves in a cycle: what is not remembered is older than the budget.
        self._sent_ns: deque[int] = deque(maxlen=budget_ns // cycle_ns + 2)
        """When the last states left, the newest last."""
        self._newest = 0
        self.late_in_a_row = 0
        self.last_late = ""
        """How late the last one was, in words."""

    def sent(self, sequence: int, *, at_ns: int) -> None:
        """The state ``sequence``, one more than the last one, is to leave."""
        self._newest = sequence
        self._sent_ns.append(at_ns)

    def departed(self, *, at_ns: int) -> None:
        """The newest state leaves at ``at_ns``, not when its cycle began."""
        if self._sent_ns:
            self._sent_ns[-1] = max(self._sent_ns[-1], at_ns)

    def late(self, reflected_sequence: int, *, now_ns: int) -> str:
        """Return by how much a packet that reflects a state is over the budget, in words; empty when it is not."""
        if reflected_sequence == self._newest:
            self.late_in_a_row = 0
            return ""
        since = self._newest - reflected_sequence
        if since < 0:
            problem = f"reflects state {reflected_sequence}, which was not sent yet"
        elif since > len(self._sent_ns):
            problem = (
                f"reflects state {reflected_sequence}, {since} states ago; that is longer than its latency budget of "
                f"{self.budget_ns / 1e6:g} ms"
            )
        else:
            age_ns = now_ns - self._sent_ns[-since]
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
