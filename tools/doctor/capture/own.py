"""A recording of ours: the controller runs again on what it was told, and says what it would have said live."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, cast

from hil.core.controller import SHUTS_DOWN, Controller
from hil.core.diagnosis.connection import QUALITY_NOT_REACHED
from hil.core.fri.link import FriLink
from hil.replay.exact import ExactReplay
from hil.replay.replay import ProgressTold, replay_own
from hil.replay.result import ReplayResult
from hil.runtime.capture_header import CaptureHeader
from hil.values.finding import EvidenceTable, Finding, worst_first
from hil.values.fri import Quality
from tools.doctor.capture.healthy import healthy, late_and_missing, silent_client
from tools.doctor.capture.tables import fault_table, slowest_table, split_table, state_table


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
            now_ns = controller.ticks * controller.cycle_ns
            fri.diagnosis.tell(now_ns, over=True)
            if not _was_good(fri) and any(late_and_missing(fri.diagnosis.report())) and not _not_reached(controller):
                fri.diagnosis.not_reached(now_ns=now_ns)
            findings.extend(_findings(title, controller, fri))
            tables.extend(_tables(title, fri, limit))

    result = replay_own(file, header, progress=progress, finished=look)
    return OwnDiagnosis(result, tuple(worst_first(findings)), tuple(tables), bool(links))


def _was_good(fri: FriLink) -> bool:
    return fri.quality >= Quality.GOOD or any(change.quality >= Quality.GOOD for change in fri.log.history)


def _not_reached(controller: Controller) -> bool:
    return any(finding.kind == QUALITY_NOT_REACHED for finding in controller.findings.worst())


def _findings(title: str, controller: Controller, fri: FriLink) -> list[Finding]:
    found = controller.findings.worst()
    if not any(one.is_wrong for one in found):
        found.insert(0, _healthy(title, controller, fri))
    return found


def _healthy(title: str, controller: Controller, fri: FriLink) -> Finding:
    stops = [stop for stop in controller.stops if stop.reason != SHUTS_DOWN.reason]
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
    history = [(f"{one.at_ns / 1e9:.3f} s", one.new.name, one.quality.name, one.reason) for one in fri.log.history]
    return [
        state_table(f"{title}session states", history, ("at", "state", "quality", "reason")),
        split_table(f"{title}where the time of the answers went", fri.path.histograms, own=True),
        slowest_table(f"{title}slowest answers [ms]", fri.path.worst, limit, own=True),
        fault_table(f"{title}answers that did not count", counts, fri.counters.by_outcome),
    ]
