"""The file format: what is written is read back, by us and by Wireshark, and damage is named."""

import ipaddress
import os
import re
import shutil
import struct
import subprocess
import tempfile
import zlib
from contextlib import suppress
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import dpkt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.values.errors import HilError, UsageError
from transport.capture.endpoints import MAX_PAYLOAD_BYTES
from transport.capture.errors import CaptureError
from transport.capture.frames import _MAX_ROUTES, LINK_ETHERNET, FrameEncoder, decode_frame
from transport.capture.reading import CaptureReader, read_capture, read_records, read_section_comment
from transport.capture.records import CapturedDatagram, Notes, Packet
from transport.capture.writing import PcapngWriter

SHARED = Path(__file__).parents[2].parent / "shared" / "captures"
ROBOT, CLIENT = ("192.170.10.2", 30200), ("192.170.10.100", 30200)
AT = 1_795_322_450_887_916_123

PACKETS = {
    "fri-1.11-joint-sine-5ms": 961,
    "fri-1.14-joint-sine-5ms": 961,
    "fri-1.15-io-10ms": 481,
    "fri-1.15-joint-sine-1ms": 3401,
    "fri-1.15-joint-sine-5ms": 961,
    "fri-1.15-torque-sine-2ms": 2401,
    "fri-1.15-trafo-10ms": 481,
    "fri-1.15-wrench-sine-2ms": 2401,
    "fri-1.16-joint-sine-5ms": 961,
    "fri-2.5-io-10ms": 481,
    "fri-2.5-joint-sine-5ms": 961,
    "fri-2.5-torque-sine-2ms": 2401,
    "fri-2.5-trafo-10ms": 481,
    "fri-2.5-wrench-sine-2ms": 2401,
    "fri-2.7-cartesian-5ms": 961,
    "fri-2.7-io-10ms": 481,
    "fri-2.7-joint-sine-2ms-multiplier3": 1601,
    "fri-2.7-joint-sine-5ms": 961,
    "fri-2.7-torque-sine-2ms": 2401,
    "fri-2.7-trafo-10ms": 481,
    "fri-2.7-wrench-sine-2ms": 2401,
}
"""As capinfos counts them."""

endpoints = st.tuples(st.ip_addresses(v=4).map(str), st.integers(0, 65_535))
datagrams = st.builds(
    CapturedDatagram,
    at_unix_ns=st.integers(0, (1 << 64) - 1),
    source=endpoints,
    destination=endpoints,
    payload=st.binary(max_size=1500),
)


def written(*packets: CapturedDatagram, comment: str | None = None) -> bytes:
    file = BytesIO()
    with PcapngWriter(file, comment=comment) as writer:
        for packet in packets:
            writer.write(packet)
    return file.getvalue()


def block(kind: int, body: bytes, order: str = "<") -> bytes:
    """A block put together by hand, independent of what writes ours."""
    body += bytes(-len(body) % 4)
    size = struct.pack(f"{order}I", len(body) + 12)
    return struct.pack(f"{order}I", kind) + size + body + size


def section(order: str = "<", version: int = 1) -> bytes:
    return block(0x0A0D0D0A, struct.pack(f"{order}IHHq", 0x1A2B3C4D, version, 0, -1), order)


def interface(order: str = "<", link_type: int = 1, options: bytes = b"") -> bytes:
    return block(1, struct.pack(f"{order}HHI", link_type, 0, 0) + options, order)


def option(code: int, data: bytes, order: str = "<") -> bytes:
    return struct.pack(f"{order}HH", code, len(data)) + data + bytes(-len(data) % 4)


def packet(frame: bytes, ticks: int = 0, order: str = "<", number: int = 0, full: int | None = None) -> bytes:
    full = len(frame) if full is None else full
    head = struct.pack(f"{order}IIIII", number, ticks >> 32, ticks & 0xFFFFFFFF, len(frame), full)
    return block(6, head + frame, order)


def frame_of(payload: bytes = b"hello") -> bytes:
    return FrameEncoder().encode(CapturedDatagram(0, ROBOT, CLIENT, payload))


def file_with(tmp_path: Path, *parts: bytes) -> Path:
    path = tmp_path / "some.pcapng"
    path.write_bytes(b"".join(parts))
    return path


