"""``hil demo`` and ``hil bench`` as processes, small."""

import json
from pathlib import Path

import pytest

from tests.support.processes import finish, hil

pytestmark = pytest.mark.alone


def test_demo_leaves_picture_status_capture_and_table(tmp_path: Path) -> None:
    ended = finish(hil("demo", "--out", tmp_path / "out", "--seconds", 6), timeout_s=90)
    assert ended.code == 0, ended.err
    assert "COMMANDING_ACTIVE" in ended.out
    assert (tmp_path / "out" / "run.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "out" / "run.pcapng").stat().st_size > 100_000
    status = json.loads((tmp_path / "out" / "status.json").read_text())
    client = json.loads((tmp_path / "out" / "client.json").read_text())
    arm = status["robots"]["arm"]
    assert client["answers"] - 2 <= arm["packets"]["received"] <= client["answers"]
    # How soon a machine gets there, and stays there, is its own affair: CI's was busy once.
    assert client["states"]["COMMANDING_ACTIVE"] > 100
    for figure in ("rate_hz", "ticks", "missed_cycles", "max_flange_speed_mm_s", "initial_position", "stops"):
        assert figure in arm
    for figure in ("lateness_us", "cycle_us", "answer_latency_us"):
        assert set(arm[figure]) == {"p50", "p99", "p99_9", "max"}


def test_demo_says_what_went_wrong(tmp_path: Path) -> None:
    ended = finish(hil("demo", "--out", tmp_path / "out", "--seconds", 3, "--robot", "lbr-iiwa-99"))
    assert ended.code == 2
    assert "unknown robot 'lbr-iiwa-99'" in ended.err
    (tmp_path / "file").write_text("")
    assert finish(hil("demo", "--out", tmp_path / "file")).code == 2


def test_bench_cycle_splits_the_cycle_into_its_stages() -> None:
    ended = finish(hil("bench", "cycle", "--cycles", 300, "--json"))
    assert ended.code == 0, ended.err
    found = json.loads(ended.out)
    assert set(found["stages_us"]) >= {"decode", "admission", "interpolate", "backend", "encode"}
    assert found["machine"]["python"]
    assert {bound["name"] for bound in found["bounds"]} == {
        "one cycle, median",
        "all monitors together, median",
        "virtual time",
    }


def test_bench_kinematics_measures_one_answer() -> None:
    ended = finish(hil("bench", "kinematics", "--poses", 300, "--json"))
    assert ended.code == 0, ended.err
    report = json.loads(ended.out)
    assert 0.0 < report["inverse_us"]["p50"] < report["far_us"]["p99"]


@pytest.mark.parametrize("control", ["joint-impedance", "cartesian-impedance"])
def test_bench_cycle_measures_the_impedance_modes_under_the_overlay_that_needs_them(control: str) -> None:
    ended = finish(hil("bench", "cycle", "--control", control, "--cycles", 300, "--json"))
    assert ended.code == 0, ended.err
    found = json.loads(ended.out)
    assert found["control"] == control
    assert found["stages_us"]["backend"]["p50"] > 0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--motion", "smart-servo"), "--control joint-impedance is measured under the FRI overlay, not under smart"),
        (("--backend", "ideal"), "needs a robot side that takes torques"),
    ],
)
def test_bench_cycle_refuses_what_cannot_be_controlled_so(arguments: tuple[str, ...], sentence: str) -> None:
    ended = finish(hil("bench", "cycle", "--control", "joint-impedance", "--cycles", 300, *arguments))
    assert ended.code == 2
    assert sentence in ended.err


def test_bench_rate_reports_a_run_against_a_client_process() -> None:
    ended = finish(hil("bench", "rate", "--seconds", 2, "--backend", "ideal", "--json"), timeout_s=60)
    assert ended.code == 0, ended.err
    found = json.loads(ended.out)
    assert found["robot"]["packets"]["received"] > 500
    assert len(found["bounds"]) == 4
    assert found["client"]["answers"] > 500
