"""The joint sine application as a process of its own, against a scripted controller."""

import json
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hil.client.fri import Release, SessionState
from tests.unit.test_client_support import INTERPOLATED, MEASURED, datagram, read

ROOT = Path(__file__).parents[2]
HOST = "127.0.0.1"


@contextmanager
def application(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run the application on a free port; it is gone afterwards, however the test ends."""
    command = [sys.executable, "-W", "error", "-m", "apps.fri_joint_sine", "--bind", HOST, *arguments]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def where(line: str) -> tuple[str, int]:
    """Return the address in the application's first line."""
    found = re.search(r"client on ([\d.]+):(\d+)$", line.strip())
    assert found is not None, line
    return found[1], int(found[2])


def exchange(controller: socket.socket, client: tuple[str, int], release: Release, states: list[SessionState]) -> bytes:
    """Send a message for each state and return the last answer."""
    answer = b""
    for sequence, state in enumerate(states):
        controller.sendto(datagram(release, state, sequence=sequence), client)
        if state is not SessionState.IDLE:
            answer = controller.recv(2048)
            assert read(release, answer)[:2] == (sequence, sequence)
    return answer


@pytest.fixture
def controller() -> Iterator[socket.socket]:
    """A controller's socket on a free port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind((HOST, 0))
        sock.settimeout(20)
        yield sock


@pytest.mark.parametrize("release", Release)
def test_a_session_to_its_end(controller: socket.socket, release: Release) -> None:
    active = [SessionState.COMMANDING_ACTIVE] * 5
    with application(
        "--port", "0", "--fri-version", release.value, "--json", "-", "--joint", "4", "--joint", "7"
    ) as process:
        assert process.stderr is not None
        client = where(process.stderr.readline())
        states = [SessionState.MONITORING_WAIT, SessionState.MONITORING_READY, SessionState.COMMANDING_WAIT, *active]
        last = exchange(controller, client, release, [*states, SessionState.IDLE])
        out, err = process.communicate(timeout=20)
    assert process.returncode == 0
    command = read(release, last).command
    assert command is not None
    assert command.position is not None
    moved = [axis for axis, value in enumerate(command.position, start=1) if value != INTERPOLATED[axis - 1]]
    assert moved == [4, 7]
    assert json.loads(out) == {
        "release": release.value,
        "received": 9,
        "answers": 8,
        "malformed": {},
        "states": {
            "MONITORING_WAIT": 1,
            "MONITORING_READY": 1,
            "COMMANDING_WAIT": 1,
            "COMMANDING_ACTIVE": 5,
            "IDLE": 1,
        },
        "peak_excursion_rad": [0.0] * 7,
        "first_position": list(MEASURED),
        "last_position": list(MEASURED),
    }
    assert "IDLE -> MONITORING_WAIT, quality POOR\nMONITORING_WAIT -> MONITORING_READY, quality GOOD\n" in err
    assert err.endswith(
        "COMMANDING_ACTIVE -> IDLE, quality POOR\n"
        "9 messages received, 8 answered, 0 malformed; largest measured excursion: none\n"
    )


def test_ctrl_c_ends_it_with_the_summary(controller: socket.socket, tmp_path: Path) -> None:
    result = tmp_path / "result.json"
    with application("--port", "0", "--json", str(result)) as process:
        assert process.stdout is not None
        client = where(process.stdout.readline())
        exchange(controller, client, Release.V1_15, [SessionState.MONITORING_WAIT] * 3)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20)
    assert (process.returncode, err) == (0, "")
    assert out.endswith("interrupted\n3 messages received, 3 answered, 0 malformed; largest measured excursion: none\n")
    assert json.loads(result.read_text(encoding="utf-8"))["received"] == 3


def test_nobody_there() -> None:
    with application("--port", "0", "--seconds", "0.01") as process:
        out, err = process.communicate(timeout=20)
    assert process.returncode == 1
    assert "no datagram came: does the controller run" in err
    assert out.endswith("no controller was heard\n")


def test_a_taken_port(controller: socket.socket) -> None:
    with application("--port", str(controller.getsockname()[1])) as process:
        out, err = process.communicate(timeout=20)
    assert (process.returncode, out) == (2, "")
    assert err.startswith("fri_joint_sine: cannot bind UDP 127.0.0.1:")


def test_a_result_that_cannot_be_written(tmp_path: Path) -> None:
    with application("--port", "0", "--seconds", "0", "--json", str(tmp_path)) as process:
        _, err = process.communicate(timeout=20)
    assert process.returncode == 2
    assert err.endswith(f"fri_joint_sine: cannot write {tmp_path}: Is a directory\n")
