"""What monitors that only report would have stopped (``--permissive``)."""

from collections import Counter
from collections.abc import Callable

from hil.core.counters import EVENT_INTERVAL_NS
from hil.core.events import Event, WouldHaveStopped
from hil.core.safety.monitors import Trip


class WouldStopLog:
    """Counts each cycle a monitor would have stopped the arm in, and tells ``emit`` of it now and then."""

    def __init__(self, emit: Callable[[Event], None]) -> None:
        self._emit = emit
        self._not_before_ns: dict[str, int] = {}
        self.counts: Counter[str] = Counter()
        """Cycles, by monitor."""

    def add(self, trip: Trip, now_ns: int) -> None:
        """Book a trip."""
        name = trip.monitor.value
        self.counts[name] += 1
        if now_ns >= self._not_before_ns.get(name, now_ns):
            self._not_before_ns[name] = now_ns + EVENT_INTERVAL_NS
            self._emit(WouldHaveStopped(now_ns, name, trip.category, str(trip.fault)))
