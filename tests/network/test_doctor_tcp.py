"""``hil doctor tcp`` on real sockets, with the kernel's own Nagle and delayed acknowledgements."""

import asyncio
import json
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from hil.clock import MonotonicClock, elapsed_ns
from hil.runtime.tcp_probe import TcpProbe
from hil.runtime.tcp_probe_server import CONNECTIONS_MOST, ProbeServer
from hil.values.errors import HilError
from hil.values.link import Address
from hil.values.tcp_probe import Behaviour
from tests.support.cli import cli
from tests.support.processes import Ended, finish, hil, wait_for_line
from tools.doctor.tcp.connection import find_address
from tools.doctor.tcp.measure import measure_echo, measure_responder
from transport.tcp import ProbeRefused, Responder, read_greeting
from transport.tcp.sockets import listen, set_quick_ack

pytestmark = pytest.mark.alone

KERNEL_DELAY_MS = range(30, 90)
"""Linux's 40 ms, a timer tick and a busy machine."""


@contextmanager
def responder(behaviour: Behaviour) -> Iterator[tuple[str, ProbeServer]]:
    """Serve in a thread of this process until the block ends."""
    listener = listen(Address("127.0.0.1", 0), backlog=CONNECTIONS_MOST)
    address = Address(*listener.getsockname())
    server = ProbeServer(listener, behaviour, clock=MonotonicClock())
    ours, theirs = socket.socketpair()
    thread = threading.Thread(target=server.serve, args=(theirs,))
    thread.start()
    try:
        yield str(address), server
    finally:
        ours.close()
        thread.join()
        theirs.close()


@contextmanager
def server(serve: Callable[[socket.socket], None]) -> Iterator[str]:
    """Accept connections and hand each to ``serve``, one after the other, until the block ends."""
    listener = socket.create_server(("127.0.0.1", 0))

    def accept() -> None:
        with suppress(OSError):
            while True:
                with listener.accept()[0] as sock:
                    serve(sock)

    thread = threading.Thread(target=accept)
    thread.start()
    try:
        yield f"127.0.0.1:{listener.getsockname()[1]}"
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()
        thread.join()


def says(first: bytes, *answers: bytes, stays: bool = False) -> Callable[[socket.socket], None]:
    """Return a server that says ``first``, then one of ``answers`` to whatever comes, and closes unless it stays."""

    def serve(sock: socket.socket) -> None:
        sock.sendall(first)
        for answer in answers:
            sock.recv(4096)
            sock.sendall(answer)
        while stays and sock.recv(4096):
            pass

    return serve


def doctor(peer: str, *options: object, count: int = 3) -> tuple[Ended, dict[str, Any]]:
    ended = cli("doctor", "tcp", peer, "--count", count, "--json", "-", *options)
    return ended, json.loads(ended.out) if ended.out else {}


def complaint(peer: str, *, echo: bool = False, timeout_s: float = 0.1) -> str:
    """Return what the doctor says of a peer that cannot be measured; the command line makes exit code 2 of it."""
    measure = measure_echo if echo else measure_responder
    with pytest.raises(HilError) as caught:
        measure(find_address(peer, timeout_s=2.0), count=1, timeout_s=timeout_s, progress=lambda *_: None)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def refused(ended: Ended, sentence: str) -> None:
    assert ended.code == 2
    assert sentence in ended.err
    assert len(ended.err.strip().splitlines()) == 1
    assert ended.out == ""


def test_a_good_peer_is_healthy_and_what_either_kernel_would_do_is_told() -> None:
    with responder(Behaviour.GOOD) as (peer, _):
        # So many that one hiccup of a busy machine is not 5 ms on average.
        ended, found = doctor(peer, count=8)
    assert (ended.code, found["healthy"]) == (0, True), found
    assert found["verdict"].startswith(f"TCP to {peer} is quick enough: a round trip takes ")
    notes = {finding["kind"]: finding["figures"] for finding in found["findings"][1:]}
    # Asked to, the same peer shows the kernel's own delay in both directions.
    for kind in ("late-acknowledgement-here", "late-acknowledgement-there"):
        assert int(notes[kind]["held_ms"]) in KERNEL_DELAY_MS
    assert [row[0] for row in found["tables"][0]["rows"]][:2] == ["one write, TCP_NODELAY", "one write, Nagle"]


