"""Files that one process at a time may write, and who has them: two runs with one file would spoil it silently."""

import os
import stat
import sys
from pathlib import Path

from transport.holders import told_process


def claim_file(descriptor: int) -> str | None:
    """Claim the open file for whoever has ``descriptor`` or inherits it; return who has it already, or None.

    The claim ends with the last of them, however that ends. Devices and pipes are nobody's, and where a file system
    has no locks, nothing is claimed.
    """
    if sys.platform == "win32" or not stat.S_ISREG(os.fstat(descriptor).st_mode):
        return None
    import fcntl

    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return _holder(descriptor)
    except OSError:
        return None
    return None


def _holder(descriptor: int) -> str:
    """Return who holds the lock, as far as the system tells."""
    found = os.fstat(descriptor)
    wanted = f"{os.major(found.st_dev):02x}:{os.minor(found.st_dev):02x}:{found.st_ino}"
    try:
        lines = Path("/proc/locks").read_text(encoding="ascii").splitlines()
    except (OSError, ValueError):
        lines = []
    for line in lines:
        words = line.split()
        if len(words) >= 6 and words[1] == "FLOCK" and words[5] == wanted:
            return told_process(int(words[4]))
    return "another process"
