"""Ticks that a robot side paces with its messages, as a real Cabinet does; by the clock only while it is silent."""

import asyncio
from typing import Final

from hil.clock import Clock
from hil.runtime.pacer import Tick

_PHASE_GAIN: Final = 64
"""Of the difference between expected and real arrival, so many-th is believed of a message that came later."""
_LOST_PERIODS: Final = 8
"""A message that far from where it was expected begins the count anew."""


class PeerPacer:
    """``await next_tick()`` in a loop; one waiter; ``close`` is idempotent.

    The nominal times follow the *earliest* arrivals: a message that came early moves them at once, one that came late
    hardly, so that they are the robot side's own clock with the shortest way added, whatever the jitter. Several
    messages that came at once are one tick: a set point is for the newest of them. After ``silence_ns`` without one
    there is a tick each period by our clock, so that somebody notices.
    """

    def __init__(self, *, clock: Clock, first_due_ns: int, period_ns: int, silence_ns: int) -> None:
        self._clock = clock
        self._due_ns = first_due_ns - 1
        self._period_ns = period_ns
        self._silence_ns = silence_ns
        self._messages = 0
        self._arrived_ns = 0
        self._silent = True
        """Whether the last tick was one of our clock; the first message counts like one after silence."""
        self._waiter: asyncio.Future[None] | None = None

    def message(self, *, at_ns: int) -> None:
        """A message came at ``at_ns`` that a cycle is due for."""
        self._messages += 1
        self._arrived_ns = at_ns
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_result(None)

    async def next_tick(self) -> Tick:
        """Wait for the next message, or for silence; return when the cycle was due and how late it begins."""
        if not self._messages:
            await self._wait((self._period_ns if self._silent else self._silence_ns) * 1e-9)
        messages, self._messages = self._messages, 0
        if messages:
            self._due_ns = self._nominal_ns(messages)
        else:
            self._due_ns = max(self._clock.now_ns(), self._due_ns + 1)
        self._silent = not messages
        return Tick(self._due_ns, max(0, self._clock.now_ns() - self._due_ns), max(0, messages - 1))

    def close(self) -> None:
        """A waiter is cancelled."""
        if self._waiter is not None:
            self._waiter.cancel()

    def _nominal_ns(self, messages: int) -> int:
        expected_ns = self._due_ns + messages * self._period_ns
        late_ns = self._arrived_ns - expected_ns
        if self._silent or late_ns <= 0 or late_ns > _LOST_PERIODS * self._period_ns:
            return max(self._arrived_ns, self._due_ns + 1)
        return expected_ns + late_ns // _PHASE_GAIN

    async def _wait(self, at_most_s: float) -> None:
        self._waiter = waiter = asyncio.get_running_loop().create_future()
        timer = asyncio.get_running_loop().call_later(at_most_s, _settle, waiter)
        try:
            await waiter
        finally:
            timer.cancel()
            self._waiter = None


def _settle(waiter: "asyncio.Future[None]") -> None:
    if not waiter.done():
        waiter.set_result(None)
