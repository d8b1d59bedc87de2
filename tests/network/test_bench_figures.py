"""Benchmarks whose figures do not mind company: they are whole, and have their bounds; small."""

import json

from tests.support.processes import finish, hil
from tools.bench.arms import ArmsReport, Beside, bench_arms, bounds_of
from tools.bench.memory import SAMPLES, MemoryReport
from tools.bench.start import StartReport


def test_bench_kst_measures_every_loop_of_a_published_client() -> None:
    ended = finish(hil("bench", "kst", "--backend", "ideal", "--seconds", 1, "--json"), timeout_s=90)
    assert ended.code == 0, ended.err
    found = json.loads(ended.out)
    assert [loop["name"] for loop in found["loops"]] == [
        *("joint, acknowledged", "joint, measured torques back", "Cartesian, joint positions back"),
        "joint, as fast as it can",
    ]
    assert all(loop["rate_hz"] > 20.0 and set(loop["round_trip_ms"]) == {"p50", "p99", "p99.9", "max"}
               for loop in found["loops"])  # fmt: skip
    assert [bound["bound"] for bound in found["bounds"]] == [">= 400", "<= 4"]
    assert found["robot"]["kst"]["sessions"] == 1
    assert found["machine"]["cores"]


def test_bench_start_measures_the_way_to_the_first_packet() -> None:
    ended = finish(hil("bench", "start", "--backend", "ideal", "--repeats", 2, "--json"))
    found = json.loads(ended.out)
    assert len(found["first_packet_s"]) == 2
    assert 0.0 < found["interpreter_s"] < min(found["first_packet_s"]) < 20.0
    assert StartReport((1.0, 3.0, 2.0), 0.1).median_s == 2.0


def test_bench_memory_measures_what_stays_resident() -> None:
    ended = finish(hil("bench", "memory", "--backend", "ideal", "--minutes", 0.2, "--json"))
    found = json.loads(ended.out)
    assert len(found["resident_mb"]) == len(found["blocks"]) == SAMPLES + 1
    assert min(found["resident_mb"]) > 20.0


def test_bench_arms_measures_the_worst_arm_of_all_processes() -> None:
    told: list[float] = []
    [report] = bench_arms(
        ((3, 2),), robot="lbr-iiwa-7-r800", backend="ideal", seconds=1.0, beside=Beside(load=True), progress=told.append
    )
    assert (report.arms, report.processes) == (3, 2)
    assert report.rate_hz > 500.0
    assert report.cycle_p50_us > 5.0
    assert 0 <= report.commanding <= 3
    assert told
    four = ArmsReport(4, 1, rate_hz=999.98, lateness_p99_us=150.0, missed_percent=0.2, cycle_p50_us=50.0, commanding=4)
    assert not four.keeps_pace
    assert [bound.kept for bound in bounds_of([report, four])] == [True, False, True]


def test_growth_is_what_lies_between_quarters() -> None:
    steady = MemoryReport(600.0, (100.0,) * 5 + (120.0,) * 16, (1000,) * 21)
    assert (steady.growth_mb_an_hour, steady.blocks_a_minute) == (0.0, 0.0)
    leaking = MemoryReport(600.0, tuple(100.0 + place for place in range(21)), tuple(range(0, 2100, 100)))
    # Twenty megabytes in ten minutes.
    assert leaking.growth_mb_an_hour == 120.0
    assert leaking.blocks_a_minute == 200.0
    assert not leaking.bounds()[0].kept
