"""What the benchmarks make of what they measured: on figures by hand."""

import pytest

from hil.values.errors import EndpointError
from hil.values.link import Address
from tools.bench import cycle_table
from tools.bench.answer import AnswerReport, evaluated
from tools.bench.campaign import CampaignReport, Throughput
from tools.bench.cycle import CycleReport, Distribution
from tools.bench.cycle_table import BOTH_LINKS, CASES, TableRow, bench_table, bounds_of
from transport.capture.journal import EndEntry, TickEntry, encode_entry
from transport.capture.records import CaptureRecord, Notes, Packet

HERE, THERE = Address("127.0.0.1", 30200), Address("127.0.0.1", 30201)
EPOCH_NS = 1_000_000_000_000
MS = 1_000_000
US = 1000


def packet(at_ns: int, source: Address, destination: Address) -> Packet:
    return Packet(0, 0, EPOCH_NS + at_ns, None, source, destination, b"", b"", 0)


def tick(due_ns: int, lateness_ns: int, departed_ns: int) -> Notes:
    return Notes(0, encode_entry(TickEntry(0, due_ns, lateness_ns, departed_ns, 0)))


def test_an_answer_waits_for_its_cycle_and_what_is_left_is_the_controller_s_own() -> None:
    records: list[CaptureRecord] = [
        packet(200 * US, THERE, HERE),
        tick(MS, 50 * US, MS + 150 * US),
        packet(MS + 150 * US, HERE, THERE),
        # Nothing came: what goes out answers nothing.
        tick(2 * MS, 0, 2 * MS + 90 * US),
        packet(2 * MS + 90 * US, HERE, THERE),
        # It came after the cycle was due, which began late.
        packet(3 * MS + 10 * US, THERE, HERE),
        tick(3 * MS, 30 * US, 3 * MS + 100 * US),
        packet(3 * MS + 100 * US, HERE, THERE),
        packet(3 * MS + 400 * US, THERE, HERE),
        Notes(0, encode_entry(EndEntry())),
    ]
    found = evaluated(records, "fri", HERE, EPOCH_NS)
    assert found.packets == 2
    assert (found.to_interpolator.max_us, found.waiting.max_us) == (850.0, 800.0)
    assert found.to_interpolator.p50_us == pytest.approx((850.0 + 20.0) / 2)
    assert found.to_packet_out.max_us == 950.0
    assert found.own.p50_us == pytest.approx((150.0 + 100.0) / 2)
    report = AnswerReport("robot", "ideal", (found,))
    assert [bound.kept for bound in report.bounds()] == [True]
    assert report.as_dict()["links"][0]["own_us"]["max"] == 150.0


def test_a_recording_in_which_nobody_is_answered_is_no_measurement() -> None:
    with pytest.raises(EndpointError, match="nothing was answered on the link servo"):
        evaluated([packet(0, THERE, HERE)], "servo", HERE, EPOCH_NS)


def report(p50_us: float, p99_us: float, backend: str = "mujoco") -> CycleReport:
    return CycleReport(
        "robot", backend, "fri-overlay", "1.15", "position", 1000, Distribution(p50_us, p99_us, 200.0), {}, 20.0
    )


def test_the_bound_of_the_table_is_that_of_both_links_on_mujoco() -> None:
    rows = [TableRow("FRI 1.15", report(1.0, 1.0)), TableRow(BOTH_LINKS, report(2.0, 2.0, "ideal"))]
    rows.append(TableRow(BOTH_LINKS, report(44.0, 95.0)))
    assert [(bound.figure, bound.kept) for bound in bounds_of(rows)] == [(44.0, True), (95.0, False)]


def test_cases_of_the_table_move_their_arms(monkeypatch: pytest.MonkeyPatch) -> None:
    # The cheapest and the one with impedance; `hil bench cycle --all` runs them all.
    some = [case for case in CASES if case.name == BOTH_LINKS or "joint impedance" in case.name]
    assert len(some) == 2
    monkeypatch.setattr(cycle_table, "CASES", some)
    done: list[int] = []
    rows = list(bench_table("lbr-iiwa-14-r820", cycles=100, progress=done.append))
    assert len(done) == 4
    # The ideal arm has no torques to measure: no impedance.
    assert [(row.case, row.report.backend) for row in rows] == [
        (BOTH_LINKS, "mujoco"), (BOTH_LINKS, "ideal"), (some[1].name, "mujoco"),
    ]  # fmt: skip
    assert all(len(row.report.bounds()) == 2 for row in rows), "without stages nothing is known of the monitors"
    assert all(0.0 < row.report.cycle.p50_us <= row.report.cycle.p99_us for row in rows)


def test_two_workers_are_compared_with_one() -> None:
    runs = (Throughput(1, 100, 60.0, 600.0), Throughput(2, 100, 33.0, 600.0))
    found = CampaignReport("ideal", runs)
    assert runs[0].per_minute == 100.0
    assert runs[0].factor == 10.0
    assert [(bound.figure, bound.kept) for bound in found.bounds()] == [(1.82, True)]
    assert not CampaignReport("ideal", runs[:1]).bounds()
