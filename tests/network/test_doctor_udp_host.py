"""``hil doctor udp`` against real controllers over real sockets, ``hil doctor host`` on a CPU others want too."""

import json
import os
import re
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from hil.cli.doctor.host import host
from hil.cli.doctor.udp import udp
from hil.clock import MonotonicClock
from hil.values.errors import EndpointError, HilError
from hil.values.finding import Whose
from hil.values.fri import Release
from hil.values.link import Address
from hil.values.servo import PROTOCOL_VERSION, Goodbye
from tests.network.test_impair import impairment
from tests.support.cli import cli
from tests.support.processes import own_host
from tests.support.servo_process import ServoController, servo_controller
from tests.support.servo_served import served
from tools.doctor.host import diagnose_host
from tools.doctor.udp import diagnose_udp, measure, opening
from tools.doctor.udp.fri import diagnose_fri
from tools.doctor.udp.stamped import StampedSocket
from transport.servo import ServoCodec
from transport.udp import parse_address

pytestmark = pytest.mark.alone

KEY = bytes(range(32))


@pytest.fixture(scope="module")
def fri_client() -> Address:
    """Where the controller expects its FRI client."""
    return Address(own_host(), 30200)


@pytest.fixture(scope="module")
def controller(fri_client: Address) -> Iterator[ServoController]:
    """One controller for all, with both links."""
    with servo_controller("--fri-client", fri_client, "--fri-version", "2.5", "--send-period", 20) as running:
        yield running


def test_a_healthy_link(controller: ServoController, tmp_path: Path) -> None:
    # This machine may be busy: what is sure is that nothing is lost, and that the figures are there.
    file = tmp_path / "found.json"
    ended = cli("doctor", "udp", controller.address, "--seconds", 0.6, "--period-ms", 20, "--json", file)
    assert ended.code in {0, 1}, ended.err
    found = json.loads(file.read_text())
    figures = found["findings"][0]["figures"]
    assert (figures["states_lost"], figures["requests_lost"]) == (0, 0)
    assert figures["requests_sent"] >= 25
    assert 0.02 < figures["network_p50_ms"] <= figures["round_trip_p50_ms"] < 100
    assert ended.out.splitlines()[0] == found["verdict"]
    if ended.code == 0:
        assert re.match(
            rf"nothing wrong between this host and {controller.address}: none of \d+ states and \d+ requests was lost",
            found["verdict"],
        )


def test_a_bad_network_is_named_with_its_figures(controller: ServoController, tmp_path: Path) -> None:
    faults = ("--fault", "loss=20%:to-peer", "--fault", "loss=10%:to-controller", "--fault", "delay=5ms")
    with impairment(tmp_path, "--link", "servo", *faults, "--seed", 3, to=controller.address) as running:
        where, port = running.address
        ended = cli("doctor", "udp", f"{where}:{port}", "--seconds", 0.8, "--period-ms", 10, "--json", "-")
    assert ended.code == 1, ended.err
    verdict = json.loads(ended.out)["findings"][0]
    assert (verdict["kind"], verdict["whose"]) == ("link-loss", "wire")
    figures = verdict["figures"]
    lost = running.report["faults"][0]["lost"]
    assert 0.5 * lost - 3 <= figures["states_lost"] <= lost
    assert figures["network_p50_ms"] >= 10.0
    told = re.search(
        r"packets are lost: ([\d.]+) % of what the controller sent was lost \((\d+) of (\d+) states\), ([\d.]+) % of "
        r"what this host sent \((\d+) of (\d+) requests\)",
        verdict["sentence"],
    )
    assert told is not None, verdict["sentence"]
    assert float(told[1]) == pytest.approx(20, abs=12)
    assert int(told[5]) == figures["requests_lost"] > 0


def test_who_watches_is_no_commander_and_takes_no_seat_for_long(controller: ServoController) -> None:
    with ExitStack() as stack:
        codec, address = ServoCodec(), parse_address(controller.address, default_port=1)
        clock = MonotonicClock()
        socks = [stack.enter_context(StampedSocket(address, clock)) for _ in range(64)]
        joined = []
        with suppress(EndpointError):
            # Who left through a bad network a moment ago may still hold a seat.
            for sock in socks:
                joined.append(opening.join(sock, codec, period_ms=100, has_key=False, within_s=3.0))  # noqa: PERF401
        assert joined[-1].first.snapshot.commander == ""
        full = cli("doctor", "udp", controller.address)
        for sock, one in zip(socks, joined, strict=False):
            sock.send(codec.encode_from_client(Goodbye(one.welcome.token, one.commands_sent + 1)))
    assert (full.code, full.out) == (2, "")
    assert full.err == (
        f"hil: the controller at {controller.address} gives no seat: 64 observers watch already, no more are served\n"
    )


