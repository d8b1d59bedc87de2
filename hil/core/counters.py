"""Packets by outcome, and events about dropped ones that cannot flood anybody."""

from collections.abc import Iterable

from hil.core.events import PacketDropped
from hil.values.outcomes import Outcome

EVENT_INTERVAL_NS = 1_000_000_000


class PacketCounters:
    """Counts each of the ``drops`` a link knows; gives one event per outcome and second."""

    def __init__(self, drops: Iterable[Outcome]) -> None:
        self.sent = 0
        self.received = 0
        self.accepted_count = 0
        self.by_outcome = dict.fromkeys(drops, 0)
        self._unreported = dict.fromkeys(self.by_outcome, 0)
        self._reported_at_ns: dict[Outcome, int] = {}

    def accepted(self) -> None:
        """A packet reached where it was meant to go."""
        self.accepted_count += 1

    def dropped(self, outcome: Outcome, detail: str, *, now_ns: int) -> PacketDropped | None:
        """Count a dropped packet; return an event when one is due."""
        self.by_outcome[outcome] += 1
        self._unreported[outcome] += 1
        reported_at_ns = self._reported_at_ns.get(outcome)
        if reported_at_ns is not None and now_ns - reported_at_ns < EVENT_INTERVAL_NS:
            return None
        self._reported_at_ns[outcome] = now_ns
        count, self._unreported[outcome] = self._unreported[outcome], 0
        return PacketDropped(now_ns, outcome, count, detail)

    def report(self) -> dict[str, object]:
        """Return sent, received, accepted, and the dropped ones by reason (all reasons, zeros included)."""
        return {
            "sent": self.sent,
            "received": self.received,
            "accepted": self.accepted_count,
            "dropped": {outcome.value: count for outcome, count in self.by_outcome.items()},
        }
