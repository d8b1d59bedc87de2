"""One application file, unchanged, on every robot side: simulated, ideal, behind FRI, on a CAN bus."""

import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from backends.robots import load_description
from tests.support.processes import ROOT, finish, hil, own_host, wait_for_line

pytestmark = pytest.mark.alone
CYCLE_MS = 4
SILENCE_MS = 500
"""Of the Cabinet; how soon a lost one is noticed is tested elsewhere, and must not depend here on a busy machine."""
AMPLITUDE_RAD = 0.2
MOTION = ("--fast", "--seconds", 1, "--frequency", 1, "--amplitude", AMPLITUDE_RAD)
START_RAD = load_description("lbr-iiwa-14-r820").initial_position_rad


@contextmanager
def controller(backend: str, status: Path) -> Iterator[str]:
    """Run a controller on ``backend``, with what it needs behind it; return where applications connect to."""
    host, behind = own_host(), None
    options: tuple[object, ...] = ("--cycle", CYCLE_MS, "--progress", 0)
    if backend == "cabinet":
        behind = hil("run", *options, "--send-period", CYCLE_MS, "--fri-client", f"{host}:30200")
        options = (*options, "-o", f"bind={host}:30200", "-o", f"silence_ms={SILENCE_MS}")
    elif backend == "can402":
        options = (*options, "-o", "simulated=true")
    process = hil(
        "run", "--backend", backend, *options, "--fri-client", "off", "--servo", f"{host}:0", "--status-json", status
    )
    try:
        served = re.search(r"applications at (\S+),", wait_for_line(process, "applications at ")[-1])
        assert served is not None
        yield served[1]
    finally:
        for running in (process, behind):
            if running is not None:
                running.send_signal(signal.SIGINT)
                ended = finish(running)
                assert ended.code == 0, ended.err


@pytest.mark.parametrize("backend", ["ideal", "mujoco", "cabinet", "can402"])
def test_the_same_application_moves_every_robot_side(backend: str, tmp_path: Path) -> None:
    status, figures = tmp_path / "status.json", tmp_path / "figures.json"
    with controller(backend, status) as address:
        arguments = ["apps.smart_servo_joint_motion", *MOTION, "--controller", address, "--json", figures]
        application = subprocess.Popen(
            [sys.executable, "-m", *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=ROOT,
        )
        ended = finish(application)
        assert ended.code == 0, ended.err
        assert "Statistic Timing of Overall Loop" in ended.out
    assert json.loads(figures.read_text())["peak_rad"] == pytest.approx(AMPLITUDE_RAD, abs=0.02)
    arm = json.loads(status.read_text())["robots"]["arm"]
    assert arm["backend"] == backend
    assert arm["measured_position"] == pytest.approx(START_RAD, abs=0.02)
    assert arm["servo"]["sessions_begun"] == 1
    assert arm["servo"]["motions_begun"] == 2
    assert [stop["reason"] for stop in arm["stops"]] in ([], ["the controller shuts down"])
