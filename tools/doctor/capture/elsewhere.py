"""A capture from elsewhere, or one of ours that does not replay exactly: judged from its packets."""

import heapq
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from hil.replay.replay import ProgressTold, Wish, flows_of
from hil.values.finding import EvidenceTable, Finding, Severity
from hil.values.fri import Release, SessionState
from hil.values.link import Address
from hil.values.outcomes import Outcome
from tools.doctor.capture.flow import FlowDiagnosis
from tools.doctor.capture.healthy import healthy
from tools.doctor.capture.tables import fault_table, slowest_table, split_table, state_table
from transport.capture.errors import CaptureError
from transport.capture.parts import parts_from
from transport.capture.reading import read_records
from transport.capture.records import Packet

_PROGRESS_EVERY = 2000
_NEIGHBOURS = 128
"""Packets that are put in order of time."""
_PEERS = (Outcome.DUPLICATE, Outcome.REORDERED, Outcome.REPLAYED, Outcome.UNSENT_SEQUENCE)
_PARTS = {
    "send_lateness": "send: behind the grid of its messages",
    "peer_and_wire": "peer and wire: message to answer, at the capture's place",
}


class ElsewhereDiagnosis(NamedTuple):
    """What the packets tell."""

    findings: tuple[Finding, ...]
    tables: tuple[EvidenceTable, ...]
    flows: int
    datagrams: int
    damage: str


class _Reading:
    """The datagrams of a file and of the parts of its ring behind it, up to the first damage, which it keeps."""

    def __init__(self, file: Path, progress: ProgressTold | None) -> None:
        self._parts = parts_from(file)
        self._progress = progress
        self.damage = ""
        self.datagrams = 0

    def packets(self) -> Iterator[Packet]:
        whole = sum(part.stat().st_size for part in self._parts)
        before = 0
        for part in self._parts:
            try:
                for record in read_records(part):
                    if isinstance(record, Packet):
                        self.datagrams += 1
                        if self._progress is not None and self.datagrams % _PROGRESS_EVERY == 0:
                            self._progress(before + record.offset, whole, f"{self.datagrams} datagrams")
                        yield record
            except CaptureError as error:
                self.damage = str(error)
                return
            before += part.stat().st_size


def in_order(packets: Iterator[Packet]) -> Iterator[Packet]:
    """Yield the packets by their time: recorders of several interfaces mix up neighbours in the file."""
    waiting: list[tuple[int, int, Packet]] = []
    for count, packet in enumerate(packets):
        heapq.heappush(waiting, (packet.at_unix_ns, count, packet))
        if len(waiting) > _NEIGHBOURS:
            yield heapq.heappop(waiting)[2]
    while waiting:
        yield heapq.heappop(waiting)[2]


def diagnose_elsewhere(
    file: Path, *, release: Release | None, period_ms: int | None, progress: ProgressTold | None, limit: int
) -> ElsewhereDiagnosis:
    """Judge every controller and client in ``file``; raise ``CaptureError`` where nothing can be read."""
    flows = {route: FlowDiagnosis(flow, period_ms=period_ms) for route, flow in flows_of(file, Wish(release)).items()}
    reading = _Reading(file, progress)
    with closing(in_order(reading.packets())) as packets:  # type: ignore[type-var]  # a generator, which is closed
        for packet in packets:
            source, destination = Address(*packet.source), Address(*packet.destination)
            if (sender := flows.get((source, destination))) is not None:
                sender.sent(packet)
            elif (receiver := flows.get((destination, source))) is not None:
                receiver.answered(packet)
    findings: list[Finding] = []
    tables: list[EvidenceTable] = []
    for flow in flows.values():
        flow.finish()
        title = f"{flow.flow.controller}: " if len(flows) > 1 else ""
        findings.extend(_findings(title, flow))
        tables.extend(_tables(title, flow, limit))
    findings.sort(key=lambda finding: -finding.severity.value)
    return ElsewhereDiagnosis(tuple(findings), tuple(tables), len(flows), reading.datagrams, reading.damage)


def _findings(title: str, flow: FlowDiagnosis) -> list[Finding]:
    found = flow.findings.worst()
    if all(one.severity.value <= Severity.NOTE.value for one in found):
        told = [change.quality for change in flow.changes if change.state != SessionState.IDLE.name]
        quality = told[-1] if told else "not told"
        found.insert(
            0,
            healthy(
                title,
                latency=flow.path.peer_and_wire,
                budget_ns=flow.period_ms * flow.multiplier * 1_000_000,
                by_fault=flow.by_fault,
                quality=quality,
            ),
        )
    return found


def _tables(title: str, flow: FlowDiagnosis, limit: int) -> list[EvidenceTable]:
    changes = [(f"{one.at_ns / 1e9:.3f} s", str(one.message), one.state, one.quality) for one in flow.changes]
    beside = {one.value: flow.outcomes[one] for one in _PEERS}
    counts: dict[str, dict[str, int]] = {
        what: flow.by_fault[what] for what in ("late", "missing") if what in flow.by_fault
    }
    about = [
        ("release of the controller's messages", str(flow.flow.release)),
        ("send period x receive multiplier", f"{flow.period_ms} ms x {flow.multiplier}"),
        ("messages, answers", f"{flow.messages}, {flow.answers}"),
        ("messages that the capture misses", str(max(flow.lost - flow.overtaken, 0))),
        ("messages that a later one overtook", str(flow.overtaken)),
        ("sessions", str(flow.sessions)),
        ("place", flow.place.place.value),
    ]
    if flow.shifts:
        about.append(("send grid put anew", f"{flow.shifts} times: the controller stood still, or lost its clock"))
    if flow.undecodable:
        about.append(("datagrams that are no message", f"{flow.undecodable}, the first: {flow.undecodable_detail}"))
    about += [("note", note) for note in flow.flow.notes]
    return [
        EvidenceTable(f"{title}{flow.flow.controller} to {flow.flow.client}", ("what", ""), tuple(about)),
        state_table(f"{title}session states", changes, ("at", "message", "state", "quality")),
        split_table(f"{title}where the time of the answers went", flow.path.histograms, _PARTS),
        slowest_table(f"{title}slowest answers [ms]", flow.path.worst, limit, own=False),
        fault_table(f"{title}answers that did not count", counts, beside),
    ]
