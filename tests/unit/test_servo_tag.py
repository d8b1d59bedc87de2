"""Tags of the servo link: nothing without the right one is accepted, and each end learns why; files of keys."""

import os
import stat
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.values.errors import ConfigurationError, MalformedDatagram
from hil.values.outcomes import Outcome
from hil.values.servo import PROTOCOL_VERSION, Command, Ended, FromClient, Goodbye, Hello, Refused, Role, SetDestination
from transport.servo import ServoCodec, load_key, write_key
from transport.servo.tag import TAG_BYTES, Direction, Envelope

KEY = bytes(range(32))
FROM_CLIENT: tuple[FromClient, ...] = (
    Hello(PROTOCOL_VERSION, 7, Role.COMMANDER, 300, 5, "grinder"),
    Command(1, 2, 3, 4, True, (SetDestination(5, 6, (0.0,) * 7),)),
    Goodbye(1, 2),
)
PACKETS = st.sampled_from(FROM_CLIENT)


def outcome(codec: ServoCodec, datagram: bytes) -> Outcome:
    """Return what becomes of a datagram that is no packet from a client."""
    with pytest.raises(MalformedDatagram) as caught:
        codec.decode_from_client(datagram)
    return caught.value.outcome


@given(packet=PACKETS, size=st.sampled_from([16, 17, 32, 63, 64]), data=st.data())
def test_the_same_key_opens_and_any_other_does_not(packet: FromClient, size: int, data: st.DataObject) -> None:
    key = data.draw(st.binary(min_size=size, max_size=size))
    other = data.draw(st.binary(min_size=16, max_size=64).filter(lambda other: other != key))
    datagram = ServoCodec(key).encode_from_client(packet)
    assert ServoCodec(key).decode_from_client(datagram) == packet
    assert outcome(ServoCodec(other), datagram) is Outcome.UNAUTHENTICATED


def test_the_bytes_of_a_tag() -> None:
    """Changing how these are made changes the framing, which is frozen; they hold the version of the protocol."""
    datagram = ServoCodec(KEY).encode_from_client(Goodbye(1, 2))
    assert datagram[:1].hex() == "54"
    assert datagram[1:-TAG_BYTES] == ServoCodec().encode_from_client(Goodbye(1, 2))[1:]
    assert datagram[-TAG_BYTES:].hex() == "ce6cfd5d6f0440c1a2136beeb37ab29e"
    back = ServoCodec(KEY).encode_from_controller(Ended(1, "no"))
    assert back[-TAG_BYTES:].hex() == "86b6b470bf86cefbb4597a1bd5207ca9"


def test_a_packet_cannot_be_sent_back_to_where_it_came_from() -> None:
    to_controller, to_client = Envelope(KEY, Direction.FROM_CLIENT), Envelope(KEY, Direction.FROM_CONTROLLER)
    packet = b"the same bytes both ways"
    assert to_controller.unwrap(to_controller.wrap(packet)) == to_client.unwrap(to_client.wrap(packet)) == packet
    for envelope, other in ((to_controller, to_client), (to_client, to_controller)):
        with pytest.raises(MalformedDatagram) as caught:
            envelope.unwrap(other.wrap(packet))
        assert caught.value.outcome is Outcome.UNAUTHENTICATED
    refused = ServoCodec(KEY).encode_from_controller(Refused(1, 7, "no", True))
    assert outcome(ServoCodec(KEY), refused) is Outcome.UNAUTHENTICATED


