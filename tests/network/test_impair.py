"""``hil impair`` between real processes: its faults are seen at both ends, counted and told."""

import json
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from hil.client.servo import PTP, ServoClient, SessionEnded
from hil.clock import Deadline, MonotonicClock, elapsed_ns
from hil.runtime.impair import ImpairOptions, Link, run_impair
from hil.runtime.relay import MOST_SOURCES, open_relay
from hil.values.errors import ConfigurationError, EndpointError, HilError
from hil.values.link import Address
from tests.support.processes import ROOT, Ended, finish, hil, own_host, wait_for_line
from tests.support.servo_process import servo_controller
from transport.impairment import Direction, Network

SEED = 323
LOST = [12, 44]
"""What ``loss=2%`` takes of the first 170 answers with this seed."""


class Impairment:
    """A running ``hil impair``; ``ended`` and ``report`` when the block is over."""

    def __init__(self, process: "subprocess.Popen[str]", address: tuple[str, int]) -> None:
        self.process = process
        self.address = address
        self.ended = Ended(-1, "", "")
        self.report: dict[str, Any] = {}


@contextmanager
def impairment(folder: Path, *options: object, to: object, listen: object = None) -> Iterator[Impairment]:
    """Run ``hil impair`` on a free port of an address of its own, and stop it after the block."""
    figures = folder / "impair.json"
    process = hil(
        "impair", "--listen", listen or f"{own_host()}:0", "--to", to, "--json", figures, "--progress", 0, *options
    )
    try:
        line = wait_for_line(process, " stands for ")[-1]
        found = re.match(r"([\d.]+):(\d+) stands for", line)
        assert found is not None, line
        running = Impairment(process, (found[1], int(found[2])))
        yield running
        running.ended = finish(process, interrupt=True)
    finally:
        process.kill()
        process.communicate()
    running.report = json.loads(figures.read_text())


class Story(NamedTuple):
    """What impairment, controller and client say of the same run."""

    running: Impairment
    arm: dict[str, Any]
    client: dict[str, Any]


