"""timerfd by way of the standard library (3.13 on) or the C library. Linux only; elsewhere there is a coarser pacer."""

import ctypes
import errno
import functools
import os
import sys

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


def open_periodic(*, first_due_ns: int, period_ns: int) -> int:
    """Return a non-blocking timerfd that expires at absolute CLOCK_MONOTONIC times; raise OSError."""
    descriptor = open_timer()
    try:
        arm(descriptor, due_ns=first_due_ns, period_ns=period_ns)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def open_timer() -> int:
    """Return a non-blocking timerfd that is not armed; raise OSError."""
    descriptor: int = _libc().timerfd_create(CLOCK_MONOTONIC, _TFD_NONBLOCK | _TFD_CLOEXEC)
    if descriptor < 0:
        raise _last_error("timerfd_create")
    return descriptor


def arm(descriptor: int, *, due_ns: int, period_ns: int = 0) -> None:
    """Let it expire at an absolute CLOCK_MONOTONIC time, once or every ``period_ns`` from there; 0: never."""
    spec = _TimerSpec(_TimeSpec(*divmod(period_ns, _NS_PER_S)), _TimeSpec(*divmod(due_ns, _NS_PER_S)))
    if _libc().timerfd_settime(descriptor, _TFD_TIMER_ABSTIME, ctypes.byref(spec), None) < 0:
        raise _last_error("timerfd_settime")


@functools.cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _last_error(what: str) -> OSError:
    number = ctypes.get_errno()
    return OSError(number, f"{what}: {errno.errorcode.get(number, number)}")
