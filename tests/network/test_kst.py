"""hil run --kst: real processes, real TCP. One controller with a fast arm serves all sessions of a module."""

import json
import re
import signal
import socket
import subprocess
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

from hil.clock import elapsed_ns
from tests.support.processes import finish, hil, own_host, wait_for_line

START = "jp_0.0_0.3_0.0_-1.5_0.0_1.0_0.0_"
PATIENCE_S = 20.0


class Running(NamedTuple):
    """A controller, and where its KST server is."""

    process: "subprocess.Popen[str]"
    host: str
    port: int

    def connect(self) -> socket.socket:
        """Return a new connection."""
        return socket.create_connection((self.host, self.port), timeout=PATIENCE_S)


@contextmanager
def controller(*options: object, status: Path | None = None) -> Iterator[Running]:
    """Run a controller with a KST server on a free port; it ends well."""
    host = own_host()
    if status is not None:
        options = (*options, "--status-json", status)
    process = hil(
        *("run", "--backend", "ideal", "--fri-client", "off", "--servo", f"{host}:0", "--kst", f"{host}:0"),
        *("--progress", 0, *options),
    )
    try:
        (line,) = wait_for_line(process, "KST programs at TCP")[-1:]
        found = re.search(r"KST programs at TCP ([\d.]+):(\d+)", line)
        assert found is not None
        yield Running(process, found[1], int(found[2]))
    finally:
        process.send_signal(signal.SIGINT)
        ended = finish(process)
        assert ended.code == 0, ended.err
        assert "KST programs" in ended.out


@pytest.fixture(scope="module")
def running() -> Iterator[Running]:
    with controller() as served:
        yield served


@contextmanager
def client(running: Running) -> Iterator[socket.socket]:
    """A connection that says ``end``, and waits for the server to close."""
    with closing(running.connect()) as link:
        yield link
        link.sendall(b"end\n")
        assert link.recv(1024) == b""


def ask(link: socket.socket, line: str) -> bytes:
    """Send a line in one piece; return what one recv gives."""
    link.sendall(line.encode() + b"\n")
    return link.recv(1024)


def told(running: Running, text: str) -> str:
    """Wait until the log says ``text``; return the line."""
    return wait_for_line(running.process, text)[-1]


def test_a_program_is_served_and_the_next_one_too(running: Running) -> None:
    for _ in range(3):
        with client(running) as link:
            assert ask(link, "blueOn") == b"done\n"
            joints = ask(link, "getJointsPositions")
            assert joints.count(b"_") == 7
            assert ask(link, "jRelVel_1.0_") == b"done\n"
            assert ask(link, START + "\n") == b"done\n"
            assert ask(link, "doPTPinJS") == b"done\n"
            assert link.recv(1024) == b"done\n"
            position = [float(text) for text in ask(link, "getJointsPositions").decode().split("_")[:-1]]
            assert position == pytest.approx([0.0, 0.3, 0.0, -1.5, 0.0, 1.0, 0.0], abs=1e-4)
        told(running, "is served no more: the client ended it")


def test_two_acknowledgements_never_come_in_one_segment(running: Running) -> None:
    with client(running) as link:
        assert ask(link, "jRelVel_1.0_") == b"done\n"
        assert ask(link, START) == b"done\n"
        for _ in range(5):
            # Zero length: both are due at once.
            assert ask(link, "doPTPinJS") == b"done\n"
            assert link.recv(1024) == b"done\n"


def test_a_second_client_is_turned_away_and_the_first_one_goes_on(running: Running) -> None:
    with client(running) as link:
        assert ask(link, "blueOn") == b"done\n"
        with closing(running.connect()) as second:
            assert second.recv(1024) == b"nak\n"
            assert second.recv(1024) == b""
        told(running, "was turned away")
        assert ask(link, "blueOff") == b"done\n"


