"""The overlay samples and ``hil run`` as processes over UDP, at 5 ms: what is laid over the hold moves the arm."""

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.support.processes import ROOT, finish, hil, own_host

pytestmark = pytest.mark.alone

SECONDS = 5.0
RUNS = {
    "torque": ("--overlay", "torque"),
    "wrench": ("--overlay", "wrench", "--control", "cartesian-impedance"),
    "cartesian": ("--overlay", "cartesian-pose"),
}


def run(
    folder: Path, app: str, release: str, *arguments: object, overlay: tuple[str, ...] | None = None
) -> tuple[dict[str, Any], dict[str, Any], str, str]:
    """Run both; return the sample's result, the status file, the controller's lines and the sample's."""
    host, status, result = own_host(), folder / "status.json", folder / "result.json"
    with subprocess.Popen(
        [
            sys.executable, "-W", "error", "-m", f"apps.fri_{app}_sine", "--bind", host, "--fri-version", release,
            "--seconds", str(SECONDS + 5), "--json", str(result), *map(str, arguments),
        ],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as client:  # fmt: skip
        try:
            controller = hil(
                "run", "--fri-client", f"{host}:30200", "--fri-version", release, "--send-period", 5,
                "--duration", SECONDS, "--status-json", status, *(overlay or RUNS[app]),
            )  # fmt: skip
            ended = finish(controller)
            out, err = client.communicate(timeout=30)
        finally:
            client.kill()
    assert (ended.code, client.returncode, err) == (0, 0, ""), (ended.err, err)
    return json.loads(result.read_text()), json.loads(status.read_text())["robots"]["arm"], ended.err, out


def commanded_without_a_stop(found: dict[str, Any], status: dict[str, Any]) -> None:
    """The session came to commanding and stayed there until the controller ended it."""
    states = [change["to"] for change in status["session"]["history"]]
    assert "COMMANDING_ACTIVE" in states, status["session"]
    assert [stop["reason"] for stop in status["stops"]] == ["the controller shuts down"]
    assert found["states"]["COMMANDING_ACTIVE"] > 200
    assert sum(found["malformed"].values()) == 0


def test_a_torque_sine_deflects_its_axis(tmp_path: Path) -> None:
    """15 Nm against 1000 Nm/rad."""
    picture = tmp_path / "torque.png"
    found, status, lines, out = run(tmp_path, "torque", "1.15", "--frequency", 1, "--plot", picture)
    commanded_without_a_stop(found, status)
    assert "arm: a torque overlay needs joint-impedance; taken, of default stiffness and damping" in lines
    assert found["peak_excursion_rad"][3] == pytest.approx(0.015, rel=0.3)
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert f"wrote {picture}" in out


def test_a_wrench_sine_deflects_the_flange(tmp_path: Path) -> None:
    """20 N along the flange's x against 2000 N/m, slowly; that x lies in the plane of the arm, base x and z."""
    found, status, lines, _ = run(tmp_path, "wrench", "2.7", "--amplitude-x", 20, "--amplitude-y", 0)
    commanded_without_a_stop(found, status)
    assert "taken, of default" not in lines
    assert math.hypot(*found["peak_excursion_mm"]) == pytest.approx(10.0, rel=0.2)
    assert found["peak_excursion_mm"][1] < 0.5


@pytest.mark.parametrize("release", ["2.5", "2.7"])
def test_a_cartesian_sine_moves_the_flange_and_the_elbow(tmp_path: Path, release: str) -> None:
    picture = tmp_path / "cartesian.png"
    found, status, _, out = run(
        tmp_path, "cartesian", release, "--frequency", 1, "--e1-amplitude", 0.05, "--plot", picture
    )
    assert picture.read_bytes().startswith(b"\x89PNG")
    commanded_without_a_stop(found, status)
    along_x, along_y, along_z = found["peak_excursion_mm"]
    assert 8.0 < along_y < 30.0
    assert max(along_x, along_z) < 0.5
    assert 0.02 < found["peak_excursion_rad"][2] < 0.08
    assert "flange y" in out


def test_a_sample_under_another_overlay_only_mirrors_and_says_so(tmp_path: Path) -> None:
    found, status, _, out = run(tmp_path, "torque", "1.15", overlay=("--overlay", "joint-position"))
    commanded_without_a_stop(found, status)
    assert "the running overlay takes JOINT_POSITION, not TORQUE: only mirroring" in out
    assert max(found["peak_excursion_rad"]) < 1e-3


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ("--overlay", "torque", "--control", "position"),
            "a torque overlay needs joint impedance control, not position control",
        ),
        (
            ("--overlay", "torque", "--control", "cartesian-impedance"),
            "a torque overlay needs joint impedance control, not Cartesian impedance control",
        ),
        (
            ("--overlay", "wrench", "--control", "joint-impedance"),
            "a wrench overlay needs Cartesian impedance control, not joint impedance control",
        ),
        (("--overlay", "cartesian-pose"), "a cartesian-pose overlay needs a client of release 2.x, not 1.15"),
        (
            ("--overlay", "torque", "--backend", "ideal"),
            "a torque overlay under joint impedance control needs a robot side that takes torques",
        ),
    ],
)
def test_what_does_not_fit_is_refused_on_the_command_line(arguments: tuple[str, ...], sentence: str) -> None:
    ended = finish(hil("run", "--fri-client", f"{own_host()}:30200", "--duration", 1, *arguments))
    assert ended.code == 2
    assert sentence in ended.err
    assert "Traceback" not in ended.err


def test_a_cartesian_sine_of_a_release_without_poses_is_refused() -> None:
    command = [sys.executable, "-m", "apps.fri_cartesian_sine", "--fri-version", "1.16", "--port", "0"]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=30)
    assert ended.returncode == 2
    assert ended.stderr == "fri_cartesian_sine: release 1.16 has no poses; 2.5 and 2.7 have\n"