@given(st.lists(datagrams, max_size=5))
def test_what_is_written_is_read(packets: list[CapturedDatagram]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "round.pcapng"
        with PcapngWriter(path) as writer:
            for one in packets:
                writer.write(one)
        reader = read_capture(path)
        assert list(reader) == packets
        assert reader.skipped == 0


def test_the_longest_datagram_is_read_back_and_a_longer_one_refused(tmp_path: Path) -> None:
    longest = CapturedDatagram(AT, ROBOT, CLIENT, bytes(MAX_PAYLOAD_BYTES))
    assert list(read_capture(file_with(tmp_path, written(longest)))) == [longest]
    with pytest.raises(UsageError, match="65507"):
        written(CapturedDatagram(AT, ROBOT, CLIENT, bytes(MAX_PAYLOAD_BYTES + 1)))


@pytest.mark.parametrize(
    "wrong",
    [
        CapturedDatagram(-1, ROBOT, CLIENT, b""),
        CapturedDatagram(1 << 64, ROBOT, CLIENT, b""),
        CapturedDatagram(0, ("localhost", 1), CLIENT, b""),
        CapturedDatagram(0, ("::1", 1), CLIENT, b""),
        CapturedDatagram(0, ROBOT, ("10.0.0.1", 65_536), b""),
    ],
)
def test_what_no_datagram_can_have_is_a_usage_error(wrong: CapturedDatagram) -> None:
    with pytest.raises(UsageError, match="valid"):
        written(wrong)


@given(datagrams)
def test_checksums_addresses_and_lengths_are_those_of_a_real_frame(datagram: CapturedDatagram) -> None:
    frame = FrameEncoder().encode(datagram)
    ethernet = dpkt.ethernet.Ethernet(frame)
    ip = ethernet.data
    assert dpkt.dpkt.in_cksum(frame[14:34]) == 0
    pseudo_header = ip.src + ip.dst + struct.pack("!BBH", 0, 17, ip.data.ulen)
    assert dpkt.dpkt.in_cksum(pseudo_header + frame[34:]) == 0
    assert ip.data.sum != 0  # would mean "not computed"
    assert ip.len == len(frame) - 14
    for mac, (host, _) in ((ethernet.src, datagram.source), (ethernet.dst, datagram.destination)):
        assert mac == b"\x02\x00" + ipaddress.IPv4Address(host).packed


def test_headers_kept_per_route_leave_no_trace_of_the_datagram_before() -> None:
    encoder = FrameEncoder()
    short, long = (CapturedDatagram(0, ROBOT, CLIENT, payload) for payload in (b"ab", b"x" * 900))
    alone = FrameEncoder().encode(short)
    assert [encoder.encode(one) for one in (short, long, short)][::2] == [alone, alone]


def test_headers_of_ever_new_senders_are_not_kept_for_ever() -> None:
    encoder = FrameEncoder()
    for port in range(1, 3000):
        frame = encoder.encode(CapturedDatagram(0, (ROBOT[0], port), CLIENT, b"ab"))
    assert len(encoder._headers) <= _MAX_ROUTES
    assert frame == FrameEncoder().encode(CapturedDatagram(0, (ROBOT[0], 2999), CLIENT, b"ab"))


@given(st.sampled_from([1, 101, 113, 276, 9999]), st.binary(max_size=200))
def test_any_bytes_decode_to_a_datagram_or_to_nothing(link_type: int, frame: bytes) -> None:
    decode_frame(link_type, frame)


@given(st.integers(12, 13), st.binary(max_size=80), st.sampled_from([0x0800, 0x8100, 0x8847, 0x86DD, 0x8864, 0x2000]))
def test_any_inner_protocol_decodes_to_a_datagram_or_to_nothing(at: int, rest: bytes, ethertype: int) -> None:
    assert decode_frame(LINK_ETHERNET, bytes(12) + ethertype.to_bytes(2, "big") + rest[at:]) is None


def test_every_shared_capture_is_listed() -> None:
    assert {path.stem for path in SHARED.glob("*.pcapng")} == set(PACKETS)


@pytest.mark.parametrize(("name", "packets"), PACKETS.items())
def test_every_packet_of_the_shared_captures_is_read(name: str, packets: int) -> None:
    path = SHARED / f"{name}.pcapng"
    reader = read_capture(path)
    read = list(reader)
    assert (len(read), reader.skipped) == (packets, 0)
    assert {one.source for one in read} == {ROBOT, CLIENT}
    assert all(one.at_unix_ns < after.at_unix_ns for one, after in pairwise(read))
    with path.open("rb") as file:
        reference = [
            (round(at * 1e6) * 1000, bytes(dpkt.ethernet.Ethernet(frame).data.data.data))
            for at, frame in dpkt.pcapng.Reader(file)
        ]
    assert [(one.at_unix_ns, one.payload) for one in read] == reference
    assert read_section_comment(path) is None


@pytest.mark.parametrize("comment", ["", '{"seed": 7, "arm": "LBR iiwa 14 · µ"}', "two\nlines", "x" * 65_535])
def test_the_comment_is_read_back(tmp_path: Path, comment: str) -> None:
    assert read_section_comment(file_with(tmp_path, written(comment=comment))) == comment


def test_without_a_comment_there_is_none(tmp_path: Path) -> None:
    assert read_section_comment(file_with(tmp_path, written())) is None


@pytest.mark.parametrize("comment", ["x" * 65_536, "\ud800"])
def test_a_comment_that_does_not_fit_is_refused(comment: str) -> None:
    with pytest.raises(CaptureError, match="comment"):
        written(comment=comment)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(
    ("options", "ticks", "expected_ns"),
    [
        ((), 1_795_322_450_887_916, 1_795_322_450_887_916_000),
        (((9, b"\x06"),), 1_795_322_450_887_916, 1_795_322_450_887_916_000),
        (((9, b"\x09"),), AT, AT),
        (((9, b"\x0c"),), 1_999, 1),
        (((9, b"\x94"),), 3 << 18, 750_000_000),
        (((9, b"\x09"), (14, 5)), 7, 5_000_000_007),
        (((14, -2),), 3_000_000, 1_000_000_000),
    ],
)
def test_time_stamps_of_any_resolution_are_exact(
    tmp_path: Path, order: str, options: tuple[tuple[int, bytes | int], ...], ticks: int, expected_ns: int
) -> None:
    encoded = b"".join(
        option(code, value if isinstance(value, bytes) else struct.pack(f"{order}q", value), order)
        for code, value in options
    )
    parts = section(order), interface(order, options=encoded), packet(frame_of(), ticks, order)
    assert [one.at_unix_ns for one in read_capture(file_with(tmp_path, *parts))] == [expected_ns]


def test_sections_and_interfaces_keep_their_own_byte_order_and_resolution(tmp_path: Path) -> None:
    parts = (
        section(">"),
        interface(">"),
        interface(">", options=option(9, b"\x09", ">")),
        packet(frame_of(b"a"), 5, ">", number=1),
        packet(frame_of(b"b"), 5, ">", number=0),
        section("<"),
        interface("<", options=option(9, b"\x03")),
        packet(frame_of(b"c"), 5),
    )
    read = list(read_capture(file_with(tmp_path, *parts)))
    assert [(one.payload, one.at_unix_ns) for one in read] == [(b"a", 5), (b"b", 5_000), (b"c", 5_000_000)]


@pytest.mark.parametrize(
    ("link_type", "head"),
    [
        (101, b""),
        (113, bytes(14) + b"\x08\x00"),
        (276, b"\x08\x00" + bytes(18)),
        (1, bytes(12) + b"\x81\x00\x00\x05\x08\x00"),
    ],
)
def test_other_link_layers_carry_datagrams_too(tmp_path: Path, link_type: int, head: bytes) -> None:
    path = file_with(tmp_path, section(), interface(link_type=link_type), packet(head + frame_of()[14:]))
    assert [(one.source, one.payload) for one in read_capture(path)] == [(ROBOT, b"hello")]


def test_ethernet_padding_is_no_payload(tmp_path: Path) -> None:
    path = file_with(tmp_path, section(), interface(), packet(frame_of(b"") + bytes(18)))
    assert [one.payload for one in read_capture(path)] == [b""]


def test_packets_that_are_no_whole_datagram_are_skipped_and_counted(tmp_path: Path) -> None:
    good = frame_of()
    fragment = good[:20] + b"\x20\x00" + good[22:]
    longer_than_its_packet = good[:38] + b"\x00\xff" + good[40:]
    tcp = good[:23] + b"\x06" + good[24:]
    arp = bytes(12) + b"\x08\x06" + bytes(28)
    path = file_with(
        tmp_path,
        section(),
        interface(),
        interface(link_type=105),
        *(packet(one) for one in (arp, tcp, fragment, longer_than_its_packet, b"")),
        packet(good[:30], full=len(good)),
        packet(good, number=1),
        block(3, struct.pack("<I", len(good)) + good),
        block(5, bytes(12)),  # interface statistics: no packet
        packet(good),
    )
    reader = read_capture(path)
    assert [one.payload for one in reader] == [b"hello"]
    assert reader.skipped == 8


def test_the_obsolete_packet_block_is_read(tmp_path: Path) -> None:
    frame = frame_of()
    old = block(2, struct.pack("<HHIIII", 0, 0, 0, 3, len(frame), len(frame)) + frame)
    assert [one.at_unix_ns for one in read_capture(file_with(tmp_path, section(), interface(), old))] == [3_000]


def classic(*frames: tuple[int, bytes], nanoseconds: bool = False, order: str = "<", link_type: int = 1) -> bytes:
    """A classic pcap file, put together by hand."""
    content = struct.pack(f"{order}IHHiIII", 0xA1B23C4D if nanoseconds else 0xA1B2C3D4, 2, 4, 0, 0, 65_535, link_type)
    for ticks, frame in frames:
        seconds, rest = divmod(ticks, 10**9 if nanoseconds else 10**6)
        content += struct.pack(f"{order}IIII", seconds, rest, len(frame), len(frame)) + frame
    return content


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("nanoseconds", [True, False])
def test_classic_pcap_is_read_with_its_resolution(tmp_path: Path, order: str, nanoseconds: bool) -> None:
    ticks = AT if nanoseconds else AT // 1000
    content = classic((ticks, frame_of(b"a")), (ticks + 1, frame_of(b"b")), nanoseconds=nanoseconds, order=order)
    path = file_with(tmp_path, content)
    reader = read_capture(path)
    step_ns = 1 if nanoseconds else 1000
    first_ns = ticks * step_ns
    assert [(one.at_unix_ns, one.payload) for one in reader] == [(first_ns, b"a"), (first_ns + step_ns, b"b")]
    assert read_section_comment(path) is None


def test_classic_pcap_of_loopback_and_cut_packets(tmp_path: Path) -> None:
    ip = frame_of(b"x")[14:]
    content = classic((0, b"\x02\0\0\0" + ip), (1, b"\0\0\0\x02" + ip), (2, b"\x1e\0\0\0" + ip), link_type=0)
    cut = struct.pack("<IIII", 0, 0, 4, 400) + bytes(4)
    reader = read_capture(file_with(tmp_path, content, cut))
    assert [one.payload for one in reader] == [b"x", b"x"]
    assert reader.skipped == 2


@pytest.mark.parametrize(
    ("content", "offset", "reason"),
    [
        (classic((0, frame_of()))[:-1], 24, "46 of a packet's 47 bytes"),
        (classic((0, frame_of()))[:30], 24, "6 bytes of a packet's head"),
        (classic() + struct.pack("<IIII", 0, 0, 1 << 30, 1 << 30), 24, "its length cannot be 1073741824 bytes"),
    ],
)
def test_damaged_classic_pcap_is_named_by_offset(tmp_path: Path, content: bytes, offset: int, reason: str) -> None:
    with pytest.raises(CaptureError, match=re.escape(reason)) as raised:
        list(read_capture(file_with(tmp_path, content)))
    assert raised.value.offset == offset


def test_notes_lie_before_the_datagram_they_were_noted_before(tmp_path: Path) -> None:
    path = tmp_path / "notes.pcapng"
    with PcapngWriter(path, comment="c") as writer:
        writer.note(b"one")
        writer.note(b"two")
        writer.write(CapturedDatagram(AT, ROBOT, CLIENT, b"a"))
        writer.write(CapturedDatagram(AT, ROBOT, CLIENT, b"b"))
        writer.note(b"rest")
    found = [one.entries if isinstance(one, Notes) else one.payload for one in read_records(path)]
    assert found == [b"onetwo", b"a", b"b", b"rest"]
    assert [one.payload for one in read_capture(path)] == [b"a", b"b"]


def test_more_notes_than_an_option_holds_get_blocks_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "notes.pcapng"
    with PcapngWriter(path) as writer:
        for number in range(5000):
            writer.note(number.to_bytes(4, "little") * 10)
        writer.write(CapturedDatagram(AT, ROBOT, CLIENT, b"a"))
    notes = b"".join(one.entries for one in read_records(path) if isinstance(one, Notes))
    assert notes == b"".join(number.to_bytes(4, "little") * 10 for number in range(5000))


@given(datagrams, st.binary(max_size=30))
def test_a_packet_of_ours_is_read_alike_by_either_way(datagram: CapturedDatagram, notes: bytes) -> None:
    """The short way is for replays; a comment before our options makes the reader take the long one."""
    file = BytesIO()
    with PcapngWriter(file) as writer:
        writer.note(notes)
        writer.write(datagram)
    content = file.getvalue()
    head = len(section() + interface(options=option(9, b"\x09") + option(0, b""))) + len(option(4, b"fri-hil")) + 4
    block_ = content[head:]
    size = struct.unpack_from("<I", block_, 20)[0]
    at = 28 + size + -size % 4
    body = block_[8:at] + option(1, b"a comment") + block_[at:-4]
    with tempfile.TemporaryDirectory() as folder:
        short, long = Path(folder) / "short", Path(folder) / "long"
        short.write_bytes(content)
        long.write_bytes(content[:head] + block(6, body))
        assert list(read_records(short)) == list(read_records(long))
        packets = [one for one in read_records(short) if isinstance(one, Packet)]
    assert [one.datagram for one in packets] == [datagram]
    assert packets[0].recorded_crc32 == zlib.crc32(packets[0].frame)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "the file is empty"),
        (b"\n", "not a pcapng file: it begins with 0a"),
        (b"garbage, and more than twelve bytes of it", "not a pcapng file: it begins with 67 61 72 62"),
        (b"\xd4\xc3\xb2\xa1" + bytes(16), "20 of the header's 24 bytes"),
        (section()[:10], "10 bytes of a block's head"),
        (section()[:8] + b"abcd" + section()[12:], "61 62 63 64 is no pcapng byte order mark"),
        (section()[:20], "20 of a block's 28 bytes"),
        (section(version=2), "pcapng version 2.0; valid: 1.x"),
        (b"\n\r\r\n\x0d\x00\x00\x00" + section()[8:], "its length cannot be 13 bytes"),
        (b"\n\r\r\n\xfc\xff\xff\xff" + section()[8:], "its length cannot be 4294967292 bytes"),
        (section()[:-4] + b"\x00\x01\x02\x03", "damaged: length fields do not match"),
    ],
)
def test_a_file_that_is_no_capture_is_refused_at_once(tmp_path: Path, content: bytes, reason: str) -> None:
    path = file_with(tmp_path, content)
    for read in (read_capture, read_section_comment):
        with pytest.raises(CaptureError, match=re.escape(reason)) as raised:
            read(path)
        assert raised.value.path == path
        assert raised.value.offset == 0
        assert str(path) in str(raised.value)


