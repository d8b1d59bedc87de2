"""The way in: a capture file, and what its TCP connections suffer from."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

from hil.values.finding import EvidenceTable, Finding, Severity, Whose
from tools.doctor.capture.tcp.connection import Connection
from tools.doctor.capture.tcp.connections import Connections
from tools.doctor.capture.tcp.sides import client_of, server_of
from tools.doctor.capture.tcp.verdict import findings_of
from transport.capture.errors import CaptureError
from transport.capture.segments import read_segments

MAX_FINDINGS: Final = 24
MAX_ROWS: Final = 40

Told = tuple[tuple[Finding, ...], tuple[EvidenceTable, ...]]
ProgressTold = Callable[[int, int, str], None]
"""As that of replays: told bytes read, bytes in all, and in words how far it is."""


def diagnose_tcp(file: Path, *, progress: ProgressTold | None = None) -> Told:
    """Return what was found of the TCP connections in ``file``, the worst first; nothing where it has none.

    A file that is no capture raises ``CaptureError``. Of one that is damaged later, what lies before the damage is
    looked at, and the last finding, ``capture-damaged``, says where that is.
    """
    reader = read_segments(file, progress=None if progress is None else _bytes_told(file, progress))
    connections = Connections()
    damage: CaptureError | None = None
    try:
        connections.take(reader)
    except CaptureError as error:
        if not reader.packets or error.packet == 1:
            raise
        damage = error
    found, tables = tell(connections.end(), left_out=connections.left_out)
    notes = []
    if reader.skipped:
        what = f"{reader.skipped} TCP segments of the capture could not be read: fragments, or cut within their headers"
        notes.append(_note("tcp-skipped", what))
    if damage is not None:
        what = f"{damage}; what lies before it was looked at"
        notes.append(Finding("capture-damaged", Severity.WARNING, Whose.NOBODY, what))
    return (*found, *notes), tables


def _bytes_told(file: Path, progress: ProgressTold) -> Callable[[int], None]:
    whole = file.stat().st_size if file.exists() else 0
    return lambda read: progress(read, whole, "TCP")


def tell(connections: list[Connection], *, left_out: int = 0) -> Told:
    """Return findings and the table of ``connections``, those with the worst findings first."""
    told = [(connection, findings_of(connection)) for connection in connections]
    told = [(connection, found) for connection, found in told if found]
    told.sort(key=lambda entry: (-entry[1][0].severity.value, -entry[0].segments))
    findings = [finding for _, found in told for finding in found]
    findings.sort(key=lambda finding: finding.severity is Severity.NOTE)
    notes = []
    if len(findings) > MAX_FINDINGS:
        notes.append(
            _note("tcp-more", f"{len(findings) - MAX_FINDINGS} more findings of TCP connections are not shown")
        )
    if left_out:
        notes.append(
            _note("tcp-left-out", f"{left_out} more TCP connections were too many to keep, the least telling ones")
        )
    if not told:
        return tuple(notes), ()
    return (*findings[:MAX_FINDINGS], *notes), (_table(told),)


def _table(told: list[tuple[Connection, list[Finding]]]) -> EvidenceTable:
    rows = tuple(
        (
            client_of(connection).address,
            server_of(connection).address,
            str(connection.segments),
            str(connection.first_answers),
            str(sum(way.stalls.count for way in (connection.requests, connection.replies) if way.holds)),
            str(connection.requests.resent.count + connection.replies.resent.count),
            found[0].kind,
        )
        for connection, found in told[:MAX_ROWS]
    )
    some = f" ({MAX_ROWS} of {len(told)})" if len(told) > MAX_ROWS else ""
    columns = "client", "server", "segments with data", "round trips", "stalls", "sent again", "verdict"
    return EvidenceTable(f"TCP connections{some}", columns, rows)


def _note(kind: str, sentence: str) -> Finding:
    return Finding(kind=kind, severity=Severity.NOTE, whose=Whose.NOBODY, sentence=sentence)