@pytest.mark.parametrize(
    ("behaviour", "kind", "whose", "said"),
    [
        (Behaviour.DELAYED_ACK, "nagle-here", "application", "this side's Nagle algorithm holds the second part until"),
        (Behaviour.NAGLE, "nagle-there", "peer", "writes its reply in two parts, its Nagle algorithm holds the second"),
    ],
)
def test_the_side_whose_nagle_meets_a_delayed_acknowledgement_is_named(
    behaviour: Behaviour, kind: str, whose: str, said: str, tmp_path: Path
) -> None:
    file = tmp_path / "found.json"
    with responder(behaviour) as (peer, _):
        ended = cli("doctor", "tcp", peer, "--count", 3, "--json", file)
    assert (ended.code, ended.err) == (1, "")
    first_line = ended.out.splitlines()[0]
    assert said in first_line
    assert first_line.endswith(" ms late, as Linux does (40 ms)")
    assert "where 5 ms are allowed (manual 11.1)" in first_line
    assert "what helps, the most effective first:" in ended.out
    assert "msec) (stdDev" in ended.out
    verdict = json.loads(file.read_text())["findings"][0]
    assert (verdict["kind"], verdict["whose"]) == (kind, whose)
    assert int(verdict["figures"]["held_ms"]) in KERNEL_DELAY_MS


class Late(asyncio.Protocol):
    """A responder whose messages, or whose program, take 8 ms."""

    def __init__(self, place: str) -> None:
        self._loop = asyncio.get_running_loop()
        self._responder = Responder(Behaviour.GOOD, now_ns=elapsed_ns())
        self._in_program = place == "program"

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        transport.write(self._responder.opening(system="Linux", software="x").write)

    def data_received(self, data: bytes) -> None:
        set_quick_ack(self._transport.get_extra_info("socket"), True)
        if self._in_program:
            self._responder.receive(data, now_ns=elapsed_ns())
            self._loop.call_later(0.008, self._answer)
        else:
            self._loop.call_later(0.008, self._take, data)

    def _take(self, data: bytes) -> None:
        self._responder.receive(data, now_ns=elapsed_ns())
        self._answer()

    def _answer(self) -> None:
        for step in self._responder.steps(now_ns=elapsed_ns()):
            self._transport.write(step.write)


@pytest.mark.parametrize(
    ("place", "kind", "said"),
    [
        ("network", "slow-network", "on average even in one write with TCP_NODELAY, where 5 ms are allowed"),
        ("program", "slow-program-there", "ms of it before it replies; TCP is not the cause"),
    ],
)
async def test_what_is_slow_without_nagle_is_named(place: str, kind: str, said: str) -> None:
    async with await asyncio.get_running_loop().create_server(lambda: Late(place), "127.0.0.1", 0) as late:
        port = late.sockets[0].getsockname()[1]
        ended, found = await asyncio.to_thread(doctor, f"127.0.0.1:{port}", count=2)
    assert (ended.code, found["findings"][0]["kind"]) == (1, kind), found
    assert said in found["verdict"]


def test_an_acknowledgement_as_late_as_that_of_windows_is_told_as_such() -> None:
    with responder(Behaviour.DELAYED_ACK_200MS) as (peer, _):
        ended, found = doctor(peer, count=2)
    assert ended.code == 1
    assert found["verdict"].endswith(" ms late, as Windows does (200 ms)")
    assert any("TcpAckFrequency (REG_DWORD, value 1" in text for text in found["findings"][0]["remedies"])


def test_the_responder_as_a_process_of_a_run_and_in_its_status(tmp_path: Path) -> None:
    status = tmp_path / "status.json"
    controller = hil(
        "run", "--fri-client", "off", "--backend", "ideal", "--tcp-probe", "127.0.0.1:0", "--tcp-probe-behaviour",
        "nagle", "--status-json", status, "--progress", 0,
    )  # fmt: skip
    peer = wait_for_line(controller, "tcp probe: hil doctor tcp ")[-1].split()[5]
    ended, found = doctor(peer)
    assert (ended.code, found["findings"][0]["kind"]) == (1, "nagle-there")
    controller.send_signal(signal.SIGINT)
    run = finish(controller)
    assert run.code == 0, run.err
    assert f"tcp probe {peer}: " in run.out
    report = json.loads(status.read_text())["tcp_probe"]
    assert (report["address"], report["behaviour"], report["fault"]) == (peer, "nagle", None)
    assert report["answered"] > 10
    assert report["ended"]["closed by the other side"] == report["accepted"]


def test_strangers_get_a_sentence_and_are_counted() -> None:
    with responder(Behaviour.GOOD) as (peer, probe):
        host, port = peer.split(":")
        with socket.create_connection((host, int(port))) as stranger:
            stranger.settimeout(5)
            assert read_greeting(stranger.recv(200)) is not None
            stranger.sendall(b"GET / HTTP/1.1\r\n\r\n")
            with pytest.raises(ProbeRefused, match="is no request"):
                read_greeting(stranger.recv(300))
            assert stranger.recv(1) == b""
        many = [socket.create_connection((host, int(port)), timeout=5) for _ in range(CONNECTIONS_MOST + 1)]
        lines = [sock.recv(200) for sock in many]
        with pytest.raises(ProbeRefused, match="8 connections are served already"):
            [read_greeting(line) for line in lines]
        for sock in many:
            sock.close()
    report = probe.report()
    assert report["turned_away"] == 1
    assert report["accepted"] == CONNECTIONS_MOST + 1


