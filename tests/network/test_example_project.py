"""The example of a user's project, run as its user would run it."""

import re
import subprocess
import sys

import pytest

from tests.support.processes import ROOT
from tests.support.virtual_controller import PLUGIN

pytestmark = pytest.mark.alone

PROJECT = ROOT / "examples" / "testing_an_application"


def test_the_example_project_passes_and_skips_nothing() -> None:
    # Without what our own environment has beside: the example knows pytest alone.
    others = ("asyncio", "hypothesispytest", "timeout", "cacheprovider")
    command = [sys.executable, "-m", "pytest", *PLUGIN, *(f"-pno:{name}" for name in others), "-W", "error", "-q"]
    done = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=False, timeout=100)
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.search(r"^(\d+) passed in", done.stdout, re.MULTILINE)
    assert found is not None, done.stdout
    assert int(found[1]) >= 17
