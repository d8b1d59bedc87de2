"""Distributions and counts of a measurement, from its times."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from hil.core.settings import NS_PER_MS
from hil.core.statistics import Histogram
from hil.values.servo import Welcome
from tools.doctor.udp.floor import Floor, floor_under
from tools.doctor.udp.tally import Answered, Tally

LEAST_STATES: Final = 20
"""Fewer show no drift."""
DRIFT_DOUBT: Final = 3.0
"""Median jitters that either end of the line may be off by; with one, a machine drifted against itself (measured)."""


@dataclass(slots=True)
class LinkFigures:
    """One measurement. ``down``: from the controller to this host; ``up``: to the controller. Times in ns."""

    period_ns: int
    cycle_ns: int
    down: str = "states"
    """What the controller sends; and what this host sends:"""
    up: str = "requests"
    seconds: float = 0.0
    software: str = ""
    robot: str = ""
    states_sent: int = 0
    states_lost: int = 0
    """All that did not come, those dropped here included."""
    states_duplicate: int = 0
    states_reordered: int = 0
    dropped_here: int = 0
    drops_known: bool = True
    """Whether this system tells what its sockets drop."""
    requests_sent: int = 0
    """Those of which is known what became of them."""
    requests_lost: int = 0
    answered: int = 0
    overtaken: int = 0
    """Answers to a message that the next one followed at once: the controller may have had two, and took the newer."""
    round_trip: Histogram = field(default_factory=Histogram)
    """From sending a request to the arrival of the state that answers it."""
    cycle_wait: Histogram = field(default_factory=Histogram)
    """What of it the request waited at the controller for its next cycle, by the controller's clock."""
    network: Histogram = field(default_factory=Histogram)
    """The rest: both ways, and how late the controller's cycle was and what it took."""
    cycle_late: Histogram = field(default_factory=Histogram)
    """How late the controller's cycle was at least, where a request that it answers arrived after it was due."""
    behind: int = 0
    """Answers whose cycle was a whole cycle late, or more."""
    jitter_down: Histogram = field(default_factory=Histogram)
    """States: later than the quickest, by the time they were due at. Without what they waited in this host."""
    jitter_up: Histogram = field(default_factory=Histogram)
    """Requests: later at the controller's kernel than the quickest."""
    waited_here: Histogram = field(default_factory=Histogram)
    send_late: Histogram = field(default_factory=Histogram)
    drift_ppm: float | None = None
    """How much slower the controller's clock is than this host's; None: too little came."""
    drift_resolution_ppm: float = 0.0
    clock_ahead_ns: int | None = None
    """How far the controller's Unix time is ahead of this host's."""
    clock_resolution_ns: int = 0
    ended_because: str = ""
    quality: str = ""
    """Of an FRI session, as the controller says it, where it is less than GOOD."""

    @property
    def down_lost_share(self) -> float:
        """States lost on the way, of those sent; without those dropped here."""
        return max(0, self.states_lost - self.dropped_here) / self.states_sent if self.states_sent else 0.0

    @property
    def up_lost_share(self) -> float:
        """Requests lost, of those sent."""
        return self.requests_lost / self.requests_sent if self.requests_sent else 0.0


def figures(tally: Tally, welcome: Welcome, *, period_ms: int, unix_minus_clock_ns: int) -> LinkFigures:
    """Return the figures of a measurement; ``unix_minus_clock_ns`` is this host's Unix time less its own clock."""
    states = tally.states
    found = LinkFigures(
        period_ns=period_ms * NS_PER_MS,
        cycle_ns=welcome.cycle_ms * NS_PER_MS,
        software=welcome.software,
        robot=welcome.robot,
        states_sent=states.sent,
        states_lost=states.lost,
        states_duplicate=states.duplicates,
        states_reordered=states.reordered,
        dropped_here=min(tally.dropped_here or 0, states.lost),
        drops_known=tally.dropped_here is not None,
        requests_sent=tally.requests_sent - tally.requests_open,
        requests_lost=tally.requests_lost,
        waited_here=tally.waited,
        send_late=tally.send_late,
        ended_because=tally.ended_because,
    )
    floor = add_way_down(found, tally.due_ns, tally.arrived_ns)
    answers = tally.answers()
    up_floor = _requests(found, answers)
    if answers:
        # As NTP does it: where the quickest packet of each way took as long as that of the other.
        last = answers[-1]
        up_ns, down_ns = up_floor.delay_ns(last.sent_ns), floor.delay_ns(last.due_ns)
        found.clock_ahead_ns = welcome.unix_epoch_ns + (up_ns - down_ns) // 2 - unix_minus_clock_ns
        found.clock_resolution_ns = max(0, up_ns + down_ns) // 2
    return found


def add_way_down(found: LinkFigures, due_ns: Sequence[int], arrived_ns: Sequence[int]) -> Floor:
    """Add length, jitter and drift: what the controller sent, by its clock, and when it arrived by ours."""
    delays_ns = [arrived - due for due, arrived in zip(due_ns, arrived_ns, strict=True)]
    floor = floor_under(due_ns, delays_ns)
    for due, delay in zip(due_ns, delays_ns, strict=True):
        found.jitter_down.add(floor.excess_ns(due, delay))
    if delays_ns:
        found.seconds = (max(due_ns) - min(due_ns)) * 1e-9
        if len(delays_ns) >= LEAST_STATES and floor.over_ns > 0:
            found.drift_ppm = floor.slope * 1e6
            found.drift_resolution_ppm = DRIFT_DOUBT * (found.jitter_down.quantile(0.5) or 0) / floor.over_ns * 1e6
    return floor


def _requests(found: LinkFigures, answers: list[Answered]) -> Floor:
    found.answered = len(answers)
    floor = floor_under([one.sent_ns for one in answers], [one.arrived_ns - one.sent_ns for one in answers])
    for one in answers:
        whole_ns, wait_ns = one.answered_ns - one.sent_ns, one.due_ns - one.arrived_ns
        found.round_trip.add(whole_ns)
        found.cycle_wait.add(wait_ns)
        found.network.add(whole_ns - max(0, wait_ns))
        if wait_ns < 0:
            found.cycle_late.add(-wait_ns)
            found.behind += -wait_ns >= found.cycle_ns
        found.jitter_up.add(floor.excess_ns(one.sent_ns, one.arrived_ns - one.sent_ns))
    return floor
