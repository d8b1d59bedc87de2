"""Recordings that are not ours to the byte: an emulator beside them, and what the report says of the two."""

import json
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hil.config.station import RobotConfig
from hil.replay.guess import DEFAULT_QUALITY_RISE_MS, flow_of
from hil.replay.replay import Wish, replay_file
from hil.replay.result import ReplayResult
from hil.values.fri import OverlayKind, Release
from tests.support.recordings import fri_robot, header_of, packets, record, records, rewrite, servo_robot
from transport.capture.records import CapturedDatagram, CaptureRecord, Notes, Packet
from transport.capture.writing import PcapngWriter
from transport.fri import FriCodec

ELSEWHERE = {("127.0.0.1", 30210): ("172.31.1.147", 30200), ("127.0.0.1", 30200): ("172.31.1.10", 30200)}


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of 2 s at 5 ms with the sine in its second half."""
    file = tmp_path_factory.mktemp("elsewhere") / "ours.pcapng"
    return record(file, fri_robot(backend="mujoco", fri={"send_period_ms": 5}), 2.0)


@pytest.fixture
def file(ours: Path, tmp_path: Path) -> Path:
    copy = tmp_path / "run.pcapng"
    copy.write_bytes(ours.read_bytes())
    return copy


def without_notes(file: Path, *, addresses: bool = False, comment: bool = True) -> Path:
    """As editcap or tcpdump would have it."""
    found = packets(file)
    told = json.dumps(json.loads(header_of(file).to_comment())) if comment else None
    with PcapngWriter(file, comment=told) as writer:
        for one in found:
            source, destination = one.source, one.destination
            if addresses:
                source, destination = ELSEWHERE[source], ELSEWHERE[destination]
            writer.write(CapturedDatagram(one.at_unix_ns, source, destination, one.payload))
    return file


def close(result: ReplayResult) -> None:
    """The emulator beside a recording of our own does the same but for the jitter that is not known to it."""
    assert result.compared > 200
    assert not result.own
    assert not result.damage
    apart = result.fields.get("session state")
    assert apart is None or apart.count <= 20
    assert all(tally.largest < 1e-3 for name, tally in result.fields.items() if name in {"A4 measured", "A4 commanded"})
    emulated = [state for _, whose, _, state in result.states if whose == "emulator"]
    recorded = [state for _, whose, _, state in result.states if whose == "recording"]
    assert emulated == recorded
    assert "COMMANDING_ACTIVE" in recorded


def test_without_the_notes_it_is_compared_with_the_configuration_it_has(file: Path) -> None:
    result = replay_file(without_notes(file))
    close(result)
    assert "the recorder's notes are not in the file: compared, not replayed to the byte" in result.notes


def test_without_anything_of_ours_it_is_compared_as_it_looks(file: Path) -> None:
    result = replay_file(without_notes(file, addresses=True, comment=False))
    close(result)
    assert any("releases 1.11, 1.14, 1.15 and 1.16 look the same here" in note for note in result.notes)


def test_another_release_that_cannot_be_is_refused_in_a_note(file: Path) -> None:
    result = replay_file(without_notes(file, comment=False), wish=Wish(release=Release.V2_7))
    assert "arm: the datagrams are those of release 1.15, not 2.7, which was asked for" in result.notes
    close(result)


def test_another_release_that_can_be_is_taken(file: Path) -> None:
    result = replay_file(without_notes(file, comment=False), wish=Wish(release=Release.V1_11))
    assert not result.notes
    close(result)


def as_pcap(file: Path, *, nanoseconds: bool, big: bool, vlan: bool) -> Path:
    """As tcpdump writes it: classic pcap."""
    order = ">" if big else "<"
    magic = 0xA1B23C4D if nanoseconds else 0xA1B2C3D4
    ticks_per_s = 10**9 if nanoseconds else 10**6
    content = struct.pack(f"{order}IHHiIII", magic, 2, 4, 0, 0, 262144, 1)
    for one in packets(file):
        frame = one.frame[:12] + b"\x81\x00\x00\x07" + one.frame[12:] if vlan else one.frame
        seconds, rest = divmod(one.at_unix_ns, 10**9)
        head = struct.pack(f"{order}IIII", seconds, rest * ticks_per_s // 10**9, len(frame), len(frame))
        content += head + frame
    file.write_bytes(content)
    return file


@pytest.mark.parametrize("nanoseconds", [True, False])
@pytest.mark.parametrize("big", [True, False])
@pytest.mark.parametrize("vlan", [True, False])
def test_classic_pcap_with_vlan_tags_is_compared_too(file: Path, nanoseconds: bool, big: bool, vlan: bool) -> None:
    close(replay_file(as_pcap(file, nanoseconds=nanoseconds, big=big, vlan=vlan)))


def test_a_truncated_pcap_is_compared_up_to_the_damage(file: Path) -> None:
    whole = replay_file(as_pcap(file, nanoseconds=True, big=False, vlan=False)).compared
    file.write_bytes(file.read_bytes()[:-100])
    result = replay_file(file)
    assert "truncated" in result.damage
    assert whole - 2 <= result.compared < whole


def dropping(condition: Callable[[Packet], bool]) -> Callable[[CaptureRecord], Iterator[CaptureRecord]]:
    def change(one: CaptureRecord) -> Iterator[CaptureRecord]:
        if isinstance(one, Packet) and not condition(one):
            yield one

    return change


def test_a_recording_that_misses_its_start_is_compared(file: Path) -> None:
    begin = packets(file)[0].at_unix_ns
    rewrite(file, dropping(lambda one: one.at_unix_ns < begin + 500_000_000), comment="{}")
    result = replay_file(file)
    assert result.compared > 200
    assert result.states[0][1:] == ("recording", 0.0, "MONITORING_WAIT")
    assert [state for _, whose, _, state in result.states if whose == "emulator"][-1] == "IDLE"


def test_a_recording_that_begins_while_commanding_is_compared(file: Path) -> None:
    begin = packets(file)[0].at_unix_ns
    rewrite(file, dropping(lambda one: one.at_unix_ns < begin + 1_500_000_000), comment="{}")
    result = replay_file(file)
    assert result.compared > 90
    assert result.states[0][1:] == ("recording", 0.0, "COMMANDING_ACTIVE")
    assert "their session states are not the same in" in result.verdict


def test_messages_that_were_not_recorded_are_counted(file: Path) -> None:
    found = [one for one in packets(file) if one.source == ("127.0.0.1", 30210)]
    gone = {one.number for one in found[150:160]}
    rewrite(file, dropping(lambda one: one.number in gone), comment="{}")
    result = replay_file(file)
    assert result.missing == len(gone) == 10
    assert any(note.startswith("arm: messages are missing in the recording, first at t=0.8") for note in result.notes)
    close(result)


def test_another_session_begins_anew(file: Path) -> None:
    first = records(file)
    end_ns = packets(file)[-1].at_unix_ns
    begin_ns = packets(file)[0].at_unix_ns
    with PcapngWriter(file, comment=None) as writer:
        for shift_ns in (0, end_ns - begin_ns + 10**9):
            for one in first:
                if isinstance(one, Packet):
                    datagram = one.datagram
                    writer.write(
                        CapturedDatagram(
                            datagram.at_unix_ns + shift_ns, datagram.source, datagram.destination, datagram.payload
                        )
                    )
    result = replay_file(file)
    assert any("another session begins with packet" in note for note in result.notes)
    assert [state for _, whose, _, state in result.states if whose == "emulator"].count("COMMANDING_ACTIVE") == 2


def test_a_recording_begun_later_says_so(file: Path) -> None:
    told = json.loads(header_of(file).to_comment())
    told["robots"][0]["cycles_before"] = 4321
    result = replay_file(rewrite(file, lambda one: iter((one,)), comment=json.dumps(told)))
    assert (
        "the recording began 4321 cycles after the controller did: compared, not replayed to the byte" in result.notes
    )
    close(result)


def test_the_servo_link_is_not_compared_without_its_notes(tmp_path: Path) -> None:
    file = record(tmp_path / "run.pcapng", servo_robot(), 0.2)
    result = replay_file(without_notes(file))
    assert result.verdict.startswith("nothing to compare")
    assert "the servo link needs the whole recording: only FRI is compared" in result.notes
    assert result.strangers == len(packets(file))


def test_foreign_traffic_is_nothing_to_compare(tmp_path: Path) -> None:
    file = tmp_path / "foreign.pcapng"
    with PcapngWriter(file) as writer:
        for number in range(50):
            writer.write(CapturedDatagram(number, ("10.0.0.1", 53), ("10.0.0.2", 53), bytes([number] * number)))
    assert replay_file(file).verdict.startswith("nothing to compare")


def test_inputs_of_the_recorded_robot_are_set_here_too(tmp_path: Path) -> None:
    io = ({"name": "FRI", "signal": ({"name": "Clock", "type": "digital", "direction": "input", "initial": 3},)},)
    file = record(tmp_path / "run.pcapng", fri_robot(io=io, fri={"send_period_ms": 5}), 0.3)
    codec = FriCodec(Release.V1_15)

    def tick(one: CaptureRecord) -> Iterator[CaptureRecord]:
        if isinstance(one, Notes):
            return
        if one.source == ("127.0.0.1", 30210):
            message = codec.decode_monitoring(one.payload)
            assert message.monitor is not None
            clock = message.monitor.inputs_outputs[0]._replace(digital=message.sequence_counter // 7)
            message = message._replace(monitor=message.monitor._replace(inputs_outputs=(clock,)))
            one = one._replace(payload=codec.encode_monitoring(message))
        yield one

    result = replay_file(rewrite(file, tick, comment="{}"))
    assert result.compared > 50
    assert not [name for name in result.fields if "inputs outputs" in name]


@pytest.mark.parametrize(
    ("release", "overlay", "known"),
    [
        (Release.V1_15, OverlayKind.JOINT_POSITION, False),
        (Release.V2_5, OverlayKind.TORQUE, True),
        (Release.V2_7, OverlayKind.WRENCH, True),
    ],
)
def test_release_overlay_and_period_are_seen_in_the_packets(
    tmp_path: Path, release: Release, overlay: OverlayKind, known: bool
) -> None:
    fri = {"overlay": overlay, "send_period_ms": 2, "receive_multiplier": 1}
    file = record(tmp_path / "run.pcapng", fri_robot(release, backend="mujoco", fri=fri), 1.2)
    sent = [one for one in packets(file) if one.destination == ("127.0.0.1", 30200)]
    flow = flow_of(sent[0], None)
    assert flow is not None
    codec = FriCodec(release)
    for one in sent:
        flow.look(codec.decode_monitoring(one.payload), one.at_unix_ns)
    assert (flow.release, flow.sure) == (release, known)
    assert flow.known
    config = flow.config(RobotConfig(), backend=None)
    assert config.fri is not None
    assert config.fri.overlay is overlay
    assert config.fri.send_period_ms == 2
    assert 1 <= config.fri.quality_rise_ms <= DEFAULT_QUALITY_RISE_MS
    assert flow.initial_position_rad == pytest.approx((0.0, 0.5236, 0.0, 0.6981, 0.0, 1.5708, 0.0), abs=1e-3)


def test_an_answer_is_no_flow(file: Path) -> None:
    answer = next(one for one in packets(file) if one.destination == ("127.0.0.1", 30210))
    assert flow_of(answer, None) is None
