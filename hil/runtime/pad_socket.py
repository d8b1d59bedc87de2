"""The file a controller's pad listens at: made so that only its owner may open it, and removed at the end."""

import os
import socket
import stat
import struct
from contextlib import suppress
from pathlib import Path

from hil.client.pad_folder import checked_socket_path, listens, make_socket_folder, process_of
from hil.values.errors import ConfigurationError
from transport.holders import told_process


class PadSocket:
    """A bound socket at ``place``; None: in the folder of this user, where those of dead processes are removed.

    Raises :class:`ConfigurationError` when it cannot be there.
    """

    def __init__(self, place: str | None) -> None:
        if place is None:
            folder = make_socket_folder()
            _remove_dead(folder)
            place = str(folder / f"{os.getpid()}.sock")
        self.path = checked_socket_path(place)
        _make_room(self.path)
        self.link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            before = os.umask(0o177)
            try:
                self.link.bind(str(self.path))
            finally:
                os.umask(before)
            found = self.path.lstat()
        except OSError as error:
            self.link.close()
            raise ConfigurationError(f"cannot make the pad's socket {self.path}: {error.strerror or error}") from error
        self._bound = found.st_dev, found.st_ino

    def close(self) -> None:
        """Close it, and remove its file unless another one took its place; idempotent."""
        self.link.close()
        with suppress(OSError):
            found = self.path.lstat()
            if (found.st_dev, found.st_ino) == self._bound:
                self.path.unlink()


def _make_room(path: Path) -> None:
    """Remove a socket nobody listens at; raise :class:`ConfigurationError` for whatever else is there."""
    try:
        found = path.lstat()
    except FileNotFoundError:
        return
    except OSError as error:
        raise ConfigurationError(f"cannot make the pad's socket {path}: {error.strerror}") from error
    if not stat.S_ISSOCK(found.st_mode):
        raise ConfigurationError(f"{path} is there already, and it is no socket; give --pad another path")
    try:
        taken = listens(path)
        if not taken:
            path.unlink(missing_ok=True)
    except OSError as error:
        raise ConfigurationError(f"the pad's socket {path} cannot be taken: {error.strerror}") from error
    if taken:
        process = _listener(path)
        who = "" if process is None else f", {told_process(process)}"
        raise ConfigurationError(f"a controller listens at {path} already{who}; give --pad another path")


def _listener(path: Path) -> int | None:
    """Return the process that listens there; None where the system does not tell."""
    option = getattr(socket, "SO_PEERCRED", None)
    if option is None:
        return None
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as trial:
        trial.setblocking(False)
        try:
            trial.connect(str(path))
            process, _, _ = struct.unpack("3i", trial.getsockopt(socket.SOL_SOCKET, option, struct.calcsize("3i")))
        except OSError:
            return None
    return int(process) or None


def _remove_dead(folder: Path) -> None:
    """Remove the sockets that dead processes left in ``folder``."""
    for file in list(folder.iterdir()):
        process = process_of(file)
        # Both must hold: a process that just starts has bound and does not listen yet.
        if process is not None and not _lives(process):
            with suppress(OSError):
                if stat.S_ISSOCK(file.lstat().st_mode) and not listens(file):
                    file.unlink()


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True
