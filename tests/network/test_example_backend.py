"""The third-party backend of the example, installed beside ours as its user would install it."""

import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec

import pytest

from tests.support.processes import ROOT, finish, hil, own_host
from tests.support.virtual_controller import PLUGIN

pytestmark = pytest.mark.alone
PROJECT = ROOT / "examples" / "backend"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Install the example into a folder of its own, and return the environment that finds it."""
    folder = tmp_path_factory.mktemp("installed")
    copy = shutil.copytree(PROJECT, folder / "source")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(folder), str(copy)]
    if find_spec("setuptools") is not None:
        command.append("--no-build-isolation")
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)
    assert done.returncode == 0, done.stdout + done.stderr
    return {**os.environ, "PYTHONPATH": str(folder)}


def test_it_passes_the_suite_of_all_backends(installed: dict[str, str]) -> None:
    others = ("asyncio", "hypothesispytest", "timeout", "cacheprovider")
    command = [sys.executable, "-m", "pytest", *PLUGIN, *(f"-pno:{name}" for name in others), "-W", "error", "-q"]
    done = subprocess.run(command, cwd=PROJECT, env=installed, capture_output=True, text=True, check=False, timeout=100)
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.search(r"^(\d+) passed in", done.stdout, re.MULTILINE)
    assert found is not None, done.stdout
    assert int(found[1]) >= 20


def test_it_is_listed_and_runs_like_ours(installed: dict[str, str]) -> None:
    listed = finish(hil("backends", environment=installed))
    assert listed.code == 0, listed.err
    assert "elastic-arm 0.1.0" in re.sub(r"\s+", " ", listed.out)
    assert "damped spring" in listed.out
    one = finish(hil("backends", "elastic", environment=installed))
    assert "damping_ratio" in one.out
    compared = finish(hil("conformance", "ideal", "elastic:frequency_hz=5", environment=installed))
    assert compared.code == 1, compared.out + compared.err
    assert "elastic:frequency_hz=5 differs from ideal" in compared.out
    run = ("run", "--backend", "elastic", "--fri-client", own_host(), "--duration", 0.5)
    assert finish(hil(*run, "-o", "frequency_hz=8", environment=installed)).code == 0
    refused = finish(hil(*run, "-o", "frequency_hz=0", environment=installed))
    assert refused.code == 2
    assert "frequency_hz" in refused.err