def test_a_client_that_vanishes_in_mid_motion_brakes_the_arm_and_the_next_one_is_served(running: Running) -> None:
    link = running.connect()
    for line in ("jRelVel_0.05_", "jp_1.0_0.3_0.0_-1.5_0.0_1.0_0.0_", "doPTPinJS"):
        assert ask(link, line) == b"done\n"
    link.close()
    # It need not wait until the arm is at rest.
    with client(running) as link:
        told(running, "closed the connection without a word (end); the arm brakes")
        assert ask(link, "jRelVel_1.0_") == b"done\n"
        assert ask(link, START) == b"done\n"
        assert ask(link, "doPTPinJS") == b"done\n"
        assert link.recv(1024) == b"done\n"


def test_bad_input_is_answered_and_the_session_lives(running: Running) -> None:
    with client(running) as link:
        for wrong in ("foo", "jp_1_2_", "jp_a_0_0_0_0_0_0_", "jp_NaN_0_0_0_0_0_0_", "jp_9_0_0_0_0_0_0_", "x" * 5000):
            assert ask(link, wrong) == b"nak\n"
        assert ask(link, "\x01\x02") == b"nak\n"
        assert ask(link, "blueOn") == b"done\n"


def test_a_client_that_does_not_read_is_let_go(running: Running) -> None:
    with closing(running.connect()) as link:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        port = link.getsockname()[1]
        with pytest.raises(OSError, match=r"Broken pipe|reset"):
            link.sendall(b"getJointsPositions\n" * 1_000_000)
    # Of this one: that the client before it is gone may be told late.
    line = told(running, f":{port} is served no more: ")
    # On a machine that is held up for ten seconds the kernel gives the connection up before the server does.
    assert "the client does not read its replies" in line or "Connection timed out" in line


def test_lines_as_fast_as_they_can_come_are_answered_one_by_one(running: Running) -> None:
    with client(running) as link:
        asked = 0
        began_ns = elapsed_ns()
        while elapsed_ns() - began_ns < 300_000_000:
            link.sendall(b"jp_0.0_0.3_0.0_-1.5_0.0_1.0_0.0_\n" * 20)
            got = b""
            while got.count(b"\n") < 20:
                got += link.recv(4096)
            asked += 20
        assert asked > 100


def test_the_status_file_and_the_pad_tell_what_was_served(tmp_path: Path) -> None:
    status = tmp_path / "status.json"
    with controller(status=status) as served:
        with client(served) as link:
            assert ask(link, "blueOn") == b"done\n"
            assert ask(link, "foo") == b"nak\n"
        told(served, "is served no more")
    kst = json.loads(status.read_text())["robots"]["arm"]["kst"]
    assert (kst["sessions"], kst["refused"], kst["counters"]["lines"]) == (1, {"unknown command": 1}, 3)
    assert kst["address"].startswith("127.")


def test_strictly_the_server_ends_with_its_session() -> None:
    with controller("--kst-strict") as served:
        with closing(served.connect()) as link:
            assert ask(link, "blueOn") == b"done\n"
            link.sendall(b"foo\nend\n")
            assert link.recv(1024) == b""
        told(served, "nobody serves")
        with pytest.raises(OSError, match="refused"):
            served.connect()


def test_options_that_cannot_be_are_refused_in_a_sentence() -> None:
    for options, sentence in (
        (("--kst", "127.0.0.1:0", "--servo", "off"), "commands the arm through the servo link, and needs one"),
        (("--kst-strict",), "there is no KST server for the KST options"),
        (("--kst", "off", "--kst-nagle"), "leaves nothing for the other KST options to say"),
    ):
        ended = finish(hil("run", "--fri-client", "off", "--servo", f"{own_host()}:0", *options))
        assert ended.code == 2
        assert sentence in ended.err


def test_an_address_in_use_is_told_before_anything_moves() -> None:
    with closing(socket.create_server((own_host(), 0))) as taken:
        address = "{}:{}".format(*taken.getsockname())
        ended = finish(hil("run", "--fri-client", "off", "--servo", f"{own_host()}:0", "--kst", address))
        assert ended.code == 2
        assert f"cannot listen at TCP {address}: Address already in use" in ended.err
