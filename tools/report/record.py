"""What a report keeps of one robot, in bounded memory, whatever it was learned from. Times are in seconds."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.values.finding import EvidenceTable
from hil.values.robot import JOINT_COUNT, Seven
from tools.report.envelope import Envelope

COMMANDED: Final = 0
MEASURED: Final = JOINT_COUNT
DIFFERENCE: Final = 2 * JOINT_COUNT
FLANGE_SPEED: Final = 3 * JOINT_COUNT
"""Columns of :attr:`RobotRecord.arm`; the first of seven where there are seven."""
NOT_KNOWN: Final = (float("nan"),) * JOINT_COUNT

_MOST_SPANS: Final = 1500
_MOST_MARKS: Final = 1000
_MOST_EVENTS: Final = 250
_EDGES_MS: Final = np.logspace(-3, 4, 141)
"""Edges of the latency histogram [ms]: a microsecond to ten seconds, twenty to a decade."""


class Span(NamedTuple):
    """From when to when something was so, and why."""

    begin_s: float
    end_s: float
    label: str
    reason: str


class Lane:
    """One thing of the timeline that is one of a few at any time; an empty label is nothing."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.spans: list[Span] = []
        self.not_kept = 0
        self._label = ""
        self._reason = ""
        self._since_s = 0.0

    @property
    def label(self) -> str:
        """What it is now."""
        return self._label

    def change(self, at_s: float, label: str, reason: str = "") -> None:
        """From now on it is ``label``."""
        if label == self._label:
            return
        self.end(at_s)
        self._label, self._reason, self._since_s = label, reason, at_s

    def end(self, at_s: float) -> None:
        """Nothing is known of what comes after ``at_s``."""
        if self._label and at_s > self._since_s:
            if len(self.spans) < _MOST_SPANS:
                self.spans.append(Span(self._since_s, at_s, self._label, self._reason))
            else:
                self.not_kept += 1
        self._label = ""


class MarkKind(StrEnum):
    """What stands at one time."""

    STOP = "stop"
    FINDING = "finding"
    OPERATOR = "operator"
    WARNING = "warning"


class Mark(NamedTuple):
    """Something that happened at one time."""

    at_s: float
    kind: MarkKind
    text: str


class Latencies:
    """Answer latencies [ms]: over time, and how often each."""

    def __init__(self) -> None:
        self.series = Envelope(1)
        self.count = 0
        self.late = 0
        self.largest_ms = 0.0
        self.largest_at_s = 0.0
        self._counts: NDArray[np.int64] = np.zeros(len(_EDGES_MS) + 1, dtype=np.int64)
        self._waiting: list[float] = []

    def add(self, at_s: float, latency_ms: float, *, budget_ms: float) -> None:
        """Take one answer."""
        self.series.add((at_s, latency_ms))
        self.count += 1
        self.late += latency_ms > budget_ms
        if latency_ms > self.largest_ms:
            self.largest_ms, self.largest_at_s = latency_ms, at_s
        self._waiting.append(latency_ms)
        if len(self._waiting) >= 4096:
            self._tally()

    def bars(self) -> list[tuple[float, float, int]]:
        """Return the histogram: from [ms], to [ms], how many; without the empty ends."""
        self._tally()
        found = np.flatnonzero(self._counts)
        if not len(found):
            return []
        edges = (0.0, *_EDGES_MS.tolist(), float("inf"))
        return [(edges[at], edges[at + 1], int(self._counts[at])) for at in range(int(found[0]), int(found[-1]) + 1)]

    def quantile_ms(self, share: float) -> float:
        """Return the upper edge of the bar that holds a quantile, at most the largest."""
        wanted, seen = share * self.count, 0
        for _, upper_ms, count in self.bars():
            seen += count
            if seen >= wanted:
                return min(upper_ms, self.largest_ms)
        return self.largest_ms

    def _tally(self) -> None:
        if self._waiting:
            places = np.searchsorted(_EDGES_MS, self._waiting, side="right")
            self._counts += np.bincount(places, minlength=len(self._counts))
            self._waiting.clear()


@dataclass(slots=True)
class RobotRecord:
    """One robot."""

    name: str
    model: str
    commanded_is: str
    """Whose positions the commanded ones are, in words."""
    speed_is: str
    """How the flange speed is known, in words."""
    inside_known: bool
    """Whether it comes from a controller, not from packets alone."""
    budget_ms: float | None = None
    """What an answer of the FRI client may take."""
    t1_mm_s: float = 250.0
    lanes: dict[str, Lane] = field(default_factory=dict)
    arm: Envelope = field(default_factory=lambda: Envelope(3 * JOINT_COUNT + 1))
    latencies: Latencies = field(default_factory=Latencies)
    marks: list[Mark] = field(default_factory=list)
    marks_not_kept: int = 0
    first_events: list[tuple[float, str]] = field(default_factory=list)
    last_events: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=_MOST_EVENTS))
    events: int = 0
    drops: dict[str, tuple[int, float, str]] = field(default_factory=dict)
    """By reason: how many, when it was told last, and what that was."""
    quality_falls: list[tuple[float, str]] = field(default_factory=list)
    """From GOOD or better to worse."""
    stops: list[tuple[float, str]] = field(default_factory=list)
    stop_count: int = 0
    largest_speed_mm_s: float = 0.0
    largest_speed_at_s: float = 0.0
    end_s: float = 0.0
    report: dict[str, object] = field(default_factory=dict)
    """What the controller said of itself at the end."""
    figures: list[tuple[str, str]] = field(default_factory=list)
    """Key figures in words."""
    configuration: dict[str, object] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    evidence: list[EvidenceTable] = field(default_factory=list)
    """Where the time of the answers went."""

    def lane(self, name: str) -> Lane:
        """Return the lane of that name; the order in which they are asked for first is that of the page."""
        if name not in self.lanes:
            self.lanes[name] = Lane(name)
        return self.lanes[name]

    def sample(self, at_s: float, told: Sequence[float], measured: Seven, speed_mm_s: float) -> None:
        """Take positions [rad] and the flange's speed; ``told`` is where the arm should be, NaN where nobody knows."""
        difference = [here - there for here, there in zip(measured, told, strict=True)]
        self.arm.add((at_s, *told, *measured, *difference, speed_mm_s))
        if speed_mm_s > self.largest_speed_mm_s:
            self.largest_speed_mm_s, self.largest_speed_at_s = speed_mm_s, at_s

    def mark(self, at_s: float, kind: MarkKind, text: str) -> None:
        """Put something on the timeline."""
        if len(self.marks) < _MOST_MARKS:
            self.marks.append(Mark(at_s, kind, text))
        else:
            self.marks_not_kept += 1

    def stopped(self, at_s: float, text: str) -> None:
        """The arm was stopped."""
        self.stop_count += 1
        if len(self.stops) < _MOST_MARKS:
            self.stops.append((at_s, text))
        self.mark(at_s, MarkKind.STOP, text)

    def quality_fell(self, at_s: float, text: str) -> None:
        """The connection became worse than GOOD."""
        if len(self.quality_falls) < _MOST_MARKS:
            self.quality_falls.append((at_s, text))

    def tell(self, at_s: float, text: str) -> None:
        """Take a line for the list of what happened."""
        self.events += 1
        if len(self.first_events) < _MOST_EVENTS:
            self.first_events.append((at_s, text))
        else:
            self.last_events.append((at_s, text))

    def finish(self) -> None:
        """The record is over."""
        for lane in self.lanes.values():
            lane.end(self.end_s)
