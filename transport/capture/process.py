"""The capture of a running control loop, written by a process of its own.

A thread would take the interpreter lock for milliseconds whenever it encodes a batch, and a 1 kHz loop has not got
them. The loop only packs its datagrams into batches and hands those to a local socket, without ever waiting.
"""

import errno
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from hil.values.errors import UsageError
from transport.capture.batches import FULL_BATCH_BYTES, FULL_BATCH_RECORDS, RECORD_HEAD, pack_opening
from transport.capture.comment import encode_comment
from transport.capture.endpoints import MAX_PAYLOAD_BYTES, Endpoint, pack_endpoint
from transport.capture.errors import CaptureError, cannot_create

_WRITER = "transport.capture.writer_main"
_SOURCE_ROOT = Path(__file__).resolve().parents[2]
"""The folder that holds the package, which the child must find wherever it is started."""

_SEND_BUFFER_BYTES = 4 << 20
"""Asked for; the system grants at most net.core.wmem_max."""
_MAX_WAITING_BATCHES = 256
"""More than 16 000 packets: two seconds of four arms at 1 kHz."""
_MAX_ROUTES = 1024
"""Remembered pairs of addresses; strangers may come from any number of them."""
_SENDS_PER_FLUSH = 2
"""Catches up twice as fast as it fell behind, and a flush costs no more than two system calls."""

_NO_ROOM = {errno.EAGAIN, errno.ENOBUFS}
"""The writer, or the system's memory, does not keep up; the next flush tries again."""
_TERMINAL_SIGNALS = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}


@dataclass(frozen=True, slots=True)
class CaptureSummary:
    """What became of a capture; ``written + dropped`` is the number of packets put."""

    path: Path
    """The file."""
    written: int
    """Packets the writing process reported to be in the file."""
    dropped: int
    """Packets not reported to be there."""
    error: str | None
    """What went wrong, in one sentence; ``None`` if nothing did."""


