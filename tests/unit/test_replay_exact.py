"""A recording of ours through a fresh controller: the same bytes, and whatever was changed is found and named."""

import json
import random
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from hil.config.station import RobotConfig
from hil.core.controller import FRI_LINK
from hil.replay.replay import replay_file
from hil.replay.result import ReplayResult
from hil.values.arm import Push
from hil.values.errors import UsageError
from hil.values.fri import OperationMode, Release, SessionState
from hil.values.operator import PadKey, Press, SelectMode, SetInput, SetOverride
from tests.support.cases import cases
from tests.support.recordings import (
    flip_bit,
    fri_robot,
    header_of,
    packets,
    record,
    records,
    rewrite,
    servo_robot,
)
from tools.bench.clients import BenchMotion
from tools.bench.recording import BOUND, UNIX_EPOCH_NS, VirtualRun
from transport.capture.errors import CaptureError
from transport.capture.journal import (
    ActionEntry,
    CloseEntry,
    Entry,
    FailedEntry,
    LostEntry,
    TickEntry,
    encode_entry,
    read_entries,
)
from transport.capture.records import CapturedDatagram, CaptureRecord, Notes, Packet
from transport.fri import FriCodec
from transport.servo import write_key

FRI_BOUND = tuple(BOUND[FRI_LINK])


def from_client(packet: Packet) -> bool:
    return packet.destination == FRI_BOUND


