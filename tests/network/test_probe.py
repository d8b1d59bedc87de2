"""The independent probe against the real process: every release, and every way it can misbehave."""

from pathlib import Path
from typing import Any

import pytest

from hil.values.fri import Release
from tests.support.processes import own_host, run_with_probe
from transport.capture.reading import read_capture, read_section_comment

pytestmark = pytest.mark.alone

SINE_RAD = 0.04


def robot(status: dict[str, Any]) -> dict[str, Any]:
    arm: dict[str, Any] = status["robots"]["arm"]
    return arm


def states(found: dict[str, Any]) -> list[str]:
    return [entry[1] for entry in found["history"]]


@pytest.mark.parametrize("release", list(Release))
def test_every_release_moves_joint_4_over_udp(tmp_path: Path, release: str) -> None:
    capture = tmp_path / "run.pcapng"
    found, status, _ = run_with_probe(tmp_path, release, run=["--send-period", 2, "--capture", capture])
    assert found["errors"] == {}
    assert states(found)[:4] == ["MONITORING_WAIT", "MONITORING_READY", "COMMANDING_WAIT", "COMMANDING_ACTIVE"]
    assert states(found)[-1] == "IDLE"
    assert 0.9 * SINE_RAD < found["peak_excursion_rad"][3] < 1.02 * SINE_RAD
    assert max(found["peak_excursion_rad"][:3]) < 1e-4
    arm = robot(status)
    assert arm["session"]["state"] == "IDLE"
    assert [change["to"] for change in arm["session"]["history"]][-1] == "IDLE"
    # The answer to the last message but one may still be on its way when the socket closes.
    assert found["answers"] - 2 <= arm["packets"]["received"] <= found["answers"]
    assert arm["packets"]["sent"] >= found["received"]
    assert arm["max_flange_speed_mm_s"] > 5
    packets = list(read_capture(capture))
    assert len(packets) == status["capture"]["written"] == arm["packets"]["sent"] + arm["packets"]["received"]
    assert release in str(read_section_comment(capture))


def test_receive_multiplier(tmp_path: Path) -> None:
    found, status, _ = run_with_probe(tmp_path, "2.7", run=["--send-period", 2, "--receive-multiplier", 3])
    assert found["errors"] == {}
    assert "COMMANDING_ACTIVE" in states(found)
    assert robot(status)["packets"]["accepted"] <= found["received"] / 3 + 1


def test_a_silent_client_loses_the_arm_and_gets_it_back(tmp_path: Path) -> None:
    found, status, _ = run_with_probe(
        tmp_path, "1.15", seconds=6.5, run=["--send-period", 5],
        probing=["--silent-after", 340, "--silent-for", 60, "--amplitude", 0.0],
    )  # fmt: skip
    assert found["errors"] == {}
    assert states(found).count("COMMANDING_ACTIVE") == 2
    stops = robot(status)["stops"]
    assert "client lost" in stops[0]["reason"]


@pytest.mark.parametrize(
    ("probing", "outcome", "words"),
    [
        (["--jump-after", 100], "axis_velocity", "rad/s; its limit is"),
        (["--nan-after", 100], "not_finite", "A1 is nan"),
    ],
)
def test_commands_out_of_bounds_end_commanding(tmp_path: Path, probing: list[object], outcome: str, words: str) -> None:
    found, status, _ = run_with_probe(
        tmp_path, "2.5", seconds=3.0, run=["--send-period", 2, "--backend", "ideal"], probing=probing
    )
    arm = robot(status)
    assert states(found)[4] == "MONITORING_READY"
    assert arm["packets"]["dropped"][outcome] >= 1
    assert any(words in stop["reason"] for stop in arm["stops"])
    assert max(found["peak_excursion_rad"]) < 0.01
    assert set(found["errors"]) <= {"tracking performance"}


def test_corrupt_and_late_answers_are_counted_and_told(tmp_path: Path) -> None:
    found, status, lines = run_with_probe(
        tmp_path, "2.7", seconds=3.0, run=["--send-period", 5, "--overlay", "none"],
        probing=["--corrupt-every", 10, "--late-every", 7, "--late-ms", 8],
    )  # fmt: skip
    dropped = robot(status)["packets"]["dropped"]
    assert dropped["undecodable"] >= 40
    assert dropped["late"] >= 40
    assert "ms over the budget of 5 ms" in lines
    assert "COMMANDING_WAIT" not in states(found)


def test_a_client_that_wants_the_controllers_port_is_served_from_another_address(tmp_path: Path) -> None:
    controller_host = own_host()
    found, status, _ = run_with_probe(
        tmp_path, "1.11", seconds=3.0, run=["--send-period", 4, "--fri-bind", f"{controller_host}:30200"],
        probing=["--host", controller_host],
    )  # fmt: skip
    assert found["errors"] == {}
    assert "COMMANDING_ACTIVE" in states(found)
    assert robot(status)["fri"]["bound"] == f"{controller_host}:30200"
