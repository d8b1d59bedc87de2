"""Decoding is total: any bytes are a message or a MalformedDatagram with its outcome and words."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.values.errors import MalformedDatagram
from hil.values.fri import COMMAND_IDENTIFIER, MONITORING_IDENTIFIER, TRAITS, Release
from hil.values.fri_messages import (
    CommandData,
    CommandMessage,
    ConnectionInfo,
    IOValue,
    IpoData,
    MonitorData,
    MonitoringMessage,
    Redundancy,
    RobotInfo,
    TimeStamp,
    Transformation,
)
from hil.values.outcomes import Outcome
from tests.support.captures import datagrams, files, release_of
from transport.fri import FriCodec, fri_pb2, reading, writing
from transport.fri.framing import frame, unframe
from transport.fri.usual import usual_command

FLOATS = st.floats(allow_nan=False)
COUNTERS = st.integers(0, 2**32 - 1)
INT32 = st.integers(-(2**31), 2**31 - 1)


def vectors(minimum: int = 0, maximum: int = 9) -> st.SearchStrategy[tuple[float, ...]]:
    return st.lists(FLOATS, min_size=minimum, max_size=maximum).map(tuple)


STAMPS = st.builds(TimeStamp, COUNTERS, COUNTERS)
IO = st.builds(IOValue, st.text(max_size=63), INT32, INT32, st.one_of(st.none(), st.integers(0, 2**64 - 1)), st.none())
MAYBE_VECTOR = st.one_of(st.none(), vectors(), vectors(7, 7))


def poses(size: int) -> st.SearchStrategy[Transformation]:
    return st.builds(Transformation, st.text(max_size=63), vectors(size, size), st.one_of(st.none(), STAMPS))


def monitoring_messages() -> st.SearchStrategy[MonitoringMessage]:
    optional = st.one_of(st.none(), INT32)
    redundancy = st.one_of(st.none(), st.builds(Redundancy, INT32, FLOATS))
    pose = st.one_of(st.none(), poses(7))
    monitor = st.builds(
        MonitorData,
        *[MAYBE_VECTOR] * 6,
        st.lists(IO, max_size=3).map(tuple),
        pose,
        redundancy,
        st.one_of(st.none(), STAMPS),
    )
    return st.builds(
        MonitoringMessage,
        COUNTERS,
        COUNTERS,
        st.one_of(
            st.none(),
            st.builds(RobotInfo, optional, optional, st.lists(INT32, max_size=8).map(tuple), optional, optional),
        ),
        st.one_of(st.none(), monitor),
        st.one_of(st.none(), st.builds(ConnectionInfo, INT32, INT32, st.none(), COUNTERS)),
        st.one_of(
            st.none(),
            st.builds(IpoData, MAYBE_VECTOR, pose, redundancy, optional, optional, st.one_of(st.none(), FLOATS)),
        ),
        st.lists(poses(7), max_size=2).map(tuple),
        st.none(),
        st.just(MONITORING_IDENTIFIER),
    )


@pytest.mark.parametrize("release", [Release.V1_15, Release.V2_7])
@given(message=monitoring_messages())
def test_monitoring_round_trip(release: Release, message: MonitoringMessage) -> None:
    codec = FriCodec(release)
    datagram = codec.encode_monitoring(message)
    if len(datagram) <= 1500:
        assert codec.decode_monitoring(datagram) == message
    else:
        with pytest.raises(MalformedDatagram) as caught:
            codec.decode_monitoring(datagram)
        assert caught.value.outcome is Outcome.TOO_LONG


COMMANDS = st.builds(
    CommandMessage,
    COUNTERS,
    COUNTERS,
    st.builds(
        CommandData,
        MAYBE_VECTOR,
        st.one_of(st.none(), vectors(6, 6)),
        MAYBE_VECTOR,
        st.just(()),
        st.just(()),
        st.none(),
        st.none(),
    ),
    st.none(),
    st.just(COMMAND_IDENTIFIER),
)


@pytest.mark.parametrize("release", list(Release))
@given(message=COMMANDS)
def test_command_round_trip(release: Release, message: CommandMessage) -> None:
    codec = FriCodec(release)
    assert codec.decode_command(codec.encode_command(message)) == message


@pytest.mark.parametrize("release", list(Release))
@given(data=st.data())
def test_decoding_mutated_recordings_gives_a_message_or_the_one_error(release: Release, data: st.DataObject) -> None:
    """Invariant: whatever the bytes, decode returns a message or raises MalformedDatagram, and nothing else."""
    codec = FriCodec(release)
    path = data.draw(st.sampled_from([path for path in files() if release_of(path) is release]))
    recorded = _some_datagrams(str(path))
    body = bytearray(data.draw(st.sampled_from(recorded)))
    for _ in range(data.draw(st.integers(0, 8))):
        body[data.draw(st.integers(0, len(body) - 1))] = data.draw(st.integers(0, 255))
    mutated = bytes(body[: data.draw(st.integers(0, len(body)))]) + data.draw(st.binary(max_size=20))
    if TRAITS[release].framed and data.draw(st.booleans()):
        mutated = frame(mutated[4:-4])
    for decode in (codec.decode_command, codec.decode_monitoring):
        with contextlib.suppress(MalformedDatagram):
            assert decode(mutated) is not None


_cache: dict[str, list[bytes]] = {}


def _some_datagrams(path: str) -> list[bytes]:
    from pathlib import Path

    if path not in _cache:
        _cache[path] = [payload for index, (_, payload) in enumerate(datagrams(Path(path))) if index % 37 == 0]
    return _cache[path]


def test_a_frame_says_what_is_wrong_with_it() -> None:
    good = frame(b"0123456789")
    assert unframe(good) == (b"0123456789", None)
    for broken, words in (
        (good[:7], "7 bytes cannot hold"),
        (good + b"x", "the length prefix says 10 bytes, the datagram has 11"),
        (good[:-1] + b"\0", "the CRC is"),
    ):
        body, reason = unframe(broken)
        assert body is None
        assert words in str(reason)


@pytest.mark.parametrize(
    ("release", "data", "words"),
    [
        (Release.V1_15, CommandData(pose=Transformation("", (0.0,) * 12)), "a Cartesian pose, which only 2.x has"),
        (Release.V1_11, CommandData(inputs_outputs=(IOValue("a.b", 0, 1, 1),)), "outputs, which exist from 1.14 on"),
        (
            Release.V1_14,
            CommandData(transformations=(Transformation("T", (0.0,) * 7),)),
            "a transformation of 7 numbers",
        ),
        (Release.V2_5, CommandData(transformations=(Transformation("T", (0.0,) * 12),)), "where 7 are needed"),
    ],
)
def test_what_a_release_does_not_have_is_another_releases(release: Release, data: CommandData, words: str) -> None:
    codec = FriCodec(release)
    with pytest.raises(MalformedDatagram, match="other_release") as caught:
        codec.decode_command(codec.encode_command(CommandMessage(0, 0, data)))
    assert words in caught.value.detail


def test_a_monitoring_message_is_no_command() -> None:
    codec = FriCodec(Release.V1_15)
    path = next(path for path in files() if release_of(path) is Release.V1_15)
    monitoring = next(payload for from_controller, payload in datagrams(path) if from_controller)
    with pytest.raises(MalformedDatagram) as caught:
        codec.decode_command(monitoring)
    assert caught.value.outcome in {Outcome.OTHER_RELEASE, Outcome.UNDECODABLE}


@pytest.mark.parametrize("release", list(Release))
def test_a_name_that_is_no_utf8_is_no_message(release: Release) -> None:
    codec = FriCodec(release)
    size = TRAITS[release].transformation_values
    good = codec.encode_command(
        CommandMessage(0, 0, CommandData(transformations=(Transformation("NAME", (0.0,) * size),)))
    )
    body = (good[4:-4] if TRAITS[release].framed else good).replace(b"NAME", b"\xff\xfe\xff\xfe")
    with pytest.raises(MalformedDatagram, match="is no UTF-8") as caught:
        codec.decode_command(frame(body) if TRAITS[release].framed else body)
    assert caught.value.outcome is Outcome.UNDECODABLE


@given(
    message=st.builds(
        CommandMessage,
        COUNTERS,
        COUNTERS,
        st.one_of(
            st.none(),
            st.builds(lambda position: CommandData(position=position), vectors(7, 7)),
            st.builds(lambda position, torque: CommandData(position, torque=torque), vectors(7, 7), vectors(7, 7)),
            st.builds(lambda position, wrench: CommandData(position, wrench=wrench), vectors(7, 7), vectors(6, 6)),
        ),
        st.none(),
        COUNTERS,
    ),
    changes=st.lists(st.tuples(st.integers(0, 200), st.integers(0, 255)), max_size=3),
    cut=st.one_of(st.none(), st.integers(0, 160)),
)
def test_the_usual_commands_are_read_as_protobuf_reads_them(
    message: CommandMessage, changes: list[tuple[int, int]], cut: int | None
) -> None:
    """Invariant: the short way may decline, but what it accepts is what protobuf makes of the same bytes."""
    body = bytearray(writing.command(message).SerializeToString()[:cut])
    for place, value in changes:
        if body:
            body[place % len(body)] = value
    read = usual_command(bytes(body))
    if not changes and cut is None:
        assert read == message
    if read is not None:
        assert repr(read) == repr(reading.command(fri_pb2.CommandMessage.FromString(bytes(body))))