def test_another_version_is_told_in_the_controllers_words(
    controller: ServoController, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opening, "PROTOCOL_VERSION", PROTOCOL_VERSION + 1)
    ended = cli("doctor", "udp", controller.address)
    assert ended.code == 2
    assert f"gives no seat: the application speaks version {PROTOCOL_VERSION + 1} of the servo link" in ended.err


@pytest.mark.parametrize(
    ("address", "sentence"),
    [
        ("no.such.host.invalid", "there is no host 'no.such.host.invalid' with an IPv4 address"),
        ("127.0.0.1:0", "a controller has a port of its own, 1..65535"),
        ("127.0.0.1:x", "the port 'x' is no number"),
        ("::1", "the links run over IPv4"),
    ],
)
def test_an_address_nobody_can_be_at(address: str, sentence: str) -> None:
    with pytest.raises(HilError, match=re.escape(sentence)):
        udp(address)


def test_nobody_there_ends_in_one_sentence_and_exit_code_2() -> None:
    ended = cli("doctor", "udp", f"{own_host()}:9")
    assert (ended.code, ended.out) == (2, "")
    assert re.fullmatch(
        r"hil: nothing listens at UDP [\d.]+:9: its machine answers that the port is closed; .*\n", ended.err
    )


def test_silence_and_a_key_that_does_not_fit() -> None:
    def refused(address: Address, codec: ServoCodec, *, has_key: bool) -> str:
        with pytest.raises(EndpointError) as raised:
            diagnose_udp(address, codec, seconds=1, has_key=has_key, answer_within_s=0.1)
        return str(raised.value)

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind((own_host(), 0))
        address = Address(*silent.getsockname())
        assert refused(address, ServoCodec(), has_key=False) == (
            f"no answer from UDP {address} within 0.1 s: something on the way drops the packets (firewall, wrong "
            "address), or a controller is there and is silent to us: it has a key (then give it: --servo-key FILE)"
        )
        assert refused(address, ServoCodec(KEY), has_key=True).endswith(
            "it has another key than the one given, or none"
        )
    with served(key=KEY) as keyed:
        address = parse_address(keyed.address, default_port=1)
        assert "it has a key (then give it" in refused(address, ServoCodec(), has_key=False)
        assert "another key than the one given" in refused(address, ServoCodec(KEY[::-1]), has_key=True)
        diagnosis = diagnose_udp(address, ServoCodec(KEY), seconds=0.2, has_key=True)
        assert diagnosis.verdict.figures["requests_lost"] == 0


def test_what_answers_but_is_no_controller_is_told_so() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as echo:
        echo.bind((own_host(), 0))
        echo.settimeout(2)

        def answer() -> None:
            _, sender = echo.recvfrom(2048)
            echo.sendto(b"HTTP/1.1 400 Bad Request", sender)

        thread = threading.Thread(target=answer)
        thread.start()
        with pytest.raises(EndpointError, match="what answers is no controller's servo link"):
            diagnose_udp(Address(*echo.getsockname()), ServoCodec(), seconds=1, answer_within_s=0.2)
        thread.join()


def test_a_controller_that_falls_silent_ends_the_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measure, "SILENCE_NS", 200_000_000)
    with served() as controller:

        def fall_silent() -> None:
            controller.deaf = True

        timer = threading.Timer(0.3, fall_silent)
        timer.start()
        address = parse_address(controller.address, default_port=1)
        diagnosis = diagnose_udp(address, ServoCodec(), seconds=30)
        timer.join()
    assert diagnosis.verdict.kind == "link-ended"
    assert "nothing came any more for 0.2 s" in diagnosis.verdict.sentence


def test_the_fri_link_from_where_its_client_will_stand(controller: ServoController, fri_client: Address) -> None:
    ended = cli(
        "doctor", "udp", fri_client.host, "--fri", fri_client, "--fri-version", "2.5", "--seconds", 0.6, "--json", "-"
    )
    assert ended.code in {0, 1}, ended.err
    found = json.loads(ended.out)
    figures = found["findings"][0]["figures"]
    assert (figures["states_lost"], figures["period_ms"]) == (0, 20)
    assert figures["states_sent"] >= 20
    # A new session is POOR, and rises after half a second: it says so while it is.
    told = " ".join(one["sentence"] for one in found["findings"])
    assert re.search(r"answers are confirmed after \d+\.\d\d ms|quality (POOR|FAIR)|late|jitter", told), told
    title = found["tables"][0]["title"]
    assert re.search(r"s with FRI 2\.5, (MONITORING|COMMANDING)_\w+, quality \w+: messages every 20 ms", title)


