"""What each fault does to a datagram on its way in one direction."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random
from statistics import NormalDist
from typing import Final, Generic, TypeVar

from transport.impairment.faults import (
    HEADER_BYTES,
    AtPacket,
    BurstLoss,
    ClockSkew,
    Corrupt,
    Delay,
    Direction,
    Distribution,
    Duplicate,
    Fault,
    HalfOpen,
    Jitter,
    Loss,
    PacketAction,
    Rate,
    Reorder,
)
from transport.impairment.report import PacketId, Tally

LONGEST_HOLD_NS: Final = 1_000_000_000
"""A datagram that waits to be overtaken by packets that do not come goes on after so long."""
_LONGEST_TAIL: Final = 20.0
_STANDARD_NORMAL: Final = NormalDist()
_NS_PER_S: Final = 1_000_000_000

F_co = TypeVar("F_co", bound=Fault, covariant=True)


@dataclass(slots=True)
class Passage:
    """A datagram on its way through the stages."""

    packet: PacketId
    number: int
    """Its own, among all the network ever carried."""
    datagram: bytes
    entered_ns: int
    at_ns: int
    """When it arrives, as far as the stages so far say."""
    origin_ns: int
    """When the first datagram of the network entered."""
    route: object = None
    lost: bool = False
    copies_ns: list[int] = field(default_factory=list)
    """When copies of it arrive."""
    released: list[tuple[int, int]] = field(default_factory=list)
    """Numbers of datagrams held back before, and the time this one lets them arrive at, right behind it."""


class Stage(ABC, Generic[F_co]):
    """One fault in one direction."""

    def __init__(self, fault: F_co, *, tally: Tally, rng: Random) -> None:
        self._fault = fault
        self._tally = tally
        self._rng = rng

    def meet(self, passage: Passage) -> None:
        """Do to ``passage`` what the fault does, and count it."""
        self._tally.met += 1
        self._apply(passage)

    @abstractmethod
    def _apply(self, passage: Passage) -> None:
        """Do to ``passage`` what the fault does."""

    def _lose(self, passage: Passage) -> None:
        passage.lost = True
        self._tally.fire(passage.packet, lost=1)


class _Loss(Stage[Loss]):
    def _apply(self, passage: Passage) -> None:
        if self._rng.random() < self._fault.share:
            self._lose(passage)


class _BurstLoss(Stage[BurstLoss]):
    _in_burst = False

    def _apply(self, passage: Passage) -> None:
        turns = self._rng.random() < (self._fault.leave if self._in_burst else self._fault.enter)
        self._in_burst ^= turns
        if self._in_burst:
            self._lose(passage)


class _HalfOpen(Stage[HalfOpen]):
    def _apply(self, passage: Passage) -> None:
        until_ns = self._fault.until_ns
        if self._fault.from_ns <= passage.entered_ns and (until_ns is None or passage.entered_ns < until_ns):
            self._lose(passage)


class _Corrupt(Stage[Corrupt]):
    def _apply(self, passage: Passage) -> None:
        length = 8 * len(passage.datagram)
        if length and self._rng.random() < self._fault.share:
            flipped = self._rng.sample(range(length), min(self._fault.bits, length))
            passage.datagram = _flipped(passage.datagram, flipped)
            self._tally.fire(passage.packet)


class _Rate(Stage[Rate]):
    _free_ns = 0
    """When the line has sent all it took."""

    def _apply(self, passage: Passage) -> None:
        rate, size = self._fault.bits_per_s, len(passage.datagram) + HEADER_BYTES
        waits_ns = self._free_ns - passage.at_ns
        if waits_ns > 0:
            unsent_bytes = -(-waits_ns * rate // (8 * _NS_PER_S))
            if unsent_bytes + size > self._fault.queue_bytes:
                self._lose(passage)
                return
            self._tally.fire(passage.packet)
        self._free_ns = max(self._free_ns, passage.at_ns) + -(-8 * size * _NS_PER_S // rate)
        passage.at_ns = self._free_ns


class _Delay(Stage[Delay]):
    def _apply(self, passage: Passage) -> None:
        passage.at_ns += self._fault.delay_ns
        self._tally.fire(passage.packet)


class _Jitter(Stage[Jitter]):
    _latest_ns = 0

    def _apply(self, passage: Passage) -> None:
        before_ns = passage.at_ns
        passage.at_ns += round(self._fault.scale_ns * self._deviate())
        if not self._fault.overtaking:
            self._latest_ns = passage.at_ns = max(self._latest_ns, passage.at_ns)
        if passage.at_ns > before_ns:
            self._tally.fire(passage.packet)

    def _deviate(self) -> float:
        """Return what is drawn, for a scale of 1."""
        drawn = self._rng.random()
        if self._fault.distribution is Distribution.UNIFORM:
            return drawn
        if self._fault.distribution is Distribution.EXPONENTIAL:
            return min(_LONGEST_TAIL, -math.log(1.0 - drawn))
        return _STANDARD_NORMAL.inv_cdf(0.5 + 0.5 * drawn)


class _ClockSkew(Stage[ClockSkew]):
    def _apply(self, passage: Passage) -> None:
        fault = self._fault
        shift_ns = round((passage.at_ns - passage.origin_ns) * abs(fault.ppm) * 1e-6)
        grows = (fault.ppm > 0) is (passage.packet.direction is Direction.TO_PEER)
        passage.at_ns += shift_ns if grows else max(0, fault.base_ns - shift_ns)
        if shift_ns:
            self._tally.fire(passage.packet)


class _Duplicate(Stage[Duplicate]):
    def _apply(self, passage: Passage) -> None:
        if self._rng.random() < self._fault.share:
            passage.copies_ns.append(passage.at_ns + self._fault.after_ns)
            self._tally.fire(passage.packet, added=1)


class _AtPacket(Stage[AtPacket]):
    def _apply(self, passage: Passage) -> None:
        fault = self._fault
        if passage.packet.number != fault.index:
            return
        if fault.action is PacketAction.DROP:
            self._lose(passage)
        elif fault.action is PacketAction.DELAY:
            passage.at_ns += fault.delay_ns or 0
            self._tally.fire(passage.packet)
        elif fault.action is PacketAction.DUPLICATE:
            passage.copies_ns.append(passage.at_ns + (fault.delay_ns or 0))
            self._tally.fire(passage.packet, added=1)
        elif passage.datagram:
            length = 8 * len(passage.datagram)
            bit = self._rng.randrange(length) if fault.bit is None else fault.bit % length
            passage.datagram = _flipped(passage.datagram, [bit])
            self._tally.fire(passage.packet)


@dataclass(slots=True)
class _Held:
    packet: PacketId
    number: int
    at_ns: int
    """When it goes on at the latest."""
    overtaken_by: int = 0
    latest_ns: int = 0
    """When the last of those that overtook it arrives."""


class _Reorder(Stage[Reorder]):
    def __init__(self, fault: Reorder, *, tally: Tally, rng: Random) -> None:
        super().__init__(fault, tally=tally, rng=rng)
        self._held: list[_Held] = []

    def _apply(self, passage: Passage) -> None:
        holds = self._rng.random() < self._fault.share
        if holds:
            by_ns = self._fault.by_ns
            passage.at_ns += LONGEST_HOLD_NS if by_ns is None else by_ns
        self._held = [held for held in self._held if passage.entered_ns < held.at_ns and self._stays(held, passage)]
        if holds:
            self._held.append(_Held(passage.packet, passage.number, passage.at_ns))

    def _stays(self, held: _Held, passage: Passage) -> bool:
        """Let ``passage`` overtake ``held``; return whether that one goes on waiting."""
        if passage.at_ns >= held.at_ns:
            return True
        held.overtaken_by += 1
        held.latest_ns = max(held.latest_ns, passage.at_ns)
        if held.overtaken_by == 1:
            self._tally.fire(held.packet)
        if self._fault.by_ns is not None or held.overtaken_by < self._fault.by_packets:
            return True
        passage.released.append((held.number, held.latest_ns))
        return False


def _flipped(datagram: bytes, bits: list[int]) -> bytes:
    damaged = bytearray(datagram)
    for bit in bits:
        damaged[bit // 8] ^= 1 << bit % 8
    return bytes(damaged)


_STAGES: Final[dict[type[Fault], Callable[..., Stage[Fault]]]] = {
    HalfOpen: _HalfOpen,
    Loss: _Loss,
    BurstLoss: _BurstLoss,
    Corrupt: _Corrupt,
    Rate: _Rate,
    Delay: _Delay,
    Jitter: _Jitter,
    ClockSkew: _ClockSkew,
    Duplicate: _Duplicate,
    Reorder: _Reorder,
}
"""In the order a datagram meets them, which makes times add up: what loses it comes before what holds it."""
_ROWS: Final = {kind: 10 * row for row, kind in enumerate(_STAGES)}
_ROWS_AT_PACKET: Final[dict[str, int]] = {
    PacketAction.DROP: -1,
    PacketAction.CORRUPT: _ROWS[Corrupt] + 1,
    PacketAction.DELAY: _ROWS[ClockSkew] + 1,
    PacketAction.DUPLICATE: _ROWS[Duplicate] + 1,
}


def row(fault: Fault) -> int:
    """Return the place of ``fault`` on the way of a datagram; lower ones come first."""
    return _ROWS_AT_PACKET[fault.action] if isinstance(fault, AtPacket) else _ROWS[type(fault)]


def make_stage(fault: Fault, *, tally: Tally, rng: Random) -> Stage[Fault]:
    """Return what does ``fault`` in one direction."""
    if isinstance(fault, AtPacket):
        return _AtPacket(fault, tally=tally, rng=rng)
    return _STAGES[type(fault)](fault, tally=tally, rng=rng)
