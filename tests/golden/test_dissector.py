"""Wireshark's dissector, run by tshark: every field it shows has the value that our decoders read."""

import math
import random
import shutil
import struct
import subprocess
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from google.protobuf.message import DecodeError, Message
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from hil.cli.dissector import dissector
from hil.values.errors import ConfigurationError, MalformedDatagram
from hil.values.fri import MONITORING_IDENTIFIER, TRAITS, Quality, Release, SessionState
from hil.values.fri_messages import MonitoringMessage, Vector
from hil.values.servo import PROTOCOL_VERSION, Command, FromClient, FromController, Goodbye, Hello, Refused, Role
from tests.support.captures import datagrams, files, release_of
from tests.support.processes import finish, hil
from tests.support.wireshark import Node, capture, expected, named, shown, tshark
from tests.unit.test_servo_codec import ANSWERS, CODECS, COMMANDS, GOLDEN, HELLOS, REQUESTS, STATES
from tools.wireshark import DISSECTOR, FIRST_LINE
from transport.capture.reading import read_capture
from transport.capture.records import CapturedDatagram
from transport.fri import FriCodec, fri_pb2, reading
from transport.fri.framing import frame, unframe
from transport.fri.vectors import varint
from transport.servo import servo_pb2
from transport.servo.layout import field
from transport.servo.tag import TAG_BYTES

pytestmark = pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")

ROBOT, CLIENT = ("192.170.10.2", 30200), ("192.170.10.100", 30200)
APPLICATION, CONTROLLER = ("192.170.10.100", 41000), ("192.170.10.2", 30300)
EVERY = 50
"""Of this many recorded packets two are compared, a message and its answer: all kinds in two seconds."""
AT = 1_795_322_450_000_000_000
NO_CAPTURES = pytest.mark.skipif(not files(), reason="the recordings in ../shared/captures are not here")


class Sample(NamedTuple):
    """A recorded packet and the value our decoder reads."""

    release: Release
    message: Any
    payload: bytes

    def wire(self) -> Message:
        """Return what the *value* is written as, which is the packet again."""
        codec, monitoring = FriCodec(self.release), isinstance(self.message, MonitoringMessage)
        again = codec.encode_monitoring(self.message) if monitoring else codec.encode_command(self.message)
        assert again == self.payload
        body = unframe(again)[0] if TRAITS[self.release].framed else again
        assert body is not None
        return fri_pb2.MonitoringMessage.FromString(body) if monitoring else fri_pb2.CommandMessage.FromString(body)


def recorded() -> Iterator[tuple[CapturedDatagram, Sample]]:
    """Yield two packets in a row of every 50 of all recordings, and those that are the first of their length."""
    at_ns = AT
    for path in files():
        release = release_of(path)
        codec, lengths = FriCodec(release), set[int]()
        for index, (from_controller, payload) in enumerate(datagrams(path)):
            if index % EVERY not in {0, 1} and len(payload) in lengths:
                continue
            lengths.add(len(payload))
            at_ns += 1_000_000
            message = (codec.decode_monitoring if from_controller else codec.decode_command)(payload)
            ends = (ROBOT, CLIENT) if from_controller else (CLIENT, ROBOT)
            yield CapturedDatagram(at_ns, *ends, payload), Sample(release, message, payload)


@NO_CAPTURES
def test_fri_of_all_releases_is_shown_as_it_is_decoded(tmp_path: Path) -> None:
    packets, samples = zip(*recorded(), strict=True)
    path = capture(tmp_path / "fri.pcapng", packets)
    messages = fri_pb2.DESCRIPTOR.message_types_by_name
    roots = [messages["MonitoringMessage"], messages["CommandMessage"]]
    seen: set[str] = set()
    for nodes, sample in zip(shown(path, "fri", roots), samples, strict=True):
        assert nodes == expected(sample.wire(), "fri")
        assert_counters(nodes, sample.message)
        seen.update(names_in(nodes))
    # Every kind of packet is among them: joint, torque, wrench, inputs and outputs, transformations, poses.
    for name in ("position", "torque", "wrench", "io.analog", "transformation.name", "pose.value"):
        assert f"fri.command.{name}" in seen
    for name in ("commanded_position", "external_force", "io.digital", "measured_pose.value", "redundancy.strategy"):
        assert f"fri.monitor.{name}" in seen


