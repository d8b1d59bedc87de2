"""timerfd by way of the standard library (3.13 on) or the C library. Linux only; elsewhere there is a coarser pacer."""

import asyncio
import ctypes
import errno
import functools
import os
import sys
from collections.abc import Callable

CLOCK_MONOTONIC = 1
_TFD_TIMER_ABSTIME = 1
_TFD_NONBLOCK = 0o4000
_TFD_CLOEXEC = 0o2000000
_NS_PER_S = 1_000_000_000


class _TimeSpec(ctypes.Structure):
    _fields_ = (("tv_sec", ctypes.c_long), ("tv_nsec", ctypes.c_long))


class _TimerSpec(ctypes.Structure):
    _fields_ = (("it_interval", _TimeSpec), ("it_value", _TimeSpec))


def available() -> bool:
    """Return whether this system has timerfd."""
    return sys.platform == "linux"


class LoopTimer:
    """A timerfd read by the running event loop, which tells ``on_expired`` how often it expired; raises OSError.

    Armed at absolute CLOCK_MONOTONIC times. ``close`` is idempotent.
    """

    def __init__(self, on_expired: Callable[[int], None]) -> None:
        self._on_expired = on_expired
        self._loop = asyncio.get_running_loop()
        self._descriptor: int | None = _open_timer()
        self._loop.add_reader(self._descriptor, self._read)

    def arm(self, *, due_ns: int, period_ns: int = 0) -> None:
        """Let it expire once, or every ``period_ns`` from there; 0: never."""
        if self._descriptor is not None:
            _arm(self._descriptor, due_ns=due_ns, period_ns=period_ns)

    def close(self) -> None:
        """Release the timer."""
        if self._descriptor is not None:
            self._loop.remove_reader(self._descriptor)
            os.close(self._descriptor)
            self._descriptor = None

    def _read(self) -> None:
        if self._descriptor is None:
            return
        try:
            expired = int.from_bytes(os.read(self._descriptor, 8), "little")
        except BlockingIOError:
            return
        self._on_expired(expired)


def _open_timer() -> int:
    descriptor: int = _libc().timerfd_create(CLOCK_MONOTONIC, _TFD_NONBLOCK | _TFD_CLOEXEC)
    if descriptor < 0:
        raise _last_error("timerfd_create")
    return descriptor


def _arm(descriptor: int, *, due_ns: int, period_ns: int) -> None:
    spec = _TimerSpec(_TimeSpec(*divmod(period_ns, _NS_PER_S)), _TimeSpec(*divmod(due_ns, _NS_PER_S)))
    if _libc().timerfd_settime(descriptor, _TFD_TIMER_ABSTIME, ctypes.byref(spec), None) < 0:
        raise _last_error("timerfd_settime")


@functools.cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _last_error(what: str) -> OSError:
    number = ctypes.get_errno()
    return OSError(number, f"{what}: {errno.errorcode.get(number, number)}")
