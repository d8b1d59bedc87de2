"""TCP segments are read from captures as Wireshark reads them, of whole frames and of cut ones."""

import shutil
import struct
import subprocess
import tempfile
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.cases import cases
from tests.unit.test_capture_pcapng import block, classic, file_with, frame_of, interface, option, packet, section
from tools.doctor.capture.tcp.diagnose import diagnose_tcp
from transport.capture.errors import CaptureError
from transport.capture.segments import read_segments
from transport.capture.tcp import ACK, SYN, Segment, SegmentDecoder, SynOptions

DATA = Path(__file__).parents[1] / "data"
REAL = [DATA / "tcp" / f"{name}.pcapng" for name in ("nagle-request", "nagle-reply", "no-delay")]
"""Linux 6.x on loopback, recorded by ``tools/make_tcp_captures.py``; frames are cut behind 74 bytes."""
ETHERNET = bytes(12) + b"\x08\x00"


def ip_packet(
    payload: bytes = b"hello",
    *,
    flags: int = ACK,
    options: bytes = b"",
    ip_options: bytes = b"",
    total: int | None = None,
    fragment: int = 0,
    protocol: int = 6,
) -> bytes:
    """An IPv4 packet with a TCP segment, put together by hand."""
    tcp = struct.pack("!HHIIBBHHH", 51234, 30001, 7, 9, (20 + len(options)) // 4 << 4, flags, 500, 0, 0) + options
    size = 20 + len(ip_options) + len(tcp) + len(payload)
    first = 0x40 | (20 + len(ip_options)) // 4
    ends = bytes([172, 31, 1, 100, 172, 31, 1, 147])
    head = struct.pack("!BBHHHBBH", first, 0, size if total is None else total, 3, fragment, 64, protocol, 0)
    return head + ends + ip_options + tcp + payload


SEGMENT = Segment(1, 0, ("172.31.1.100", 51234), ("172.31.1.147", 30001), 7, 9, ACK, 500, 5, 3, None)


def decoded(frame: bytes, *, link_type: int = 1, full: int | None = None) -> Segment | None:
    return SegmentDecoder().decode(1, 0, link_type, frame, len(frame) if full is None else full)


@pytest.mark.parametrize(
    ("link_type", "head"),
    [
        (1, ETHERNET),
        (1, bytes(12) + b"\x81\x00\x00\x05\x08\x00"),
        (101, b""),
        (228, b""),
        (113, bytes(14) + b"\x08\x00"),
        (276, b"\x08\x00" + bytes(18)),
        (0, b"\x02\0\0\0"),
        (108, b"\0\0\0\x02"),
    ],
)
def test_segments_are_read_of_any_link_layer(link_type: int, head: bytes) -> None:
    assert decoded(head + ip_packet(), link_type=link_type) == SEGMENT


def test_options_of_ip_and_tcp_are_no_payload() -> None:
    assert decoded(ETHERNET + ip_packet(ip_options=bytes(8), options=bytes(12))) == SEGMENT


def test_padding_of_ethernet_is_no_payload() -> None:
    assert decoded(ETHERNET + ip_packet(b"") + bytes(6)) == SEGMENT._replace(size=0)


def test_a_cut_frame_has_its_payloads_length_all_the_same() -> None:
    whole = ETHERNET + ip_packet(bytes(1000))
    assert decoded(whole[:54], full=len(whole)) == SEGMENT._replace(size=1000)


def test_what_the_network_card_is_to_cut_has_the_frames_length() -> None:
    frame = ETHERNET + ip_packet(bytes(40_000), total=0)
    assert decoded(frame[:60], full=len(frame)) == SEGMENT._replace(size=40_000)


@pytest.mark.parametrize(
    ("options", "offered"),
    [
        (b"", SynOptions(None, None, has_timestamps=False)),
        (b"\x02\x04\x05\xb4\x01\x03\x03\x07", SynOptions(1460, 7, has_timestamps=False)),
        (b"\x01\x01\x08\x0a" + bytes(8), SynOptions(None, None, has_timestamps=True)),
        (b"\x03\x03\xff\x00", SynOptions(None, 14, has_timestamps=False)),
        (b"\x00\x02\x04\x05", SynOptions(None, None, has_timestamps=False)),
        (b"\x02\x04\x05\xb4\x08\x00\x01\x01", SynOptions(1460, None, has_timestamps=False)),
        (b"\x01\x01\x01\x02", SynOptions(None, None, has_timestamps=False)),
    ],
)
def test_what_a_syn_offers_is_read_as_far_as_it_holds_together(options: bytes, offered: SynOptions) -> None:
    found = decoded(ETHERNET + ip_packet(flags=SYN, options=options))
    assert found is not None
    assert found.syn_options == offered


@pytest.mark.parametrize(
    ("frame", "skipped"),
    [
        (ETHERNET + ip_packet(protocol=17), 0),
        (bytes(12) + b"\x86\xdd" + bytes(60), 0),
        (ETHERNET + ip_packet()[:15], 0),
        (ETHERNET + ip_packet()[:39], 1),
        (ETHERNET + ip_packet(fragment=0x2000), 1),
        (ETHERNET + ip_packet(total=39), 1),
        (ETHERNET + b"\x41" + ip_packet()[1:], 1),
        (ETHERNET + ip_packet()[:32] + b"\x10" + ip_packet()[33:], 1),
    ],
)
def test_what_is_no_whole_head_of_a_segment_is_passed_over(frame: bytes, skipped: int) -> None:
    decoder = SegmentDecoder()
    assert decoder.decode(1, 0, 1, frame, len(frame)) is None
    assert decoder.skipped == skipped


@settings(max_examples=cases(60))
@given(st.sampled_from([1, 101, 113, 276, 9999]), st.binary(max_size=120))
def test_any_bytes_decode_to_a_segment_or_to_nothing(link_type: int, frame: bytes) -> None:
    decoded(frame, link_type=link_type)
    decoded(ETHERNET + ip_packet()[:20] + frame)
    decoded(ETHERNET + ip_packet(flags=SYN, options=bytes(40))[:40] + frame)


@pytest.mark.parametrize("order", ["<", ">"])
def test_segments_lie_between_datagrams_with_their_numbers_and_times(tmp_path: Path, order: str) -> None:
    tcp = ETHERNET + ip_packet()
    parts = (
        section(order),
        interface(order, options=option(9, b"\x09", order)),
        packet(frame_of(), 4, order),
        packet(tcp, 5, order),
        block(5, bytes(12), order),
        packet(tcp[:54], 6, order, full=len(tcp)),
    )
    reader = read_segments(file_with(tmp_path, *parts))
    assert list(reader) == [SEGMENT._replace(number=2, at_unix_ns=5), SEGMENT._replace(number=3, at_unix_ns=6)]
    assert reader.packets == 3


def test_classic_pcap_is_read_too(tmp_path: Path) -> None:
    path = file_with(tmp_path, classic((7, ETHERNET + ip_packet()), (8, frame_of())))
    assert list(read_segments(path)) == [SEGMENT._replace(at_unix_ns=7000)]


def test_progress_is_told_in_bytes_of_the_file(tmp_path: Path) -> None:
    one = packet(frame_of())
    path = file_with(tmp_path, section(), interface(), *[one] * 9000)
    told: list[int] = []
    assert list(read_segments(path, progress=told.append)) == []
    at = [28 + 20 + len(one) * (count - 1) for count in (4096, 8192)]
    assert told == at
    bars: list[tuple[int, int, str]] = []
    diagnose_tcp(path, progress=lambda *bar: bars.append(bar))
    assert bars == [(read, path.stat().st_size, "TCP") for read in at]


def test_a_damaged_file_is_read_up_to_the_damage(tmp_path: Path) -> None:
    content = REAL[0].read_bytes()[:-500]
    path = file_with(tmp_path, content)
    read: list[Segment] = []
    with pytest.raises(CaptureError, match="truncated") as raised:
        read += read_segments(path)
    assert 90 < len(read) < 107
    findings, tables = diagnose_tcp(path)
    assert [one.kind for one in findings] == ["tcp-nagle", "capture-damaged"]
    assert findings[1].sentence == f"{raised.value}; what lies before it was looked at"
    assert len(tables) == 1


def test_what_is_no_capture_and_what_has_no_tcp(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="not a pcapng file"):
        diagnose_tcp(file_with(tmp_path, b"garbage, and more than twelve bytes of it"))
    with pytest.raises(CaptureError, match="interface 0 is not described"):
        diagnose_tcp(file_with(tmp_path, section(), packet(ETHERNET + ip_packet())))
    with pytest.raises(CaptureError, match="cannot be read: No such file"):
        diagnose_tcp(tmp_path / "none.pcapng")
    assert diagnose_tcp(DATA / "smart-servo-2ms.pcapng") == ((), ())


def test_segments_that_cannot_be_read_are_counted(tmp_path: Path) -> None:
    cut = packet((ETHERNET + ip_packet())[:40], full=80)
    findings, _ = diagnose_tcp(file_with(tmp_path, section(), interface(), cut, cut))
    assert [one.sentence for one in findings] == [
        "2 TCP segments of the capture could not be read: fragments, or cut within their headers"
    ]


@settings(max_examples=cases(60), deadline=None)
@given(st.data())
def test_a_damaged_file_raises_nothing_but_capture_errors(data: st.DataObject) -> None:
    content = bytearray(REAL[2].read_bytes()[:2000])
    for _ in range(data.draw(st.integers(1, 6))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    with tempfile.TemporaryDirectory() as folder, suppress(CaptureError):
        diagnose_tcp(file_with(Path(folder), bytes(content)))


@pytest.mark.parametrize(
    ("file", "sender", "acknowledger"),
    [(REAL[0], "client 127.0.0.1", "server 127.0.0.1:30001"), (REAL[1], "server 127.0.0.1:30001", "client 127.0.0.1")],
)
def test_nagle_is_found_in_what_a_kernel_did(file: Path, sender: str, acknowledger: str) -> None:
    findings, (table,) = diagnose_tcp(file)
    (finding,) = findings
    assert finding.kind == "tcp-nagle"
    assert finding.sentence.startswith(f"the {sender}")
    assert "needs TCP_NODELAY: 19 times in 40 segments" in finding.sentence
    assert f"until the {acknowledger}" in finding.sentence
    assert "about 44 ms late, as Linux does" in finding.sentence
    assert finding.sentence.endswith("at most 23 exchanges a second")
    assert "both sides are on the machine that captured (loopback)" in finding.evidence
    assert table.rows[0][4] == "19"


def test_no_delay_is_healthy_in_what_a_kernel_did() -> None:
    (finding,), _ = diagnose_tcp(REAL[2])
    assert finding.kind == "tcp-healthy"
    assert finding.sentence.endswith("nothing was held back, lost or late")
    assert "n(20)" in finding.sentence
    assert any("TCP_NODELAY is set there" in line for line in finding.evidence)


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_every_field_is_wiresharks(tmp_path: Path) -> None:
    path = file_with(tmp_path, *(file.read_bytes() for file in REAL))  # sections follow each other
    fields = (
        "frame.number frame.time_epoch ip.src tcp.srcport ip.dst tcp.dstport tcp.seq_raw tcp.ack_raw tcp.flags "
        "tcp.window_size_value tcp.len ip.id tcp.options.mss_val tcp.options.wscale.shift"
    )
    command = ["tshark", "-r", str(path), "-T", "fields"]
    for field in fields.split():
        command += ["-e", field]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    ours = [
        [
            str(one.number),
            f"{one.at_unix_ns // 10**9}.{one.at_unix_ns % 10**9:09}",
            one.source[0],
            str(one.source[1]),
            one.destination[0],
            str(one.destination[1]),
            str(one.sequence),
            str(one.acknowledged),
            f"0x{one.flags:04x}",
            str(one.window),
            str(one.size),
            f"0x{one.identification:04x}",
            str(one.syn_options.maximum_segment_bytes) if one.syn_options else "",
            str(one.syn_options.window_shift) if one.syn_options else "",
        ]
        for one in read_segments(path)
    ]
    assert len(ours) > 280
    assert [line.split("\t") for line in result.stdout.splitlines()] == ours