@pytest.fixture(scope="module")
def commanding(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A recording of 1.6 s at 5 ms, commanding for the last 0.5 s."""
    file = tmp_path_factory.mktemp("recording") / "commanding.pcapng"
    config = fri_robot(fri={"send_period_ms": 5})
    return record(file, config, 1.6).read_bytes()


@pytest.fixture
def recording(commanding: bytes, tmp_path: Path) -> Path:
    file = tmp_path / "run.pcapng"
    file.write_bytes(commanding)
    return file


def misuse_everything(run: VirtualRun) -> None:
    """The operator, a push and inputs, while the arm moves."""
    run.operate(SetInput("Gripper.Closed", True))  # the value of a boolean input
    run.operate(SetOverride(60.0))
    run.operate(Push(7, (15.0, -5.0, 0.0), (0.0, 0.0, 1.0), 0.2))
    run.run(0.4)
    run.operate(Press(PadKey.EMERGENCY_STOP))
    run.run(0.6)
    run.operate(Press(PadKey.RESET))
    run.operate(SelectMode(OperationMode.T1))
    run.operate(Press(PadKey.ENABLE))
    run.operate(Press(PadKey.START))
    run.operate(SelectMode(OperationMode.AUT))
    run.run(0.5)


IO = ({"name": "Gripper", "signal": ({"name": "Closed", "type": "boolean", "direction": "input"},)},)


@pytest.mark.parametrize(
    "config",
    [
        fri_robot(backend="mujoco", io=IO),
        fri_robot(Release.V2_7, backend="mujoco", io=IO, cycle_ms=2, fri={"send_period_ms": 2}),
        fri_robot(Release.V2_5, backend="mujoco", io=IO, fri={"overlay": "torque", "receive_multiplier": 1}),
        servo_robot(backend="mujoco", io=IO),
        servo_robot(backend="mujoco", io=IO, mode="T1", enabled=True, seed=7),
    ],
    ids=["fri-1.15", "fri-2.7-2ms", "fri-2.5-torque", "servo", "servo-T1"],
)
def test_whatever_happened_replays_byte_for_byte(tmp_path: Path, config: RobotConfig) -> None:
    file = record(tmp_path / "run.pcapng", config, 1.3, during=misuse_everything, seed=3)
    result = replay_file(file)
    assert result.verdict.startswith("identical byte for byte"), result.verdict
    assert result.equal
    assert result.complete
    assert not result.notes
    assert result.identical == result.compared > 1000 // config.cycle_ms
    assert result.inputs > 400
    assert result.compared + result.inputs == len(packets(file))


def test_direct_servo_replays_too(tmp_path: Path) -> None:
    file = record(tmp_path / "run.pcapng", servo_robot(), 0.5, motion=BenchMotion.DIRECT_SERVO)
    assert replay_file(file).equal


def test_the_recording_has_what_it_says(recording: Path) -> None:
    states = [
        SessionState(message.connection.session_state)
        for message in map(FriCodec(Release.V1_15).decode_monitoring, _sent(recording))
        if message.connection is not None
    ]
    assert SessionState.COMMANDING_ACTIVE in states
    header = header_of(recording)
    assert header.software.startswith("fri-hil ")
    assert header.config(0).seed == 0
    assert header.robots[0].unix_epoch_ns == UNIX_EPOCH_NS
    assert {"python", "numpy", "mujoco", "arithmetic"} <= set(header.machine)


def _sent(file: Path) -> list[bytes]:
    return [one.payload for one in packets(file) if one.source == FRI_BOUND]


def test_one_bit_of_any_command_is_found_and_named(commanding: bytes, tmp_path: Path) -> None:
    file = tmp_path / "run.pcapng"
    file.write_bytes(commanding)
    commands = [one for one in packets(file) if from_client(one)]
    chooser = random.Random(5)
    for packet in [commands[0], commands[-1], *chooser.choices(commands, k=cases(8))]:
        file.write_bytes(commanding)
        byte, bit = chooser.randrange(len(packet.payload)), chooser.randrange(8)
        flip_bit(file, packet, byte, bit)
        result = replay_file(file)
        assert not result.equal
        assert result.altered_count == 1
        told = result.altered[0]
        assert f"packet {packet.number}, " in told
        assert f"bit {bit} of byte {byte} of its payload was changed" in told


def test_the_field_that_a_bit_changed_is_named(recording: Path) -> None:
    codec = FriCodec(Release.V1_15)
    packet = [one for one in packets(recording) if from_client(one)][-20]
    command = codec.decode_command(packet.payload)
    assert command.command is not None
    assert command.command.position is not None
    a4 = command.command.position[3]
    byte = packet.payload.index(struct.pack("<d", a4)) + 5
    flip_bit(recording, packet, byte, 2)
    result = replay_file(recording)
    assert f"A4 commanded was {a4!r} and is " in result.altered[0]
    assert f"CommandMessage {command.sequence_counter} from 127.0.0.1:30200" in result.altered[0]
    # It was an accepted command, so the arm went elsewhere, and that is told too.
    assert "A4" in result.first
    assert "mrad" in result.first
    assert " cycle " in result.first


def test_a_command_changed_with_all_its_checksums_is_found_by_the_notes(recording: Path) -> None:
    codec = FriCodec(Release.V1_15)
    commands = [one for one in packets(recording) if from_client(one)]
    for target in (commands[3], commands[-30]):
        command = codec.decode_command(target.payload)
        changed = codec.encode_command(command._replace(sequence_counter=command.sequence_counter ^ 1))

        def change(one: CaptureRecord, target: Packet = target, changed: bytes = changed) -> Iterator[CaptureRecord]:
            same = isinstance(one, Packet) and one.number == target.number
            yield one._replace(payload=changed) if same and isinstance(one, Packet) else one

        before = recording.read_bytes()
        result = replay_file(rewrite(recording, change))
        assert result.altered_count == 1
        assert f"packet {target.number}, " in result.altered[0]
        assert "not what was recorded" in result.altered[0]
        recording.write_bytes(before)


def test_a_command_that_came_at_another_time_is_found(recording: Path) -> None:
    target = [one for one in packets(recording) if from_client(one)][40]

    def later(one: CaptureRecord) -> Iterator[CaptureRecord | CapturedDatagram]:
        if isinstance(one, Packet) and one.number == target.number:
            datagram = one.datagram
            yield CapturedDatagram(datagram.at_unix_ns + 1, datagram.source, datagram.destination, datagram.payload)
        else:
            yield one

    assert "or not when it was" in replay_file(rewrite(recording, later)).altered[0]


def test_a_command_that_is_missing_is_found(recording: Path) -> None:
    target = [one for one in packets(recording) if from_client(one)][40]

    def without(one: CaptureRecord) -> Iterator[CaptureRecord]:
        if not (isinstance(one, Packet) and one.number == target.number):
            yield one

    assert "a datagram to the controller is missing" in replay_file(rewrite(recording, without)).altered[0]


def test_what_the_controller_said_is_compared_to_the_bit(recording: Path) -> None:
    codec = FriCodec(Release.V1_15)
    target = [one for one in packets(recording) if one.source == FRI_BOUND][200]
    message = codec.decode_monitoring(target.payload)
    assert message.monitor is not None
    measured = message.monitor.measured_position
    assert measured is not None
    changed = codec.encode_monitoring(
        message._replace(
            monitor=message.monitor._replace(measured_position=(*measured[:2], measured[2] - 0.2e-3, *measured[3:]))
        )
    )

    def change(one: CaptureRecord) -> Iterator[CaptureRecord]:
        same = isinstance(one, Packet) and one.number == target.number
        yield one._replace(payload=changed) if same and isinstance(one, Packet) else one

    result = replay_file(rewrite(recording, change))
    assert result.compared - result.identical == 1
    assert result.first.startswith("A3 measured +0.2 mrad (recorded ")
    assert f"t=1.000 s, cycle 1000, packet {target.number}" in result.first
    assert list(result.fields) == ["A3 measured"]
    assert result.fields["A3 measured"].largest == pytest.approx(0.2e-3)


def test_datagrams_of_the_controller_that_are_missing_or_new_are_told(recording: Path) -> None:
    mine = [one for one in packets(recording) if one.source == FRI_BOUND]

    def change(one: CaptureRecord) -> Iterator[CaptureRecord]:
        if isinstance(one, Packet) and one.number == mine[50].number:
            return
        yield one
        if isinstance(one, Packet) and one.number == mine[80].number:
            yield one

    result = replay_file(rewrite(recording, change))
    assert (result.missing, result.extra) == (1, 1)
    assert result.first.startswith(
        "the emulator sent a datagram on the fri link that the recording has not at t=0.250 s"
    )
    assert result.compared == result.identical == len(mine) - 1


def test_another_configuration_parts_where_it_matters(tmp_path: Path) -> None:
    file = record(tmp_path / "run.pcapng", fri_robot(backend="mujoco"), 0.05)
    header = header_of(file)
    told = json.loads(header.to_comment())
    told["station"]["robot"][0]["seed"] = 1
    result = replay_file(rewrite(file, lambda one: iter((one,)), comment=json.dumps(told)))
    assert not result.equal
    assert "measured torque" in result.first
    assert set(result.fields) <= {
        f"A{axis} {what}" for axis in range(1, 8) for what in ("measured torque", "external torque")
    }


@pytest.mark.parametrize("missing", [1, 700, 20_000])
def test_a_truncated_file_is_replayed_up_to_the_damage(recording: Path, missing: int) -> None:
    whole = replay_file(recording)
    recording.write_bytes(recording.read_bytes()[:-missing])
    result = replay_file(recording)
    assert result.damage.startswith(f"capture {recording} at byte ")
    assert "truncated" in result.damage
    assert not result.complete
    assert result.alike
    assert not result.equal
    assert result.verdict.endswith("up to where the file cannot be read")
    assert whole.compared - 2 - missing // 300 <= result.compared <= whole.compared


def test_damage_in_the_middle_costs_only_what_is_behind_it(recording: Path) -> None:
    content = bytearray(recording.read_bytes())
    at = packets(recording)[200].offset
    content[at + 4] ^= 0xFF
    recording.write_bytes(content)
    result = replay_file(recording)
    assert f"at byte {at}" in result.damage
    assert result.compared + result.inputs == 200
    assert result.alike


def test_damaged_notes_are_damage(recording: Path) -> None:
    first = next(one for one in records(recording) if isinstance(one, Notes))

    def change(one: CaptureRecord) -> Iterator[CaptureRecord]:
        yield one._replace(entries=b"\x01\x00\xff\xff") if one is first or one == first else one

    result = replay_file(rewrite(recording, change))
    assert "the recorder's notes are damaged: an entry of 65535 bytes has only 0" in result.damage


@pytest.mark.parametrize("content", [b"", b"\n", b"not a capture at all, but long enough to look like one"])
def test_a_file_that_is_no_capture_is_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "foreign.pcapng"
    file.write_bytes(content)
    with pytest.raises(CaptureError, match=str(file)):
        replay_file(file)


def test_a_recording_that_was_not_ended_says_so(recording: Path) -> None:
    def change(one: CaptureRecord) -> Iterator[CaptureRecord]:
        if isinstance(one, Notes):
            kept = [entry for entry in read_entries(one.entries) if isinstance(entry, TickEntry)]
            yield one._replace(entries=b"".join(map(encode_entry, kept)))
        else:
            yield one

    result = replay_file(rewrite(recording, change))
    assert not result.complete
    # Without the note that the run was to end, the emulator goes on commanding where the recorded one braked.
    assert 1 <= result.compared - result.identical <= 6


def test_what_the_writer_lost_is_told(recording: Path) -> None:
    _insert(recording, LostEntry(12))
    result = replay_file(recording)
    assert result.notes == ["12 records are missing at t=0.400 s: the disk did not keep up with the run"]


def test_a_failed_robot_side_ends_the_comparison(recording: Path) -> None:
    _insert(recording, FailedEntry(0, 400_000_000, "the bus is off"))
    result = replay_file(recording)
    assert result.notes == [
        "arm: its robot side failed at t=0.400 s (the bus is off), which a fresh one does not: the rest is not compared"
    ]
    assert result.equal
    assert result.compared == 81


def _insert(file: Path, entry: Entry) -> None:
    """Note something at t = 0.4 s."""

    def change(one: CaptureRecord) -> Iterator[CaptureRecord]:
        yield one
        if isinstance(one, Packet) and one.source == FRI_BOUND and _at_ms(one) == 400:
            yield Notes(0, encode_entry(entry))

    rewrite(file, change)


def _at_ms(packet: Packet) -> int:
    return (packet.at_unix_ns - UNIX_EPOCH_NS) // 1_000_000


def test_update_makes_what_the_emulator_says_the_recording(tmp_path: Path) -> None:
    file = record(tmp_path / "run.pcapng", fri_robot(backend="mujoco"), 0.1)
    told = json.loads(header_of(file).to_comment())
    told["station"]["robot"][0]["seed"] = 5
    rewrite(file, lambda one: iter((one,)), comment=json.dumps(told))
    inputs = [one.datagram for one in packets(file) if from_client(one)]
    before = replay_file(file)
    assert not before.equal
    updated = replay_file(file, update=True)
    assert updated.updated
    assert [one.datagram for one in packets(file) if from_client(one)] == inputs
    after = replay_file(file)
    assert after.equal
    assert after.complete
    assert after.compared == before.compared
    assert list(tmp_path.iterdir()) == [file]


def test_a_damaged_recording_is_not_updated(recording: Path) -> None:
    content = recording.read_bytes()[:-5]
    recording.write_bytes(content)
    assert not replay_file(recording, update=True).updated
    assert recording.read_bytes() == content
    assert list(recording.parent.iterdir()) == [recording]


def test_a_keyed_link_needs_its_key(tmp_path: Path) -> None:
    key, moved = tmp_path / "key", tmp_path / "moved"
    write_key(key)
    config = servo_robot(servo={"key_file": key})
    run = VirtualRun(config, _Nobody(), tmp_path / "run.pcapng")
    run.run(0.05)
    run.close()
    assert "cannot read key file" not in replay_file(tmp_path / "run.pcapng").verdict
    key.rename(moved)
    with pytest.raises(CaptureError, match="cannot be made here: cannot read key file"):
        replay_file(tmp_path / "run.pcapng")
    assert replay_file(tmp_path / "run.pcapng", key_file=moved).complete


class _Nobody:
    """A client that never says anything."""

    def answer(self, outgoing: object) -> tuple[()]:
        return ()

    def check(self, controller: object) -> None:
        return


HOSTILE: list[tuple[str, Any]] = [
    ("no robots of the station", lambda told: told["robots"].append(told["robots"][0])),
    ("token", lambda told: told["robots"][0].update(token_secret="xyz")),  # noqa: S106  # that it is none is the point
    ("epoch", lambda told: told["robots"][0].update(unix_epoch_ns=-5)),
    ("port", lambda told: told["robots"][0].update(fri_peer=["x", 1 << 70])),
    ("same addresses", lambda told: told["robots"][0].update(bound={"fri": ["127.0.0.1", 30200]})),
    ("model", lambda told: told["station"]["robot"][0].update(model="lbr-iiw`-14-r820")),
    ("backend", lambda told: told["station"]["robot"][0].update(backend="/bin/sh")),
    ("key", lambda told: told["station"]["robot"][0].update(servo={"key_file": "/etc/shadow"})),
    ("seed", lambda told: told["station"]["robot"][0].update(seed=1 << 80)),
    ("deep", lambda told: told.update(machine={"x": "y" * 60_000})),
]


@pytest.mark.parametrize(("what", "change"), HOSTILE, ids=[what for what, _ in HOSTILE])
def test_a_hostile_header_is_a_sentence_or_a_comparison(recording: Path, what: str, change: Any) -> None:
    told = json.loads(header_of(recording).to_comment())
    change(told)
    rewrite(recording, lambda one: iter((one,)), comment=json.dumps(told)[:65_535])
    with suppress(CaptureError):
        assert not replay_file(recording).equal or what == "deep"


@pytest.mark.parametrize(
    "entry",
    [
        TickEntry(3, 500_000_000, 0, 500_000_000, 0),
        TickEntry(0, 0, 0, 0, 0),
        TickEntry(0, 1 << 62, 1 << 62, 1 << 62, 0),
        ActionEntry(200, 0, "{}"),
        CloseEntry(255, 0),
    ],
)
def test_entries_that_cannot_be_are_damage(recording: Path, entry: TickEntry | ActionEntry | CloseEntry) -> None:
    _insert(recording, entry)
    result = replay_file(recording)
    assert "the recorder's notes are damaged" in result.damage or entry.robot == 0
    assert result.compared >= 80


@pytest.mark.parametrize("action", ["", "no JSON", "[]", '{"do": "jump"}'])
def test_actions_that_are_none_are_told(recording: Path, action: str) -> None:
    _insert(recording, ActionEntry(0, 400_000_000, action))
    assert "an action of the operator is not understood" in replay_file(recording).notes[0]


def test_any_byte_of_a_file_may_be_another_one(recording: Path, commanding: bytes) -> None:
    chooser = random.Random(11)
    for _ in range(cases(16)):
        content = bytearray(commanding[:60_000])
        for _ in range(chooser.randrange(1, 4)):
            content[chooser.randrange(len(content))] ^= 1 << chooser.randrange(8)
        recording.write_bytes(content)
        with suppress(CaptureError):
            result = replay_file(recording)
            assert not result.equal


def test_only_a_whole_recording_of_ours_can_be_updated(recording: Path) -> None:
    told = json.loads(header_of(recording).to_comment())
    told["robots"][0]["cycles_before"] = 100
    rewrite(recording, lambda one: iter((one,)), comment=json.dumps(told))
    with pytest.raises(UsageError, match="not recorded by fri-hil from the start of a run"):
        replay_file(recording, update=True)


def test_progress_and_pace_are_told(recording: Path) -> None:
    told: list[tuple[int, int, str]] = []
    paced: list[int] = []
    replay_file(recording, progress=lambda *one: told.append(one), pace=paced.append)
    assert told[-1][0] == told[-1][1] == recording.stat().st_size
    assert "x real time" in told[-1][2]
    assert paced[:3] == [0, 1_000_000, 2_000_000]
    assert len(paced) == replay_file(recording).cycles > 1_600


def test_a_result_is_json(recording: Path) -> None:
    result: ReplayResult = replay_file(recording)
    told = json.loads(json.dumps(result.as_dict()))
    assert told["equal"]
    assert told["compared"] == result.compared
    assert told["real_time_factor"] > 1
