"""The network: datagrams enter, meet the faults, and leave when they are due."""

from bisect import insort
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from random import Random
from types import MappingProxyType
from typing import Final, NamedTuple

from hil.values.errors import UsageError
from transport.impairment.faults import Direction, Fault
from transport.impairment.report import FaultNeverFired, FaultReport, PacketId, Tally
from transport.impairment.stages import Passage, Stage, make_stage, row
from transport.impairment.units import size_text

MOST_BYTES_ON_THE_WAY: Final = 64_000_000
"""What a network holds at most; a datagram counts a little more than it carries, so that empty ones are bounded too."""
_BOOKKEEPING_BYTES: Final = 200


@dataclass(frozen=True, slots=True)
class NetworkFull(Fault):
    """The model's own bound, armed by nobody: what would be too much on the way is lost, and counted here."""

    most_bytes: int
    direction: Direction | None = None

    def __str__(self) -> str:
        return f"more than {size_text(self.most_bytes)} on the way"


class Delivery(NamedTuple):
    """A datagram that left the network at ``at_ns``; a duplicate has the ``packet`` of its original."""

    at_ns: int
    direction: Direction
    datagram: bytes
    packet: PacketId
    route: object = None
    """What was given beside the datagram when it entered."""


class _OnTheWay(NamedTuple):
    at_ns: int
    turn: int
    """Among those that leave at the same time."""
    number: int
    delivery: Delivery


class Network:
    """Two directions of a network with ``faults``, the same for the same seed, datagrams and times.

    A datagram meets the faults in an order of their kind, whatever order they are given in: it is lost (a single
    packet, half-open, loss, bursts), corrupted, waits for the line (rate), is held (delay, jitter, skew, a single
    packet), duplicated, reordered. Several of one kind follow on each other as given. Each fault draws from a
    stream of random numbers of its own in each direction.
    """

    def __init__(
        self, faults: Sequence[Fault], *, seed: int = 0, most_bytes_on_the_way: int = MOST_BYTES_ON_THE_WAY
    ) -> None:
        self._tallies = [Tally(fault) for fault in faults]
        self._full = Tally(NetworkFull(most_bytes_on_the_way))
        self._most_bytes = most_bytes_on_the_way
        self._stages = {direction: self._make_stages(direction, seed) for direction in Direction}
        self._entered = dict.fromkeys(Direction, 0)
        self._latest_ns: dict[Direction, int] = {}
        self._origin_ns: int | None = None
        self._on_the_way: list[_OnTheWay] = []
        self._bytes = 0
        self._turns = 0

    @property
    def packets(self) -> Mapping[Direction, int]:
        """How many datagrams entered in each direction."""
        return MappingProxyType(self._entered)

    @property
    def on_the_way(self) -> int:
        """How many datagrams, copies included, have not left yet."""
        return len(self._on_the_way)

    def send(self, datagram: bytes, direction: Direction, *, now_ns: int, route: object = None) -> None:
        """Let a datagram enter. In each direction time must not go back: raises :class:`UsageError`.

        ``route`` comes out beside it: whatever the user needs to know where it goes on to.
        """
        if now_ns < self._latest_ns.get(direction, now_ns):
            raise UsageError(
                f"a datagram enters {direction} at {now_ns} ns, before the last at {self._latest_ns[direction]} ns: "
                "time must not go back"
            )
        self._latest_ns[direction] = now_ns
        if self._origin_ns is None:
            self._origin_ns = now_ns
        packet = PacketId(direction, self._entered[direction])
        self._entered[direction] += 1
        passage = Passage(packet, self._next_turn(), datagram, now_ns, now_ns, self._origin_ns, route)
        for stage in self._stages[direction]:
            stage.meet(passage)
            if passage.lost:
                return
        self._put(passage, passage.at_ns, number=passage.number)
        for at_ns in passage.copies_ns:
            self._put(passage, at_ns, number=self._next_turn())
        for number, at_ns in passage.released:
            self._let_go(number, at_ns)

    def next_due_ns(self) -> int | None:
        """Return when the next datagram leaves; None while there is none on the way."""
        return self._on_the_way[0].at_ns if self._on_the_way else None

    def due(self, *, now_ns: int) -> list[Delivery]:
        """Take out what has left by ``now_ns``, in the order of time."""
        count = 0
        while count < len(self._on_the_way) and self._on_the_way[count].at_ns <= now_ns:
            count += 1
        leaving = [one.delivery for one in self._on_the_way[:count]]
        del self._on_the_way[:count]
        self._bytes -= sum(_size(delivery.datagram) for delivery in leaving)
        return leaving

    def reports(self) -> tuple[FaultReport, ...]:
        """Return what each fault did, in the order they were given; the model's own bound at the end if it was met."""
        tallies = [*self._tallies, self._full] if self._full.fired else self._tallies
        return tuple(tally.report() for tally in tallies)

    def require_fired(self) -> None:
        """Raise :class:`FaultNeverFired` if an armed fault did nothing."""
        if silent := [tally.fault for tally in self._tallies if not tally.fired]:
            raise FaultNeverFired(silent, self._entered)

    def _make_stages(self, direction: Direction, seed: int) -> list[Stage[Fault]]:
        stages: list[tuple[int, Stage[Fault]]] = []
        for tally in self._tallies:
            if tally.fault.direction not in {None, direction}:
                continue
            place = row(tally.fault)
            # A stream by kind and number within the kind: another fault beside it changes nothing about its draws.
            rng = Random(f"{seed} {direction} {place} {sum(place == other for other, _ in stages)}")  # noqa: S311
            stages.append((place, make_stage(tally.fault, tally=tally, rng=rng)))
        return [stage for _, stage in sorted(stages, key=lambda pair: pair[0])]

    def _put(self, passage: Passage, at_ns: int, *, number: int) -> None:
        size = _size(passage.datagram)
        if self._bytes + size > self._most_bytes:
            self._full.fire(passage.packet, lost=1)
            return
        self._bytes += size
        delivery = Delivery(at_ns, passage.packet.direction, passage.datagram, passage.packet, passage.route)
        insort(self._on_the_way, _OnTheWay(at_ns, number, number, delivery))

    def _let_go(self, number: int, at_ns: int) -> None:
        """Let the datagram ``number``, which was held back, leave at ``at_ns`` behind all that leave then."""
        for place, one in enumerate(self._on_the_way):
            if one.number == number:
                del self._on_the_way[place]
                delivery = one.delivery._replace(at_ns=at_ns)
                insort(self._on_the_way, _OnTheWay(at_ns, self._next_turn(), number, delivery))
                return

    def _next_turn(self) -> int:
        self._turns += 1
        return self._turns


def _size(datagram: bytes) -> int:
    return len(datagram) + _BOOKKEEPING_BYTES
