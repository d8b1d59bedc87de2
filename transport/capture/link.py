"""The recorder's end of the way to the process that writes: it never waits, and counts what does not get through."""

import errno
import json
import socket
import struct
import threading
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

from hil.values.errors import UsageError
from transport.capture.batches import (
    DATAGRAM,
    FULL_BATCH_BYTES,
    FULL_BATCH_DATAGRAMS,
    NOTE,
    NOTE_HEAD,
    RECORD_HEAD,
    Opening,
    Ring,
    pack_opening,
)
from transport.capture.comment import encode_comment
from transport.capture.endpoints import MAX_PAYLOAD_BYTES, Endpoint, pack_endpoint
from transport.capture.journal import EndEntry, LostEntry, encode_entry

_SEND_BUFFER_BYTES: Final = 4 << 20
"""Asked for; the system grants at most net.core.wmem_max."""
_MAX_WAITING_BATCHES: Final = 256
"""More than 16 000 packets: two seconds of four arms at 1 kHz."""
_MAX_ROUTES: Final = 1024
"""Remembered pairs of addresses; strangers may come from any number of them."""
_SENDS_PER_FLUSH: Final = 2
"""Catches up twice as fast as it fell behind, and a flush costs no more than two system calls."""
_MAX_REPORT_BYTES: Final = 1 << 16
_BEHIND_THE_ALARM_S: Final = 1.0
"""Where giving up does not end the waiting: a killed process may still wait for a disk."""
_NO_ROOM: Final = {errno.EAGAIN, errno.ENOBUFS}
"""The writer, or the system's memory, does not keep up; the next flush tries again."""


@dataclass(frozen=True, slots=True)
class CaptureSummary:
    """What became of a capture; ``written + dropped + removed`` is the number of packets put."""

    path: Path
    """The file."""
    written: int
    """Packets the writing process reported to be in the file."""
    dropped: int
    """Packets not reported to be there."""
    error: str | None
    """What went wrong, in one sentence; ``None`` if nothing did."""
    removed: int = 0
    """Packets that were in files of a ring which newer ones replaced."""

    def report(self) -> dict[str, object]:
        """Return it for the status file."""
        told = {"path": str(self.path), "written": self.written, "dropped": self.dropped, "error": self.error}
        return {**told, "removed": self.removed}


class _Batch(NamedTuple):
    datagrams: int
    message: bytes