@pytest.mark.parametrize("missing", [1, 4, 40])
def test_a_truncated_file_gives_its_whole_packets_then_an_error(tmp_path: Path, missing: int) -> None:
    whole = written(*(CapturedDatagram(AT + i, ROBOT, CLIENT, b"x" * 40) for i in range(3)))
    reader = read_capture(file_with(tmp_path, whole[:-missing]))
    assert [next(reader).at_unix_ns, next(reader).at_unix_ns] == [AT, AT + 1]
    with pytest.raises(CaptureError, match="truncated") as raised:
        next(reader)
    assert raised.value.offset == len(whole) - 132


@pytest.mark.parametrize(
    ("parts", "reason"),
    [
        ((packet(frame_of()),), "interface 0 is not described"),
        (
            (interface(), packet(frame_of()).replace(b"\x2f\x00\x00\x00", b"\x00\x0f\x00\x00", 1)),
            "3840 bytes of packet",
        ),
    ],
)
def test_a_damaged_packet_is_named_by_number_and_offset(tmp_path: Path, parts: tuple[bytes, ...], reason: str) -> None:
    with pytest.raises(CaptureError, match=reason) as raised:
        list(read_capture(file_with(tmp_path, section(), *parts)))
    assert raised.value.packet == 1
    assert raised.value.offset == 28 + len(b"".join(parts[:-1]))
    assert "at packet 1, byte " in str(raised.value)