@given(packet=PACKETS, data=st.data())
def test_no_changed_packet_is_accepted(packet: FromClient, data: st.DataObject) -> None:
    """Invariant: one bit more or less anywhere, framing and tag included, and the packet is unauthenticated."""
    codec = ServoCodec(KEY)
    datagram = bytearray(codec.encode_from_client(packet))
    for bit in data.draw(st.sets(st.integers(0, 8 * len(datagram) - 1), min_size=1, max_size=3)):
        datagram[bit // 8] ^= 1 << bit % 8
    assert outcome(codec, bytes(datagram)) is Outcome.UNAUTHENTICATED


@pytest.mark.parametrize("packet", FROM_CLIENT, ids=lambda packet: type(packet).__name__)
def test_no_part_of_a_packet_is_accepted(packet: FromClient) -> None:
    codec = ServoCodec(KEY)
    datagram = codec.encode_from_client(packet)
    for size in range(len(datagram)):
        expected = Outcome.UNAUTHENTICATED if size >= 5 else Outcome.TOO_SHORT
        assert outcome(codec, datagram[:size]) is expected
        assert outcome(codec, datagram[len(datagram) - size :]) is expected
    for longer in (datagram + b"\0", datagram + datagram[-TAG_BYTES:], datagram[:1] + datagram):
        assert outcome(codec, longer) is Outcome.UNAUTHENTICATED


def test_an_end_with_a_key_and_one_without_know_each_other() -> None:
    keyed, bare = ServoCodec(KEY), ServoCodec()
    for here, there, words in (
        (bare, keyed, "a tag, but there is no pre-shared key on this side"),
        (keyed, bare, "no tag, but there is a pre-shared key on this side"),
    ):
        with pytest.raises(MalformedDatagram, match=f"unauthenticated: {words}"):
            here.decode_from_client(there.encode_from_client(FROM_CLIENT[0]))
        with pytest.raises(MalformedDatagram, match=f"unauthenticated: {words}"):
            here.decode_from_controller(there.encode_from_controller(Ended(1, "")))


@pytest.mark.parametrize("size", [0, 1, 15, 65])
def test_a_key_has_16_to_64_bytes(size: int) -> None:
    with pytest.raises(ConfigurationError, match=rf"a key of {size} bytes; 16\.\.64 are needed"):
        ServoCodec(bytes(size))


def key_file(folder: Path, content: bytes, *, mode: int = 0o600) -> Path:
    """Return a new key file."""
    file = folder / "servo.key"
    file.write_bytes(content)
    file.chmod(mode)
    return file


def test_a_new_key_is_random_private_and_never_written_over_another(tmp_path: Path) -> None:
    files = [tmp_path / "one.key", tmp_path / "two.key"]
    mask = os.umask(0)
    try:
        for file in files:
            write_key(file)
    finally:
        os.umask(mask)
    one, two = (load_key(file) for file in files)
    assert len(one) == len(two) == 32
    assert one != two
    assert bytes.fromhex(files[0].read_text()) == one
    if os.name == "posix":
        assert stat.S_IMODE(files[0].stat().st_mode) == 0o600
    with pytest.raises(ConfigurationError, match=r"one\.key exists already; a key file is never overwritten"):
        write_key(files[0])
    assert load_key(str(files[0])) == one
    with pytest.raises(ConfigurationError, match=r"cannot write key file .*: No such file or directory"):
        write_key(tmp_path / "no folder" / "servo.key")


@pytest.mark.parametrize(
    ("content", "key"),
    [
        (b"000102030405060708090a0b0c0d0e0f", bytes(range(16))),
        (b"  000102030405060708090A0B0C0D0E0F\r\n", bytes(range(16))),
        (b"ab" * 64, b"\xab" * 64),
        (b"correct horse battery staple\n", b"correct horse battery staple"),
        ("Schlüssel für den Roboter".encode(), "Schlüssel für den Roboter".encode()),
    ],
)
def test_a_key_file_has_hexadecimal_digits_or_text(tmp_path: Path, content: bytes, key: bytes) -> None:
    assert load_key(key_file(tmp_path, content)) == key


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", r"has a key of 0 bytes; 16\.\.64 are needed"),
        (b"\n\n", r"has a key of 0 bytes; 16\.\.64 are needed"),
        (b"fifteen letters", r"has a key of 15 bytes; 16\.\.64 are needed"),
        (b"0123456789abcdef", r"has a key of 8 bytes in 16 hexadecimal digits; 16\.\.64 are needed"),
        (b"0" * 33, "has 33 hexadecimal digits: an even number is needed"),
        (b"x" * 65, r"has a key of 65 bytes; 16\.\.64 are needed"),
        (b"x" * 16 + b" " * 2000, "has more than 1024 bytes: that is no key"),
    ],
)
def test_a_file_that_has_no_key_is_named(tmp_path: Path, content: bytes, words: str) -> None:
    with pytest.raises(ConfigurationError, match=rf"key file .*servo\.key {words}"):
        load_key(key_file(tmp_path, content))


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"cannot read key file .*servo\.key: No such file"):
        load_key(tmp_path / "servo.key")
    with pytest.raises(ConfigurationError, match=r"cannot read key file .*: Is a directory"):
        load_key(tmp_path)
    for touch in (load_key, write_key):
        with pytest.raises(ConfigurationError, match="key file a\0b: embedded null byte"):
            touch("a\0b")


@pytest.mark.skipif(os.name != "posix", reason="modes are POSIX")
@pytest.mark.parametrize("mode", [0o644, 0o640, 0o604, 0o620, 0o602, 0o601])
def test_a_key_that_is_not_secret_is_refused(tmp_path: Path, mode: int) -> None:
    file = key_file(tmp_path, b"correct horse battery staple", mode=mode)
    with pytest.raises(
        ConfigurationError, match=rf"has mode {mode:04o}, so that others may .* it: chmod 600 .*servo\.key"
    ):
        load_key(file)
    file.chmod(0o400)
    assert load_key(file) == b"correct horse battery staple"