class CaptureLink:
    """Hands records over ``link``, a connected sequenced-packet socket to the writer of ``path``; for one thread.

    Nothing that happens to file or process raises: packets are dropped and counted.
    """

    def __init__(self, link: socket.socket, path: Path) -> None:
        link.setblocking(False)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
        self.path = path
        self.dropped = 0
        """Packets known not to reach the file; complete when there is a summary."""
        self._socket = link
        self._sent = 0
        self._lost_records = 0
        """Records dropped that the file does not tell of yet."""
        self._pending: list[bytes] = []
        self._pending_bytes = 0
        self._pending_datagrams = 0
        self._waiting: deque[_Batch] = deque()
        """Batches the socket had no room for."""
        self._routes: dict[tuple[Endpoint, Endpoint], bytes] = {}
        self._peer_gone = False
        self._finished = False
        self.summary: CaptureSummary | None = None
        """What became of it; there once the writer reported, or cannot."""

    def begin(self, comment: str, *, ring: Ring | None = None) -> None:
        """Tell the writer the section's ``comment``, before anything is put; raise ``CaptureError`` if too long."""
        self._waiting.append(_Batch(0, pack_opening(Opening(encode_comment(self.path, comment), ring))))
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
            record = RECORD_HEAD.pack(DATAGRAM, size, at_unix_ns, route) + payload
        except struct.error as error:
            raise UsageError(f"time stamp {at_unix_ns} ns cannot be captured; valid: 0 to 2^64 - 1") from error
        self._pending.append(record)
        self._pending_bytes += len(record)
        self._pending_datagrams += 1
        if self._pending_datagrams >= FULL_BATCH_DATAGRAMS or self._pending_bytes >= FULL_BATCH_BYTES:
            self.flush()

    def note(self, entry: bytes) -> None:
        """Record an entry of the journal; takes a microsecond, never waits."""
        self._pending.append(NOTE_HEAD.pack(NOTE, len(entry)) + entry)
        self._pending_bytes += NOTE_HEAD.size + len(entry)
        if self._pending_bytes >= FULL_BATCH_BYTES:
            self.flush()

    def flush(self) -> None:
        """Hand over what is pending, as far as the socket takes it now; never waits."""
        if self._pending:
            self._queue_pending()
        for _ in range(_SENDS_PER_FLUSH):
            if not self._waiting:
                return
            try:
                self._socket.send(self._waiting[0].message)
            except OSError as error:
                if error.errno not in _NO_ROOM:
                    self._drop_everything()
                return
            self._sent += self._waiting.popleft().datagrams

    def finish(self) -> bool:
        """Hand over the end, as far as the socket takes it now; return whether the writer has everything.

        To be called again until it has; then the writer's report can be read from the socket.
        """
        if not self._finished:
            self._finished = True
            self.note(encode_entry(EndEntry()))
        self.flush()
        if self._waiting:
            return False
        self._say_end()
        return True

    @property
    def socket(self) -> socket.socket:
        """Where the writer's report comes, to be waited for."""
        return self._socket

    def take_report(self) -> CaptureSummary:
        """Read the writer's report, which is there or not, release the socket, and return the summary."""
        report = b""
        with suppress(OSError):
            report = self._socket.recv(_MAX_REPORT_BYTES)
        self.release()
        return self._summarise(report)

    def close(self, timeout_s: float = 5.0) -> CaptureSummary:
        """Complete the file within ``timeout_s`` [s] and say what is in it; a second call returns the same summary.

        Waits, so it belongs behind the run.
        """
        # One alarm bounds all the waiting below, also for a writer that takes a little now and then.
        alarm = threading.Timer(timeout_s, self._give_up)
        alarm.daemon = True
        alarm.start()
        try:
            summary = self.summary or self._complete(timeout_s)
            self._await_end()
        finally:
            alarm.cancel()
            alarm.join()
        return summary

    def _complete(self, timeout_s: float) -> CaptureSummary:
        self._socket.settimeout(timeout_s + _BEHIND_THE_ALARM_S)
        while not self.finish():
            continue
        return self.take_report()

    def _give_up(self) -> None:
        """End the waiting for the writer, from another thread."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    def _await_end(self) -> None:
        """Wait until the writer is gone, where that is known."""

    def release(self) -> None:
        """Release the socket; what is put from now on is dropped."""
        self._peer_gone = True
        self._socket.close()

    def _trouble(self) -> str:
        """Why there is no report of the writer."""
        return "the writing process did not report"

    def _summarise(self, report: bytes) -> CaptureSummary:
        written, removed, error = 0, 0, None
        told = _read_report(report, most=self._sent)
        if told is None:
            error = f"{self._trouble()}; what the file holds is not confirmed"
        else:
            written, removed, refused = told
            if refused is not None:
                error = f"{self.path} cannot be written: {refused}"
        self.dropped += self._sent - written - removed
        self.summary = CaptureSummary(self.path, written, self.dropped, error, removed)
        return self.summary

    def _say_end(self) -> None:
        self._peer_gone = True
        # Not only closed: a process forked from this one may hold the socket too, and would withhold the end.
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)

    def _queue_pending(self) -> None:
        datagrams = self._pending_datagrams
        # The newest batch gives way, not the oldest: what waits continues the file without a gap.
        if self._peer_gone or len(self._waiting) >= _MAX_WAITING_BATCHES:
            self.dropped += datagrams
            self._lost_records += len(self._pending)
        else:
            if self._lost_records:
                lost = encode_entry(LostEntry(self._lost_records))
                self._pending.insert(0, NOTE_HEAD.pack(NOTE, len(lost)) + lost)
                self._lost_records = 0
            self._waiting.append(_Batch(datagrams, b"".join(self._pending)))
        self._pending.clear()
        self._pending_bytes = self._pending_datagrams = 0

    def _drop_everything(self) -> None:
        """The writer is gone: nothing that waits, and nothing that is yet to come, has a receiver."""
        self._peer_gone = True
        self.dropped += sum(batch.datagrams for batch in self._waiting)
        self._waiting.clear()


def _read_report(report: bytes, *, most: int) -> tuple[int, int, str | None] | None:
    """Return written and removed packets, of ``most`` that were sent, and what went wrong; None: that is no report."""
    try:
        told = json.loads(report)
    except (ValueError, RecursionError):
        return None
    if not isinstance(told, dict):
        return None
    written, removed, error = (told.get(name) for name in ("written", "removed", "error"))
    counts = [one for one in (written, removed) if type(one) is int and 0 <= one <= most]
    if len(counts) < 2 or sum(counts) > most or not isinstance(error, str | None):
        return None
    return counts[0], counts[1], error
