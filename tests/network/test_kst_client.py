"""The client of KST servers against a peer that says what a test makes it say, and the examples against hil run."""

import json
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from hil.client.kst import Feedback, KstClient, KstClosed, KstRefused, KstSilent
from hil.values.errors import EndpointError, HilError, PeerError
from tests.support.processes import ROOT, finish, hil, own_host, wait_for_line

SEVEN = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 1e-5)


@contextmanager
def peer(*replies: bytes | None) -> Iterator[tuple[str, list[bytes]]]:
    """A server that answers each line with the next of ``replies`` (None: closes); return its address and the lines."""
    lines: list[bytes] = []

    def serve(server: socket.socket) -> None:
        link, _ = server.accept()
        with link, link.makefile("rb") as requests:
            for reply, line in zip(replies, requests, strict=False):
                lines.append(line)
                if reply is None:
                    return
                for part in reply.split(b"|"):
                    link.sendall(part)
            lines.extend(requests)

    with closing(socket.create_server((own_host(), 0))) as server:
        thread = threading.Thread(target=serve, args=(server,))
        thread.start()
        try:
            yield "{}:{}".format(*server.getsockname()), lines
        finally:
            thread.join(10)


def test_replies_are_lines_however_tcp_cut_them() -> None:
    replies = (b"0.0_0.1_|0.2_0.3_0.4_0.5_|1.0E-5_\n", b"1\n\n", b"1.5_-2.25_0.5_\n")
    with peer(*replies) as (address, lines), KstClient(address) as arm:
        assert arm.joint_positions() == SEVEN
        assert arm.input_is_high(3)
        assert arm.force() == (1.5, -2.25, 0.5)
    assert lines == [b"getJointsPositions\n", b"getPin3\n", b"Eef_force\n", b"end\n"]


def test_both_acknowledgements_of_a_motion_are_taken_also_in_one_segment() -> None:
    with peer(b"done\n", b"done\n", b"done\ndone\n", b"1.0_2.0_3.0_\n") as (address, lines), KstClient(address) as arm:
        arm.move_joints(SEVEN, velocity_rel=0.25)
        assert arm.moment() == (1.0, 2.0, 3.0)
        assert lines[:3] == [b"jRelVel_0.25_\n", b"jp_0.0_0.1_0.2_0.3_0.4_0.5_1e-05_\n", b"doPTPinJS\n"]


