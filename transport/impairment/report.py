"""What each fault did: how often, and to which packets."""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from hil.values.errors import HilError
from transport.impairment.faults import Direction, Fault

PACKETS_TOLD: Final = 8
"""So many packets from the first one on, and as many up to the last, are remembered of each fault."""


class PacketId(NamedTuple):
    """A packet: its number among those that entered in its direction, from 0."""

    direction: Direction
    number: int

    def __str__(self) -> str:
        return f"{self.direction} {self.number}"


@dataclass(frozen=True, slots=True)
class FaultReport:
    """What became of one fault."""

    fault: Fault
    fired: int
    """Packets it did something to."""
    met: int
    """Packets that came as far as this fault."""
    lost: int
    """Of those it fired on, how many it lost."""
    added: int
    """Copies it added."""
    first: tuple[PacketId, ...]
    """The first packets it fired on."""
    last: tuple[PacketId, ...]
    """The last ones, none of them among the first."""

    @property
    def packets(self) -> tuple[PacketId, ...]:
        """The packets it fired on: all, or the first and the last where they are many."""
        return self.first + self.last

    @property
    def packets_text(self) -> str:
        """Those packets in words, by direction; three dots stand for what was left out."""
        gap = " ... " if self.fired > len(self.packets) else ", "
        parts = []
        for direction in Direction:
            ends = [_numbers(packets, direction) for packets in (self.first, self.last)]
            if any(ends):
                parts.append(f"{direction} {gap.join(filter(None, ends))}")
        return "; ".join(parts)

    def __str__(self) -> str:
        if not self.fired:
            return f"{self.fault}: never fired, {self.met} packets met it"
        counts = "".join(f", {count} {what}" for count, what in ((self.lost, "lost"), (self.added, "added")) if count)
        return f"{self.fault}: fired on {self.fired} of {self.met} packets{counts}: {self.packets_text}"


class FaultNeverFired(HilError):
    """Armed ``faults`` that did nothing, so that a test under them shows nothing."""

    def __init__(self, faults: Sequence[Fault], packets: Mapping[Direction, int]) -> None:
        self.faults, self.packets = tuple(faults), dict(packets)
        passed = ", ".join(f"{count} {direction}" for direction, count in packets.items())
        super().__init__(f"never fired: {', '.join(map(str, faults))}; packets that entered: {passed}")


class Tally:
    """Counts for one fault; bounded however long it runs."""

    def __init__(self, fault: Fault) -> None:
        self.fault = fault
        self.fired = self.met = self.lost = self.added = 0
        self._first: list[PacketId] = []
        self._last: deque[PacketId] = deque(maxlen=PACKETS_TOLD)

    def fire(self, packet: PacketId, *, lost: int = 0, added: int = 0) -> None:
        """Count that the fault did something to ``packet``."""
        self.fired += 1
        self.lost += lost
        self.added += added
        (self._first if len(self._first) < PACKETS_TOLD else self._last).append(packet)

    def report(self) -> FaultReport:
        """Return the counts so far."""
        return FaultReport(
            self.fault, self.fired, self.met, self.lost, self.added, tuple(self._first), tuple(self._last)
        )


def _numbers(packets: Sequence[PacketId], direction: Direction) -> str:
    return ", ".join(str(packet.number) for packet in packets if packet.direction is direction)