def assert_counters(nodes: Sequence[Node], message: Any) -> None:
    """What is named by hand here is where the names of the schema might mislead both sides of the comparison."""

    def doubles(path: str) -> Vector | None:
        node = named(nodes, f"fri.{path}.count")
        return None if node is None else tuple(struct.unpack("<d", one.value)[0] for one in node.below)  # type: ignore[arg-type]

    def number(path: str) -> object:
        node = named(nodes, f"fri.{path}")
        return None if node is None else node.value

    assert number("header.sequence_counter") == message.sequence_counter
    assert number("header.reflected_sequence_counter") == message.reflected_sequence_counter
    if isinstance(message, MonitoringMessage):
        assert message.monitor is not None
        assert message.connection is not None
        assert doubles("monitor.measured_position") == message.monitor.measured_position
        assert number("connection.session_state") == message.connection.session_state
    elif message.command is not None:
        assert doubles("command.position") == message.command.position
        assert doubles("command.wrench") == message.command.wrench
        assert doubles("command.torque") == message.command.torque


def names_in(nodes: Sequence[Node]) -> Iterator[str]:
    for node in nodes:
        yield node.name.removesuffix(".count")
        yield from names_in(node.below)


@NO_CAPTURES
def test_columns_answers_and_latencies_of_a_whole_recording() -> None:
    """One with transformations; and with a receive multiplier, so that two messages of three have no answer."""
    for name in ("fri-1.15-trafo-10ms", "fri-2.7-joint-sine-2ms-multiplier3"):
        assert_lines(next(path for path in files() if path.stem == name))


def assert_lines(path: Path) -> None:
    codec = FriCodec(release_of(path))
    lines: list[str] = []
    sent: dict[int, tuple[int, int]] = {}
    for number, packet in enumerate(read_capture(path), 1):
        if packet.source == ROBOT:
            message = codec.decode_monitoring(packet.payload)
            assert message.connection is not None
            state, quality = SessionState(message.connection.session_state), Quality(message.connection.quality)
            lines.append(f"FRI\tFRI monitoring #{message.sequence_counter} {state.name} {quality.name}\t\t")
            sent[message.sequence_counter] = number, packet.at_unix_ns
        else:
            command = codec.decode_command(packet.payload)
            answered, sent_ns = sent[command.reflected_sequence_counter]
            data = command.command
            parts = (
                [] if data is None else [name for name in ("position", "transformation") if getattr(data, NAMES[name])]
            )
            text = f"FRI command #{command.sequence_counter} answers #{command.reflected_sequence_counter}"
            told = f": {', '.join(parts)}" if parts else ""
            latency_ns = packet.at_unix_ns - sent_ns
            lines.append(f"FRI\t{text}{told}\t{answered}\t0.{latency_ns:09}")
    columns = ("_ws.col.Protocol", "_ws.col.Info", "fri.answer_to", "fri.answer_latency")
    assert len(lines) > 400
    assert tshark(path, "-T", "fields", *(f"-e{column}" for column in columns)).splitlines() == lines


NAMES = {"position": "position", "transformation": "transformations"}
"""What a field of the schema is called in our values."""


@pytest.mark.parametrize("packed", [False, True])
def test_numbers_at_the_ends_of_their_ranges_are_shown_packed_and_not(tmp_path: Path, packed: bool) -> None:
    """Numbers no recording has; and both ways to write repeated ones, of which each recording has one."""
    io = [
        fri_pb2.IOValue(name="ü.€", type=-1, direction=2**31 - 1, digital=number)
        for number in (0, 127, 128, 2**28, 2**32 - 1, 2**32, 2**35, 2**56, 2**63, 2**64 - 1)
    ]
    drives, position = [-1, 0, 1, 2, 3, 300], [-0.0, 5e-324, math.inf]
    message = fri_pb2.MonitoringMessage(
        header=fri_pb2.Header(
            identifier=MONITORING_IDENTIFIER, sequence_counter=2**32 - 1, reflected_sequence_counter=0
        ),
        robot=fri_pb2.RobotInfo(joint_count=-(2**31), drive_state=[] if packed else drives),
        monitor=fri_pb2.MonitorData(io=io, measured_position=None if packed else fri_pb2.JointValues(value=position)),
    )
    payload = message.SerializeToString()
    if packed:
        head = fri_pb2.MonitoringMessage(header=message.header).SerializeToString()
        states = b"".join(varint(state % 2**64) for state in drives)
        robot = message.robot.SerializeToString() + field(b"\x2a", states)
        joints = field(b"\x0a", field(b"\x0a", struct.pack("<3d", *position)))
        payload = head + field(b"\x12", robot) + field(b"\x1a", joints + message.monitor.SerializeToString())
        message = fri_pb2.MonitoringMessage.FromString(payload)
        assert (list(message.robot.drive_state), len(message.monitor.measured_position.value)) == (drives, 3)
    path = capture(tmp_path / "ends.pcapng", [fri_packet(ROBOT, CLIENT, payload)])
    roots = [fri_pb2.DESCRIPTOR.message_types_by_name["MonitoringMessage"]]
    assert list(shown(path, "fri", roots)) == [expected(message, "fri")]


