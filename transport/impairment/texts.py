"""Faults from text, as on the command line: ``loss=2%``, ``half-open=to-peer@5s..8s``; ``str`` of a fault is one."""

import re
from collections.abc import Callable
from typing import Final, NamedTuple

from hil.values.errors import ConfigurationError, UnknownName
from transport.impairment.faults import (
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
from transport.impairment.units import DURATION_NS, RATE_BITS_PER_S, SIZE_BYTES

_COUNT: Final = r"\d{1,15}"
_NUMBER: Final = rf"{_COUNT}(?:\.{_COUNT})?"
_UNITS: Final = {**DURATION_NS, **RATE_BITS_PER_S, **SIZE_BYTES}


def _quantity(name: str, units: dict[str, int]) -> str:
    return rf"(?P<{name}>{_NUMBER}(?:{'|'.join(units)}))"


_SHARE: Final = rf"(?P<share>{_NUMBER})%"
_DURATION: Final = _quantity("duration", DURATION_NS)
_AFTER: Final = rf"(?:/{_DURATION})?"


class _Value(dict[str, str | None]):
    """What the groups of a pattern held."""

    def number(self, name: str, default: int) -> int:
        text = self[name]
        return default if text is None else int(text)

    def share(self) -> float:
        # Rounded, because a hundredth of a decimal fraction is not the float of that decimal fraction.
        return round(float(self["share"] or 0) / 100.0, 15)

    def quantity(self, name: str, default: int) -> int:
        return default if self[name] is None else self.given(name)

    def optional(self, name: str) -> int | None:
        return None if self[name] is None else self.given(name)

    def given(self, name: str) -> int:
        number, unit = re.fullmatch(rf"({_NUMBER})(\w+)", self[name] or "").groups()  # type: ignore[union-attr]
        return round(float(number) * _UNITS[unit])


class _Kind(NamedTuple):
    pattern: str
    make: Callable[[_Value, Direction | None], Fault]
    written: str
    """How it is written, for a person who wrote it otherwise."""


def _reorder(value: _Value, direction: Direction | None) -> Fault:
    return Reorder(value.share(), value.number("count", 1), value.optional("duration"), direction)


def _jitter(value: _Value, direction: Direction | None) -> Fault:
    distribution = Distribution(value["distribution"] or Distribution.UNIFORM)
    return Jitter(value.given("duration"), distribution, value["overtaking"] is not None, direction)


def _half_open(value: _Value, direction: Direction | None) -> Fault:  # noqa: ARG001  # it is in the value
    return HalfOpen(Direction(value["dead"] or ""), value.quantity("begin", 0), value.optional("end"))


def _packet(value: _Value, direction: Direction | None) -> Fault:
    bit = value["bit"]
    return AtPacket(
        value["action"] or "",
        value.number("index", 0),
        direction,
        value.optional("duration"),
        None if bit is None else int(bit),
    )


_KINDS: Final = {
    "loss": _Kind(_SHARE, lambda value, way: Loss(value.share(), way), "loss=2%"),
    "burst": _Kind(
        rf"{_SHARE}(?:x(?P<mean>{_NUMBER}))?",
        lambda value, way: BurstLoss(value.share(), float(value["mean"] or 8), way),
        "burst=2%x8 (share lost x mean length of a burst in packets)",
    ),
    "delay": _Kind(_DURATION, lambda value, way: Delay(value.given("duration"), way), "delay=5ms"),
    "jitter": _Kind(
        rf"{_DURATION}(?:/(?P<distribution>{'|'.join(Distribution)}))?(?P<overtaking>/overtaking)?",
        _jitter,
        f"jitter=1ms (then /{', /'.join(Distribution)} and /overtaking if wanted)",
    ),
    "reorder": _Kind(
        rf"{_SHARE}(?:/(?:{_DURATION}|(?P<count>{_COUNT})))?",
        _reorder,
        "reorder=1%[/3] (by packets) or reorder=1%/2ms",
    ),
    "duplicate": _Kind(
        rf"{_SHARE}{_AFTER}",
        lambda value, way: Duplicate(value.share(), value.quantity("duration", 0), way),
        "duplicate=1%[/2ms]",
    ),
    "corrupt": _Kind(
        rf"{_SHARE}(?:x(?P<count>{_COUNT}))?",
        lambda value, way: Corrupt(value.share(), value.number("count", 1), way),
        "corrupt=0.1%[x3] (share x bits)",
    ),
    "rate": _Kind(
        rf"{_quantity('rate', RATE_BITS_PER_S)}(?:/{_quantity('queue', SIZE_BYTES)})?",
        lambda value, way: Rate(value.given("rate"), value.quantity("queue", 64_000), way),
        "rate=1Mbit[/64kB] (bits a second / queue)",
    ),
    "half-open": _Kind(
        rf"(?P<dead>{'|'.join(Direction)})"
        rf"(?:@{_quantity('begin', DURATION_NS)}\.\.{_quantity('end', DURATION_NS)}?)?",
        _half_open,
        "half-open=to-peer, half-open=to-controller@5s.. or half-open=to-peer@5s..8s (the dead direction)",
    ),
    "skew": _Kind(
        rf"(?P<ppm>-?{_NUMBER})ppm{_AFTER}",
        lambda value, way: ClockSkew(float(value["ppm"] or 0), value.quantity("duration", 1_000_000), way),
        "skew=100ppm[/1ms] (how much the peer's clock is fast / base delay)",
    ),
    "packet": _Kind(
        rf"(?P<action>{'|'.join(PacketAction)})@(?P<index>{_COUNT})(?:\+(?:{_DURATION}|bit(?P<bit>{_COUNT})))?",
        _packet,
        "packet=drop@17, packet=delay@17+5ms, packet=duplicate@17[+5ms] or packet=corrupt@17[+bit3]",
    ),
}
FAULT_TEXTS: Final = tuple(kind.written for kind in _KINDS.values())
"""How each fault is written, for a help text."""


def parse_fault(text: str) -> Fault:
    """Return the fault that ``text`` says; raise :class:`UnknownName` or :class:`ConfigurationError` in a sentence."""
    name, _, rest = text.strip().partition("=")
    if name not in _KINDS:
        raise UnknownName("fault", name, _KINDS)
    kind = _KINDS[name]
    value, colon, way = rest.partition(":")
    if colon and (name == "half-open" or way not in set(Direction)):
        valid = "half-open names its direction before the times" if name == "half-open" else " or ".join(Direction)
        raise ConfigurationError(f"fault {text!r}: {way!r} after the colon; valid: {valid}")
    found = re.fullmatch(kind.pattern, value)
    if found is None:
        direction = "" if name == "half-open" else f", with :{' or :'.join(Direction)} for one direction"
        raise ConfigurationError(f"fault {text!r}: write {kind.written}{direction}")
    try:
        return kind.make(_Value(found.groupdict()), Direction(way) if way else None)
    except ConfigurationError as error:
        raise ConfigurationError(f"fault {text!r}: {error}") from error
