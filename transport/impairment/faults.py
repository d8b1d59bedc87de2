"""Faults of a network, as values. Each says what it does to a datagram; ``str`` gives the text ``hil impair`` takes.

A fault holds for one ``direction``, or for both where that is None; then each direction is hit for itself. A value that
cannot be, or that could never do anything, raises :class:`OutOfRange` or :class:`ConfigurationError`.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from hil.values.errors import ConfigurationError, OutOfRange, UnknownName
from transport.impairment.units import duration_text, percent_text, rate_text, size_text

LONGEST_NS: Final = 3_600_000_000_000
"""No fault holds a datagram longer than an hour."""
HEADER_BYTES: Final = 28
"""Of IPv4 and UDP: what a datagram is longer on a line than what it carries."""


class Direction(StrEnum):
    """Which way a datagram goes."""

    TO_CONTROLLER = "to-controller"
    TO_PEER = "to-peer"
    """Towards the FRI client or the application."""


class Distribution(StrEnum):
    """How jitter is spread; all of it comes on top, because nothing arrives before it was sent."""

    UNIFORM = "uniform"
    """From 0 to the scale: half the scale in the mean."""
    NORMAL = "normal"
    """The size of a normal deviate whose sigma is the scale: 0.8 of the scale in the mean, rarely more than three."""
    EXPONENTIAL = "exponential"
    """The scale is the mean; the long tail of a busy switch, cut at twenty times the scale."""


class PacketAction(StrEnum):
    """What happens to a single packet."""

    DROP = "drop"
    DELAY = "delay"
    DUPLICATE = "duplicate"
    CORRUPT = "corrupt"


class Fault:
    """One fault of a network; see the dataclasses below."""

    __slots__ = ()
    direction: Direction | None


@dataclass(frozen=True, slots=True)
class Loss(Fault):
    """Each datagram is lost with probability ``share``, whatever became of the others."""

    share: float
    direction: Direction | None = None

    def __post_init__(self) -> None:
        _check_share("share lost", self.share)

    def __str__(self) -> str:
        return f"loss={percent_text(self.share)}{_suffix(self.direction)}"


@dataclass(frozen=True, slots=True)
class BurstLoss(Fault):
    """Datagrams are lost in bursts: Gilbert's model, that is Gilbert-Elliott where a burst loses all and the rest none.

    ``share`` of all datagrams is lost in the long run, in bursts of ``mean_packets`` in the mean, whose lengths are
    distributed geometrically. Before each datagram a burst begins with probability ``enter`` or ends with ``leave``.
    """

    share: float
    mean_packets: float = 8.0
    direction: Direction | None = None

    def __post_init__(self) -> None:
        _check("mean burst length", self.mean_packets, 1.0, 1e6, "packets")
        _check_share("share lost in bursts", self.share)
        # A new burst may follow on the last one after a single datagram, not sooner.
        most = self.mean_packets / (self.mean_packets + 1.0)
        if self.share > most * (1.0 + 1e-12):
            raise OutOfRange(
                "share lost in bursts", self.share, f"> 0 ... {most:g} for bursts of {self.mean_packets:g}"
            )

    @classmethod
    def of_probabilities(cls, *, enter: float, leave: float, direction: Direction | None = None) -> "BurstLoss":
        """Return the fault whose bursts begin with probability ``enter`` and end with ``leave``, before a datagram."""
        _check_share("probability that a burst begins", enter)
        _check_share("probability that a burst ends", leave)
        return cls(enter / (enter + leave), 1.0 / leave, direction)

    @property
    def leave(self) -> float:
        """Probability that a burst is over at the next datagram."""
        return 1.0 / self.mean_packets

    @property
    def enter(self) -> float:
        """Probability that a burst begins with the next datagram."""
        return min(1.0, self.share * self.leave / (1.0 - self.share))

    def __str__(self) -> str:
        return f"burst={percent_text(self.share)}x{self.mean_packets:.10g}{_suffix(self.direction)}"


@dataclass(frozen=True, slots=True)
class Delay(Fault):
    """Each datagram arrives ``delay_ns`` later."""

    delay_ns: int
    direction: Direction | None = None

    def __post_init__(self) -> None:
        _check_duration("delay", self.delay_ns)

    def __str__(self) -> str:
        return f"delay={duration_text(self.delay_ns)}{_suffix(self.direction)}"


@dataclass(frozen=True, slots=True)
class Jitter(Fault):
    """Each datagram arrives later by a time of its own, never sooner.

    By default the order is kept, as a queue on the way keeps it: a datagram waits for the one before it, so where they
    follow closely they are later in the mean than the distribution says. With ``overtaking`` each has its drawn delay
    exactly, and comes before an earlier one where that is later.
    """

    scale_ns: int
    distribution: Distribution = Distribution.UNIFORM
    overtaking: bool = False
    direction: Direction | None = None

    def __post_init__(self) -> None:
        _check_duration("jitter", self.scale_ns)

    def __str__(self) -> str:
        overtaking = "/overtaking" if self.overtaking else ""
        return f"jitter={duration_text(self.scale_ns)}/{self.distribution}{overtaking}{_suffix(self.direction)}"


@dataclass(frozen=True, slots=True)
class Reorder(Fault):
    """A ``share`` of the datagrams is held back until later ones have overtaken it.

    Held until ``by_packets`` later ones have passed, or for ``by_ns`` where that is given. It counts only when another
    one truly came first. Where too few come, the one that waits for packets goes on after a second.
    """

    share: float
    by_packets: int = 1
    by_ns: int | None = None
    direction: Direction | None = None

    def __post_init__(self) -> None:
        _check_share("share reordered", self.share)
        _check_count("packets that overtake", self.by_packets, 1, 1000)
        if self.by_ns is not None:
            _check_duration("time held back", self.by_ns)
            if self.by_packets != 1:
                raise ConfigurationError("reorder holds back by packets or by time, not by both")

    def __str__(self) -> str:
        by = str(self.by_packets) if self.by_ns is None else duration_text(self.by_ns)
        return f"reorder={percent_text(self.share)}/{by}{_suffix(self.direction)}"


@dataclass(frozen=True, slots=True)
class Duplicate(Fault):
    """A ``share`` of the datagrams arrives twice, the second time ``after_ns`` after the first.

    The copy itself is neither duplicated nor held back, should its original be.
    """

    share: float
    after_ns: int = 0
    direction: Direction | None = None

    def __post_init__(self) -> None:
        _check_share("share duplicated", self.share)
        _check_duration("time to the duplicate", self.after_ns, shortest_ns=0)

    def __str__(self) -> str:
        after = f"/{duration_text(self.after_ns)}" if self.after_ns else ""
        return f"duplicate={percent_text(self.share)}{after}{_suffix(self.direction)}"


@dataclass(frozen=True, slots=True)
class Corrupt(Fault):
    """In a ``share`` of the datagrams ``bits`` different bits are flipped; all of them where it has no more.

    A damage that UDP's checksum did not notice: what it notices arrives nowhere, which is :class:`Loss`. An empty
    datagram cannot be damaged.
    """

    share: float
    bits: int = 1
    direction: Direction | None = None

    def __post_init__(self) -> None:
        _check_share("share corrupted", self.share)
        _check_count("bits flipped", self.bits, 1, 8 * 65_507)

    def __str__(self) -> str:
        return f"corrupt={percent_text(self.share)}x{self.bits}{_suffix(self.direction)}"


@dataclass(frozen=True, slots=True)
class Rate(Fault):
    """A line that carries ``bits_per_s``, the headers of IPv4 and UDP (28 bytes) included, and a queue before it.

    A datagram arrives when its last bit has left. One that would bring what is not yet sent above ``queue_bytes`` is
    lost; a line that is idle takes any. It counts where a datagram had to wait or was lost.
    """

    bits_per_s: int
    queue_bytes: int = 64_000
    direction: Direction | None = None

    def __post_init__(self) -> None:
        _check_count("rate in bit/s", self.bits_per_s, 1_000, 100_000_000_000)
        _check_count("queue in bytes", self.queue_bytes, 1, 64_000_000)

    def __str__(self) -> str:
        return f"rate={rate_text(self.bits_per_s)}/{size_text(self.queue_bytes)}{_suffix(self.direction)}"


@dataclass(frozen=True, slots=True)
class HalfOpen(Fault):
    """All in ``direction`` is lost from ``from_ns`` on, until ``until_ns`` or for good; the other direction lives.

    Both are times of the axis the network is used on: in ``hil impair`` since the first datagram.
    """

    direction: Direction
    from_ns: int = 0
    until_ns: int | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.direction, Direction):
            raise ConfigurationError(f"half-open needs the direction that is dead: {' or '.join(Direction)}")
        _check_count("begin of half-open in ns", self.from_ns, 0, 2**63 - 1)
        if self.until_ns is not None and self.until_ns <= self.from_ns:
            raise OutOfRange("end of half-open in ns", self.until_ns, f"> {self.from_ns}, its begin")

    def __str__(self) -> str:
        if self.until_ns is None:
            return f"half-open={self.direction}{f'@{duration_text(self.from_ns)}..' if self.from_ns else ''}"
        return f"half-open={self.direction}@{duration_text(self.from_ns)}..{duration_text(self.until_ns)}"


@dataclass(frozen=True, slots=True)
class ClockSkew(Fault):
    """The peer's clock runs fast by ``ppm`` (slow where that is negative), as the two ends would see it on the wire.

    By a fast clock what the controller sends comes later and later; what such a peer sends comes sooner and sooner. The
    first is a delay that grows from nothing with the time since the first datagram, the second one that shrinks from
    ``base_ns`` until that is used up, because nothing can arrive before it was sent; with a slow clock it is the other
    way round. In both directions together the round trip stays ``base_ns``, as a skewed clock leaves it.

    What this is not: the peer's own timers keep their true pace, its time stamps are not touched, and it sends neither
    more nor fewer datagrams, as a periodic sender with a skewed clock would in the long run. In one direction alone the
    round trip grows or shrinks, which no clock does.
    """

    ppm: float
    base_ns: int = 1_000_000
    direction: Direction | None = None

    def __post_init__(self) -> None:
        _check("clock skew", self.ppm, -100_000.0, 100_000.0, "ppm")
        if self.ppm == 0:
            raise OutOfRange("clock skew", self.ppm, "-100000 ... 100000 ppm without 0")
        _check_duration("base delay of the clock skew", self.base_ns)

    def __str__(self) -> str:
        return f"skew={self.ppm:.10g}ppm/{duration_text(self.base_ns)}{_suffix(self.direction)}"


@dataclass(frozen=True, slots=True)
class AtPacket(Fault):
    """One thing happens to the packet numbered ``index``, counted from 0 in its direction; for sweeps.

    ``delay`` holds only that packet, for ``delay_ns``, so that later ones overtake it. ``duplicate`` sends its copy
    ``delay_ns`` after it where that is given, at once otherwise. ``corrupt`` flips ``bit``, counted from the lowest bit
    of the first byte and from there again where the datagram is shorter; a seeded one where that is None.
    """

    action: PacketAction | str
    """A name is taken too, and becomes the action."""
    index: int
    direction: Direction | None = None
    delay_ns: int | None = None
    bit: int | None = None

    def __post_init__(self) -> None:
        try:
            action = PacketAction(self.action)
        except ValueError:
            raise UnknownName("action on a packet", str(self.action), PacketAction) from None
        object.__setattr__(self, "action", action)
        _check_count("packet", self.index, 0, 2**63 - 1)
        if self.delay_ns is not None:
            if action not in {PacketAction.DELAY, PacketAction.DUPLICATE}:
                raise ConfigurationError(f"{action} takes no time; only delay and duplicate do")
            _check_duration("delay of the packet", self.delay_ns)
        elif action is PacketAction.DELAY:
            raise ConfigurationError("delay of a packet needs the time: delay_ns")
        if self.bit is not None:
            if action is not PacketAction.CORRUPT:
                raise ConfigurationError(f"{action} takes no bit; only corrupt does")
            _check_count("bit", self.bit, 0, 8 * 65_507 - 1)

    def __str__(self) -> str:
        detail = f"+{duration_text(self.delay_ns)}" if self.delay_ns is not None else ""
        detail += f"+bit{self.bit}" if self.bit is not None else ""
        return f"packet={self.action}@{self.index}{detail}{_suffix(self.direction)}"


def _suffix(direction: Direction | None) -> str:
    return "" if direction is None else f":{direction}"


def _check(name: str, value: float, low: float, high: float, unit: str) -> None:
    if not math.isfinite(value) or not low <= value <= high:
        raise OutOfRange(name, value, f"{low:g} ... {high:g} {unit}")


def _check_share(name: str, share: float) -> None:
    if not 0.0 < share <= 1.0:
        raise OutOfRange(name, share, "> 0 ... 1; leave out a fault that shall not be")


def _check_count(name: str, value: int, low: int, high: int) -> None:
    if not isinstance(value, int):
        raise ConfigurationError(f"{name} is {value!r}; a whole number {low} ... {high} is needed")
    if not low <= value <= high:
        raise OutOfRange(name, value, f"{low} ... {high}")


def _check_duration(name: str, duration_ns: int, *, shortest_ns: int = 1) -> None:
    _check_count(f"{name} in ns", duration_ns, shortest_ns, LONGEST_NS)
