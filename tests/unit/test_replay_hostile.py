"""Recordings with hostile content: a sentence, or a replay up to the damage; never a traceback, nothing left behind."""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hil.cli.plain import plain
from hil.config.station import RobotConfig
from hil.core.controller import FRI_LINK
from hil.replay import altered, exact
from hil.replay.exact import ExactReplay
from hil.replay.guess import Flow, flow_of
from hil.replay.replay import replay_file
from hil.replay.result import MAX_TOLD, ReplayResult
from hil.replay.stand_in_client import RecordedClient
from hil.runtime import assembly
from hil.runtime.capture_header import CaptureHeader, read_header
from hil.values.errors import ConfigurationError, UnknownName
from hil.values.fri import Release
from hil.values.fri_messages import IOValue, MonitoringMessage
from tests.support.recordings import flip_bit, fri_robot, header_of, packets, record, rewrite
from tools.bench.recording import BOUND
from transport.capture.errors import CaptureError
from transport.capture.journal import ActionEntry, Entry, TickEntry, encode_entry, read_entries
from transport.capture.options import TIME_OFFSET, TIME_RESOLUTION, option
from transport.capture.records import CapturedDatagram, CaptureRecord, Notes, Packet
from transport.capture.writing import PcapngWriter
from transport.fri import FriCodec

CODEC = FriCodec(Release.V1_15)
FRI_BOUND = tuple(BOUND[FRI_LINK])
ABSURD_NS = 1 << 63


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return record(tmp_path_factory.mktemp("hostile") / "ours.pcapng", fri_robot(), 0.05).read_bytes()


@pytest.fixture
def file(ours: bytes, tmp_path: Path) -> Path:
    copy = tmp_path / "run.pcapng"
    copy.write_bytes(ours)
    return copy


def with_entry(entry: Entry, *, behind: int) -> Callable[[CaptureRecord], Iterator[CaptureRecord]]:
    """Put ``entry`` behind the notes of so many cycles."""
    seen = 0

    def change(one: CaptureRecord) -> Iterator[CaptureRecord]:
        nonlocal seen
        yield one
        if isinstance(one, Notes):
            seen += sum(isinstance(each, TickEntry) for each in read_entries(one.entries))
            if seen == behind:
                yield Notes(one.offset, encode_entry(entry))
                seen += 1

    return change


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        (TickEntry(7, 0, 0, 0, 0), "an entry of robot 7, and the run has 1"),
        (ActionEntry(255, 0, "{}"), "an entry of robot 255, and the run has 1"),
        (TickEntry(0, -1, 0, 0, 0), "an entry of the time -1 ns"),
        (TickEntry(0, ABSURD_NS - 1, 0, 0, 0), f"an entry of the time {ABSURD_NS - 1} ns"),
        (TickEntry(0, 20_000_000, -ABSURD_NS, 0, 0), f"{-ABSURD_NS} ns late"),
        (ActionEntry(0, -ABSURD_NS, "{}"), f"an entry of the time {-ABSURD_NS} ns"),
    ],
)
def test_an_entry_that_cannot_be_is_damage_and_all_before_it_is_replayed(file: Path, entry: Entry, said: str) -> None:
    rewrite(file, with_entry(entry, behind=20))
    result = replay_file(file)
    assert "the recorder's notes are damaged: " in result.damage
    assert said in result.damage
    assert result.cycles == 20
    assert result.compared == result.identical > 15


def test_a_time_stamp_of_another_age_is_named(file: Path) -> None:
    def change(one: CaptureRecord) -> Iterator[CaptureRecord | CapturedDatagram]:
        if isinstance(one, Packet) and one.number == 12:
            yield replace(one.datagram, at_unix_ns=(1 << 64) - 1)
        else:
            yield one

    if packets(file)[11].destination != FRI_BOUND:
        pytest.fail("packet 12 is no input")
    result = replay_file(rewrite(file, change))
    assert result.altered_count
    assert "packet 12" in result.altered[0]


