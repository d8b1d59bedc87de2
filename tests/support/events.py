"""Waiting for what another process does: for the event itself; nobody looks again after a while."""

import ctypes
import os
import select
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from socket import socket
from typing import Final

PATIENCE_S: Final = 10.0
_IN_MODIFY: Final = 0x2
_EVENT_BYTES: Final = 16
"""Of an inotify event of a watched file, which has no name."""


def until_written(path: Path, condition: Callable[[], bool]) -> None:
    """Wait until ``condition`` holds of a file that another process writes; fail if nothing it writes makes it true."""
    libc = ctypes.CDLL(None, use_errno=True)
    descriptor = libc.inotify_init1(os.O_CLOEXEC)
    with closing(os.fdopen(descriptor, "rb", buffering=0)) as events:
        assert libc.inotify_add_watch(descriptor, os.fsencode(path), _IN_MODIFY) >= 0, os.strerror(ctypes.get_errno())
        # The watch comes first: what is written after a look is told, what was written before it is seen.
        while not condition():
            assert select.select([events], [], [], PATIENCE_S)[0], f"nothing more was written to {path}"
            events.read(64 * _EVENT_BYTES)


def until_takes(sock: socket) -> None:
    """Wait until the other end has read so much that ``sock`` takes more; fail if it does not."""
    assert select.select([], [sock], [], PATIENCE_S)[1], "the other end reads nothing"


def until_stopped(child: int) -> None:
    """Wait until a child of ours stands still after SIGSTOP, or is over; it can still be waited for."""
    os.waitid(os.P_PID, child, os.WSTOPPED | os.WEXITED | os.WNOWAIT)


def until_dead(process: int) -> None:
    """Wait until a process is over, whether it was waited for or not; fail if it lives on."""
    try:
        descriptor = os.pidfd_open(process)
    except ProcessLookupError:
        return
    with closing(os.fdopen(descriptor, "rb", buffering=0)) as over:
        assert select.select([over], [], [], PATIENCE_S)[0], f"process {process} lives on"
