"""A capture from elsewhere, or one of ours that does not replay exactly: judged from its packets."""

import heapq
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from hil.replay.replay import ProgressTold, Wish, flows_of, records_of
from hil.replay.result import ReplayResult
from hil.values.finding import EvidenceTable, Finding, worst_first
from hil.values.fri import Release, SessionState
from hil.values.link import Address
from tools.doctor.capture.flow import FlowDiagnosis
from tools.doctor.capture.healthy import healthy
from tools.doctor.capture.tables import fault_table, slowest_table, split_table, state_table
from transport.capture.parts import parts_from
from transport.capture.records import CaptureRecord, Packet

_NEIGHBOURS = 128
"""Packets that are put in order of time."""


class ElsewhereDiagnosis(NamedTuple):
    """What the packets tell."""

    findings: tuple[Finding, ...]
    tables: tuple[EvidenceTable, ...]
    flows: int
    datagrams: int
    damage: str


def in_order(records: Iterable[CaptureRecord]) -> Iterator[Packet]:
    """Yield the packets by their time: recorders of several interfaces mix up neighbours in the file."""
    waiting: list[tuple[int, int, Packet]] = []
    packets = (record for record in records if isinstance(record, Packet))
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
    reading = ReplayResult(str(file), own=False)
    datagrams = 0
    for packet in in_order(records_of(parts_from(file), reading, progress)):
        datagrams += 1
        source, destination = Address(*packet.source), Address(*packet.destination)
        if (sender := flows.get((source, destination))) is not None:
            sender.sent(packet)
            reading.reached_s = sender.last_ns / 1e9
        elif (receiver := flows.get((destination, source))) is not None:
            receiver.answered(packet)
    findings: list[Finding] = []
    tables: list[EvidenceTable] = []
    for flow in flows.values():
        flow.finish()
        title = f"{flow.flow.controller}: " if len(flows) > 1 else ""
        findings.extend(_findings(title, flow))
        tables.extend(_tables(title, flow, limit))
    return ElsewhereDiagnosis(tuple(worst_first(findings)), tuple(tables), len(flows), datagrams, reading.damage)


def _findings(title: str, flow: FlowDiagnosis) -> list[Finding]:
    found = flow.findings.worst()
    if not any(one.is_wrong for one in found):
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
        split_table(f"{title}where the time of the answers went", flow.path.histograms, own=False),
        slowest_table(f"{title}slowest answers [ms]", flow.path.worst, limit, own=False),
        fault_table(f"{title}answers that did not count", counts, flow.outcomes),
    ]
