"""Cycles that a robot side paces: nominal times from arrivals, bunches, silence."""

import asyncio

from hil.clock import VirtualClock
from hil.runtime.peer_pacer import PeerPacer

MS = 1_000_000


async def ticks(arrivals_ns: list[int], *, read_at_ns: list[int] | None = None) -> list[tuple[int, int]]:
    """Return due time and lateness of a tick a message; each is read when it arrives, or when it is said."""
    clock = VirtualClock()
    pacer = PeerPacer(clock=clock, first_due_ns=0, period_ns=MS, silence_ns=10 * MS)
    found = []
    for arrived_ns, read_ns in zip(arrivals_ns, read_at_ns or arrivals_ns, strict=True):
        clock.advance(read_ns - clock.now_ns())
        pacer.message(at_ns=arrived_ns)
        tick = await pacer.next_tick()
        assert tick.missed == 0
        found.append((tick.due_ns, tick.lateness_ns))
    pacer.close()
    return found


async def test_regular_messages_are_their_own_nominal_times() -> None:
    assert await ticks([5 * MS, 6 * MS, 7 * MS]) == [(5 * MS, 0), (6 * MS, 0), (7 * MS, 0)]


async def test_a_late_message_hardly_moves_the_time_axis_and_an_early_one_does_at_once() -> None:
    late, early = 6 * MS + 320_000, 7 * MS - 50_000
    found = await ticks([5 * MS, late, early, 8 * MS - 50_000])
    assert found[1] == (6 * MS + 320_000 // 64, 320_000 - 320_000 // 64)
    assert found[2] == (early, 0)
    assert found[3] == (8 * MS - 50_000, 0)


async def test_a_clock_that_drifts_is_followed_both_ways() -> None:
    for period_ns in (MS + 100, MS - 100):
        found = await ticks([MS + number * period_ns for number in range(20_000)])
        assert found[-1][1] <= 64 * 100 + 100
        assert found[-1][0] <= MS + 19_999 * period_ns


async def test_how_late_a_message_is_read_is_lateness_and_nothing_else() -> None:
    found = await ticks([MS, 2 * MS, 3 * MS], read_at_ns=[MS, 2 * MS + 700_000, 3 * MS])
    assert found == [(MS, 0), (2 * MS, 700_000), (3 * MS, 0)]


async def test_messages_that_come_together_are_one_cycle() -> None:
    clock = VirtualClock(5 * MS)
    pacer = PeerPacer(clock=clock, first_due_ns=0, period_ns=MS, silence_ns=10 * MS)
    pacer.message(at_ns=5 * MS)
    await pacer.next_tick()
    clock.advance(3 * MS + 1000)
    for _ in range(3):
        pacer.message(at_ns=8 * MS + 1000)
    tick = await pacer.next_tick()
    assert tick.missed == 2
    assert tick.due_ns == 8 * MS + 1000 // 64
    pacer.close()


async def test_after_silence_cycles_go_by_the_clock_and_always_forward() -> None:
    clock = VirtualClock(5 * MS)
    pacer = PeerPacer(clock=clock, first_due_ns=0, period_ns=MS, silence_ns=2 * MS)
    pacer.message(at_ns=5 * MS)
    dues = [(await pacer.next_tick()).due_ns]
    for _ in range(3):
        clock.advance(2 * MS)
        dues.append((await pacer.next_tick()).due_ns)
    # A message that was on its way since before the last of them.
    pacer.message(at_ns=clock.now_ns() - 100)
    dues.append((await pacer.next_tick()).due_ns)
    assert dues == [5 * MS, 7 * MS, 9 * MS, 11 * MS, 11 * MS + 1]
    pacer.close()


async def test_close_cancels_who_waits() -> None:
    pacer = PeerPacer(clock=VirtualClock(), first_due_ns=0, period_ns=MS, silence_ns=10**12)
    pacer.message(at_ns=0)
    await pacer.next_tick()
    waiting = asyncio.ensure_future(pacer.next_tick())
    await asyncio.wait({waiting}, timeout=0.001)
    pacer.close()
    await asyncio.wait({waiting})
    assert waiting.cancelled()
