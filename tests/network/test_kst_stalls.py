"""Stalls of KST connections on real sockets: the kernel's own Nagle and delayed acknowledgements."""

import json
import select
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from hil.clock import MonotonicClock, Pause
from hil.kst.stalls import StallWatch
from hil.values.finding import Finding, Whose
from tests.network.test_kst import controller
from tests.support.cli import cli
from tests.support.processes import wait_for_line
from transport.kst import LineCutter
from transport.tcp.sockets import kernel_facts, set_no_delay

pytestmark = [
    pytest.mark.alone,
    pytest.mark.skipif(not hasattr(socket, "TCP_QUICKACK"), reason="what is tested is what Linux does"),
]

SET_POINT = b"jf_0.1_0.1_0.1_-1.5707_0.1_1.5708_0.1_\n"
"""Short, so that what is held for 40 ms, or for longer on a busy machine, is far from a full segment."""
BETWEEN_QUERIES = 20
KERNEL_DELAY_MS = range(30, 90)
"""Linux's 40 ms, a timer tick and a busy machine."""


class Server(threading.Thread):
    """Serves one client as the KST server does: ``jf_`` has no reply, ``doPTP`` has two, anything else has one."""

    def __init__(self, *, nagle: bool) -> None:
        super().__init__()
        self.watch = StallWatch(nagle)
        self._nagle = nagle
        self._clock = MonotonicClock()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address: tuple[str, int] = self._listener.getsockname()

    def run(self) -> None:
        with self._listener, self._listener.accept()[0] as self._socket:
            set_no_delay(self._socket, not self._nagle)
            cutter = LineCutter()
            while True:
                due_ns, now_ns = self.watch.due_ns, self._clock.now_ns()
                left_s = None if due_ns is None else max(0.0, (due_ns - now_ns) * 1e-9)
                if not select.select([self._socket], [], [], left_s)[0]:
                    self.watch.sampled(self._clock.now_ns(), kernel_facts(self._socket))
                    continue
                data = self._socket.recv(1 << 16)
                if not data:
                    return
                self._serve(data, cutter)

    def _serve(self, data: bytes, cutter: LineCutter) -> None:
        lines = [line for line in cutter.feed(data) if line]
        replies = [b"done\n" for line in lines for _ in range(_replies_to(line))]
        self.watch.received(
            self._clock.now_ns(),
            bytes_read=len(data),
            lines=len(lines),
            replies_due=len(replies),
            line_open=bool(cutter.open_line),
            kernel=kernel_facts(self._socket),
        )
        for reply in replies:
            self._socket.sendall(reply)
            self.watch.written(self._clock.now_ns(), size=len(reply), kernel=kernel_facts(self._socket))


def _replies_to(line: bytes) -> int:
    return 0 if line.startswith(b"jf_") else 2 if line.startswith(b"doPTP") else 1


@contextmanager
def served(*, nagle: bool, no_delay: bool) -> Iterator[tuple[StallWatch, socket.socket, Callable[[int], object]]]:
    """Yield what the server sees, a client's connection, and what waits for so many replies there."""
    server = Server(nagle=nagle)
    server.start()
    try:
        with socket.create_connection(server.address, timeout=10.0) as client, client.makefile("rb") as replies:
            set_no_delay(client, no_delay)

            def take(count: int) -> None:
                for _ in range(count):
                    replies.readline()

            yield server.watch, client, take
    finally:
        server.join()


def asks_in_two_writes(client: socket.socket, take: Callable[[int], object], count: int) -> None:
    for _ in range(count):
        client.sendall(b"jp_0.1_0.2_0.3_-1.5_0.1_1.5_0.1_")
        client.sendall(b"\n")
        take(1)


def moves(client: socket.socket, take: Callable[[int], object], count: int) -> None:
    for _ in range(count):
        client.sendall(b"doPTPinJS\n")
        take(2)


def streams(client: socket.socket, take: Callable[[int], object], count: int) -> None:
    """Some 250 set-points a second, and a query now and then, as programs have that look where they are."""
    pause, at_ns = Pause(1.0), 0
    for number in range(count * BETWEEN_QUERIES):
        pause.until(at_ns)
        at_ns += 4_000_000
        if number % BETWEEN_QUERIES == 0:
            client.sendall(b"getJointsPositions\n")
            take(1)
        client.sendall(SET_POINT)


def only(watch: StallWatch) -> Finding:
    (found,) = watch.findings()
    assert int(float(found.figures["median_ms"] or 0)) in KERNEL_DELAY_MS
    return found


def test_a_client_that_writes_in_two_parts_with_nagle_on_is_told() -> None:
    with served(nagle=False, no_delay=False) as (watch, client, take):
        asks_in_two_writes(client, take, 8)
    found = only(watch)
    assert (found.kind, found.whose) == ("kst-request-in-parts", Whose.PEER)


def test_a_client_that_streams_with_nagle_on_is_told() -> None:
    with served(nagle=False, no_delay=False) as (watch, client, take):
        streams(client, take, 8)
    found = only(watch)
    assert (found.kind, found.whose) == ("kst-stream-in-bursts", Whose.PEER)


def test_this_sides_nagle_is_told_where_it_is_on() -> None:
    with served(nagle=True, no_delay=True) as (watch, client, take):
        moves(client, take, 8)
    found = only(watch)
    assert (found.kind, found.whose) == ("kst-reply-held", Whose.CONTROLLER)
    assert "as Linux does (40 ms)" in found.sentence


def test_with_no_delay_on_both_sides_there_is_nothing_to_tell() -> None:
    with served(nagle=False, no_delay=True) as (watch, client, take):
        asks_in_two_writes(client, take, 50)
        moves(client, take, 20)
        streams(client, take, 5)
    assert watch.report()["requests"] == 50 + 20 + 5 * (BETWEEN_QUERIES + 1)
    assert not [finding for finding in watch.findings() if finding.is_wrong]


def test_a_running_controller_says_it_in_its_log_and_to_the_doctor(tmp_path: Path) -> None:
    pad = tmp_path / "pad.sock"
    with (
        controller("--pad", pad) as running,
        closing(running.connect()) as client,
        client.makefile("rb") as replies,
    ):
        asks_in_two_writes(client, lambda count: [replies.readline() for _ in range(count)], 8)
        said = wait_for_line(running.process, "kst: tcp: the client has to set TCP_NODELAY")[-1]
        # What the server's process did is told every half second.
        ended = cli("doctor", "kst", "--socket", pad, "--seconds", "0.6", "--json", "-")
        client.sendall(b"end\n")
        assert replies.read() == b""
    found = json.loads(ended.out)["findings"][0]
    assert (ended.code, found["kind"], found["whose"]) == (1, "kst-request-in-parts", "peer")
    assert "requests came in parts" in said
