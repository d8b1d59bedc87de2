"""Pacing on absolute due times, on a clock of the test's own where time matters."""

import asyncio
import itertools

import pytest

from hil.clock import Clock, MonotonicClock, VirtualClock
from hil.runtime import timer
from hil.runtime.pacer import LoopPacer, Pacer, TimerFdPacer, open_pacer

PERIOD_NS = 2_000_000


def pacers() -> list[type[Pacer]]:
    return [LoopPacer, TimerFdPacer] if timer.available() else [LoopPacer]


@pytest.mark.parametrize("kind", pacers())
async def test_ticks_come_on_multiples_of_the_period_and_never_early(kind: type[Pacer]) -> None:
    clock = MonotonicClock()
    first_due_ns = clock.now_ns() + 1_000_000
    pacer = kind(clock=clock, first_due_ns=first_due_ns, period_ns=PERIOD_NS)
    ticks = [await pacer.next_tick() for _ in range(30)]
    pacer.close()
    pacer.close()
    assert ticks[0].due_ns == first_due_ns + ticks[0].missed * PERIOD_NS
    for before, after in itertools.pairwise(ticks):
        assert after.due_ns - before.due_ns == (after.missed + 1) * PERIOD_NS
    assert all(tick.lateness_ns >= 0 for tick in ticks)


@pytest.mark.parametrize("kind", pacers())
async def test_due_times_that_went_by_are_told_as_missed(kind: type[Pacer]) -> None:
    clock = MonotonicClock()
    pacer = kind(clock=clock, first_due_ns=clock.now_ns() - 10 * PERIOD_NS - PERIOD_NS // 2, period_ns=PERIOD_NS)
    tick = await pacer.next_tick()
    pacer.close()
    assert tick.missed >= 10
    assert tick.lateness_ns < 20 * PERIOD_NS


async def test_closing_cancels_the_waiter() -> None:
    clock = MonotonicClock()
    pacer = open_pacer(clock=clock, first_due_ns=clock.now_ns() + 10**12, period_ns=PERIOD_NS)
    waiter = asyncio.ensure_future(pacer.next_tick())
    asyncio.get_running_loop().call_soon(pacer.close)
    if isinstance(pacer, LoopPacer):
        waiter.cancel()
    with pytest.raises(asyncio.CancelledError):
        await waiter


def test_the_virtual_clock_moves_only_when_told() -> None:
    clock = VirtualClock(5)
    as_clock: Clock = clock
    assert as_clock.now_ns() == 5
    assert clock.advance(7) == clock.now_ns() == 12
    with pytest.raises(ValueError, match="time cannot go back"):
        clock.advance(-1)