def test_more_messages_than_the_machine_can_spare_end_the_connection() -> None:
    with responder(Behaviour.GOOD) as (peer, _):
        host, port = peer.split(":")
        with socket.create_connection((host, int(port)), timeout=5) as flood:
            data = b"HTPq" + bytes(8) + b"\x00\x10" + bytes(2) + bytes(16)
            with suppress(OSError):
                while b"refused" not in flood.recv(65536):
                    flood.sendall(data)
                assert flood.recv(1) == b""


@pytest.mark.parametrize(
    ("peer", "sentence"),
    [
        ("nowhere.invalid:30400", "there is no host 'nowhere.invalid'"),
        ("127.0.0.1", "'127.0.0.1' is no HOST:PORT; give both"),
        ("127.0.0.1:1", "nothing listens at TCP 127.0.0.1:1"),
    ],
)
def test_a_peer_that_cannot_be_reached_is_one_sentence_and_exit_code_2(peer: str, sentence: str) -> None:
    refused(cli("doctor", "tcp", peer), sentence)


def test_a_host_that_drops_everything_costs_the_timeout_and_no_more() -> None:
    with socket.socket() as full:
        full.bind(("127.0.0.1", 0))
        full.listen(0)
        address = full.getsockname()
        # With its queue full, Linux drops what comes: as silent as a host that is not there.
        waiting = [socket.socket() for _ in range(3)]
        for sock in waiting:
            sock.setblocking(False)
            sock.connect_ex(address)
        began_ns = elapsed_ns()
        sentence = complaint(f"127.0.0.1:{address[1]}")
        took_s = (elapsed_ns() - began_ns) * 1e-9
        for sock in waiting:
            sock.close()
    assert "did not answer within 0.1 s: there is no such machine, it is not reachable" in sentence
    assert took_s < 2.0


GREETING = b"HIL-TCP-PROBE 1 Linux x\n"


@pytest.mark.parametrize(
    ("serve", "sentence"),
    [
        (says(b"", stays=True), "and says nothing for 0.1 s: it is not the responder of hil run --tcp-probe"),
        (says(b""), "accepts connections and closes them at once"),
        (says(b"SSH-2.0-x\r\n"), "it begins with 'SSH-2.0-x\\r\\n', where 'HIL-TCP-PROBE 1 '"),
        (says(b"HIL-TCP-PROBE 1 Li"), "closes them in the middle of its first line"),
        (says(b"HIL-TCP-PROBE 1 Li", stays=True), "and stops in the middle of its first line for 0.1 s"),
        (says(b"HIL-TCP-PROBE refused: come back later\n"), "refuses to be measured: come back later"),
        (says(GREETING, b""), "closed the connection instead of answering"),
        (says(GREETING, bytes(99)), "answered what is no answer: "),
        (says(GREETING, stays=True), "did not answer 32 bytes within 0.1 s"),
    ],
)
def test_a_peer_that_is_no_responder_is_told_in_one_sentence(
    serve: Callable[[socket.socket], None], sentence: str
) -> None:
    with server(serve) as peer:
        assert sentence in complaint(peer)


@pytest.mark.parametrize(("no_delay", "code", "kind"), [(True, 0, "tcp-healthy"), (False, 1, "nagle-there")])
def test_an_echo_server_is_measured_when_told_and_its_nagle_found(no_delay: bool, code: int, kind: str) -> None:
    def echo(sock: socket.socket) -> None:
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, no_delay)
        while data := sock.recv(16):
            sock.sendall(data)

    with server(echo) as peer:
        ended, found = doctor(peer, "--echo", count=12 if no_delay else 3)
    assert (ended.code, found["findings"][0]["kind"]) == (code, kind), found


def test_what_is_no_echo_server_is_told() -> None:
    with server(says(b"", b"hello")) as peer:
        assert "sends back something else than it was sent" in complaint(peer, echo=True)


async def test_a_responder_whose_process_is_killed_is_told_and_reported() -> None:
    told = asyncio.get_running_loop().create_future()
    probe = TcpProbe(Address("127.0.0.1", 0), Behaviour.GOOD, say=told.set_result)
    try:
        os.kill(probe._process.pid, signal.SIGKILL)
        sentence = await asyncio.wait_for(told, 10)
    finally:
        probe.close()
    assert sentence == (
        f"tcp probe: nobody answers at {probe.local} any more: its process ended with code -9 before its report"
    )
    assert probe.report()["fault"] == "its process ended with code -9 before its report"


def test_a_responder_that_cannot_listen_ends_the_run_in_a_sentence() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        place = f"127.0.0.1:{taken.getsockname()[1]}"
        common = ("run", "--fri-client", "off", "--servo", "off", "--pad", "off", "--backend", "ideal", "--duration", 1)
        refused(cli(*common, "--tcp-probe", place), f"cannot listen at TCP {place}: Address already in use")
    refused(cli(*common, "--tcp-probe-behaviour", "nagle"), "needs a responder; add --tcp-probe ADDR:PORT")
