"""``hil doctor capture``: what kind of capture it is, and who judges it."""

from pathlib import Path
from typing import Final, NamedTuple

from hil.replay.replay import ProgressTold, own_header
from hil.values.finding import Diagnosis, EvidenceTable, Finding, Severity, Whose
from hil.values.fri import Release
from tools.doctor.capture.elsewhere import diagnose_elsewhere
from tools.doctor.capture.own import diagnose_own
from transport.capture.errors import CaptureError

DEFAULT_LIMIT: Final = 10


class CaptureOptions(NamedTuple):
    """How to look at it; None: as the capture tells."""

    release: Release | None = None
    period_ms: int | None = None
    limit: int = DEFAULT_LIMIT
    """Slowest answers to be shown."""


class CaptureDiagnosis(NamedTuple):
    """What was found, and where the file could not be read any further."""

    diagnosis: Diagnosis
    damage: str


def diagnose_capture(file: Path, options: CaptureOptions, *, progress: ProgressTold | None = None) -> CaptureDiagnosis:
    """Judge what is in ``file``; raise ``CaptureError`` where nothing can be read or nothing in it is understood."""
    note: Finding | None = None
    header = own_header(file) if options.release is None and options.period_ms is None else None
    if header is not None:
        try:
            own = diagnose_own(file, header, progress=progress, limit=options.limit)
        except CaptureError as error:
            note = _not_exact(str(error))
        else:
            if own.result.alike and own.result.compared and own.has_fri:
                return _result(own.findings, own.tables, own.result.damage)
            note = _not_exact(own.result.verdict) if own.has_fri else None
    found = diagnose_elsewhere(
        file, release=options.release, period_ms=options.period_ms, progress=progress, limit=options.limit
    )
    if not found.flows:
        what = "no UDP datagram"
        if found.datagrams:
            what = f"{found.datagrams} UDP datagrams, none of them a monitoring message of FRI"
        before = f", before the damage ({found.damage})" if found.damage else ""
        raise CaptureError(file, f"holds no FRI to diagnose: {what}{before}")
    return _result(found.findings if note is None else (*found.findings, note), found.tables, found.damage)


def _not_exact(why: str) -> Finding:
    return Finding(
        "not-replayed",
        Severity.NOTE,
        Whose.NOBODY,
        f"the recording does not replay exactly, so it was judged from its packets alone: {why}",
    )


def _result(findings: tuple[Finding, ...], tables: tuple[EvidenceTable, ...], damage: str) -> CaptureDiagnosis:
    ordered = sorted(findings, key=lambda finding: -finding.severity.value)
    if damage:
        ordered.append(
            Finding(
                "capture-damaged",
                Severity.WARNING,
                Whose.NOBODY,
                f"{damage}; what is before that was diagnosed",
            )
        )
    return CaptureDiagnosis(Diagnosis(_healthy_first(ordered), tables), damage)


def _healthy_first(findings: list[Finding]) -> tuple[Finding, ...]:
    """The good news leads where there is nothing worse than a note, though a note is worse than good."""
    worse = [one for one in findings if one.severity.value > Severity.NOTE.value and one.kind != "capture-damaged"]
    if worse:
        return tuple(one for one in findings if one.severity is not Severity.GOOD)
    return tuple(sorted(findings, key=lambda finding: finding.severity is not Severity.GOOD))