MOTIONS: dict[str, tuple[Callable[[KstClient], None], list[bytes]]] = {
    "line": (
        lambda arm: arm.move_line((1, 2, 3, 0, 0, 0), speed_mm_s=50.0),
        [b"jRelVel_50.0_\n", b"cArtixanPosition_1.0_2.0_3.0_0.0_0.0_0.0_\n", b"doPTPinCS\n"],
    ),
    "relative line": (
        lambda arm: arm.move_by((1, 2, 3), speed_mm_s=50.0, in_tool=True),
        [b"jRelVel_50.0_\n", b"cArtixanPosition_1.0_2.0_3.0_0.0_0.0_0.0_\n", b"doPTPinCSRelEEF\n"],
    ),
    "circle": (
        lambda arm: arm.move_circle((1, 0, 0, 0, 0, 0), (2, 0, 0, 0, 0, 0), speed_mm_s=5.0),
        [
            b"jRelVel_5.0_\n",
            b"cArtixanPositionCirc1_1.0_0.0_0.0_0.0_0.0_0.0_\n",
            b"cArtixanPositionCirc2_2.0_0.0_0.0_0.0_0.0_0.0_\n",
            b"doPTPinCSCircle1_\n",
        ],
    ),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_motions_as_lines_and_a_rejected_one_raises(name: str) -> None:
    move, wanted = MOTIONS[name]
    with peer(*[b"done\n"] * (len(wanted) - 1), b"done\n|nak\n") as (address, lines), KstClient(address) as arm:
        with pytest.raises(KstRefused, match="'nak'"):
            move(arm)
        assert lines == wanted


def test_set_points_and_what_comes_back() -> None:
    replies = (b"done\n", b"0_0_0_0_0_0_0_\n", b"1_2_3_4_5_6_\n", b"done\n", b"1_1_1_1_1_1_1_\n")
    with peer(*replies) as (address, lines), KstClient(address) as arm:
        assert arm.set_joints(SEVEN) == ()
        assert arm.set_joints(SEVEN, Feedback.MEASURED_TORQUES) == (0.0,) * 7
        assert arm.set_pose((1, 2, 3, 4, 5, 6), Feedback.POSE) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
        assert arm.set_pose((1, 2, 3, 4, 5, 6), Feedback.DONE) == ()
        assert arm.set_velocities(SEVEN, Feedback.EXTERNAL_TORQUES) == (1.0,) * 7
        assert arm.round_trip_ms > 0.0
        tokens = [line.partition(b"_")[0] for line in lines]
        assert tokens == [b"jp", b"jpMT", b"DcSeCarEEfP", b"DcSeCarW", b"velJDCExT"]


def test_streams_wait_for_nothing() -> None:
    with peer(b"", b"", b"1_2_3_\n") as (address, lines), KstClient(address) as arm:
        arm.stream_joints(SEVEN)
        arm.stream_pose((1, 2, 3, 4, 5, 6))
        assert arm.force() == (1.0, 2.0, 3.0)
        assert [line[:8] for line in lines[:2]] == [b"jf_0.0_0", b"DcSeCar_"]


def test_the_end_of_impedance_is_acknowledged_twice_and_both_are_taken() -> None:
    with peer(b"done\n", b"done\n|done\n", b"1_2_3_\n") as (address, lines), KstClient(address) as arm:
        arm.start_impedance(
            mass_kg=1.0, centre_mm=(0, 0, 50), translational_n_m=900, rotational_nm_rad=80, null_space_nm_rad=50
        )
        arm.stop()
        assert arm.force() == (1.0, 2.0, 3.0)
        assert lines[0] == b"startSmartImpedneceJoints_1.0_0.0_0.0_50.0_900.0_80.0_50.0_\n"


WRONG: dict[str, tuple[bytes | None, Callable[[KstClient], object], type[HilError], str]] = {
    "silent": (b"", KstClient.pose, KstSilent, r"no reply to 'Eef_pos' within 0\.2 s"),
    "refused": (b"nak\n", lambda arm: arm.attach_tool((1, 2)), KstRefused, r"'TFtrans_1\.0_2\.0_'"),
    "no numbers": (b"nak\n", KstClient.pose, KstRefused, "'Eef_pos'"),
    "too few numbers": (b"1_2_\n", KstClient.pose, PeerError, "2 numbers, 6 are needed"),
    "no end": (b"1_" * 3000, KstClient.pose, PeerError, "has no end within 4096 bytes"),
    "closed": (None, KstClient.pose, KstClosed, "'Eef_pos' was not answered"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_goes_wrong_is_an_error_that_names_the_request(name: str) -> None:
    reply, does, error, words = WRONG[name]
    with peer(reply) as (address, _), KstClient(address, timeout_s=0.2) as arm, pytest.raises(error, match=words):
        does(arm)


def test_a_client_that_is_not_open_says_so() -> None:
    with pytest.raises(HilError, match="not open"):
        KstClient("127.0.0.1").pose()
    with pytest.raises(EndpointError, match="cannot reach a KST server"):
        KstClient(f"{own_host()}:1").__enter__()


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    """A controller with a KST server, for the examples."""
    host = own_host()
    process = hil("run", "--fri-client", "off", "--servo", f"{host}:0", "--kst", f"{host}:0", "--progress", 0)
    try:
        found = re.search(r"KST programs at TCP (\S+)", wait_for_line(process, "KST programs at TCP")[-1])
        assert found is not None
        yield found[1]
    finally:
        process.send_signal(signal.SIGINT)
        assert finish(process).code == 0


def example(name: str, *arguments: object) -> str:
    """Run an example to its good end; return what it said."""
    command = [sys.executable, "-m", f"apps.{name}", *map(str, arguments)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_examples_run(server: str, tmp_path: Path) -> None:
    said = example("kst_getters", "--controller", server)
    assert "measured torques, Nm" in said
    assert "3, 4, 10, 13, 16" in said
    picture, figures = tmp_path / "path.png", tmp_path / "figures.json"
    said = example("kst_ptp", "--controller", server, "--speed", 400, "--plot", picture)
    back = re.search(r"within ([\d.]+) mm", said)
    assert back is not None
    assert float(back[1]) < 0.5
    assert picture.stat().st_size > 10_000
    example("kst_direct_servo_sine", "--controller", server, "--seconds", 1, "--frequency", 1, "--json", figures,
            "--plot", picture)  # fmt: skip
    assert json.loads(figures.read_text())["set_points"] > 20


def test_an_example_without_a_server_says_so() -> None:
    command = [sys.executable, "-m", "apps.kst_getters", "--controller", f"{own_host()}:1"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "cannot reach a KST server at TCP" in done.stderr