class CaptureProcess:
    """Records datagrams to ``path``, which is created, or emptied, before anything else.

    ``comment`` goes into the section header. A file that cannot be created raises ``CaptureError``; once the recording
    runs, nothing that happens to file or process raises: packets are dropped and counted. For use by one thread.
    """

    def __init__(self, path: Path, *, comment: str) -> None:
        self.path = path
        self.dropped = 0
        """Packets known not to reach the file; complete after ``close``."""
        self._sent = 0
        self._pending: list[bytes] = []
        self._pending_bytes = 0
        self._waiting: deque[tuple[int, bytes]] = deque()
        """Batches the socket had no room for: packets, message."""
        self._routes: dict[tuple[Endpoint, Endpoint], bytes] = {}
        self._peer_gone = False
        self._overdue = False
        self._summary: CaptureSummary | None = None
        opening = pack_opening(encode_comment(path, comment))
        self._socket, self._process = _start_writer(path)
        self._waiting.append((0, opening))
        self.flush()

    def put(self, at_unix_ns: int, source: Endpoint, destination: Endpoint, payload: bytes) -> None:
        """Record a datagram that passed at ``at_unix_ns`` [ns since 1970, UTC]; takes microseconds, never waits.

        Raises ``UsageError`` for a time stamp, an address or a payload that no UDP datagram over IPv4 can have.
        """
        route = self._routes.get((source, destination))
        if route is None:
            route = pack_endpoint(source) + pack_endpoint(destination)
            if len(self._routes) >= _MAX_ROUTES:
                self._routes.clear()
            self._routes[source, destination] = route
        size = len(payload)
        if size > MAX_PAYLOAD_BYTES:
            raise UsageError(f"a datagram of {size} bytes; UDP carries at most {MAX_PAYLOAD_BYTES}")
        try:
            record = RECORD_HEAD.pack(at_unix_ns, route, size) + payload
        except struct.error as error:
            raise UsageError(f"time stamp {at_unix_ns} ns cannot be captured; valid: 0 to 2^64 - 1") from error
        pending = self._pending
        pending.append(record)
        self._pending_bytes += len(record)
        if len(pending) >= FULL_BATCH_RECORDS or self._pending_bytes >= FULL_BATCH_BYTES:
            self.flush()

    def flush(self) -> None:
        """Hand over what is pending, as far as the socket takes it now; never waits."""
        if self._pending:
            self._queue_pending()
        for _ in range(_SENDS_PER_FLUSH):
            if not self._waiting:
                return
            try:
                self._socket.send(self._waiting[0][1])
            except OSError as error:
                if error.errno not in _NO_ROOM:
                    self._drop_everything()
                return
            self._sent += self._waiting.popleft()[0]

    def close(self, timeout_s: float = 5.0) -> CaptureSummary:
        """Complete the file and say what is in it; a writer not done within ``timeout_s`` [s] is killed.

        Waits, so it belongs behind the run. A second call returns the same summary.
        """
        if self._summary is None:
            # One alarm bounds all the waiting below: the writer's death ends every send and every read.
            alarm = threading.Timer(timeout_s, self._kill)
            alarm.daemon = True
            alarm.start()
            try:
                self._send_rest(timeout_s)
                self._summary = self._end_writer(timeout_s)
            finally:
                alarm.cancel()
                alarm.join()
            self.dropped = self._summary.dropped
        return self._summary

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _queue_pending(self) -> None:
        packets = len(self._pending)
        # The newest batch gives way, not the oldest: what waits continues the file without a gap.
        if self._peer_gone or len(self._waiting) >= _MAX_WAITING_BATCHES:
            self.dropped += packets
        else:
            self._waiting.append((packets, b"".join(self._pending)))
        self._pending.clear()
        self._pending_bytes = 0

    def _drop_everything(self) -> None:
        """The writer is gone: nothing that waits, and nothing that is yet to come, has a receiver."""
        self._peer_gone = True
        self.dropped += sum(packets for packets, _ in self._waiting)
        self._waiting.clear()

    def _send_rest(self, timeout_s: float) -> None:
        if self._pending:
            self._queue_pending()
        self._socket.settimeout(timeout_s)
        while self._waiting and not self._peer_gone:
            try:
                self._socket.send(self._waiting[0][1])
            except OSError:
                self._drop_everything()
            else:
                self._sent += self._waiting.popleft()[0]
        self._peer_gone = True

    def _end_writer(self, timeout_s: float) -> CaptureSummary:
        # Not only closed: a process forked from this one may hold the socket too, and would withhold the end.
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)
        self._socket.close()
        # A killed process still waits for a disk that does not answer; then it is left to the system.
        try:
            output, complaint = self._process.communicate(timeout=timeout_s + 1.0)
        except subprocess.TimeoutExpired:
            output, complaint = b"", b""
        for pipe in (self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()
        return self._summarise(output, complaint, timeout_s)

    def _summarise(self, output: bytes, complaint: bytes, timeout_s: float) -> CaptureSummary:
        written, error = 0, None
        try:
            report = json.loads(output)
            written, refused = report["written"], report["error"]
        except ValueError:
            error = f"{self._cause_of_death(complaint, timeout_s)}; what the file holds is not confirmed"
        else:
            if refused is not None:
                error = f"{self.path} cannot be written: {refused}"
        return CaptureSummary(self.path, written, self.dropped + self._sent - written, error)

    def _cause_of_death(self, complaint: bytes, timeout_s: float) -> str:
        if self._overdue:
            return f"the capture process was not done within {timeout_s:g} s and was killed"
        code = self._process.returncode
        last_line = complaint.decode(errors="replace").strip().rpartition("\n")[2]
        end = f"by signal {-code}" if code is not None and code < 0 else f"with exit code {code}"
        return f"the capture process ended {end} before its report" + (f" ({last_line})" if last_line else "")

    def _kill(self) -> None:
        self._overdue = True
        self._process.kill()


def _start_writer(path: Path) -> tuple[socket.socket, subprocess.Popen[bytes]]:
    try:
        file_fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise cannot_create(path, error) from error
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setblocking(False)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
    descriptors = theirs.fileno(), file_fd
    search_path = os.pathsep.join(filter(None, [str(_SOURCE_ROOT), os.environ.get("PYTHONPATH")]))
    try:
        with _terminal_signals_blocked():
            process = subprocess.Popen(
                # -P: a file of the user's folder must not pass for a module
                [sys.executable, "-P", "-m", _WRITER, *map(str, descriptors)],
                pass_fds=descriptors,
                env={**os.environ, "PYTHONPATH": search_path},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
    except OSError as error:
        ours.close()
        raise CaptureError(path, f"the writing process cannot be started: {error.strerror or error}") from error
    finally:
        theirs.close()
        os.close(file_fd)
    return ours, process


@contextmanager
def _terminal_signals_blocked() -> Iterator[None]:
    """A process started inside is born with these signals blocked, and they stay so.

    A handler it installs itself would come too late for a Ctrl-C in its first milliseconds.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _TERMINAL_SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