def test_another_release_and_a_silent_controller_are_told_apart(
    controller: ServoController, fri_client: Address
) -> None:
    def refused(bind: Address) -> str:
        with pytest.raises(EndpointError) as raised:
            diagnose_fri(Address(fri_client.host, 0), bind=bind, release=Release.V1_15, seconds=1, answer_within_s=0.15)
        return str(raised.value)

    assert re.search(
        r"no datagram was a monitoring message of release 1\.15: \d+ (shape|other_release)", refused(fri_client)
    )
    silent = refused(Address(own_host(), 0))
    assert "nothing came from" in silent
    assert "in FRI the controller speaks first" in silent


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"fri_version": Release.V2_7}, "--fri-version is of the FRI link: give --fri PORT too"),
        ({"fri": "30200", "period_ms": 5}, "--servo-key and --period-ms are of the servo link"),
        ({"fri": "192.0.2.1:30200"}, "cannot bind UDP 192.0.2.1:30200"),
    ],
)
def test_options_that_do_not_fit(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(HilError, match=re.escape(sentence)):
        udp("127.0.0.1", **options)


def test_our_own_socket_s_losses_are_ours() -> None:
    # Read nothing while far more comes than the buffer holds.
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.bind((own_host(), 0))
        with StampedSocket(Address(*sender.getsockname()), MonotonicClock()) as sock:
            sock.send(b"here I am")
            _, address = sender.recvfrom(100)
            for _ in range(600):
                sender.sendto(bytes(1400), address)
            heard = 0
            while sock.receive(0) is not None:
                heard += 1
            sender.sendto(b"after", address)
            last = sock.receive(1)
    assert last is not None
    if sys.platform == "linux":
        assert sock.dropped == 600 - heard > 0
        assert last.waited_ns is not None
        assert last.waited_ns >= 0


@contextmanager
def starved(others: int) -> Iterator[None]:
    """Keep this process on one CPU, which ``others`` busy ones want too."""
    before = os.sched_getaffinity(0)
    cpu = max(before)
    busy = f"import os\nos.sched_setaffinity(0, {{{cpu}}})\nprint(flush=True)\nwhile True: pass"
    hogs = [subprocess.Popen([sys.executable, "-c", busy], stdout=subprocess.PIPE) for _ in range(others)]
    try:
        for hog in hogs:
            assert hog.stdout is not None
            hog.stdout.readline()
        os.sched_setaffinity(0, {cpu})
        yield
    finally:
        os.sched_setaffinity(0, before)
        for hog in hogs:
            hog.kill()
            hog.communicate()


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system does not keep a process on a CPU")
def test_a_starved_host_names_what_starves_it() -> None:
    with starved(4):
        diagnosis = diagnose_host(seconds=0.7, cycle_ms=1)
    verdict = diagnosis.verdict
    assert verdict.whose is Whose.HOST
    assert re.match(
        r"this host cannot hold 1 kHz: .*lateness p99 \d+ us \(bound 200\), longest [\d.]+ ms, \d+ of \d+ cycles miss",
        verdict.sentence,
    ), verdict.sentence
    assert re.search(
        r"its process was ready to run and had no CPU [\d.]+ % of the time; others took it: .*python\S* \(\d+\) \d+ %",
        verdict.sentence,
    ), verdict.sentence
    assert any("stop what competes, or keep it off a CPU" in remedy for remedy in verdict.remedies)


def test_the_command_tells_verdict_and_readings() -> None:
    ended = cli("doctor", "host", "--seconds", 0.2, "--cycle-ms", 20, "--json", "-")
    found = json.loads(ended.out)
    assert ended.code == (0 if found["healthy"] else 1)
    assert found["findings"][0]["kind"] == "host-timing"
    assert "50 Hz" in found["verdict"]
    assert [table["title"] for table in found["tables"]] == [
        "lateness of the timer, 10 cycles of 20 ms",
        "this host, while it was measured",
    ]


def test_a_result_that_cannot_be_written_is_told_before_it_begins(tmp_path: Path) -> None:
    with pytest.raises(HilError, match="that is a folder"):
        host(json_file=str(tmp_path))
    with pytest.raises(HilError, match="that is a folder"):
        udp("127.0.0.1:9", json_file=str(tmp_path))
