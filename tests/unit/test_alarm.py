"""An alarm rings at its time, never before, and sooner when it is woken."""

import asyncio

import pytest

from hil.clock import MonotonicClock
from hil.runtime import timer
from hil.runtime.alarm import Alarm, LoopAlarm, TimerFdAlarm

MS = 1_000_000
HOUR_NS = 3_600_000 * MS


def alarms() -> list[type[Alarm]]:
    return [LoopAlarm, TimerFdAlarm] if timer.available() else [LoopAlarm]


@pytest.mark.parametrize("kind", alarms())
async def test_it_rings_at_its_time_and_never_early(kind: type[Alarm]) -> None:
    clock = MonotonicClock()
    alarm = kind(clock)
    for ahead_ns in (3 * MS, 100_000, 1, 0, -5 * MS, 2 * MS):
        due_ns = clock.now_ns() + ahead_ns
        await alarm.wait(due_ns)
        assert clock.now_ns() >= due_ns
    alarm.close()
    alarm.close()


@pytest.mark.parametrize("kind", alarms())
@pytest.mark.parametrize("ahead_ns", [HOUR_NS, None])
async def test_it_is_woken_for_what_is_due_sooner(kind: type[Alarm], ahead_ns: int | None) -> None:
    clock = MonotonicClock()
    alarm = kind(clock)
    due_ns = None if ahead_ns is None else clock.now_ns() + ahead_ns
    asyncio.get_running_loop().call_soon(alarm.wake, clock.now_ns())
    await alarm.wait(due_ns)
    # Woken before anybody waits: the next one to wait looks again, once.
    alarm.wake(clock.now_ns())
    await alarm.wait(due_ns)
    asyncio.get_running_loop().call_soon(alarm.wake, clock.now_ns())
    await alarm.wait(due_ns)
    alarm.close()


@pytest.mark.parametrize("kind", alarms())
async def test_what_is_due_later_wakes_nobody(kind: type[Alarm]) -> None:
    clock = MonotonicClock()
    alarm = kind(clock)
    due_ns = clock.now_ns() + 5 * MS
    asyncio.get_running_loop().call_soon(alarm.wake, due_ns + HOUR_NS)
    await alarm.wait(due_ns)
    assert clock.now_ns() >= due_ns
    alarm.close()
