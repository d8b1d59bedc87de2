"""Waiting for one time after another, each of which may still be moved up."""

import asyncio
from abc import ABC, abstractmethod

from hil.clock import Clock
from hil.runtime import timer


class Alarm(ABC):
    """``await wait(due_ns)`` in a loop; one waiter; ``close`` is idempotent."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._waiter: asyncio.Future[None] | None = None
        self._due_ns: int | None = None
        self._woken = False

    async def wait(self, due_ns: int | None) -> None:
        """Wait until ``due_ns`` (None: for ever), never less, or until :meth:`wake`."""
        if self._woken or (due_ns is not None and due_ns <= self._clock.now_ns()):
            self._woken = False
            return
        self._waiter = asyncio.get_running_loop().create_future()
        self._due_ns = due_ns
        if due_ns is not None:
            self._arm(due_ns)
        try:
            await self._waiter
        finally:
            self._waiter = None
            self._woken = False
            self._disarm()

    def wake(self, due_ns: int) -> None:
        """Wake who waits for a time later than ``due_ns``, or comes to wait next."""
        if self._waiter is None:
            self._woken = True
        elif self._due_ns is None or due_ns < self._due_ns:
            self._ring()

    def _ring(self) -> None:
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_result(None)

    @abstractmethod
    def _arm(self, due_ns: int) -> None:
        """Have :meth:`_ring` called at ``due_ns``."""

    @abstractmethod
    def _disarm(self) -> None:
        """Forget the time."""

    @abstractmethod
    def close(self) -> None:
        """Release the timer."""


class TimerFdAlarm(Alarm):
    """Linux: a timerfd read by the event loop."""

    def __init__(self, clock: Clock) -> None:
        super().__init__(clock)
        self._timer = timer.LoopTimer(lambda _: self._ring())

    def close(self) -> None:
        """Release the timer."""
        self._timer.close()

    def _arm(self, due_ns: int) -> None:
        self._timer.arm(due_ns=due_ns)

    def _disarm(self) -> None:
        self._timer.arm(due_ns=0)


class LoopAlarm(Alarm):
    """Anywhere: the event loop's own timer, as coarse as the loop's selector."""

    _handle: asyncio.TimerHandle | None = None

    def close(self) -> None:
        """Release the timer."""
        self._disarm()

    def _arm(self, due_ns: int) -> None:
        ahead_ns = due_ns - self._clock.now_ns()
        if ahead_ns <= 0:
            self._ring()
            return
        self._handle = asyncio.get_running_loop().call_later(ahead_ns * 1e-9, self._arm, due_ns)

    def _disarm(self) -> None:
        if self._handle is not None:
            self._handle.cancel()
            self._handle = None


def open_alarm(clock: Clock) -> Alarm:
    """Return the finest alarm this system has."""
    return TimerFdAlarm(clock) if timer.available() else LoopAlarm(clock)