def fields_of(path: Path, *names: str, options: Sequence[str] = ()) -> list[list[str]]:
    """Return some fields of each packet."""
    out = tshark(path, *options, "-T", "fields", *(f"-e{name}" for name in names))
    return [line.split("\t") for line in out.splitlines()]


def fri_packet(
    source: tuple[str, int], destination: tuple[str, int], payload: bytes, index: int = 0
) -> CapturedDatagram:
    return CapturedDatagram(AT + 1_000_000 * index, source, destination, payload)


def body(*, counter: int = 7, command: fri_pb2.CommandData | None = None) -> bytes:
    """Return a command without framing."""
    header = fri_pb2.Header(identifier=0x34001, sequence_counter=counter, reflected_sequence_counter=3)
    return fri_pb2.CommandMessage(header=header, command=command).SerializeToString()


def test_a_wrong_crc_and_a_wrong_length_are_told(tmp_path: Path) -> None:
    whole = frame(body())
    crc = bytearray(whole)
    crc[-1] ^= 1
    packets = [whole, bytes(crc), whole + b"\0", whole[:-2], whole[:-4]]
    path = capture(tmp_path / "f.pcapng", [fri_packet(CLIENT, ROBOT, one) for one in packets])
    found = fields_of(path, "fri.frame.crc_wrong", "fri.frame.length_wrong", "fri.malformed", "_ws.col.Info")
    text = "FRI command #7 answers #3"
    cut = f"{text} [malformed: the CRC is cut off]"
    assert found == [
        ["", "", "", text],
        ["1", "", "", f"{text} [CRC wrong]"],
        ["", "1", "", text],
        ["", "1", "1", cut],
        ["", "1", "1", cut],
    ]


def test_any_port_is_recognised_and_others_are_left_alone(tmp_path: Path) -> None:
    """By what the packets look like; a broken one is FRI's only on a usual port, or one the user chose."""
    there, back = ("10.0.0.1", 50_000), ("10.0.0.2", 50_001)
    servo = CODECS[0].encode_from_client(Hello(PROTOCOL_VERSION, 7, Role.COMMANDER, 300, 5, "grinder"))
    payloads = [body(), frame(body()), servo, CODECS[1].encode_from_client(Goodbye(1, 2)), b"other", b"S", b"\x53\n"]
    path = capture(tmp_path / "any.pcapng", [fri_packet(there, back, payload) for payload in payloads])
    left_alone = ["UDP"] * 3

    def protocols(*options: str) -> list[str]:
        return [line[0] for line in fields_of(path, "_ws.col.Protocol", options=options)]

    assert protocols() == ["FRI", "FRI", "servo", "servo", *left_alone]
    assert protocols("-d", "udp.port==50000,fri") == ["FRI", "FRI", "servo", "servo", "FRI", "FRI", "FRI"]
    assert protocols("-d", "udp.port==50001,servo") == ["FRI", "FRI", "servo", "servo", "servo", "servo", "servo"]
    assert protocols("-o", "fri.ports:50000-50005") == ["FRI", "FRI", "servo", "servo", "FRI", "FRI", "FRI"]
    usual = capture(tmp_path / "usual.pcapng", [fri_packet(there, ROBOT, payload) for payload in payloads])
    assert [line[0] for line in fields_of(usual, "_ws.col.Protocol")] == ["FRI", "FRI", "servo", "servo", *["FRI"] * 3]


