"""How late the pacer's own timer wakes an event loop that has nothing else to do."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field

from hil.clock import MonotonicClock
from hil.core.settings import NS_PER_MS
from hil.core.statistics import Histogram
from hil.runtime.pacer import Tick, open_pacer

_MOST_BOOKED = 10_000
"""Cycles of one stall whose lateness is booked."""


@dataclass(slots=True)
class Lateness:
    """What a timer did. A cycle that could not begin before the next one was due is missed, as in ``hil run``."""

    cycle_ns: int
    cycles: int = 0
    """Cycles that were due."""
    missed: int = 0
    stalls: int = 0
    """How often at least one was missed."""
    late: Histogram = field(default_factory=Histogram)
    """Of all of them, the missed ones included: when each could have begun, after it was due."""

    def book(self, tick: Tick) -> None:
        """Book a tick of the pacer, and the cycles it went over."""
        self.cycles += 1 + tick.missed
        self.missed += tick.missed
        self.stalls += tick.missed > 0
        for behind in range(min(tick.missed, _MOST_BOOKED), -1, -1):
            self.late.add(tick.lateness_ns + behind * self.cycle_ns)

    @property
    def missed_share(self) -> float:
        """Missed cycles of all that were due."""
        return self.missed / self.cycles if self.cycles else 0.0


def measure_lateness(*, seconds: float, cycle_ms: int, progress: Callable[[float], None]) -> Lateness:
    """Let the pacer tick every ``cycle_ms`` for ``seconds``; ``progress`` is called once a second."""
    return asyncio.run(_measure(Lateness(cycle_ms * NS_PER_MS), seconds, progress))


async def _measure(found: Lateness, seconds: float, progress: Callable[[float], None]) -> Lateness:
    clock = MonotonicClock()
    pacer = open_pacer(clock=clock, first_due_ns=clock.now_ns() + found.cycle_ns, period_ns=found.cycle_ns)
    wanted = max(1, round(seconds * 1e9 / found.cycle_ns))
    told_s = 0
    try:
        while found.cycles < wanted:
            found.book(await pacer.next_tick())
            if (gone_s := found.cycles * found.cycle_ns // 1_000_000_000) > told_s:
                told_s = gone_s
                progress(gone_s)
    finally:
        pacer.close()
    return found
