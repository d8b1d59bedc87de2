"""``hil top`` against ``hil run``, as processes: on a terminal of its own, without one, once, and what goes wrong."""

import fcntl
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import tempfile
import termios
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.support.cli import cli
from tests.support.processes import ROOT, finish, hil, own_host, wait_for_line

_COLOUR = re.compile(r"\x1b\[[0-9;]*m")


class Served(NamedTuple):
    """A running controller."""

    pad: Path
    servo: str


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    # pytest's own folders are longer than a socket's path may be.
    with tempfile.TemporaryDirectory(prefix="top") as folder:
        place, servo = Path(folder) / "x", f"{own_host()}:30300"
        process = hil("run", "--fri-client", "off", "--backend", "ideal", "--pad", place, "--servo", servo)
        try:
            wait_for_line(process, "pad: ")
            yield Served(place, servo)
        finally:
            ended = finish(process, interrupt=True)
        assert ended.code == 0, ended.err


def test_on_a_terminal_it_draws_the_whole_screen_and_leaves_it_as_it_was(served: Served) -> None:
    """At 60 columns, then at 40; Ctrl-C ends it with the cursor shown and the screen of before."""
    ours, theirs = pty.openpty()
    _resize(theirs, lines=24, columns=60)
    before = termios.tcgetattr(theirs)
    # What the variables say of a terminal's size would hold, and pytest's workers have them.
    environment = {name: value for name, value in os.environ.items() if name not in {"COLUMNS", "LINES"}}
    environment["TERM"] = "xterm"
    process = subprocess.Popen(
        [sys.executable, "-m", "hil.cli.main", "top", "--socket", str(served.pad)],
        stdin=theirs, stdout=theirs, stderr=theirs, cwd=ROOT, env=environment,
    )  # fmt: skip
    try:
        shown = _read_until(ours, "drives ACTIVE")
        # A screen may come in several pieces.
        shown += _read_until(ours, "A7  -175 ") if "A7  -175 " not in shown else ""
        assert shown.index("\x1b[?1049h") < shown.index("A7")
        assert "arm lbr-iiwa" in shown
        assert "│ A7  -175 " in shown
        _resize(theirs, lines=24, columns=40)
        _read_until(ours, "│ A7 ──")
        process.send_signal(signal.SIGINT)
        last = _read_until(ours, "\x1b[?1049l")
        last += _read_until(ours, "\x1b[?25h") if "\x1b[?25h" not in last else ""
        assert process.wait(timeout=10) == 0
        assert termios.tcgetattr(theirs) == before
        assert "Traceback" not in last
    finally:
        process.kill()
        process.wait()
        os.close(ours)
        os.close(theirs)


def test_without_a_terminal_a_robot_is_a_line_a_second_until_it_is_told_to_end(served: Served) -> None:
    process = hil("top", served.servo)
    assert process.stdout is not None
    line = process.stdout.readline()
    assert " AUT RUNNING | not enabled, override 100 % | axes 0.00 30.00 0.00 40.00 0.00 90.00 0.00 deg | " in line
    assert f" s] {served.servo}: " in line
    ended = finish(process, interrupt=True)
    assert (ended.code, ended.err) == (0, "")
    assert "\x1b" not in line + ended.out


def test_once_shows_what_the_pad_says_too_and_ends(served: Served) -> None:
    ended = finish(hil("top", "--once", "--socket", served.pad, environment={"COLUMNS": "80"}))
    assert (ended.code, ended.err) == (0, "")
    lines = ended.out.splitlines()
    assert max(map(len, lines)) == 80
    assert any("drives ACTIVE" in line for line in lines)
    assert any("speed, T1 250 ░" in line for line in lines)


def test_it_says_why_there_is_nothing_to_see(tmp_path: Path, served: Served) -> None:
    for ended, words in (
        (cli("top", "--socket", tmp_path / "none"), "hil: no controller at "),
        (cli("top", served.servo, "--socket", served.pad), "hil: give either the addresses of servo links or a contr"),
    ):
        assert ended.code == 2, ended
        assert ended.err.startswith(words)
        assert ended.err.count("\n") == 1


def _resize(terminal: int, *, lines: int, columns: int) -> None:
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("4H", lines, columns, 0, 0))


def _read_until(terminal: int, text: str) -> str:
    """Read what a terminal is sent, colours left out, until that is there; pytest's timeout ends what never comes."""
    read = b""
    while text not in (shown := _COLOUR.sub("", read.decode(errors="replace"))):
        read += os.read(terminal, 65536)
    return shown
