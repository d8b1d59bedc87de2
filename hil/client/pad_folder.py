"""Where the sockets of running controllers are: a folder that only its owner may enter, and a file for each process.

Both sides look here: the controller for a place to listen, the pad for the controllers of its user.
"""

import os
import re
import socket
import stat
import sys
import tempfile
from pathlib import Path
from typing import Final

from hil.values.errors import ConfigurationError

MAX_SOCKET_PATH_BYTES: Final = 107 if sys.platform == "linux" else 103
"""``sun_path`` without its closing zero."""
_WAYS_OUT: Final = "give another socket (--pad SOCKET), or none (--pad off)"
_OF_A_PROCESS: Final = re.compile(r"(\d{1,10})\.sock")


def socket_folder() -> Path:
    """Return the folder of this user's sockets, which need not be there yet."""
    session = os.environ.get("XDG_RUNTIME_DIR", "")
    if session.startswith("/"):
        try:
            owner = os.stat(session).st_uid  # noqa: PTH116  # a NUL in the variable must not raise ValueError later
        except (OSError, ValueError):
            owner = None
        if owner == os.geteuid():
            return Path(session, "fri-hil")
    return Path(tempfile.gettempdir(), f"fri-hil-{os.geteuid()}")


def make_socket_folder() -> Path:
    """Make the folder of this user's sockets if it is not there; raise :class:`ConfigurationError` if not trusted."""
    folder = socket_folder()
    try:
        folder.mkdir(mode=0o700)
    except FileExistsError:
        pass
    except OSError as error:
        raise ConfigurationError(f"cannot make the pad's folder {folder}: {error.strerror}; {_WAYS_OUT}") from error
    if problem := distrusted(folder):
        raise ConfigurationError(f"the pad's folder {folder} {problem}; {_WAYS_OUT}")
    return folder


def distrusted(folder: Path) -> str:
    """Return why ``folder`` is not one that only its owner may enter, or an empty text."""
    found = folder.lstat()
    if stat.S_ISLNK(found.st_mode):
        return "is a symbolic link"
    if not stat.S_ISDIR(found.st_mode):
        return "is no folder"
    if found.st_uid != os.geteuid():
        return f"belongs to user {found.st_uid}, this is user {os.geteuid()}"
    if found.st_mode & 0o077:
        return f"is open to others (mode {stat.S_IMODE(found.st_mode):04o}, 0700 is needed)"
    return ""


def process_of(file: Path) -> int | None:
    """Return the number of the process whose socket ``file`` is by its name; None for any other name."""
    found = _OF_A_PROCESS.fullmatch(file.name)
    return None if found is None else int(found[1])


def checked_socket_path(text: str) -> Path:
    """Return ``text`` as a path a socket can have; raise :class:`ConfigurationError`."""
    if not text or "\0" in text:
        raise ConfigurationError(f"{text!r} cannot be the path of the pad's socket")
    length = len(os.fsencode(text))
    if length > MAX_SOCKET_PATH_BYTES:
        raise ConfigurationError(
            f"the pad's socket {text} has a path of {length} bytes; a socket's may have {MAX_SOCKET_PATH_BYTES}"
        )
    return Path(text)


def listens(file: Path) -> bool:
    """Whether somebody listens on the socket ``file``; raise OSError when it cannot be told."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as trial:
        trial.setblocking(False)
        try:
            trial.connect(str(file))
        except BlockingIOError:
            return True
        except (ConnectionRefusedError, FileNotFoundError):
            return False
    return True