def drawn(strategy: st.SearchStrategy[Any], count: int) -> list[Any]:
    """Return values of a strategy, the same ones every time."""
    values: list[Any] = []

    @settings(max_examples=count, phases=[Phase.generate], suppress_health_check=list(HealthCheck))
    @given(strategy)
    def collect(value: Any) -> None:
        values.append(value)

    collect()
    return values


@cache
def servo_packets() -> list[FromClient | FromController]:
    """Return packets of all kinds, and commands with requests of all kinds."""
    packets: list[FromClient | FromController] = [packet for packet, _ in GOLDEN]
    packets += drawn(HELLOS, 10) + drawn(ANSWERS, 25) + drawn(COMMANDS, 15) + drawn(STATES, 30)
    packets += [Command(1, 2, 3, 4, False, (request,)) for request in drawn(REQUESTS, 60)]
    return packets


@pytest.mark.parametrize("key", [False, True], ids=["no key", "key"])
def test_the_servo_link_is_shown_as_it_is_decoded(tmp_path: Path, key: bool) -> None:
    codec = CODECS[key]
    packets = servo_packets()
    sent = [
        CapturedDatagram(AT + index, APPLICATION, CONTROLLER, codec.encode_from_client(packet))
        if isinstance(packet, Hello | Command | Goodbye)
        else CapturedDatagram(AT + index, CONTROLLER, APPLICATION, codec.encode_from_controller(packet))
        for index, packet in enumerate(packets)
    ]
    path = capture(tmp_path / "servo.pcapng", sent)
    messages = servo_pb2.DESCRIPTOR.message_types_by_name
    seen: set[str] = set()
    for nodes, one in zip(shown(path, "servo", [messages["Packet"]]), sent, strict=True):
        decode = codec.decode_from_client if one.source == APPLICATION else codec.decode_from_controller
        decode(one.payload)
        packet = one.payload[1:-TAG_BYTES] if key else one.payload[1:]
        assert nodes == expected(servo_pb2.Packet.FromString(packet), "servo")
        seen.update(names_in(nodes))
    for name, path_to in (
        ("Packet", "servo"),
        ("Request", "servo.command.request"),
        ("Report", "servo.state.report"),
        ("Snapshot", "servo.state.snapshot"),
    ):
        assert {f"{path_to}.{field.name}" for field in messages[name].fields} <= seen


def test_columns_and_tags_of_the_servo_link(tmp_path: Path) -> None:
    packets = [packet for packet, _ in GOLDEN]
    packets.insert(0, Hello(PROTOCOL_VERSION, 7, Role.COMMANDER, 300, 5, "grinder"))
    sent = [
        CODECS[1].encode_from_client(packet)
        if isinstance(packet, Hello | Command | Goodbye)
        else CODECS[1].encode_from_controller(packet)
        for packet in packets
    ]
    path = capture(tmp_path / "servo.pcapng", [fri_packet(APPLICATION, CONTROLLER, one) for one in sent])
    infos, tags = zip(*fields_of(path, "_ws.col.Info", "servo.tag"), strict=True)
    assert list(tags) == [one[-TAG_BYTES:].hex() for one in sent]
    assert list(infos) == [
        "servo hello ROLE_COMMANDER grinder",
        "servo command #2 reflects #3",
        "servo command #2 reflects #3: destination",
        "servo command #2 reflects #3: destination",
        "servo command #2 reflects #3: describe, locate",
        "servo command #2 reflects #3: stop",
        "servo goodbye #2",
        "servo welcome fri-hil 1 lbr",
        "servo refused no",
        "servo ended no",
        "servo state #2 reflects #3 cycle 1: done",
    ]


def test_of_another_version_only_the_frozen_parts_are_read(tmp_path: Path) -> None:
    hello = servo_pb2.Packet(
        header=servo_pb2.Header(version=PROTOCOL_VERSION + 1),
        hello=servo_pb2.Hello(nonce=0x1234, role=servo_pb2.ROLE_OBSERVER, padding=bytes(400)),
    )
    command = servo_pb2.Packet(header=servo_pb2.Header(version=9, token=5), command=servo_pb2.Command(reports_seen=1))
    packets = [b"\x53" + packet.SerializeToString() for packet in (hello, command)]
    path = capture(tmp_path / "v.pcapng", [fri_packet(APPLICATION, CONTROLLER, one) for one in packets])
    names = ("servo.header.version", "servo.hello.nonce", "servo.hello.role", "servo.command", "servo.malformed")
    assert fields_of(path, *names) == [["4", "0x0000000000001234", "", "", ""], ["9", "", "", "", ""]]


