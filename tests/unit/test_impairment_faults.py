"""Faults as values and as text: every one can be written and read, and what cannot be is refused in a sentence."""

import re
from collections.abc import Callable

import pytest

from hil.values.errors import ConfigurationError, OutOfRange, UnknownName, UsageError
from transport.impairment import (
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
    parse_fault,
)
from transport.impairment.units import duration_text, rate_text, size_text

MS = 1_000_000
S = 1_000_000_000
THERE, BACK = Direction.TO_PEER, Direction.TO_CONTROLLER
TEXTS: list[tuple[str, Fault]] = [
    ("loss=2%", Loss(0.02)),
    ("loss=0.07%:to-peer", Loss(0.0007, THERE)),
    ("burst=2%x8", BurstLoss(0.02, 8.0)),
    ("burst=30%x2.5:to-controller", BurstLoss(0.3, 2.5, BACK)),
    ("delay=5ms", Delay(5 * MS)),
    ("delay=2.5us:to-peer", Delay(2500, THERE)),
    ("jitter=1ms/uniform", Jitter(MS)),
    ("jitter=1.5ms/normal/overtaking", Jitter(1_500_000, Distribution.NORMAL, overtaking=True)),
    ("jitter=3ns/exponential:to-peer", Jitter(3, Distribution.EXPONENTIAL, direction=THERE)),
    ("reorder=1%/1", Reorder(0.01)),
    ("reorder=1%/3:to-peer", Reorder(0.01, 3, direction=THERE)),
    ("reorder=1%/2ms", Reorder(0.01, by_ns=2 * MS)),
    ("duplicate=1%", Duplicate(0.01)),
    ("duplicate=1%/2ms:to-controller", Duplicate(0.01, 2 * MS, BACK)),
    ("corrupt=0.1%x1", Corrupt(0.001)),
    ("corrupt=100%x3", Corrupt(1.0, 3)),
    ("rate=1Mbit/64kB", Rate(1_000_000)),
    ("rate=1.5Gbit/1.5MB:to-peer", Rate(1_500_000_000, 1_500_000, THERE)),
    ("half-open=to-peer", HalfOpen(THERE)),
    ("half-open=to-peer@5s..", HalfOpen(THERE, 5 * S)),
    ("half-open=to-controller@0ns..1.25s", HalfOpen(BACK, 0, 1_250 * MS)),
    ("skew=100ppm/1ms", ClockSkew(100.0)),
    ("skew=-0.5ppm/20ms:to-peer", ClockSkew(-0.5, 20 * MS, THERE)),
    ("packet=drop@0", AtPacket(PacketAction.DROP, 0)),
    ("packet=delay@17+5ms:to-peer", AtPacket(PacketAction.DELAY, 17, THERE, 5 * MS)),
    ("packet=duplicate@17", AtPacket(PacketAction.DUPLICATE, 17)),
    ("packet=duplicate@17+1ms", AtPacket(PacketAction.DUPLICATE, 17, delay_ns=MS)),
    ("packet=corrupt@17", AtPacket(PacketAction.CORRUPT, 17)),
    ("packet=corrupt@17+bit3:to-controller", AtPacket(PacketAction.CORRUPT, 17, BACK, bit=3)),
]


@pytest.mark.parametrize(("text", "fault"), TEXTS)
def test_a_fault_is_written_as_it_is_read(text: str, fault: Fault) -> None:
    assert parse_fault(text) == fault
    assert parse_fault(f" {text}\n") == fault
    assert str(fault) == text