@given(st.data())
def test_a_damaged_file_raises_nothing_but_capture_errors(data: st.DataObject) -> None:
    content = bytearray(written(CapturedDatagram(AT, ROBOT, CLIENT, b"payload"), comment="comment"))
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    with tempfile.TemporaryDirectory() as folder:
        path = file_with(Path(folder), bytes(content))
        with suppress(CaptureError):
            list(read_capture(path))


def test_errors_of_the_system_are_capture_errors(tmp_path: Path) -> None:
    missing = tmp_path / "none" / "a.pcapng"
    with pytest.raises(CaptureError, match="there is no folder"):
        PcapngWriter(missing)
    with pytest.raises(CaptureError, match="cannot be created: Is a directory"):
        PcapngWriter(tmp_path)
    with pytest.raises(CaptureError, match="cannot be read: No such file"):
        read_capture(missing)
    assert issubclass(CaptureError, HilError)


def test_a_full_disk_is_a_capture_error() -> None:
    with pytest.raises(CaptureError, match="No space left"), PcapngWriter(Path("/dev/full")):
        pass
    with Path("/dev/full").open("wb", buffering=0) as full, pytest.raises(CaptureError, match="No space left"):
        PcapngWriter(full)


def test_the_error_inside_the_block_is_the_one_that_is_heard() -> None:
    with pytest.raises(KeyError), PcapngWriter(Path("/dev/full")):
        raise KeyError


