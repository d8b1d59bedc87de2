"""``hil doctor capture``: what kind of capture it is, and who judges it."""

from pathlib import Path
from typing import Final, NamedTuple

from hil.replay.replay import ProgressTold, own_header
from hil.values.finding import Diagnosis, EvidenceTable, Finding, Severity, Whose, worst_first
from hil.values.fri import Release
from tools.doctor.capture.elsewhere import diagnose_elsewhere
from tools.doctor.capture.own import diagnose_own
from tools.doctor.capture.tcp.diagnose import diagnose_tcp
from transport.capture.errors import CaptureError

DEFAULT_LIMIT: Final = 10
DAMAGED: Final = "capture-damaged"


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
    fri = _fri(file, options, progress)
    tcp_findings, tcp_tables = diagnose_tcp(file, progress=progress)
    # FRI's reading tells of the damage already.
    tcp = tuple(one for one in tcp_findings if one.kind != DAMAGED)
    if not fri.findings and not tcp_tables:
        what = "no UDP datagram"
        if fri.datagrams:
            what = f"{fri.datagrams} UDP datagrams, none of them a monitoring message of FRI"
        before = f", before the damage ({fri.damage})" if fri.damage else ""
        raise CaptureError(file, f"holds no FRI and no TCP connection to diagnose: {what}{before}")
    return _result((*fri.findings, *tcp), (*fri.tables, *tcp_tables), fri.damage)


class _Fri(NamedTuple):
    """What was found of FRI; no findings where there is none."""

    findings: tuple[Finding, ...]
    tables: tuple[EvidenceTable, ...]
    datagrams: int
    damage: str


def _fri(file: Path, options: CaptureOptions, progress: ProgressTold | None) -> _Fri:
    note: tuple[Finding, ...] = ()
    header = own_header(file) if options.release is None and options.period_ms is None else None
    if header is not None:
        try:
            own = diagnose_own(file, header, progress=progress, limit=options.limit)
        except CaptureError as error:
            note = (_not_exact(str(error)),)
        else:
            if own.result.alike and own.result.compared and own.has_fri:
                return _Fri(own.findings, own.tables, own.result.compared + own.result.inputs, own.result.damage)
            if own.has_fri:
                note = (_not_exact(own.result.verdict),)
    found = diagnose_elsewhere(
        file, release=options.release, period_ms=options.period_ms, progress=progress, limit=options.limit
    )
    return _Fri((*found.findings, *note) if found.flows else (), found.tables, found.datagrams, found.damage)


def _not_exact(why: str) -> Finding:
    return Finding(
        "not-replayed",
        Severity.NOTE,
        Whose.NOBODY,
        f"the recording does not replay exactly, so it was judged from its packets alone: {why}",
    )


def _result(findings: tuple[Finding, ...], tables: tuple[EvidenceTable, ...], damage: str) -> CaptureDiagnosis:
    ordered = worst_first(findings)
    if damage:
        ordered.append(
            Finding(
                DAMAGED,
                Severity.WARNING,
                Whose.NOBODY,
                f"{damage}; what is before that was diagnosed",
            )
        )
    return CaptureDiagnosis(Diagnosis(_healthy_first(ordered), tables), damage)


def _healthy_first(findings: list[Finding]) -> tuple[Finding, ...]:
    """The good news leads where there is nothing worse than a note, though a note is worse than good."""
    worse = [one for one in findings if one.is_wrong and one.kind != DAMAGED]
    if worse:
        return tuple(one for one in findings if one.severity is not Severity.GOOD)
    return tuple(sorted(findings, key=lambda finding: finding.severity is not Severity.GOOD))
