"""Faults of the client, of the wire and of this controller: live, from the recording and from packets, one sentence."""

import json
import struct
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

from hil.values.finding import Diagnosis, Severity, Whose
from hil.values.fri import Release
from hil.values.fri_messages import CommandData
from hil.values.link import Outgoing, Source
from tests.support import captures
from tests.support.cli import cli
from tests.support.faulty_run import (
    EXCELLENT_S,
    MS,
    USUAL_ANSWER_NS,
    USUAL_LATENESS_NS,
    FaultyRun,
    seen_from_outside,
)
from tests.support.recordings import packets
from tools.bench.clients import PEER
from tools.doctor.capture.diagnose import CaptureOptions, diagnose_capture
from transport.capture.records import CapturedDatagram
from transport.capture.writing import PcapngWriter
from transport.fri import FriCodec

NETWORK = {30200: "10.0.0.7", 30210: "10.0.0.2"}
FAULTY_S = 0.4


def each(milliseconds: int, wrong: int | None, usual: int) -> Callable[[int], int | None]:
    return lambda ms: wrong if ms % milliseconds == 0 else usual


def peer_late(run: FaultyRun) -> None:
    run.answer = each(25, 6_800_000, USUAL_ANSWER_NS)


def peer_silent_now_and_then(run: FaultyRun) -> None:
    run.answer = each(25, None, USUAL_ANSWER_NS)


def read_too_late(run: FaultyRun) -> None:
    run.unread = lambda ms: 1 <= ms % 25 <= 6
    run.lateness = lambda ms: 6 * MS if ms % 25 == 6 else USUAL_LATENESS_NS


def sent_in_bursts(run: FaultyRun) -> None:
    run.lateness = lambda ms: 4 * MS if ms % 25 == 0 else USUAL_LATENESS_NS
    run.answer = each(25, 6_200_000, USUAL_ANSWER_NS)


def both_late(run: FaultyRun) -> None:
    run.lateness = lambda ms: 3 * MS if ms % 25 == 0 else USUAL_LATENESS_NS
    run.answer = each(25, 6_200_000, USUAL_ANSWER_NS)


def peer_gone(run: FaultyRun) -> None:
    gone_ms = run.now_ns // MS + 15
    run.answer = lambda ms: None if gone_ms <= ms < gone_ms + 60 else USUAL_ANSWER_NS


class Fault(NamedTuple):
    cause: Callable[[FaultyRun], None]
    whose: Whose
    live: str
    outside: str
    """What the packets alone tell."""


ENDS = "which ends the overlay: "
FAULTS = [
    Fault(
        peer_late,
        Whose.PEER_OR_WIRE,
        " us), its answer took 6.8 ms of the 5 ms allowed (median 0.4 ms); peer or wire, not this controller",
        "its answer took 6.8 ms of the 5 ms allowed (median 0.4 ms); peer or wire, not the controller",
    ),
    Fault(
        peer_silent_now_and_then,
        Whose.PEER_OR_WIRE,
        " us), no answer to it came (median 0.4 ms, 5 ms are allowed); peer or wire, not this controller",
        "no answer to it came (median 0.4 ms, 5 ms are allowed); peer or wire, not the controller",
    ),
    Fault(
        read_too_late,
        Whose.CONTROLLER,
        " us) and a cycle behind it began 6 ms late, its answer came in time, after 0.4 ms, and was read after the "
        "5 ms allowed; this controller, not peer or wire",
        "though every answer of the second before passed the place of the capture in time: the wire between there and "
        "the controller, or the controller itself",
    ),
    Fault(
        sent_in_bursts,
        Whose.CONTROLLER,
        " ms late, its answer took 6.2 ms of the 5 ms allowed (median 0.4 ms); this controller, not peer or wire",
        " ms late, its answer took 6.2 ms of the 5 ms allowed (median 0.4 ms); the controller, not peer or wire",
    ),
    Fault(
        both_late,
        Whose.BOTH,
        " ms late, its answer took 6.2 ms of the 5 ms allowed (median 0.4 ms); both this controller and peer or wire",
        " ms late, its answer took 6.2 ms of the 5 ms allowed (median 0.4 ms); both the controller and peer or wire",
    ),
    Fault(
        peer_gone,
        Whose.PEER_OR_WIRE,
        "client lost at cycle 1666: 10 answers in a row are missing, 50 ms of silence where the watchdog allows 50 ms; "
        "the last answer was to message 322, ",
        "no answer to it came (median 0.4 ms, 5 ms are allowed); peer or wire, not the controller",
    ),
]


