"""The example of a backend in a package of its own, installed as its user would, tested and run."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hil.client.servo import PTP, ServoClient
from tests.support.cli import cli
from tests.support.processes import ROOT, finish, hil, own_host, wait_for_line
from tests.support.virtual_controller import PLUGIN


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project, for its build leaves files behind; its package is in ``site`` beside it, nowhere else."""
    folder = tmp_path_factory.mktemp("example")
    copy = shutil.copytree(
        ROOT / "examples" / "backend",
        folder / "project",
        ignore=shutil.ignore_patterns("*.egg-info", "build", "__pycache__"),
    )
    offline = ("--no-index", "--no-deps", "--no-build-isolation", "--quiet", "--disable-pip-version-check")
    command = [sys.executable, "-m", "pip", "install", *offline, "--target", str(folder / "site"), str(copy)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    shutil.rmtree(copy / "elastic_arm")
    return copy


def with_site(project: Path) -> dict[str, str]:
    return {"PYTHONPATH": os.pathsep.join(map(str, (ROOT, project.parent / "site")))}


def test_it_passes_its_own_tests_and_the_contract(project: Path) -> None:
    others = ("asyncio", "hypothesispytest", "timeout", "cacheprovider")
    command = [sys.executable, "-m", "pytest", *PLUGIN, *(f"-pno:{name}" for name in others), "-W", "error", "-q"]
    environment = {**os.environ, **with_site(project)}
    done = subprocess.run(
        command, cwd=project, env=environment, capture_output=True, text=True, check=False, timeout=100
    )
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.search(r"^(\d+) passed in", done.stdout, re.MULTILINE)
    assert found is not None, done.stdout
    assert int(found[1]) >= 49


@pytest.fixture
def installed(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """For what the command line says in this process."""
    monkeypatch.syspath_prepend(str(project.parent / "site"))


@pytest.mark.usefixtures("installed")
def test_hil_backends_lists_it_with_what_it_can_do() -> None:
    ended = cli("backends", "--json", "-")
    assert ended.code == 0, ended.err
    found = json.loads(ended.out)
    assert {"ideal", "mujoco", "elastic"} <= set(found)
    elastic = found["elastic"]
    assert (elastic["from"], elastic["problem"]) == ("elastic-arm 1.0.0", "")
    assert set(elastic["options"]) == {"frequency_hz", "damping_ratio"}
    assert elastic["capabilities"]["switches_drives"] is True
    assert elastic["capabilities"]["takes_torque"] is False


@pytest.mark.usefixtures("installed")
def test_an_option_it_does_not_have_is_refused_by_hil_run() -> None:
    ended = cli("run", "--backend", "elastic", "-o", "stiffness=3", "--servo", "off", "--pad", "off")
    sentence = "options of the backend elastic: there is no 'stiffness'; valid: frequency_hz, damping_ratio"
    assert (ended.code, ended.err.splitlines()[-1]) == (2, f"hil: {sentence}")


@pytest.mark.usefixtures("installed")
def test_its_station_file_is_good(project: Path) -> None:
    assert cli("config", "check", project / "station.toml").code == 0


def test_hil_run_moves_it(project: Path, tmp_path: Path) -> None:
    status = tmp_path / "status.json"
    controller = hil(
        "run", "--backend", "elastic", "-o", "damping_ratio=0.3", "--servo", f"{own_host()}:0", "--fri-client", "off",
        "--duration", 20, "--status-json", status, environment=with_site(project),
    )  # fmt: skip
    said = wait_for_line(controller, "applications at ")[-1]
    found = re.search(r"applications at (\S+),", said)
    assert found is not None, said
    with ServoClient(found[1]) as application:
        start = application.read_state().measured_position
        application.move(PTP((start[0] + 0.1, *start[1:])))
    ended = finish(controller, interrupt=True)
    assert ended.code == 0, ended.err
    robot = json.loads(status.read_text())["robots"]["arm"]
    assert (robot["backend"], robot["servo"]["motions_begun"], robot["stops"]) == ("elastic", 1, [])
    assert robot["measured_position"][0] == pytest.approx(start[0] + 0.1, abs=0.01)


@pytest.mark.usefixtures("installed")
def test_hil_conformance_tells_it_from_the_ideal_arm() -> None:
    compared = cli("conformance", "ideal", "elastic:frequency_hz=5")
    assert compared.code == 1, compared.err
    assert "elastic:frequency_hz=5 differs from ideal" in compared.out
