"""What the shell measures of a run: rate, lateness, cost of a cycle."""

from hil.core.statistics import Histogram


class RunMeasurements:
    """Nanoseconds in, status figures out."""

    def __init__(self) -> None:
        self.lateness = Histogram()
        self.cycle = Histogram()
        self.missed_cycles = 0
        self.last_lateness_ns = 0
        self._ticks = 0
        self._first_ns = 0
        self._last_ns = 0
        self._between_ns = 0

    def between_ticks(self, cost_ns: int) -> None:
        """Book what was done for the coming cycle before its tick: decoding and admission."""
        self._between_ns += cost_ns

    def missed(self, count: int) -> None:
        """Book cycles that could not begin before the next one was due, caught up or not."""
        self.missed_cycles += count

    def ticked(self, *, began_ns: int, lateness_ns: int, cost_ns: int) -> None:
        """Book a cycle that began at ``began_ns`` and cost ``cost_ns`` from there."""
        if self._ticks == 0:
            self._first_ns = began_ns
        self._ticks += 1
        self._last_ns = began_ns
        self.last_lateness_ns = lateness_ns
        self.lateness.add(lateness_ns)
        self.cycle.add(cost_ns + self._between_ns)
        self._between_ns = 0

    @property
    def rate_hz(self) -> float | None:
        """Cycles a second, over the whole run; None before the second one."""
        if self._last_ns == self._first_ns:
            return None
        return (self._ticks - 1) * 1e9 / (self._last_ns - self._first_ns)

    def report(self) -> dict[str, object]:
        """Return the figures of the status file."""
        rate_hz = self.rate_hz
        return {
            "rate_hz": None if rate_hz is None else round(rate_hz, 4),
            "missed_cycles": self.missed_cycles,
            "lateness_us": self.lateness.summary_us(),
            "cycle_us": self.cycle.summary_us(),
        }