def broken(randomness: random.Random, payload: bytes) -> bytes:
    """Return a payload with one or two bytes changed; sometimes cut off too, or with bytes put in."""
    data = bytearray(payload)
    for _ in range(randomness.randint(1, 2)):
        data[randomness.randrange(len(data))] = randomness.randrange(256)
    at, how = randomness.randrange(len(data)), randomness.randrange(8)
    if how == 0:
        return bytes(data[: at + 1])
    return bytes(data[:at] + randomness.randbytes(2) + data[at:]) if how == 1 else bytes(data)


def is_command(payload: bytes) -> bool:
    """Tell whether bytes are a command, with all that is required: protobuf's parser does not ask for that."""
    try:
        wire = fri_pb2.CommandMessage.FromString(payload)
        reading.command(wire)
    except (DecodeError, MalformedDatagram):
        return False
    return wire.IsInitialized()


def is_packet(payload: bytes) -> bool:
    try:
        servo_pb2.Packet.FromString(payload[1:])
    except DecodeError:
        return False
    return True


def test_broken_messages_of_fri_are_malformed_exactly_where_they_cannot_be_decoded(tmp_path: Path) -> None:
    randomness = random.Random(7)
    vector = [randomness.uniform(-1.0, 1.0) for _ in range(7)]
    data = fri_pb2.CommandData(
        position=fri_pb2.JointValues(value=vector),
        wrench=fri_pb2.CommandedWrench(value=vector[:6]),
        transformation=[fri_pb2.CommandedTransformation(name="base", value=vector)],
        io=[fri_pb2.IOValue(name="Out.One", type=0, direction=1, digital=1)],
    )
    whole = body(command=data)
    start = len(body())  # the header stays whole, so that it is still known for a command
    payloads = [whole[:start] + broken(randomness, whole[start:]) for _ in range(800)]
    path = capture(tmp_path / "broken.pcapng", [fri_packet(CLIENT, ROBOT, one, i) for i, one in enumerate(payloads)])
    shown_malformed = [line[0] != "" for line in fields_of(path, "fri.malformed")]
    assert shown_malformed == [not is_command(payload) for payload in payloads]
    assert 150 < sum(shown_malformed) < 650


def test_broken_packets_of_the_servo_link_are_malformed_exactly_where_they_cannot_be_decoded(tmp_path: Path) -> None:
    randomness = random.Random(3)
    wholes = [CODECS[0].encode_from_controller(state) for state in drawn(STATES, 20)]
    wholes += [CODECS[0].encode_from_client(command) for command in drawn(COMMANDS, 20)]
    start = 1 + len(
        servo_pb2.Header(version=PROTOCOL_VERSION, token=1, sequence=1, reflected_sequence=1).SerializeToString()
    )
    payloads = [whole[:start] + broken(randomness, whole[start:]) for whole in wholes for _ in range(12)]
    packets = [fri_packet(APPLICATION, CONTROLLER, one, i) for i, one in enumerate(payloads)]
    path = capture(tmp_path / "broken.pcapng", packets)
    shown_malformed = [line[0] != "" for line in fields_of(path, "servo.malformed")]
    assert shown_malformed == [not is_packet(payload) for payload in payloads]
    assert 50 < sum(shown_malformed) < 430


def test_fields_that_are_there_and_empty_do_not_break_it(tmp_path: Path) -> None:
    """A text, padding, a vector and packed numbers of no bytes, each of them the last bytes of its packet."""
    packets = ["530a02080342020a00", "530a02080312027a00", "530a0208032a061a041a021200", "530a0208033a0412024a00"]
    names = ("servo.ended.reason", "servo.hello.padding", "servo.command.request.destination.position.count")
    path = capture(
        tmp_path / "empty.pcapng", [fri_packet(APPLICATION, CONTROLLER, bytes.fromhex(one)) for one in packets]
    )
    assert fields_of(path, "_ws.col.Info", *names, "servo.state.snapshot.measured_position.count", "_ws.expert") == [
        ["servo ended ", "", "", "", "", ""],
        ["servo hello 0 ", "", "<MISSING>", "", "", ""],
        ["servo command #0 reflects #0: destination", "", "", "0", "", ""],
        ["servo state #0 reflects #0 cycle 0", "", "", "", "0", ""],
    ]


