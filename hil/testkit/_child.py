"""A ``hil`` command in a process of its own: started, heard, and ended, this one process and no other."""

import queue
import signal
import subprocess
import sys
import threading
from collections import deque
from typing import Final

from hil.testkit.errors import ProcessFailed

START_S: Final = 60.0
"""What has not started after so long will not."""
STOP_S: Final = 20.0
MOST_LINES: Final = 2_000


class Child:
    """``hil`` with ``arguments``. :meth:`end` releases everything."""

    def __init__(self, *arguments: object) -> None:
        self.name = f"hil {arguments[0]}"
        self._lines: deque[str] = deque(maxlen=MOST_LINES)
        self._news: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._awaited = True
        """Whether somebody waits for its lines, or will."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "hil.cli.main", *map(str, arguments)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
        # A pipe that nobody reads would hold the process up.
        self._reader = threading.Thread(target=self._read, name=f"output of {self.name}", daemon=True)
        self._reader.start()

    @property
    def output(self) -> str:
        """What it printed so far, the last two thousand lines."""
        return "\n".join(self._lines)

    @property
    def running(self) -> bool:
        """Whether it runs."""
        return self._process.poll() is None

    def wait_for(self, text: str) -> list[str]:
        """Return its lines up to the first with ``text``; raise :class:`ProcessFailed` when none comes. Once only."""
        lines: list[str] = []
        while True:
            try:
                line = self._news.get(timeout=START_S)
            except queue.Empty:
                raise self._failed(f"was not ready within {START_S:g} s") from None
            if line is None:
                raise self._failed(f"ended at once, exit code {self._process.wait()}")
            lines.append(line)
            if text in line:
                self._awaited = False
                return lines

    def end(self, number: signal.Signals = signal.SIGINT) -> int:
        """Send it a signal if it runs, and wait; one that does not obey is killed. Return its exit code."""
        if self.running:
            self._process.send_signal(number)
            try:
                self._process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
        code = self._process.wait()
        self._reader.join()
        if self._process.stdout is not None:
            self._process.stdout.close()
        return code

    def end_in_order(self) -> None:
        """End it; raise :class:`ProcessFailed` with what it said if its exit code is not 0."""
        code = self.end()
        if code:
            raise self._failed(f"ended with exit code {code}")

    def _failed(self, how: str) -> ProcessFailed:
        return ProcessFailed(f"{self.name} {how}; it said:\n{self.output}")

    def _read(self) -> None:
        for line in self._process.stdout or ():
            self._lines.append(line.rstrip("\n"))
            if self._awaited:
                self._news.put(line)
        self._news.put(None)