@pytest.mark.parametrize(
    ("offset", "said"),
    [
        (bytes(3000), "an offset of time of 3000 bytes, not 8"),
        (b"\xff" * 7 + b"\x7f", "packet 1, byte"),
        (bytes(7) + b"\x80", "its time stamp is -"),
    ],
)
def test_an_interface_of_another_age_is_damage(file: Path, offset: bytes, said: str) -> None:
    content = file.read_bytes()
    at = int.from_bytes(content[4:8], "little")
    size = int.from_bytes(content[at + 4 : at + 8], "little")
    body = content[at + 8 : at + 16] + option(TIME_RESOLUTION, b"\x09") + option(TIME_OFFSET, offset)
    length = (len(body) + 12).to_bytes(4, "little")
    file.write_bytes(content[:at] + content[at : at + 4] + length + body + length + content[at + size :])
    result = replay_file(file)
    assert said in result.damage


BAD_HEADERS: list[Callable[[dict[str, Any]], object]] = [
    lambda told: told["robots"][0].update({"token_secret": "no hex"}),
    lambda told: told["robots"][0].update({"token_secret": "abc"}),
    lambda told: told["robots"].extend(told["robots"] * 15),
    lambda told: told["robots"][0].update(unix_epoch_ns=10**30),
    lambda told: told["robots"][0].update(bound={"fri": ["::1", 1]}),
    lambda told: told["robots"][0].update(bound={"fri": ["127.0.0.1", 65536]}),
    lambda told: told["robots"][0].update(bound={}),
    lambda told: told["robots"][0].update(fri_peer=["not an address", 1]),
]


@pytest.mark.parametrize("change", BAD_HEADERS)
def test_a_header_that_no_run_wrote_is_none_of_ours(file: Path, change: Callable[[dict[str, Any]], object]) -> None:
    told = json.loads(header_of(file).to_comment())
    change(told)
    assert read_header(json.dumps(told)) is None
    result = replay_file(rewrite(file, lambda one: iter([one]), comment=json.dumps(told)))
    assert not result.own
    assert result.compared


def test_an_update_that_fails_leaves_nothing_behind(file: Path) -> None:
    told = json.loads(header_of(file).to_comment())
    told["station"]["robot"][0]["backend"] = "warp-drive"
    rewrite(file, lambda one: iter([one]), comment=json.dumps(told))
    before = file.read_bytes()
    with pytest.raises(CaptureError, match="unknown backend 'warp-drive'"):
        replay_file(file, update=True)
    assert list(file.parent.iterdir()) == [file]
    assert file.read_bytes() == before


