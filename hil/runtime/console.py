"""Lines for a person, written by a thread: a full pipe or a slow terminal must not hold up a control cycle."""

import queue
import sys
import threading
from typing import TextIO

QUEUED_LINES = 1000


class Console:
    """``say`` never blocks; what the reader cannot take is counted and told at the end."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._lines: queue.Queue[str | None] = queue.Queue(maxsize=QUEUED_LINES)
        self._dropped = 0
        self._thread = threading.Thread(target=self._write, name="hil console", daemon=True)
        self._thread.start()

    def say(self, line: str) -> None:
        """Queue one line."""
        try:
            self._lines.put_nowait(line)
        except queue.Full:
            self._dropped += 1

    def close(self, *, timeout_s: float = 2.0) -> None:
        """Write what is queued, for at most ``timeout_s``."""
        try:
            self._lines.put(None, timeout=timeout_s)
        except queue.Full:
            return
        self._thread.join(timeout_s)

    def _write(self) -> None:
        while (line := self._lines.get()) is not None:
            self._write_line(line)
        if self._dropped:
            self._write_line(f"({self._dropped} lines were not written: nobody read fast enough)")

    def _write_line(self, line: str) -> None:
        try:
            self._stream.write(line + "\n")
            self._stream.flush()
        except (OSError, ValueError):
            self._dropped += 1