@pytest.mark.skipif(shutil.which("editcap") is None, reason="editcap (part of tshark) is not installed")
def test_packets_that_the_recorder_cut_are_told(tmp_path: Path) -> None:
    payloads = [frame(body()), body(), CODECS[1].encode_from_client(Command(1, 2, 3))]
    ports = (30200, 30200, 30300)
    packets = [fri_packet(CLIENT, ("10.0.0.2", port), one) for port, one in zip(ports, payloads, strict=True)]
    whole = capture(tmp_path / "whole.pcapng", packets)
    for size in (43, 51):
        path = tmp_path / f"{size}.pcapng"
        subprocess.run(["editcap", "-s", str(size), str(whole), str(path)], check=True)  # noqa: S607
        for (info,) in fields_of(path, "_ws.col.Info"):
            assert "[malformed: the recorder cut this packet]" in info


def test_no_bytes_break_it(tmp_path: Path) -> None:
    """Invariant: whatever the bytes, on whatever port, tshark shows a packet and no error of Lua."""
    randomness = random.Random(11)
    wholes = [CODECS[index % 2].encode_from_controller(state) for index, state in enumerate(drawn(STATES, 20))]
    wholes += [CODECS[0].encode_from_client(command) for command in drawn(COMMANDS, 10)]
    wholes += [
        frame(body()),
        body(),
        b"\x53",
        b"\x54",
        b"\x0a",
        b"\0",
        CODECS[0].encode_from_controller(Refused(3, 1, "no", False)),
    ]
    payloads = [b"", bytes(3), bytes(60_000), b"\x54" + bytes(15)]
    payloads += [broken(randomness, randomness.choice(wholes)) for _ in range(300)]
    payloads += [whole[:cut] for whole in wholes[-5:] for cut in range(min(60, len(whole)))]
    payloads += [
        randomness.choice((b"", b"\x53", b"\x54", b"\x0a")) + randomness.randbytes(randomness.randrange(80))
        for _ in range(150)
    ]
    packets = [
        fri_packet(("10.0.0.1", 9), ("10.0.0.2", port), payload, index)
        for index, payload in enumerate(payloads)
        for port in (30200, 30300, 50_000)
    ]
    path = capture(tmp_path / "noise.pcapng", packets)
    out = tshark(path, "-O", "fri,servo")
    assert out.count("\nUser Datagram Protocol") == len(packets)
    assert out.count("Malformed at byte") > 300


def test_the_command_says_where_it_is() -> None:
    told = finish(hil("dissector"))
    assert told.code == 0, told.err
    assert told.out.splitlines()[0] == str(DISSECTOR)
    assert f"tshark -X lua_script:{DISSECTOR} -r FILE" in told.out


@pytest.fixture
def target(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the dissector is installed for a user whose home is a new folder."""
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path / ".local/lib/wireshark/plugins" / DISSECTOR.name


def test_installed_it_is_loaded_always(target: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dissector(install=True)
    assert capsys.readouterr().out.startswith(f"wrote {target}; ")
    target.write_text(f"{FIRST_LINE}\nan older one, which is replaced")
    dissector(install=True)
    assert target.read_bytes() == DISSECTOR.read_bytes()
    path = capture(tmp_path / "one.pcapng", [fri_packet(CLIENT, ROBOT, body())])
    for script in (False, True):  # as a plugin, and both ways at once
        assert "FRI command #7" in tshark(path, script=script)


def test_without_tshark_it_is_put_where_wireshark_looks_by_default(
    target: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")
    dissector(install=True)
    assert target.read_bytes() == DISSECTOR.read_bytes()


def test_installing_overwrites_nothing_that_is_not_ours(target: Path) -> None:
    target.parent.mkdir(parents=True)
    target.write_text("-- mine")
    with pytest.raises(ConfigurationError, match="is there already and is not ours; move it away first"):
        dissector(install=True)
    assert target.read_text() == "-- mine"


def test_what_the_system_refuses_is_said(target: Path) -> None:
    target.parent.parent.mkdir(parents=True)
    target.parent.write_text("a file where the folder should be")
    with pytest.raises(ConfigurationError, match=f"cannot write {target}: .*; without it: tshark -X lua_script:"):
        dissector(install=True)
