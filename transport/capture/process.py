"""Captures written by a process of their own.

A disk or a file system may take seconds for a write, so the loop that records only hands batches to a child over a
Unix socket and never waits for it. What the child does not take in time is dropped and counted. The child has the
end of the stream as its order to finish, so the file is completed however this process ends.
"""

import os
import socket
import stat
import subprocess
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from transport.capture.batches import Ring
from transport.capture.comment import encode_comment
from transport.capture.errors import CaptureError, cannot_create
from transport.capture.link import CaptureLink, CaptureSummary
from transport.child import module_command, module_environment, terminal_signals_blocked
from transport.claims import claim_file

_WRITER = "transport.capture.writer_main"


class CaptureProcess(CaptureLink):
    """Records datagrams to ``path``, which is created, or emptied, before anything else.

    ``comment`` goes into the section header; without one :meth:`begin` is to be called before the first ``put``. With a
    ``ring``, files beside ``path`` are written one after the other, and only the newest are kept. A file that cannot be
    created raises ``CaptureError``; once the recording runs, nothing that happens to file or process raises: packets
    are dropped and counted. For use by one thread.
    """

    def __init__(self, path: Path, *, comment: str | None = None, ring: Ring | None = None) -> None:
        if comment is not None:
            encode_comment(path, comment)  # before a file is touched
        self._overdue = False
        self._allowed_s = 0.0
        link, self._process = _start_writer(path)
        super().__init__(link, path)
        if comment is not None:
            self.begin(comment, ring=ring)

    def close(self, timeout_s: float = 5.0) -> CaptureSummary:
        """Complete the file and say what is in it; a writer not done within ``timeout_s`` [s] is killed.

        Waits, so it belongs behind the run. A second call returns the same summary.
        """
        self._allowed_s = timeout_s
        return super().close(timeout_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _trouble(self) -> str:
        complaint = self._reap()
        if self._overdue:
            return f"the capture process was not done within {self._allowed_s:g} s and was killed"
        code = self._process.returncode
        last_line = complaint.decode(errors="replace").strip().rpartition("\n")[2]
        end = f"by signal {-code}" if code is not None and code < 0 else f"with exit code {code}"
        return f"the capture process ended {end} before its report" + (f" ({last_line})" if last_line else "")

    def _reap(self) -> bytes:
        """Wait for the writer's end, and return what it complained of."""
        if self._process.stderr is None or self._process.stderr.closed:
            return b""
        # A killed process still waits for a disk that does not answer; then it is left to the system.
        complaint = b""
        with suppress(subprocess.TimeoutExpired):
            _, complaint = self._process.communicate(timeout=self._allowed_s + 1.0)
        self._process.stderr.close()
        return complaint

    def _give_up(self) -> None:
        """The writer's death ends every send and every read."""
        self._overdue = True
        self._process.kill()

    def _await_end(self) -> None:
        self._reap()


def _start_writer(path: Path) -> tuple[socket.socket, subprocess.Popen[bytes]]:
    with ExitStack() as ours_only, ExitStack() as copied:
        file_fd = create_file(path)
        copied.callback(os.close, file_fd)
        try:
            ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        except OSError as error:
            raise CaptureError(path, f"the writing process cannot be reached: {error.strerror or error}") from error
        ours_only.callback(ours.close)
        copied.callback(theirs.close)
        process = start_writer(path, socket_fd=theirs.fileno(), file_fd=file_fd)
        ours_only.pop_all()
    return ours, process


def create_file(path: Path, *, keep: bool = False) -> int:
    """Create or empty ``path`` and return its descriptor; raise ``CaptureError``, also while another process writes it.

    ``keep``: what an existing file holds stays until a recorder connects to the writer that listens.
    """
    try:
        file_fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise cannot_create(path, error) from error
    with ExitStack() as refused:
        refused.callback(os.close, file_fd)
        if holder := claim_file(file_fd):
            raise CaptureError(path, f"{holder} records to it; choose another file")
        if not keep and stat.S_ISREG(os.fstat(file_fd).st_mode):
            os.ftruncate(file_fd, 0)
        refused.pop_all()
    return file_fd


def start_writer(
    path: Path, *, socket_fd: int, file_fd: int, listens: bool = False, detached: bool = False
) -> subprocess.Popen[bytes]:
    """Start the process that writes ``path``; it gets its own copies of both descriptors.

    ``listens``: the socket is one that a recorder will connect to. ``detached``: it outlives its parent's terminal.
    """
    descriptors = socket_fd, file_fd
    arguments = [*map(str, descriptors), os.path.abspath(path), "listen" if listens else "connected"]  # noqa: PTH100  # a link to the file stays one
    try:
        with terminal_signals_blocked():
            return subprocess.Popen(
                module_command(_WRITER, *arguments),
                pass_fds=descriptors,
                env=module_environment(),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL if detached else subprocess.PIPE,
                start_new_session=detached,
            )
    except OSError as error:
        raise CaptureError(path, f"the writing process cannot be started: {error.strerror or error}") from error
