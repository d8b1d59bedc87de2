"""What the benchmarks of the view make of what they saw."""

import os
from pathlib import Path
from typing import Any

import pytest

from tools.bench.page import Picture, Watched, is_software
from tools.bench.processor import children, processor_s
from tools.bench.rate_view import RateViewReport, Watching


def robot(p99_us: float, *, missed: int = 0, rate_hz: float = 1000.0) -> dict[str, Any]:
    lateness = {"p50": 60.0, "p99": p99_us, "p99_9": 400.0, "max": 900.0}
    return {"lateness_us": lateness, "missed_cycles": missed, "rate_hz": rate_hz, "measured_s": 20.0}


def report(without: list[dict[str, Any]], view: list[dict[str, Any]], *late_s: float) -> RateViewReport:
    return RateViewReport(20.0, {Watching.NOBODY: without, Watching.VIEW: view}, list(late_s))


def test_what_differs_less_than_the_runs_without_is_noise() -> None:
    [sentence] = report([robot(100), robot(140), robot(120)], [robot(130), robot(159), robot(300)]).sentences()
    assert sentence.startswith("view: no figure is worse than without")


def test_what_is_worse_by_more_than_the_noise_is_said_with_both_figures() -> None:
    found = report([robot(100), robot(140), robot(120)], [robot(161), robot(161, missed=40), robot(161)])
    [sentence] = found.sentences()
    assert "NOT within the noise" in sentence
    assert "lateness p99 by 41 us (noise 40)" in sentence
    assert "missed" not in sentence
    missed = next(one for one in found.as_dict()["compared"] if one["figure"] == "missed cycles")
    assert missed["spread"] == pytest.approx(0.2)
    assert missed["within_noise"]


def test_a_rate_is_worse_on_either_side() -> None:
    for rate_hz in (999.9, 1000.1):
        view = [robot(100, rate_hz=rate_hz)] * 2
        [sentence] = report([robot(100), robot(100)], view).sentences()
        assert "rate by 0.1 Hz" in sentence
    [sentence] = report([robot(100)] * 2, [robot(100, rate_hz=1000.01)] * 2).sentences()
    assert "no figure is worse" in sentence


def test_one_run_of_a_kind_is_no_verdict() -> None:
    [sentence] = report([robot(100)], [robot(5000)]).sentences()
    assert "no noise to judge by" in sentence


def test_a_browser_that_came_late_is_told() -> None:
    *_, sentence = report([robot(100)] * 2, [robot(100)] * 2, 17.2).sentences()
    assert sentence == "1 runs with the browser have its start in them: it took 17 s"


def test_pictures_are_counted_by_whole_seconds_from_the_first_one() -> None:
    pictures = [Picture(500.0 + 50.0 * number, number % 2 == 0, 30, 10_000) for number in range(44)]
    watched = Watched(2.4, tuple(pictures), {})
    assert watched.per_second() == [20, 20]
    assert watched.per_second(moved=True) == [10, 10]
    assert watched.longest_gap_ms() == pytest.approx(100.0)


def test_a_page_that_stood_still_has_seconds_without_pictures() -> None:
    watched = Watched(3.1, (Picture(0.0, True, 1, 1), Picture(2500.0, True, 1, 1)), {})
    assert watched.per_second() == [1, 0, 1]
    assert Watched(2.0, (), {}).per_second() == [0, 0]


@pytest.mark.parametrize(
    ("renderer", "software"),
    [
        ("ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (Subzero) (0x0000C0DE)), SwiftShader driver)", True),
        ("ANGLE (Mesa, llvmpipe (LLVM 15.0.6 256 bits), OpenGL 4.5)", True),
        ("ANGLE (Intel, Mesa Intel(R) UHD Graphics 620 (KBL GT2), OpenGL 4.6)", False),
    ],
)
def test_software_is_told_from_a_gpu(renderer: str, software: bool) -> None:
    assert is_software(renderer) is software


def test_processor_time_is_that_of_the_process_and_its_children() -> None:
    before_s = processor_s(os.getpid())[""]
    while processor_s(os.getpid())[""] < before_s + 0.02:
        sum(range(10_000))
    interpreter = Path("/proc/self/cmdline").read_bytes().replace(b" ", b"\0").split(b"\0")[0].decode()
    assert os.getpid() in children(os.getppid(), saying=interpreter)
    # No process has this number: Linux has 2**22 at most.
    assert processor_s(2**22 + 1) == {}
