"""A recorded run in virtual time whose controller, client and wire misbehave as told."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from hil.core.events import Diagnosed, Event
from hil.values.finding import Finding
from tests.support.recordings import fri_robot
from tools.bench.clients import BenchMotion, recorded_client
from tools.bench.recording import VirtualRun

MS = 1_000_000
USUAL_ANSWER_NS = 400_000
USUAL_LATENESS_NS = 30_000
COMMANDING_FROM_S = 1.1
"""Of a run at 5 ms: the session commands by then."""


class FaultyRun(VirtualRun):
    """5 ms a message; ``lateness``, ``answer`` and ``read_until`` are by the time of the cycle, in milliseconds."""

    def __init__(self, file: Path, **config: Any) -> None:
        robot = fri_robot(**{"fri": {"send_period_ms": 5}, **config})
        super().__init__(robot, recorded_client(robot, BenchMotion.FRI_OVERLAY), file)
        self.found: list[Finding] = []
        self.lateness: Callable[[int], int] = lambda _: USUAL_LATENESS_NS
        self.answer: Callable[[int], int | None] = lambda _: USUAL_ANSWER_NS
        self.unread: Callable[[int], bool] = lambda _: False
        """Whether what came in the period before the cycle is read behind it only."""

    @property
    def at_ms(self) -> int:
        """Time of the cycle."""
        return self.now_ns // MS

    def lateness_ns(self) -> int:
        return self.lateness(self.at_ms)

    def answer_ns(self) -> int | None:
        return self.answer(self.at_ms)

    def read_until_ns(self) -> int:
        return -1 if self.unread(self.at_ms) else self.now_ns

    def events(self, events: list[Event]) -> None:
        self.found += [event.finding for event in events if isinstance(event, Diagnosed)]

    def skip(self, cycles: int) -> None:
        """Miss control cycles."""
        self.now_ns += cycles * MS

    def of_kind(self, kind: str) -> list[Finding]:
        """What was found of a kind, in order."""
        return [finding for finding in self.found if finding.kind == kind]