@pytest.mark.parametrize(
    ("short", "fault"),
    [
        ("burst=2%", BurstLoss(0.02, 8.0)),
        ("jitter=1ms", Jitter(MS)),
        ("jitter=1ms/overtaking:to-peer", Jitter(MS, overtaking=True, direction=THERE)),
        ("reorder=1%", Reorder(0.01)),
        ("corrupt=0.1%", Corrupt(0.001)),
        ("rate=1Mbit", Rate(1_000_000)),
        ("rate=9600bit/500B", Rate(9600, 500)),
        ("skew=100ppm", ClockSkew(100.0)),
        ("half-open=to-peer@1s..2s", HalfOpen(THERE, S, 2 * S)),
    ],
)
def test_what_may_be_left_out(short: str, fault: Fault) -> None:
    assert parse_fault(short) == fault


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("loss=2", "fault 'loss=2': write loss=2%, with :to-controller or :to-peer for one direction"),
        ("loss", "fault 'loss': write loss=2%"),
        ("loss=-1%", "write loss=2%"),
        ("loss=nan%", "write loss=2%"),
        ("loss=0%", "share lost 0 is outside its range > 0 ... 1"),
        ("loss=200%", "share lost 2 is outside its range > 0 ... 1"),
        ("loss=2%:up", "'up' after the colon; valid: to-controller or to-peer"),
        ("loss=2%:", "'' after the colon; valid: to-controller or to-peer"),
        ("burst=95%x2", "share lost in bursts 0.95 is outside its range > 0 ... 0.666667 for bursts of 2"),
        ("burst=1%x0.5", "mean burst length 0.5 is outside its range 1 ... 1e+06 packets"),
        ("delay=5", "write delay=5ms"),
        ("delay=5min", "write delay=5ms"),
        ("delay=0ms", "delay in ns 0 is outside its range 1 ... 3600000000000"),
        ("delay=0.4ns", "delay in ns 0 is outside"),
        ("delay=99999s", "delay in ns 9.9999e+13 is outside"),
        (f"delay={'9' * 5000}s", "write delay=5ms"),
        ("jitter=1ms/gaussian", "write jitter=1ms (then /uniform, /normal, /exponential and /overtaking if wanted)"),
        ("reorder=1%/0", "packets that overtake 0 is outside its range 1 ... 1000"),
        ("corrupt=1%x0", "bits flipped 0 is outside its range 1 ... 524056"),
        ("rate=1bit", "rate in bit/s 1 is outside its range 1000 ... 100000000000"),
        ("rate=1Mbit/0B", "queue in bytes 0 is outside its range 1 ... 64000000"),
        (
            "half-open=up",
            "write half-open=to-peer, half-open=to-controller@5s.. or half-open=to-peer@5s..8s (the dead direction)",
        ),
        ("half-open=to-peer:to-peer", "half-open names its direction before the times"),
        ("half-open=to-peer@8s..5s", "end of half-open in ns 5e+09 is outside its range > 8000000000, its begin"),
        ("skew=0ppm", "clock skew 0 is outside its range -100000 ... 100000 ppm without 0"),
        ("skew=1e9ppm", "write skew=100ppm"),
        ("packet=drop", "write packet=drop@17"),
        ("packet=lose@3", "write packet=drop@17"),
        ("packet=delay@3", "delay of a packet needs the time"),
        ("packet=drop@3+5ms", "drop takes no time; only delay and duplicate do"),
        ("packet=drop@3+bit4", "drop takes no bit; only corrupt does"),
    ],
)
def test_what_cannot_be_is_refused_with_what_would_be_valid(text: str, sentence: str) -> None:
    with pytest.raises(
        ConfigurationError, match=re.escape(sentence).replace("with\\ :to\\-peer", "with :to")
    ) as caught:
        parse_fault(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "los=2%", "=", "Loss=2%", "loss 2%"])
def test_an_unknown_fault_is_refused_with_the_names(text: str) -> None:
    with pytest.raises(UnknownName, match="valid: loss, burst, delay, jitter, reorder, duplicate, corrupt, rate, half"):
        parse_fault(text)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Loss(float("nan")),
        lambda: BurstLoss(0.1, float("inf")),
        lambda: Delay(-1),
        lambda: Jitter(0),
        lambda: Reorder(0.1, 2, MS),
        lambda: Duplicate(0.1, -1),
        lambda: Corrupt(0.1, -1),
        lambda: HalfOpen("to-peer"),  # type: ignore[arg-type]
        lambda: Delay(1.5),  # type: ignore[arg-type]
        lambda: ClockSkew(float("nan")),
        lambda: AtPacket("lose", 1),
        lambda: AtPacket("drop", -1),
    ],
)
def test_values_are_checked_where_they_are_made(make: Callable[[], Fault]) -> None:
    with pytest.raises(UsageError):
        make()


def test_an_error_carries_value_and_range() -> None:
    with pytest.raises(OutOfRange) as caught:
        Loss(1.5)
    assert (caught.value.name, caught.value.value) == ("share lost", 1.5)


@pytest.mark.parametrize(
    ("number", "duration", "rate", "size"),
    [
        (1, "1ns", "1bit", "1B"),
        (1_500, "1.5us", "1.5kbit", "1.5kB"),
        (1_234_567, "1234.567us", "1234.567kbit", "1234.567kB"),
        (10_000_000, "10ms", "10Mbit", "10MB"),
        (60_000_000_000, "60s", "60Gbit", "60000MB"),
    ],
)
def test_quantities_are_exact(number: int, duration: str, rate: str, size: str) -> None:
    assert (duration_text(number), rate_text(number), size_text(number)) == (duration, rate, size)
