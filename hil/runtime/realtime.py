"""What ``--realtime`` asks of the system, and what it got: a table of wishes, each granted or refused in words."""

import ctypes
import os
from collections.abc import Callable
from typing import NamedTuple

_MCL_CURRENT_AND_FUTURE = 3
FIFO_PRIORITY = 80


class Wish(NamedTuple):
    """One thing that was asked for."""

    what: str
    granted: bool
    detail: str


def ask_for_realtime() -> list[Wish]:
    """Ask for SCHED_FIFO, locked memory and a CPU of our own; return what became of each."""
    return [
        _try(f"SCHED_FIFO priority {FIFO_PRIORITY}", _fifo),
        _try("locked memory", _lock_memory),
        _try("a CPU of its own", _own_cpu),
    ]


def _try(what: str, ask: Callable[[], str]) -> Wish:
    try:
        return Wish(what, granted=True, detail=ask())
    except (OSError, AttributeError) as error:
        return Wish(what, granted=False, detail=str(error))


def _fifo() -> str:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(FIFO_PRIORITY))
    return "the control loop goes before ordinary processes"


def _lock_memory() -> str:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT_AND_FUTURE) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return "no page of it can be swapped out"


def _own_cpu() -> str:
    allowed = sorted(os.sched_getaffinity(0))
    if len(allowed) < 2:
        raise OSError(0, "this machine gives the process only one CPU")
    os.sched_setaffinity(0, {allowed[-1]})
    return f"pinned to CPU {allowed[-1]}; other processes may still use it unless it is isolated"
