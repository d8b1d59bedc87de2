"""Whoever is not the peer gets nothing, over real sockets: other ports, replayed sessions, wrong keys; all counted."""

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hil.client.servo import PTP, ServoClient, load_key
from hil.values.servo import PROTOCOL_VERSION, Hello, Role
from tests.support.processes import finish, hil, own_host
from tests.support.servo_process import servo_controller
from transport.servo import ServoCodec

BURST = 8
"""Datagrams sent at once."""


class Tap:
    """Stands between a client and the controller, and keeps what the client sent."""

    def __init__(self, controller: tuple[str, int]) -> None:
        self.controller = controller
        self.front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.front.bind((own_host(), 0))
        self.back.bind((own_host(), 0))
        self.kept: list[bytes] = []
        self._client: tuple[str, int] | None = None
        self._over = False
        self._threads = [threading.Thread(target=turn) for turn in (self._forth, self._back)]

    @property
    def address(self) -> str:
        host, port = self.front.getsockname()
        return f"{host}:{port}"

    def start(self) -> None:
        for sock in (self.front, self.back):
            sock.settimeout(0.05)
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        self._over = True
        for thread in self._threads:
            thread.join()

    def close(self) -> None:
        for sock in (self.front, self.back):
            sock.close()

    def _forth(self) -> None:
        while not self._over:
            try:
                datagram, self._client = self.front.recvfrom(2048)
            except TimeoutError:
                continue
            self.kept.append(datagram)
            self.back.sendto(datagram, self.controller)

    def _back(self) -> None:
        while not self._over:
            try:
                datagram = self.back.recv(2048)
            except TimeoutError:
                continue
            if self._client is not None:
                self.front.sendto(datagram, self._client)


@contextmanager
def tapped(address: str) -> Iterator[Tap]:
    host, port = address.rsplit(":", 1)
    tap = Tap((host, int(port)))
    tap.start()
    try:
        yield tap
    finally:
        tap.stop()
        tap.close()


def dropped(status: Path) -> dict[str, int]:
    counts: dict[str, int] = json.loads(status.read_text())["robots"]["arm"]["servo"]["packets"]["dropped"]
    return counts


def heard_nothing(sock: socket.socket) -> bool:
    sock.settimeout(0.3)
    try:
        sock.recv(2048)
    except TimeoutError:
        return True
    return False


@pytest.mark.parametrize("keyed", [False, True])
def test_a_recorded_session_opens_nothing_and_moves_nothing(tmp_path: Path, keyed: bool) -> None:
    status, key = tmp_path / "status.json", tmp_path / "servo.key"
    options: list[object] = []
    if keyed:
        assert finish(hil("config", "key", key)).code == 0
        options = ["--servo-key", key]
    with servo_controller("--status-json", status, *options) as controller, tapped(controller.address) as tap:
        with ServoClient(tap.address, name="first", key=load_key(key) if keyed else None) as robot:
            start = robot.read_state().commanded_position
            there = (start[0] + 0.05, *start[1:])
            robot.move(PTP(there))
            robot.move(PTP(start))
        tap.stop()
        kept = [datagram for datagram in tap.kept if len(datagram) < 400]
        assert len(kept) > 10
        with (
            ServoClient(controller.address, name="second", key=load_key(key) if keyed else None) as second,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
        ):
            stranger.bind((own_host(), 0))
            before = second.read_state()
            for sender in (tap.back, stranger):
                for first in range(0, len(kept), BURST):
                    for datagram in kept[first : first + BURST]:
                        sender.sendto(datagram, tap.controller)
                    # The controller has had time to read them: none gets lost for want of room.
                    assert second.wait_for_state() is not None
            assert heard_nothing(stranger)
            after = second.wait_for_state()
            assert after is not None
            assert after.commander.startswith("second at ")
            assert after.commanded_position == before.commanded_position
            assert after.motions == ()
    counts = dropped(status)
    # Goodbyes of the session itself, from its own address, are said several times and are no offence.
    assert counts["unknown_session"] >= 2 * len(kept) - 3
    assert json.loads(status.read_text())["robots"]["arm"]["servo"]["sessions_begun"] == 2


def test_a_session_cannot_be_taken_from_another_port_or_with_a_wrong_key(tmp_path: Path) -> None:
    status, key, other = tmp_path / "status.json", tmp_path / "servo.key", tmp_path / "other.key"
    for file in (key, other):
        assert finish(hil("config", "key", file)).code == 0
    with (
        servo_controller("--status-json", status, "--servo-key", key) as controller,
        ServoClient(controller.address, name="owner", key=load_key(key)) as robot,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as thief,
    ):
        thief.bind((own_host(), 0))
        host, port = controller.address.rsplit(":", 1)
        genuine = robot.session.goodbye()
        assert genuine is not None
        for codec in (ServoCodec(load_key(other)), ServoCodec(None)):
            hello = Hello(PROTOCOL_VERSION, 1, Role.COMMANDER, 300, 5, "thief")
            thief.sendto(codec.encode_from_client(hello), (host, int(port)))
        thief.sendto(genuine, (host, int(port)))
        assert heard_nothing(thief)
        assert robot.wait_for_state() is not None
        assert robot.commander.startswith("owner at ")
    counts = dropped(status)
    assert counts["unauthenticated"] == 2
    assert counts["unknown_session"] == 1
