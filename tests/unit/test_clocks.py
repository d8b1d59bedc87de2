"""Pacing on absolute due times; virtual time, and the client library in it."""

import asyncio
import itertools
import threading

import pytest

from hil.client.servo import StatisticTimer
from hil.client.servo._link import KEEP_ALIVES_IN_WATCHDOG, LEAST_SILENCE_S, Link
from hil.clock import Clock, Deadline, MonotonicClock, VirtualClock, elapsed_ns, stopwatch_ns, using
from hil.runtime import timer
from hil.runtime.pacer import LoopPacer, Pacer, TimerFdPacer, open_pacer
from hil.values.errors import ConfigurationError
from tests.support.servo_client import connected

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


def test_deadlines_and_stopwatches_read_the_clock_in_use() -> None:
    clock = VirtualClock(1_000)
    with using(clock):
        deadline, never = Deadline(0.5), Deadline(None)
        assert (deadline.left_s(), never.left_s()) == (0.5, None)
        timing = StatisticTimer()
        with timing.new_time_step():
            clock.advance(300_000_000)
        assert timing.max_ms == 300.0
        assert deadline.left_s() == pytest.approx(0.2)
        clock.advance(200_000_000)
        assert deadline.left_s() == 0.0
        deadline.restart()
        assert deadline.left_s() == 0.5
        assert stopwatch_ns() == 500_001_000
        assert elapsed_ns() != 500_001_000


def test_a_deadline_keeps_the_clock_it_was_made_under() -> None:
    clock = VirtualClock()
    before = Deadline(1000.0)
    with using(clock):
        inside = Deadline(1000.0)
        clock.advance(900_000_000_000)
        assert 990.0 < (before.left_s() or 0.0) <= 1000.0
    assert inside.left_s() == pytest.approx(100.0)
    inside.restart()
    assert inside.left_s() == pytest.approx(1000.0)


def test_the_clock_in_use_is_that_of_every_thread_and_only_until_the_block_ends() -> None:
    read: list[int] = []

    def use() -> None:
        with using(VirtualClock(5)):
            with using(VirtualClock(7)):
                thread = threading.Thread(target=lambda: read.append(stopwatch_ns()))
                thread.start()
                thread.join()
            read.append(stopwatch_ns())
            raise KeyError

    with pytest.raises(KeyError):
        use()
    assert read == [7, 5]
    assert elapsed_ns() <= stopwatch_ns() <= elapsed_ns()


def test_what_is_no_deadline() -> None:
    with pytest.raises(ConfigurationError, match="a timeout of nan s; a number of seconds is needed, or None"):
        Deadline(float("nan"))
    assert Deadline(float("inf")).left_s() is None
    assert Deadline(threading.TIMEOUT_MAX * 1.01).left_s() is None
    assert (Deadline(float("-inf")).left_s() or 0.0) <= -1.0


def test_a_client_in_virtual_time_keeps_alive_and_gives_a_silent_controller_up() -> None:
    clock, watchdog_s = VirtualClock(), 0.3
    with using(clock):
        link = Link(connected().session, watchdog_s=watchdog_s)
        said_ms = []
        while link.session.running:
            clock.advance(1_000_000)
            if link.outgoing() is not None:
                said_ms.append(clock.now_ns() // 1_000_000)
            link.nothing_came()
    assert clock.now_ns() == LEAST_SILENCE_S * 1e9
    period_ms = watchdog_s * 1e3 / KEEP_ALIVES_IN_WATCHDOG
    assert said_ms[:3] == [pytest.approx(count * period_ms, abs=count) for count in (1, 2, 3)]
