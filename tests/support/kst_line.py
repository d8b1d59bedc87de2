"""A KST connection in hand-written time, and its kernel's books: what a StallWatch is told."""

import json
from dataclasses import dataclass, field

from hil.kst.stalls import StallWatch
from transport.tcp.sockets import Kernel

MS = 1_000_000
REQUEST = 40
"""Bytes."""


@dataclass
class Line:
    """A connection's timeline in ms, and the kernel's books of it. Sampling happens as the watch asks for it."""

    nagle: bool = False
    way_ms: float = 0.05
    tells: bool = True
    watch: StallWatch = field(init=False)
    at_ms: float = 0.0
    acknowledgements: int = 1
    segments: int = 0
    unsent: int = 0
    unacknowledged: int = 0
    again: int = 0
    full_bytes: int = 536
    samples: int = 0

    def __post_init__(self) -> None:
        self.watch = StallWatch(self.nagle)

    def kernel(self, *, late_ms: int = 0) -> Kernel | None:
        if not self.tells:
            return None
        return Kernel(
            self.way_ms,
            self.again,
            self.unacknowledged,
            self.unsent,
            self.way_ms,
            self.acknowledgements,
            self.segments,
            40.0,
            self.full_bytes,
            late_ms,
        )

    def wait(self, ms: float) -> None:
        """Let time pass, with the samples that are asked for."""
        until_ns = round((self.at_ms + ms) * MS)
        while self.watch.due_ns is not None and self.watch.due_ns < until_ns:
            due_ns = self.watch.due_ns
            self.samples += 1
            self.watch.sampled(due_ns, self.kernel())
            assert self.watch.due_ns is None or self.watch.due_ns > due_ns
        self.at_ms += ms

    def acknowledge(self) -> None:
        """This side's kernel sends an acknowledgement without data."""
        self.acknowledgements += 1

    def reads(
        self, size: int, *, lines: int = 0, due: int = 0, is_open: bool = False, segments: int = 1, late_ms: int = 0
    ) -> None:
        self.segments += segments
        self.watch.received(
            round(self.at_ms * MS),
            bytes_read=size,
            lines=lines,
            replies_due=due,
            line_open=is_open,
            kernel=self.kernel(late_ms=late_ms),
        )

    def writes(self, *, held: int = 0) -> None:
        self.unsent = held
        self.unacknowledged = 1 if held else self.unacknowledged
        self.watch.written(round(self.at_ms * MS), size=5, kernel=self.kernel())

    def kinds(self) -> list[str]:
        found = self.watch.findings()
        told = [finding.kind for finding in self.watch.news()]
        assert told == [finding.kind for finding in found if finding.is_wrong]
        assert self.watch.news() == [], "told once"
        json.dumps(self.watch.report(), allow_nan=False)
        return [finding.kind for finding in found]

    def stalls(self, kind: str) -> int:
        return int(json.loads(json.dumps(self.watch.report()))["stalls"][kind]["count"])

    def none(self, kind: str) -> dict[str, int]:
        counts: dict[str, int] = json.loads(json.dumps(self.watch.report()))["stalls"][kind]["not_stalls"]
        return counts


def asks_in_parts(line: Line, *, count: int = 12, delay_ms: float = 43.9, way_ms: float = 0.05) -> Line:
    """Body, this side's late acknowledgement, line end, reply."""
    for _ in range(count):
        line.wait(1.0)
        line.reads(REQUEST, is_open=True)
        line.wait(delay_ms)
        line.acknowledge()
        line.wait(way_ms)
        # What comes then is acknowledged when it is read: the mode of waiting for replies is over.
        line.acknowledge()
        line.reads(1, lines=1, due=1)
        line.writes()
    return line


def ping_pong(line: Line, *, count: int, pace_ms: float) -> Line:
    for _ in range(count):
        line.wait(pace_ms)
        line.reads(REQUEST, lines=1, due=1)
        line.writes()
    return line