@pytest.fixture(scope="module")
def story(tmp_path_factory: pytest.TempPathFactory) -> Story:
    """A sine that loses some answers, hears one message twice, and is heard no more after 2 s."""
    folder, client_host = tmp_path_factory.mktemp("impaired"), own_host()
    status = folder / "status.json"
    faults = (
        *("--fault", "loss=2%:to-controller", "--fault", "packet=duplicate@20:to-peer"),
        *("--fault", "half-open=to-controller@2s.."),
    )
    sine = subprocess.Popen(
        [sys.executable, "-m", "apps.fri_joint_sine", "--bind", client_host, "--seconds", "20", "--json", "-"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT,
    )  # fmt: skip
    try:
        with impairment(folder, *faults, "--require-fired", "--seed", SEED, to=client_host) as running:
            host, port = running.address
            controller = hil(
                "run", "--fri-client", f"{host}:{port}", "--backend", "ideal", "--send-period", 20,
                "--duration", 2.6, "--progress", 0, "--status-json", status,
            )  # fmt: skip
            wait_for_line(sine, "client on ")
            ended = finish(controller)
            assert ended.code == 0, ended.err
            answers = finish(sine).out
    finally:
        sine.kill()
        sine.communicate()
    return Story(running, json.loads(status.read_text())["robots"]["arm"], json.loads(answers))


def test_loss_and_a_duplicate_are_seen_at_both_ends_and_told(story: Story) -> None:
    report, packets = story.running.report, story.arm["packets"]
    loss, duplicate, dead = report["faults"]
    assert story.running.ended.code == 0, story.running.ended.err
    assert [packet["number"] for packet in loss["first"]] == LOST
    assert report["packets"]["to-peer"] == packets["sent"] > 120
    assert report["delivered"]["to-peer"] == story.client["received"] == packets["sent"] + 1
    answers = report["packets"]["to-controller"]
    assert answers == story.client["answers"]
    assert report["delivered"]["to-controller"] == answers - loss["lost"] - dead["lost"] == packets["received"]
    assert packets["dropped"]["duplicate"] + packets["dropped"]["replayed"] == 1
    assert (duplicate["fired"], duplicate["first"]) == (1, [{"direction": "to-peer", "number": 20}])
    assert "loss=2%:to-controller: to-controller 12, 44\n" in story.running.ended.out
    assert "packet=duplicate@20:to-peer: to-peer 20\n" in story.running.ended.out


def test_a_half_open_network_ends_the_motion(story: Story) -> None:
    assert story.client["states"]["COMMANDING_ACTIVE"] > 5
    # Three silent answer periods end it by the watchdog; with one late answer shortly before, the quality is first.
    reasons = [stop["reason"] for stop in story.arm["stops"]]
    assert any(re.search("answers in a row are missing|quality FAIR is not enough", reason) for reason in reasons)
    assert story.running.report["faults"][2]["lost"] > 20
    # It hears all the time, and so hears that it is not heard.
    assert story.client["states"]["MONITORING_WAIT"] > 60


def test_applications_bear_loss_and_duplicates_and_the_watchdog_a_dead_direction(tmp_path: Path) -> None:
    faults = (
        *("--fault", "loss=15%:to-controller", "--fault", "duplicate=10%", "--fault", "jitter=2ms/normal/overtaking"),
        *("--fault", "half-open=to-controller@1.5s.."),
    )
    status = tmp_path / "status.json"
    with (
        servo_controller("--status-json", status) as controller,
        impairment(
            tmp_path, "--link", "servo", *faults, "--require-fired", "--seed", 3, to=controller.address
        ) as running,
        ServoClient(f"{running.address[0]}:{running.address[1]}", name="lossy", watchdog_ms=300) as robot,
    ):
        start = robot.read_state().commanded_position
        goal = (start[0] + 0.05, *start[1:])
        robot.move(PTP(goal))
        assert robot.wait_for_state() is not None
        assert robot.read_state().commanded_position == pytest.approx(goal)
        with pytest.raises(SessionEnded, match=r"silent for \d+ ms, the watchdog allows 300 ms"):
            robot.move(PTP((start[0] + 1.0, *start[1:])).set_joint_velocity_rel(0.1))
    assert running.ended.code == 0, running.ended.err
    assert len(running.report["speakers"]) == 1
    assert all(fault["fired"] > 3 for fault in running.report["faults"]), running.report["faults"]
    stops = json.loads(status.read_text())["robots"]["arm"]["stops"]
    assert [re.sub(r"\d+ ms.*", "", stop["reason"]) for stop in stops] == ["the application left: silent for "]


@contextmanager
def sockets(count: int, *hosts: str) -> Iterator[list[socket.socket]]:
    """Open ``count`` sockets, each at the host of its place, or at the last one."""
    opened: list[socket.socket] = []
    try:
        for index in range(count):
            opened.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            opened[-1].bind((hosts[min(index, len(hosts) - 1)], 0))
            opened[-1].settimeout(5)
        yield opened
    finally:
        for sock in opened:
            sock.close()


def name_of(sock: socket.socket) -> str:
    host, port = sock.getsockname()
    return f"{host}:{port}"


def hears(sock: socket.socket, within_s: float) -> bool:
    sock.settimeout(within_s)
    try:
        sock.recv(2048)
    except TimeoutError:
        return False
    return True


def test_each_speaker_has_a_socket_of_its_own_and_strangers_none(tmp_path: Path) -> None:
    with sockets(4 + MOST_SOURCES, own_host()) as (peer, stranger, first, second, *more):
        with impairment(tmp_path, "--fault", "delay=20ms:to-controller", to=name_of(peer)) as running:
            seen: dict[bytes, tuple[str, int]] = {}
            for speaker, word in ((first, b"one"), (second, b"two")):
                speaker.sendto(word, running.address)
                said, seen[word] = peer.recvfrom(2048)
                assert said == word
            assert seen[b"one"] != seen[b"two"]
            stranger.sendto(b"let me in", seen[b"one"])
            began_ns = elapsed_ns()
            peer.sendto(b"to two", seen[b"two"])
            peer.sendto(b"to one", seen[b"one"])
            assert first.recvfrom(2048) == (b"to one", running.address)
            assert elapsed_ns() - began_ns > 20_000_000
            assert second.recvfrom(2048) == (b"to two", running.address)
            for speaker in more[: MOST_SOURCES - 1]:
                speaker.sendto(b"more", running.address)
            for _ in range(MOST_SOURCES - 2):
                assert peer.recv(2048) == b"more"
            first.sendto(b"the last one found no socket", running.address)
            peer.settimeout(5)
            assert peer.recv(2048) == b"the last one found no socket"
        report = running.report
        assert (running.ended.code, report["strangers"], report["turned_away"]) == (0, 1, 1)
        assert len(report["speakers"]) == MOST_SOURCES
        assert report["packets"] == {"to-controller": 2, "to-peer": MOST_SOURCES + 1}
        assert report["lateness_us"]["max"] is not None


def test_from_one_address_there_is_one_speaker_until_it_falls_silent(tmp_path: Path) -> None:
    with sockets(4, own_host()) as (peer, first, second, place):
        forward_from = name_of(place)
        place.close()
        options = ("--from", forward_from, "--fault", "packet=drop@99", "--require-fired", "--progress", 0.05)
        with impairment(tmp_path, *options, to=name_of(peer)) as running:
            first.sendto(b"first", running.address)
            said, sender = peer.recvfrom(2048)
            assert (said, f"{sender[0]}:{sender[1]}") == (b"first", forward_from)
            second.sendto(b"second", running.address)
            assert not hears(peer, 0.05)
            deadline = Deadline(10.0)
            while not hears(peer, 0.2):
                assert (deadline.left_s() or 0.0) > 0.0
                second.sendto(b"second", running.address)
            peer.sendto(b"answer", sender)
            assert second.recv(2048) == b"answer"
            peer.close()
            second.sendto(b"to nobody", running.address)
            wait_for_line(running.process, "| refused 1")
            second.sendto(b"to nobody", running.address)
            wait_for_line(running.process, "| refused 2")
        report = running.report
        assert report["turned_away"] >= 1
        assert report["refused"] == 2
        assert [speaker["source"] for speaker in report["speakers"]] == [name_of(second)]
        assert running.ended.code == 1
        assert "hil: never fired: packet=drop@99; packets that entered: 1 to-controller, " in running.ended.err


def test_a_bad_fault_ends_in_one_sentence_and_exit_code_2() -> None:
    ended = finish(hil("impair", "--listen", f"{own_host()}:0", "--to", own_host(), "--fault", "loss=2"))
    assert ended.code == 2
    assert ended.err == ("hil: fault 'loss=2': write loss=2%, with :to-controller or :to-peer for one direction\n")
    assert ended.out == ""


def test_a_result_that_cannot_be_written_is_told_before_it_begins(tmp_path: Path) -> None:
    options = ImpairOptions(listen=Address(own_host(), 0), to=Address(own_host(), 1), link=Link.FRI, json_file=tmp_path)
    with pytest.raises(ConfigurationError, match="that is a folder"):
        run_impair(options)


async def test_a_port_in_use_is_named() -> None:
    with sockets(1, own_host()) as (taken,):
        address = Address(*taken.getsockname())
        with pytest.raises(EndpointError, match=f"cannot bind UDP {address}: Address already in use; another program"):
            await open_relay(
                Network([]), listen=address, to=Address(address.host, 1), towards=Direction.TO_PEER, forward_from=None,
                clock=MonotonicClock(),
            )  # fmt: skip


@pytest.mark.parametrize(
    ("to", "forward_from", "sentence"),
    [
        (Address("127.0.0.1", 0), None, "it needs a port of its own, 1..65535"),
        (Address("127.0.0.1", 1), Address("127.0.0.1", 1), "that is an address of our own"),
        (Address("127.0.0.1", 1), Address("192.0.2.1", 0), "cannot bind UDP 192.0.2.1:0: "),
    ],
)
async def test_addresses_that_cannot_be(to: Address, forward_from: Address | None, sentence: str) -> None:
    with pytest.raises(HilError, match=sentence):
        await open_relay(
            Network([]), listen=Address(own_host(), 0), to=to, towards=Direction.TO_PEER, forward_from=forward_from,
            clock=MonotonicClock(),
        )  # fmt: skip
