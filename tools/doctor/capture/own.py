"""A recording of ours: the controller runs again on what it was told, and says what it would have said live."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, cast

from hil.core.controller import Controller
from hil.core.fri.link import FriLink
from hil.replay.exact import ExactReplay
from hil.replay.replay import ProgressTold, replay_own
from hil.replay.result import ReplayResult
from hil.runtime.capture_header import CaptureHeader
from hil.values.finding import EvidenceTable, Finding, Severity
from hil.values.outcomes import Outcome
from tools.doctor.capture.healthy import healthy, silent_client
from tools.doctor.capture.tables import fault_table, slowest_table, split_table, state_table

_PEERS = (Outcome.DUPLICATE, Outcome.REORDERED, Outcome.REPLAYED, Outcome.UNSENT_SEQUENCE)
"""What becomes of answers by peer or wire alone, whatever this controller does."""


class OwnDiagnosis(NamedTuple):
    """What the controllers of a recording found."""

    result: ReplayResult
    findings: tuple[Finding, ...]
    tables: tuple[EvidenceTable, ...]
    has_fri: bool


def diagnose_own(file: Path, header: CaptureHeader, *, progress: ProgressTold | None, limit: int) -> OwnDiagnosis:
    """Replay ``file`` and look at its controllers at the end; raise ``CaptureError`` where none can be made."""
    findings: list[Finding] = []
    tables: list[EvidenceTable] = []
    links: list[FriLink] = []

    def look(replay: ExactReplay) -> None:
        controllers = replay.controllers()
        for name, controller in controllers:
            title = f"{name}: " if len(controllers) > 1 else ""
            fri = controller.fri
            if fri is None:
                continue
            links.append(fri)
            fri.diagnosis.tell(controller.ticks * controller.cycle_ns, over=True)
            findings.extend(_findings(title, controller, fri))
            tables.extend(_tables(title, fri, limit))

    result = replay_own(file, header, progress=progress, finished=look)
    findings.sort(key=lambda finding: -finding.severity.value)
    return OwnDiagnosis(result, tuple(findings), tuple(tables), bool(links))


def _findings(title: str, controller: Controller, fri: FriLink) -> list[Finding]:
    found = controller.findings.worst()
    if all(one.severity.value <= Severity.NOTE.value for one in found):
        found.insert(0, _healthy(title, controller, fri))
    return found


def _healthy(title: str, controller: Controller, fri: FriLink) -> Finding:
    stops = [stop for stop in controller.stops if stop.reason != "the controller shuts down"]
    ended = f"; the arm was stopped for another reason: {stops[-1].reason}" if stops else ""
    latency = fri.answer_latency
    if not latency.count:
        return silent_client(
            title,
            client=str(fri.client),
            release=fri.release,
            messages=fri.counters.sent,
            seconds=controller.ticks * controller.cycle_ns / 1e9,
        )
    return healthy(
        title,
        latency=latency,
        budget_ns=fri.budget_ns,
        by_fault=cast("Mapping[str, Any]", fri.diagnosis.report()),
        quality=fri.quality.name,
        ended=ended,
    )


def _tables(title: str, fri: FriLink, limit: int) -> list[EvidenceTable]:
    report = fri.diagnosis.report()
    counts = cast("dict[str, dict[str, int]]", {what: report[what] for what in ("late", "missing")})
    beside = {one.value: fri.counters.by_outcome[one] for one in _PEERS}
    history = [(f"{one.at_ns / 1e9:.3f} s", one.new.name, one.quality.name, one.reason) for one in fri.log.history]
    return [
        state_table(f"{title}session states", history, ("at", "state", "quality", "reason")),
        split_table(f"{title}where the time of the answers went", fri.path.histograms),
        slowest_table(f"{title}slowest answers [ms]", fri.path.worst, limit, own=True),
        fault_table(f"{title}answers that did not count", counts, beside),
    ]