def diagnosis(file: Path) -> Diagnosis:
    return diagnose_capture(file, CaptureOptions()).diagnosis


def place(found: Diagnosis) -> str:
    return next(row[1] for row in found.tables[0].rows if row[0] == "place")


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.cause.__name__)
def test_live_recorded_and_from_packets_the_fault_is_named(fault: Fault, tmp_path: Path) -> None:
    file = tmp_path / "run.pcapng"
    run = FaultyRun(file)
    run.run(EXCELLENT_S)
    assert not run.found
    fault.cause(run)
    run.run(FAULTY_S)
    run.close()

    (live,) = [finding for finding in run.found if fault.live in finding.sentence and _is_end(finding.sentence)]
    assert live.severity is Severity.FAULT
    assert live.whose is fault.whose
    assert live.remedies

    offline = diagnosis(file)
    assert offline.verdict == live
    assert set(map(str, offline.findings)) == set(map(str, run.found))

    foreign = diagnosis(seen_from_outside(file, tmp_path / "outside.pcapng", NETWORK))
    assert foreign.verdict.sentence.startswith("quality GOOD -> FAIR at message ")
    assert foreign.verdict.sentence.endswith(fault.outside)
    assert place(foreign).endswith("so wire and peer cannot be split")


def _is_end(sentence: str) -> bool:
    return ENDS in sentence or sentence.startswith("client lost")


def test_counts_are_by_whose_fault(tmp_path: Path) -> None:
    run = FaultyRun(tmp_path / "run.pcapng")
    run.run(EXCELLENT_S)
    peer_late(run)
    run.run(0.1)
    peer_silent_now_and_then(run)
    run.run(0.1)
    run.answer = lambda _: USUAL_ANSWER_NS
    read_too_late(run)
    run.run(0.1)
    run.close()
    report = run.controller.report()
    assert report["answers_at_fault"] == {
        "late": {"controller": 8, "peer_or_wire": 4, "both": 0},
        "missing": {"controller": 0, "peer_or_wire": 4, "both": 0},
        "messages_skipped": 0,
    }
    slowest = report["slowest_answers"]
    assert isinstance(slowest, list)
    assert slowest[0]["peer_and_wire_us"] == 6800.0


def test_slow_answers_that_cost_excellent_are_named(tmp_path: Path) -> None:
    run = FaultyRun(tmp_path / "run.pcapng")
    run.run(EXCELLENT_S)
    run.answer = each(25, 3_100_000, USUAL_ANSWER_NS)
    run.run(FAULTY_S)
    run.close()
    (found,) = run.found
    assert found.severity is Severity.NOTE
    assert "its answer took 3.1 ms, in time, but half of the 5 ms allowed or more (median 0.4 ms), as 11 of 200" in str(
        found
    )


def test_messages_that_were_skipped_are_this_controllers(tmp_path: Path) -> None:
    run = FaultyRun(tmp_path / "run.pcapng")
    run.run(0.5)
    run.skip(12)
    run.run(0.1)
    run.close()
    (found,) = run.found
    assert found.whose is Whose.CONTROLLER
    assert str(found).startswith("2 messages were not sent: no cycle ran for 12 ms before cycle 500; this controller")


