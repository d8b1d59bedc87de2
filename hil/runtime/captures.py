"""The recording of a run: begun with it, or by somebody who asks a running controller for one.

A process of its own writes the file. Where the run begins with the recording, this process starts the writer before
the first cycle; later nothing is started here, because to start a process costs cycles: whoever asks brings the writer
along, and tells where it listens.
"""

import asyncio
import socket
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, Protocol

from hil.config.ring import RingSize, parse_ring
from hil.config.station import Station
from hil.runtime.capture_header import CaptureHeader, RobotStart, machine
from hil.runtime.journal import Recorder
from hil.values.errors import HilError
from transport.capture.batches import Ring
from transport.capture.link import CaptureLink, CaptureSummary
from transport.capture.process import CaptureProcess

_FLUSH_S: Final = 0.5
_FINISH_S: Final = 0.01


class RecordedRobot(Protocol):
    """A robot as its recorder sees it."""

    def record_to(self, recorder: Recorder | None) -> None:
        """Tell ``recorder`` everything from now on; None: nobody."""

    def recorded_start(self) -> RobotStart:
        """Return what a replay needs to know of the run."""


class Captures:
    """At most one capture at a time; ``robots`` are there when :meth:`begin` is called."""

    def __init__(self, station: Station, robots: Sequence[RecordedRobot]) -> None:
        self._station = station
        self._robots = robots
        self._own: CaptureProcess | None = None
        self._link: CaptureLink | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._ending: CaptureLink | None = None
        self._last: CaptureSummary | None = None

    def open(self) -> None:
        """Create the file the station names, if it names one; raise ``CaptureError``."""
        # Looked up before the first cycle, which the lookup would delay by five.
        machine()
        if self._station.capture is not None:
            self._own = CaptureProcess(self._station.capture)

    def begin(self) -> None:
        """Record from now on, where the station names a file; robots have their time axes, and no cycle has run."""
        if self._own is not None:
            self._own.begin(self._comment(), ring=self._ring())
            self._record_to(self._own)

    def start(self, writer: Path, file: Path, ring: RingSize | None) -> str:
        """Record to the process that listens at ``writer`` and writes ``file``; return why not, or an empty text."""
        if self._link is not None:
            return f"a capture to {self._link.path} runs already: hil capture stop"
        if self._ending is not None:
            return f"the capture to {self._ending.path} is being completed; try again in a moment"
        link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            link.setblocking(False)
            link.connect(str(writer))
        except (OSError, ValueError) as error:  # ValueError: a path with a NUL, or one that is no text
            link.close()
            reason = getattr(error, "strerror", None) or error
            return f"no writer of a capture listens at {str(writer)!r}: {reason}"
        capture = CaptureLink(link, file)
        try:
            capture.begin(self._comment(), ring=None if ring is None else Ring(*ring))
        except HilError as error:
            capture.release()
            return str(error)
        self._record_to(capture)
        return ""

    def stop(self) -> str:
        """End the capture that runs; return why not, or an empty text. Its summary is in the report when it is done."""
        link = self._link
        if link is None:
            return "no capture runs: hil capture start FILE.pcapng"
        self._record_to(None)
        self._finish()
        return ""

    def report(self) -> dict[str, object] | None:
        """Return what the pad and the status file say of it; None where nothing was recorded."""
        running = self._link or self._ending
        if running is not None:
            state = "recording" if running is self._link else "completing"
            return {"state": state, "path": str(running.path), "dropped": running.dropped}
        return None if self._last is None else {"state": "complete", **self._last.report()}

    def close(self) -> dict[str, object] | None:
        """End what runs, wait for the writer, and return the last summary for the status file."""
        if self._link is not None:
            self._record_to(None)
        self._cancel_timer()
        ending, self._ending = self._ending, None
        if ending is not None:
            asyncio.get_running_loop().remove_reader(ending.socket)
            self._last = ending.close()
        if self._own is not None:
            own = self._own.close()
            self._last = self._last or own
        return None if self._last is None else self._last.report()

    def _ring(self) -> Ring | None:
        text = self._station.capture_ring
        return None if text is None else Ring(*parse_ring(text))

    def _comment(self) -> str:
        return CaptureHeader.of_run(self._station, tuple(robot.recorded_start() for robot in self._robots)).to_comment()

    def _record_to(self, link: CaptureLink | None) -> None:
        if link is None:
            self._ending, self._link = self._link, None
        else:
            self._link = link
            self._after(_FLUSH_S, self._flush)
        for robot in self._robots:
            robot.record_to(link)

    def _flush(self) -> None:
        if self._link is not None:
            self._link.flush()
            self._after(_FLUSH_S, self._flush)

    def _finish(self) -> None:
        """Hand over the rest bit by bit, so that no cycle waits for it, then wait for the writer's report."""
        link = self._ending
        if link is None:
            return
        if not link.finish():
            self._after(_FINISH_S, self._finish)
            return
        self._cancel_timer()
        asyncio.get_running_loop().add_reader(link.socket, self._reported, link)

    def _reported(self, link: CaptureLink) -> None:
        asyncio.get_running_loop().remove_reader(link.socket)
        self._ending = None
        self._last = link.take_report()

    def _after(self, delay_s: float, action: Callable[[], None]) -> None:
        self._cancel_timer()
        self._timer = asyncio.get_running_loop().call_later(delay_s, action)

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