def test_a_file_given_open_stays_open(tmp_path: Path) -> None:
    with (tmp_path / "a.pcapng").open("wb") as file:
        with PcapngWriter(file) as writer:
            writer.close()
        assert not file.closed


def test_an_abandoned_reader_closes_its_file(tmp_path: Path) -> None:
    path = file_with(tmp_path, written(*[CapturedDatagram(AT, ROBOT, CLIENT, b"")] * 3))

    def opened() -> int:
        return sum(link.resolve() == path for link in Path("/proc/self/fd").iterdir() if os.path.lexists(link))

    reader: CaptureReader | None = read_capture(path)
    assert reader is not None
    next(reader)
    assert opened() == 1
    reader = None
    assert opened() == 0


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
@pytest.mark.parametrize("comment", [None, "", '{"seed": 7}'])
def test_wireshark_reads_it_without_a_warning(tmp_path: Path, comment: str | None) -> None:
    packets = [CapturedDatagram(AT + i, ROBOT, CLIENT, bytes(range(256))[:i] * 5) for i in range(0, 250, 7)]
    path = file_with(tmp_path, written(*packets, comment=comment))
    fields = "frame.time_epoch eth.src ip.src ip.checksum.status udp.checksum.status udp.length _ws.expert"
    command = [
        "tshark",
        "-r",
        str(path),
        "-o",
        "ip.check_checksum:TRUE",
        "-o",
        "udp.check_checksum:TRUE",
        "-T",
        "fields",
    ]
    for field in fields.split():
        command += ["-e", field]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    complaints = [line for line in result.stderr.splitlines() if not line.startswith("Running as user")]
    assert complaints == []
    assert [line.split("\t") for line in result.stdout.splitlines()] == [
        [
            f"{one.at_unix_ns // 10**9}.{one.at_unix_ns % 10**9:09}",
            "02:00:c0:aa:0a:02",
            ROBOT[0],
            "1",
            "1",
            str(len(one.payload) + 8),
            "",
        ]
        for one in packets
    ]


@pytest.mark.skipif(shutil.which("capinfos") is None, reason="capinfos (part of tshark) is not installed")
def test_wireshark_shows_the_comment(tmp_path: Path) -> None:
    path = file_with(tmp_path, written(comment='{"seed": 7}'))
    command = ["capinfos", "-k", str(path)]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert '{"seed": 7}' in result.stdout
