"""Ticks on absolute due times. Late wake-ups and missed ones are told, never hidden."""

import asyncio
from abc import ABC, abstractmethod
from typing import NamedTuple

from hil.clock import Clock
from hil.runtime import timer


class Tick(NamedTuple):
    """A due cycle: its nominal time, how late it began, and how many went by unserved before it."""

    due_ns: int
    lateness_ns: int
    missed: int


class Pacer(ABC):
    """``await next_tick()`` in a loop; one waiter; ``close`` is idempotent."""

    def __init__(self, *, clock: Clock, first_due_ns: int, period_ns: int) -> None:
        self._clock = clock
        self._first_due_ns = first_due_ns
        self._period_ns = period_ns
        self._served = 0

    async def next_tick(self) -> Tick:
        """Wait for the next due time; return the latest one that is due."""
        expired = await self._wait()
        missed = expired - 1
        self._served += expired
        due_ns = self._first_due_ns + (self._served - 1) * self._period_ns
        return Tick(due_ns, self._clock.now_ns() - due_ns, missed)

    @abstractmethod
    async def _wait(self) -> int:
        """Return the number of due times since the last call, at least one."""

    @abstractmethod
    def close(self) -> None:
        """Release the timer."""


class TimerFdPacer(Pacer):
    """Linux: a timerfd read by the event loop."""

    def __init__(self, *, clock: Clock, first_due_ns: int, period_ns: int) -> None:
        super().__init__(clock=clock, first_due_ns=first_due_ns, period_ns=period_ns)
        self._expired = 0
        self._waiter: asyncio.Future[None] | None = None
        self._timer = timer.LoopTimer(self._on_expired)
        try:
            self._timer.arm(due_ns=first_due_ns, period_ns=period_ns)
        except OSError:
            self._timer.close()
            raise

    def close(self) -> None:
        """Release the timer; a waiter is cancelled."""
        self._timer.close()
        if self._waiter is not None:
            self._waiter.cancel()

    async def _wait(self) -> int:
        if not self._expired:
            self._waiter = asyncio.get_running_loop().create_future()
            try:
                await self._waiter
            finally:
                self._waiter = None
        expired, self._expired = self._expired, 0
        return expired

    def _on_expired(self, expired: int) -> None:
        self._expired += expired
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_result(None)


class LoopPacer(Pacer):
    """Anywhere: the event loop's own timer, as coarse as the loop's selector."""

    async def _wait(self) -> int:
        loop = asyncio.get_running_loop()
        due_ns = self._first_due_ns + self._served * self._period_ns
        late_ns = self._clock.now_ns() - due_ns
        while late_ns < 0:
            waiter: asyncio.Future[None] = loop.create_future()
            handle = loop.call_later(-late_ns * 1e-9, waiter.set_result, None)
            try:
                await waiter
            finally:
                handle.cancel()
            late_ns = self._clock.now_ns() - due_ns
        return 1 + late_ns // self._period_ns

    def close(self) -> None:
        """Nothing is held."""
        return


def open_pacer(*, clock: Clock, first_due_ns: int, period_ns: int) -> Pacer:
    """Return the finest pacer this system has."""
    chosen = TimerFdPacer if timer.available() else LoopPacer
    return chosen(clock=clock, first_due_ns=first_due_ns, period_ns=period_ns)
