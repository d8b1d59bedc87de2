"""What is measured: kinds of small messages, and the figures of each."""

from dataclasses import dataclass, field
from typing import Final

from hil.client.servo.statistic_timer import StatisticTimer
from transport.tcp import Wishes

NO_WISHES: Final = Wishes()
STALL_MS: Final = 15.0
"""A part that is held longer waits for an acknowledgement: the shortest delay in use is Linux's 40 ms."""
_STALLED_SHARE: Final = 0.2


@dataclass(frozen=True, slots=True)
class Case:
    """One kind of message."""

    name: str
    writes: int
    """Parts the request is written in here, 1 or 2."""
    no_delay: bool
    """TCP_NODELAY here."""
    wishes: Wishes = NO_WISHES
    """What the responder is asked to do; nothing: it stays as it is."""

    @property
    def asked(self) -> bool:
        """Whether the responder was asked to be as it is not by itself."""
        return self.wishes != NO_WISHES


ONE_NO_DELAY: Final = Case("one write, TCP_NODELAY", writes=1, no_delay=True)
ONE_NAGLE: Final = Case("one write, Nagle", writes=1, no_delay=False)
TWO_NO_DELAY: Final = Case("two writes, TCP_NODELAY", writes=2, no_delay=True)
TWO_NAGLE: Final = Case("two writes, Nagle", writes=2, no_delay=False)
REPLY_NO_DELAY: Final = Case(
    "asked: reply in two, TCP_NODELAY",
    writes=1,
    no_delay=True,
    wishes=Wishes(two_writes=True, no_delay=True),
)
REPLY_NAGLE: Final = Case(
    "asked: reply in two, Nagle",
    writes=1,
    no_delay=True,
    wishes=Wishes(two_writes=True, no_delay=False),
)
TWO_NAGLE_LATE: Final = Case(
    "asked: late ACK; two writes, Nagle",
    writes=2,
    no_delay=False,
    wishes=Wishes(quick_ack=False),
)
RESPONDER_CASES: Final = (ONE_NO_DELAY, ONE_NAGLE, TWO_NO_DELAY, TWO_NAGLE, REPLY_NO_DELAY, REPLY_NAGLE, TWO_NAGLE_LATE)
ECHO_CASES: Final = (ONE_NO_DELAY, ONE_NAGLE, TWO_NO_DELAY)
"""An echo of the first part acknowledges it, so two writes with Nagle on would never be held."""


@dataclass(frozen=True, slots=True)
class Exchange:
    """Where the time of one round trip went, in ms; what is left over was the network's."""

    total_ms: float
    held_here_ms: float = 0.0
    """Between the parts of the request as they arrived there, beyond how they were written here."""
    held_there_ms: float = 0.0
    """Between the parts of the reply as they arrived here."""
    thought_ms: float = 0.0
    """From the whole request to the reply, by the other side's clock."""

    @property
    def network_ms(self) -> float:
        """Return what is neither side's."""
        return max(0.0, self.total_ms - self.held_here_ms - self.held_there_ms - self.thought_ms)


@dataclass(frozen=True, slots=True)
class Held:
    """How long the second part of a message was held, of all of them and of those that waited."""

    all: StatisticTimer = field(default_factory=StatisticTimer)
    stalls: StatisticTimer = field(default_factory=StatisticTimer)

    def add(self, held_ms: float) -> None:
        """Count one message."""
        self.all.add(held_ms)
        if held_ms >= STALL_MS:
            self.stalls.add(held_ms)

    @property
    def stalled(self) -> bool:
        """Whether so many waited that it is no accident."""
        return self.stalls.count >= max(min(2, self.all.count), _STALLED_SHARE * self.all.count, 1)


@dataclass(slots=True)
class CaseResult:
    """The figures of one case."""

    case: Case
    total: StatisticTimer = field(default_factory=StatisticTimer)
    held_here: Held = field(default_factory=Held)
    held_there: Held = field(default_factory=Held)
    thought: StatisticTimer = field(default_factory=StatisticTimer)
    network: StatisticTimer = field(default_factory=StatisticTimer)
    retransmissions: int = 0
    """Segments of both sides that were sent again."""
    not_done: str = ""
    """Why an asked case was not measured: the responder did not do as it was asked, or is so by itself."""
    nagle_there: bool | None = None
    """Whether the other side has Nagle's algorithm on; None: it does not say."""

    def add(self, exchange: Exchange) -> None:
        """Count one round trip."""
        self.total.add(exchange.total_ms)
        self.held_here.add(exchange.held_here_ms)
        self.held_there.add(exchange.held_there_ms)
        self.thought.add(exchange.thought_ms)
        self.network.add(exchange.network_ms)


@dataclass(frozen=True, slots=True)
class Measured:
    """All that was measured of one peer."""

    peer: str
    """HOST:PORT."""
    here: str
    """This side's system, as ``platform.system()`` has it."""
    there: str
    """The other side's; empty where it does not say."""
    connect_ms: float
    results: tuple[CaseResult, ...]
    left_out: tuple[Case, ...] = ()
    """Cases that the time did not suffice for."""
    echo: bool = False
    kernel_round_trip_ms: float | None = None
    """Smoothed round trip of the kernel here, where it says."""
