"""Nobody reads a clock or sleeps, but for hil/clock.py: the rule bites everywhere, and nobody is let off."""

import ast
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.processes import ROOT

CLOCK = Path("hil/clock.py")
ROOMS = ("hil", "transport", "backends", "apps", "tools", "tests")
BANNED = (
    "import time\ntime.time()",
    "import time\ntime.time_ns()",
    "import time\ntime.monotonic()",
    "import time\ntime.monotonic_ns()",
    "import time\ntime.perf_counter()",
    "import time\ntime.perf_counter_ns()",
    "import time\ntime.process_time()",
    "import time\ntime.clock_gettime(1)",
    "import time\ntime.sleep(1)",
    "import time as t\nt.sleep(1)",
    "from time import sleep\nsleep(1)",
    "from time import sleep as rest\nrest(1)",
    "from time import monotonic_ns\nmonotonic_ns()",
    "def wait():\n    from time import sleep\n    sleep(1)",
    "import datetime\ndatetime.datetime.now(datetime.UTC)",
    "import datetime as dt\ndt.datetime.utcnow()",
    "import datetime\ndatetime.datetime.today()",
    "import datetime\ndatetime.date.today()",
    "from datetime import UTC, datetime\ndatetime.now(UTC)",
    "from datetime import date\ndate.today()",
    "from datetime import datetime\nread = datetime.now",
    "import asyncio\nasync def wait():\n    await asyncio.sleep(1)",
    "from asyncio import sleep\nasync def wait():\n    await sleep(0)",
    "from asyncio.tasks import sleep\nasync def wait():\n    await sleep(0)",
    "import asyncio\nasync def wait():\n    await asyncio.tasks.sleep(1)",
    "import timeit\ntimeit.default_timer()",
    "import sched\nsched.scheduler()",
    "import os\nos.times()",
    "import signal\nsignal.alarm(1)",
    "from signal import ITIMER_REAL, setitimer\nsetitimer(ITIMER_REAL, 1)",
)
ALLOWED = (
    "import datetime\ndatetime.datetime.fromtimestamp(0, datetime.UTC)",
    "from hil.clock import elapsed_ns\nelapsed_ns()",
    "import asyncio\nasync def wait(event):\n    async with asyncio.timeout(1):\n        await event.wait()",
)
LOOP_CLOCKS = (
    "now = asyncio.get_running_loop().time()",
    "read = asyncio.get_running_loop().time",
    "now = loop.time()",
    "now = self._loop.time()",
)
DISGUISED_SLEEPS = ("threading.Event().wait(1)", "Event().wait(timeout=1)", "select.select([], [], [], 1)")


def found_by_ruff(folder: Path, *options: str) -> set[Path]:
    """The files, relative to ``folder``, in which ruff finds what TID251 bans."""
    command = [sys.executable, "-m", "ruff", "check", "--no-cache", "--output-format", "json", *options, "."]
    ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert ran.returncode in {0, 1}, ran.stderr
    findings = json.loads(ran.stdout)
    return {Path(one["filename"]).relative_to(folder.resolve()) for one in findings if one["code"] == "TID251"}


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> set[Path]:
    """What ruff finds in a tree like ours, with our settings, that has every snippet in every room."""
    folder = tmp_path_factory.mktemp("tree")
    shutil.copy(ROOT / "pyproject.toml", folder)
    for room in ROOMS:
        for kind, snippets in (("banned", BANNED), ("allowed", ALLOWED)):
            for number, snippet in enumerate(snippets):
                file = folder / room / kind / f"{number}.py"
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(f"{snippet}\n")
    return found_by_ruff(folder)


@pytest.mark.parametrize("room", ROOMS)
@pytest.mark.parametrize("number", range(len(BANNED)), ids=BANNED)
def test_ruff_finds_every_clock_and_every_sleep(found: set[Path], number: int, room: str) -> None:
    assert Path(room, "banned", f"{number}.py") in found


@pytest.mark.parametrize("number", range(len(ALLOWED)), ids=ALLOWED)
def test_ruff_lets_timeouts_and_given_times_pass(found: set[Path], number: int) -> None:
    assert not [file for file in found if file.parts[1:] == ("allowed", f"{number}.py")]


def test_nobody_but_the_clock_module_is_let_off() -> None:
    # Neither by a comment, nor by the settings of a folder.
    found = found_by_ruff(ROOT, "--ignore-noqa", "--config", "lint.per-file-ignores={}", "--select", "TID251")
    # But for the example of a user's project: it tells the time as programs do.
    assert {file for file in found if file.parts[0] != "examples"} == {CLOCK}


def clocks_of_event_loops(tree: ast.AST) -> Iterator[int]:
    """Lines with ``loop.time``, a method that ruff cannot tell from any other."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr == "time" and "loop" in ast.unparse(node.value):
            yield node.lineno


def disguised_sleeps(tree: ast.AST) -> Iterator[int]:
    """Lines that wait for an event nobody can set, or for nothing at all."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            waited_for = node.func.value
            nobodys = isinstance(waited_for, ast.Call) and ast.unparse(waited_for.func).split(".")[-1] == "Event"
            watched = node.args[:3]
            nothing = len(watched) == 3 and all(isinstance(each, ast.List) and not each.elts for each in watched)
            if (node.func.attr == "wait" and nobodys) or (node.func.attr == "select" and nothing):
                yield node.lineno


@pytest.mark.parametrize("snippet", LOOP_CLOCKS)
def test_clocks_of_event_loops_are_found(snippet: str) -> None:
    assert list(clocks_of_event_loops(ast.parse(snippet))) == [1]


@pytest.mark.parametrize("snippet", DISGUISED_SLEEPS)
def test_disguised_sleeps_are_found(snippet: str) -> None:
    assert list(disguised_sleeps(ast.parse(snippet))) == [1]


def test_our_files_have_neither() -> None:
    files = [file for room in ROOMS for file in sorted((ROOT / room).rglob("*.py"))]
    assert len(files) > 300
    found = [
        f"{file.relative_to(ROOT)}:{line}"
        for file in files
        for tree in [ast.parse(file.read_text(encoding="utf-8"))]
        for line in (*clocks_of_event_loops(tree), *disguised_sleeps(tree))
    ]
    assert found == []