def test_robot_sides_are_released_where_a_later_robot_cannot_be(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    header = header_of(file)
    station, start = header.station, header.robots[0]
    bad = station.robot[0].model_copy(update={"name": "other", "backend": "warp-drive", "fri": None})
    two = station.model_copy(update={"robot": [station.robot[0], bad]})
    closed: list[object] = []
    opened = assembly.open_parts

    def open_parts(config: RobotConfig, **more: Any) -> Any:
        parts = opened(config, **more)
        monkeypatch.setattr(parts.backend, "close", lambda: closed.append(parts))
        return parts

    monkeypatch.setattr(exact, "open_parts", open_parts)
    both = CaptureHeader(software="", format=1, station=two, robots=(start, start.model_copy(update={"name": "other"})))
    with pytest.raises(UnknownName):
        ExactReplay(both, ReplayResult("x", own=True))
    assert len(closed) == 1


def test_only_the_changed_datagrams_that_are_told_are_searched_for_the_bit(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    searched: list[Packet] = []

    def alteration(packet: Packet, decode: Callable[[bytes], object]) -> str:
        searched.append(packet)
        return altered.alteration(packet, decode)

    monkeypatch.setattr(exact, "alteration", alteration)
    changed = [one for one in packets(file) if one.destination == FRI_BOUND][: MAX_TOLD + 5]
    for packet in changed:
        flip_bit(file, packet, len(packet.payload) - 1, 0)
    result = replay_file(file)
    assert result.altered_count >= len(changed)
    assert len(searched) <= MAX_TOLD


@pytest.mark.parametrize("text", [r"\[/b]", "[/b]", r"a\\[red]b"])
def test_what_a_file_says_is_no_markup(text: str) -> None:
    from rich.text import Text

    assert Text.from_markup(plain(text)).plain == text


def test_what_a_file_says_does_not_order_the_terminal_about() -> None:
    assert plain("a\x1b[2Jb") == "a\N{REPLACEMENT CHARACTER}[2Jb"


def elsewhere(file: Path, change: Callable[[MonitoringMessage], MonitoringMessage], *, at: int = 0) -> Path:
    """As tcpdump has it, with one message of the controller changed."""
    found = packets(file)
    place = [one.number for one in found if one.source == FRI_BOUND][at]
    with PcapngWriter(file) as writer:
        for one in found:
            payload = one.payload
            if one.number == place:
                payload = CODEC.encode_monitoring(change(CODEC.decode_monitoring(payload)))
            writer.write(replace(one.datagram, payload=payload))
    return file


def in_state(number: int) -> Callable[[MonitoringMessage], MonitoringMessage]:
    def change(message: MonitoringMessage) -> MonitoringMessage:
        assert message.connection is not None
        return message._replace(connection=message.connection._replace(session_state=number))

    return change


def test_a_session_state_that_there_is_not_is_passed_over(file: Path) -> None:
    result = replay_file(elsewhere(file, in_state(101), at=10))
    assert any("tells of a session state that there is not" in note for note in result.notes)
    assert result.compared > 30


def test_a_stand_in_counts_a_session_state_that_there_is_not(file: Path) -> None:
    found = packets(file)
    flow = flow_of(next(one for one in found if one.source == FRI_BOUND), None)
    assert flow is not None
    client = RecordedClient(flow, iter(found))
    assert client.receive(CODEC.encode_monitoring(in_state(-1)(flow.first))) is None
    assert client.malformed == 1


def first_flow(file: Path, change: Callable[[MonitoringMessage], MonitoringMessage]) -> Flow:
    flow = flow_of(next(one for one in packets(elsewhere(file, change)) if one.source == FRI_BOUND), None)
    assert flow is not None
    return flow


def test_numbers_that_mean_nothing_are_not_taken(file: Path) -> None:
    def change(message: MonitoringMessage) -> MonitoringMessage:
        assert message.robot is not None
        assert message.monitor is not None
        odd = IOValue("Group.Name", 77, 88, 1, 1.0)
        return message._replace(
            robot=message.robot._replace(operation_mode=255),
            monitor=message.monitor._replace(inputs_outputs=(odd,)),
        )

    flow = first_flow(file, change)
    config = replace(flow, command_mode=99, control_mode=98).config(fri_robot(), backend=None)
    assert config.io == ()
    assert replay_file(file).compared


def test_a_controller_that_cannot_be_set_up_is_one_sentence(file: Path) -> None:
    def change(message: MonitoringMessage) -> MonitoringMessage:
        assert message.connection is not None
        return message._replace(connection=message.connection._replace(send_period_ms=100, receive_multiplier=255))

    with pytest.raises(ConfigurationError, match="no emulator can be what the controller at 127") as refusal:
        replay_file(elsewhere(file, change))
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("angle", [float("nan"), float("inf"), 1e9])
def test_an_arm_that_cannot_be_there_begins_as_described(file: Path, angle: float) -> None:
    def change(message: MonitoringMessage) -> MonitoringMessage:
        assert message.monitor is not None
        return message._replace(
            monitor=message.monitor._replace(measured_position=(angle,) * 7, commanded_position=(angle,) * 7)
        )

    assert first_flow(file, change).initial_position_rad is None