def test_a_wire_that_overtakes_is_not_this_controller(tmp_path: Path) -> None:
    run = FaultyRun(tmp_path / "run.pcapng", fri={"send_period_ms": 1, "receive_multiplier": 1}, cycle_ms=1)
    run.run(EXCELLENT_S)
    run.answer = lambda ms: 980_000 if ms % 20 == 0 else 20_000 if ms % 20 == 1 else USUAL_ANSWER_NS
    run.lateness = lambda ms: 30_000 if ms % 20 else 130_000
    run.run(FAULTY_S)
    run.close()
    late = run.controller.report()["answers_at_fault"]
    assert isinstance(late, dict)
    assert late["late"]["controller"] == late["missing"]["controller"] == 0


def test_of_a_window_of_messages_none_of_which_was_answered_the_window_is_named(tmp_path: Path) -> None:
    run = FaultyRun(tmp_path / "run.pcapng", fri={"send_period_ms": 2, "receive_multiplier": 3})
    run.run(EXCELLENT_S)
    run.answer = lambda ms: None if ms % 36 < 6 else USUAL_ANSWER_NS
    run.run(FAULTY_S)
    run.close()
    told = [str(found) for found in run.found if found.severity is Severity.FAULT]
    assert any(", no answer to them came (median 0.4 ms, 6 ms are allowed)" in text for text in told), run.found


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A recording of a client that was late."""
    file = tmp_path_factory.mktemp("late") / "run.pcapng"
    run = FaultyRun(file)
    run.run(EXCELLENT_S)
    peer_late(run)
    run.run(FAULTY_S)
    run.close()
    return file.read_bytes()


@pytest.fixture
def recording(late: bytes, tmp_path: Path) -> Path:
    file = tmp_path / "run.pcapng"
    file.write_bytes(late)
    return file


def test_on_one_machine_there_is_no_wire_to_blame(recording: Path, tmp_path: Path) -> None:
    found = diagnosis(seen_from_outside(recording, tmp_path / "outside.pcapng", {}))
    assert found.verdict.sentence.endswith("the client, not the controller")
    assert found.verdict.whose is Whose.PEER


def test_a_frame_whose_checksum_is_not_there_yet_tells_whose_machine_it_was(tmp_path: Path) -> None:
    file = tmp_path / "run.pcapng"
    run = FaultyRun(file)
    run.run(0.3)
    run.close()
    outside = seen_from_outside(file, tmp_path / "outside.pcapng", NETWORK)
    content = bytearray(outside.read_bytes())
    for packet in packets(outside):
        if packet.source[1] == PEER.port:
            at = content.index(packet.frame, packet.offset) + packet.payload_at - 2
            content[at : at + 2] = b"\x12\x34"
    outside.write_bytes(content)
    assert place(diagnosis(outside)) == "taken on the client's machine: the wire is not in the answer times"


@pytest.mark.parametrize(
    ("configured", "client", "spoken"),
    [
        (Release.V1_15, Release.V2_7, "speaks 2.7"),
        (Release.V2_5, Release.V2_7, "speaks 2.7"),
        (Release.V2_7, Release.V1_15, "speaks 1.x"),
        (Release.V2_7, Release.V2_5, "speaks 2.5"),
        (Release.V1_15, Release.V2_5, "seems to speak 2.5"),
        (Release.V2_5, Release.V1_15, "seems to speak 1.x"),
    ],
)
def test_a_client_of_another_release_is_recognised_with_the_remedy(
    configured: Release, client: Release, spoken: str, tmp_path: Path
) -> None:
    file = tmp_path / "run.pcapng"
    run = FaultyRun(file, release=configured)
    right, wrong = FriCodec(configured), FriCodec(client)
    answer = run._client.answer

    def of_other_release(outgoing: Sequence[Outgoing]) -> Iterator[tuple[Source, bytes]]:
        for source, payload in answer(outgoing):
            data = None
            if client is Release.V1_15:
                monitor = right.decode_monitoring(outgoing[0].payload).monitor
                assert monitor is not None
                data = CommandData(position=monitor.measured_position)
            yield source, wrong.encode_command(right.decode_command(payload)._replace(command=data))

    run._client.answer = of_other_release  # type: ignore[method-assign, assignment]
    run.run(0.2)
    run.close()
    (live,) = run.found
    assert live.whose is Whose.CONFIGURATION
    assert f"the client at {PEER} {spoken}, the controller is configured for {configured}" in live.sentence
    assert live.remedies[0].startswith(f"start the controller with --fri-version {client}")
    for capture in (file, seen_from_outside(file, tmp_path / "outside.pcapng", {})):
        assert diagnosis(capture).verdict.sentence == live.sentence


def test_a_client_that_never_answers_is_told_with_what_would_be_silent_too(tmp_path: Path) -> None:
    file = tmp_path / "run.pcapng"
    run = FaultyRun(file, release=Release.V2_7)
    run.answer = lambda _: None
    run.run(0.5)
    run.close()
    for capture in (file, seen_from_outside(file, tmp_path / "outside.pcapng", NETWORK)):
        found = diagnosis(capture)
        assert found.verdict.severity is Severity.FAULT
        assert f"the client at {NETWORK[30200] if capture is not file else PEER.host}:30200 never answered" in str(
            found.verdict
        )
        assert "(1.x and 2.5 clients stay silent here)" in str(found.verdict)


@pytest.mark.parametrize(
    "name", ["fri-1.15-io-10ms", "fri-1.15-torque-sine-2ms", "fri-2.7-joint-sine-2ms-multiplier3", "fri-2.5-trafo-10ms"]
)
def test_the_recorded_clients_are_healthy(name: str) -> None:
    ended = cli("doctor", "capture", captures.FOLDER / f"{name}.pcapng")
    assert ended.code == 0, ended.out
    assert ended.out.startswith("the connection was healthy: ")
    assert "quality EXCELLENT at the end" in ended.out.splitlines()[0]


def test_a_capture_without_fri_is_refused_in_a_sentence(tmp_path: Path) -> None:
    file = tmp_path / "other.pcapng"
    with PcapngWriter(file) as writer:
        writer.write(CapturedDatagram(1, ("10.0.0.1", 53), ("10.0.0.2", 4000), b"no robot speaks so"))
    ended = cli("doctor", "capture", file)
    assert (ended.code, ended.out) == (2, "")
    told = "holds no FRI to diagnose: 1 UDP datagrams, none of them a monitoring message of FRI"
    assert ended.err == f"hil: capture {file}: {told}\n"


def test_what_is_before_the_damage_is_diagnosed(recording: Path, tmp_path: Path) -> None:
    whole = seen_from_outside(recording, tmp_path / "outside.pcapng", NETWORK)
    for capture in (recording, whole):
        content = capture.read_bytes()
        capture.write_bytes(content[: len(content) - 2000] + struct.pack("<II", 6, 1) + bytes(90))
        ended = cli("doctor", "capture", capture)
        assert ended.code == 2
        assert ended.out.startswith("quality GOOD -> FAIR at ")
        assert "; what is before that was diagnosed" in ended.out


def test_a_recording_that_does_not_replay_is_judged_from_its_packets(recording: Path) -> None:
    altered = packets(recording)[400]
    content = bytearray(recording.read_bytes())
    content[content.index(altered.payload, altered.offset) + len(altered.payload) - 1] ^= 1
    recording.write_bytes(content)
    ended = cli("doctor", "capture", recording, "--json", "-")
    assert ended.code == 1
    found = json.loads(ended.out)
    assert found["verdict"].startswith("quality GOOD -> FAIR at message ")
    assert found["findings"][-1]["sentence"].startswith(
        "the recording does not replay exactly, so it was judged from its packets alone: "
    )
