"""The servo link on the wire: every packet comes back, any bytes are a packet or a named refusal, and sizes hold."""

import contextlib
import math
import struct
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.values.arm import MAX_CONTACTS, Contact
from hil.values.control import (
    CartesianImpedanceControlMode,
    CartesianSineImpedanceControlMode,
    ControlModeSettings,
    ForceOscillation,
    JointImpedanceControlMode,
    PositionControlMode,
)
from hil.values.errors import ConfigurationError, HilError, MalformedDatagram
from hil.values.frames import FLANGE, MAX_FRAME_NAME_BYTES, MAX_FRAMES, Frame, FrameKind
from hil.values.fri import ControlMode, OperationMode, SafetyState
from hil.values.load import AttachedTool, Load
from hil.values.motion import (
    MAX_MOTIONS,
    FineInterpolatorState,
    MotionEnd,
    MotionKind,
    MotionParameters,
    MotionPhase,
)
from hil.values.operator import OperatorView, ProgramState
from hil.values.outcomes import Outcome
from hil.values.pose import Pose
from hil.values.robot import Six
from hil.values.servo import (
    MAX_COMMANDER_BYTES,
    MAX_DETAIL_BYTES,
    MAX_MOTIONS_IN_PACKET,
    MAX_NAME_BYTES,
    MAX_REASON_BYTES,
    MAX_REPORTS_IN_PACKET,
    MAX_REQUESTS_IN_PACKET,
    MAX_SERVO_DATAGRAM_BYTES,
    MAX_VECTOR_NUMBERS,
    MIN_HELLO_BYTES,
    PROTOCOL_VERSION,
    ChangeControlMode,
    Command,
    DescribeFrame,
    Ended,
    FlangeLocated,
    FrameDescribed,
    FromClient,
    FromController,
    GoalReached,
    Goodbye,
    Hello,
    LoadValidated,
    LocateFlange,
    MotionEnded,
    MotionState,
    PushArm,
    Refused,
    Report,
    Request,
    RequestDone,
    RequestError,
    Role,
    SetDestination,
    SetRuntimeParameters,
    Snapshot,
    StartMotion,
    State,
    StopMotion,
    ValidateLoad,
    Vector,
    Welcome,
)
from transport.servo import ServoCodec, reading, servo_pb2, usual
from transport.servo.layout import field
from transport.servo.modes import wire_mode

KEY = b"a key of thirty-two bytes, no le"
CODECS = (ServoCodec(), ServoCodec(KEY))
Decode = Callable[[bytes], FromClient | FromController]

NUMBERS = st.integers(0, 2**64 - 1)
SMALL = st.integers(0, 2**32 - 1)
TIMES = st.integers(-(2**63), 2**63 - 1)
FLOATS = st.binary(min_size=8, max_size=8).map(lambda raw: float(struct.unpack("<d", raw)[0]))
"""Any 64 bits, NaN too: packets are compared by their repr."""


def texts(most_bytes: int, *, printable: bool = False) -> st.SearchStrategy[str]:
    text = st.text(max_size=most_bytes).filter(lambda text: len(text.encode()) <= most_bytes)
    return text.filter(str.isprintable) if printable else text


def vectors(maximum: int = 7) -> st.SearchStrategy[Vector]:
    """Vectors of any numbers, most of them with seven; drawn as bytes, which is faster."""
    sizes = st.one_of(st.just(7), st.just(7), st.integers(0, maximum))
    raw = sizes.flatmap(lambda size: st.binary(min_size=8 * size, max_size=8 * size))
    return raw.map(lambda raw: struct.unpack(f"<{len(raw) // 8}d", raw))


SEVENS = st.binary(min_size=56, max_size=56).map(lambda raw: struct.unpack("<7d", raw))
MAYBE_VECTOR = st.one_of(st.none(), vectors(MAX_VECTOR_NUMBERS))
MAYBE_BOOL = st.one_of(st.none(), st.booleans())
FINITE = st.floats(-1e3, 1e3)
QUATERNIONS = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda wxyz: sum(number * number for number in wxyz) > 1e-3)
POSES = st.builds(Pose.from_quaternion, st.tuples(*[FINITE] * 3), QUATERNIONS)
MAYBE_POSE = st.one_of(st.none(), POSES)
FRAME_NAMES = texts(MAX_FRAME_NAME_BYTES)


def sixes(least: float, most: float) -> st.SearchStrategy[Six]:
    return st.tuples(*[st.floats(least, most)] * 6)


CARTESIAN = st.builds(
    CartesianImpedanceControlMode,
    sixes(0.0, 300.0),
    sixes(0.1, 1.0),
    st.floats(0.0, 1e4),
    st.floats(0.3, 1.0),
    sixes(-1e3, 1e3),
    sixes(1.0, 1e6),
    st.booleans(),
    sixes(1.0, 1e6),
    sixes(1.0, 1e6),
)
OSCILLATIONS = st.builds(
    ForceOscillation,
    sixes(0.0, 50.0),
    sixes(0.0, 15.0),
    sixes(-360.0, 360.0),
    sixes(-50.0, 50.0),
    sixes(1.0, 1e6),
    sixes(1.0, 1e6),
    st.floats(0.0, 1e3),
    st.one_of(st.just(math.inf), st.floats(0.0, 1e3)),
    st.floats(0.0, 1e3),
)
CONTROL: st.SearchStrategy[ControlModeSettings] = st.one_of(
    st.just(PositionControlMode()),
    st.builds(JointImpedanceControlMode, st.tuples(*[st.floats(0.0, 1e4)] * 7), st.tuples(*[st.floats(0.0, 1.0)] * 7)),
    CARTESIAN,
    st.builds(CartesianSineImpedanceControlMode, CARTESIAN, OSCILLATIONS),
)
MOMENTS = st.floats(0.5, 0.9)
LOADS = st.builds(
    Load, st.floats(0.0, 50.0), st.tuples(*[FINITE] * 3), st.tuples(*[MOMENTS] * 3), st.tuples(*[FINITE] * 3)
)
TOOLS = st.one_of(st.none(), st.builds(AttachedTool, LOADS, POSES))
REQUESTS: st.SearchStrategy[Request] = st.one_of(
    st.builds(SetDestination, NUMBERS, NUMBERS, MAYBE_VECTOR, MAYBE_VECTOR, MAYBE_POSE),
    st.builds(
        StartMotion,
        NUMBERS,
        st.sampled_from(MotionKind),
        st.builds(MotionParameters, *[FLOATS] * 8, st.booleans(), st.booleans()),
        MAYBE_VECTOR,
        MAYBE_POSE,
        CONTROL,
        st.one_of(st.just(FLANGE), FRAME_NAMES.filter(bool)),
        TOOLS,
    ),
    st.builds(ChangeControlMode, NUMBERS, NUMBERS, CONTROL),
    st.builds(ValidateLoad, NUMBERS, FRAME_NAMES, TOOLS),
    st.builds(PushArm, NUMBERS, SMALL, vectors(), vectors(), FLOATS),
    st.builds(SetRuntimeParameters, NUMBERS, NUMBERS, st.one_of(st.none(), FLOATS), MAYBE_BOOL, MAYBE_BOOL),
    st.builds(StopMotion, NUMBERS, NUMBERS),
    st.builds(DescribeFrame, NUMBERS, SMALL),
    st.builds(LocateFlange, NUMBERS, vectors(MAX_VECTOR_NUMBERS)),
)
HELLOS = st.builds(
    Hello,
    st.just(PROTOCOL_VERSION),
    NUMBERS,
    st.sampled_from(Role),
    SMALL,
    SMALL,
    texts(MAX_NAME_BYTES, printable=True),
    SMALL,
)
COMMANDS = st.builds(
    Command,
    NUMBERS,
    NUMBERS,
    NUMBERS,
    NUMBERS,
    st.booleans(),
    st.lists(REQUESTS, max_size=MAX_REQUESTS_IN_PACKET).map(tuple),
)
FROM_CLIENT: st.SearchStrategy[FromClient] = st.one_of(HELLOS, COMMANDS, st.builds(Goodbye, NUMBERS, NUMBERS))

REASONS, DETAILS = texts(MAX_REASON_BYTES), texts(MAX_DETAIL_BYTES)
FRAMES = st.builds(Frame, FRAME_NAMES, st.sampled_from(FrameKind), FRAME_NAMES, POSES, st.one_of(st.none(), LOADS))
REPORTS: st.SearchStrategy[Report] = st.one_of(
    st.builds(RequestDone, NUMBERS, NUMBERS, TIMES),
    st.builds(RequestDone, NUMBERS, NUMBERS, TIMES, st.sampled_from(RequestError), REASONS, DETAILS),
    st.builds(GoalReached, NUMBERS, NUMBERS, TIMES, st.sampled_from(FineInterpolatorState), vectors()),
    st.builds(MotionEnded, NUMBERS, NUMBERS, TIMES, st.sampled_from(MotionEnd), REASONS, DETAILS),
    st.builds(FrameDescribed, NUMBERS, NUMBERS, st.integers(1, MAX_FRAMES), FRAMES),
    st.builds(FlangeLocated, NUMBERS, NUMBERS, POSES),
    st.builds(LoadValidated, NUMBERS, NUMBERS, REASONS),
)
SINGLE = st.floats(width=32)
SIXES = st.tuples(*[SINGLE] * 6)
MOTIONS = st.builds(
    MotionState,
    NUMBERS,
    st.sampled_from(MotionKind),
    st.sampled_from(MotionPhase),
    st.sampled_from(FineInterpolatorState),
    vectors(),
    TIMES,
    FLOATS,
    *[NUMBERS] * 4,
    TIMES,
)
THREES = st.tuples(*[SINGLE] * 3)
CONTACTS = st.builds(Contact, THREES, THREES)
OPERATORS = st.builds(
    OperatorView,
    st.sampled_from(OperationMode),
    st.sampled_from(ProgramState),
    st.booleans(),
    st.floats(0.0, 100.0),
    st.sampled_from(SafetyState),
    st.one_of(st.just(""), REASONS),
    st.booleans(),
)
SNAPSHOTS = st.builds(
    Snapshot,
    TIMES,
    NUMBERS,
    OPERATORS,
    *[vectors()] * 4,
    POSES,
    st.sampled_from(ControlMode),
    st.one_of(st.just(()), st.tuples(*[SINGLE] * 7)),
    *[SIXES] * 2,
    texts(MAX_COMMANDER_BYTES),
    st.lists(MOTIONS, max_size=MAX_MOTIONS_IN_PACKET).map(tuple),
    SINGLE,
    st.lists(CONTACTS, max_size=MAX_CONTACTS).map(tuple),
)
STATES = st.builds(
    State,
    NUMBERS,
    NUMBERS,
    NUMBERS,
    NUMBERS,
    SNAPSHOTS,
    st.lists(REPORTS, max_size=MAX_REPORTS_IN_PACKET).map(tuple),
)
ANSWERS: st.SearchStrategy[FromController] = st.one_of(
    st.builds(
        Welcome,
        st.just(PROTOCOL_VERSION),
        NUMBERS,
        NUMBERS,
        texts(MAX_NAME_BYTES),
        texts(MAX_NAME_BYTES),
        SMALL,
        TIMES,
    ),
    st.builds(Refused, st.just(PROTOCOL_VERSION), NUMBERS, texts(MAX_REASON_BYTES), st.booleans()),
    st.builds(Ended, NUMBERS, texts(MAX_REASON_BYTES)),
)
FROM_CONTROLLER: st.SearchStrategy[FromController] = st.one_of(STATES, ANSWERS)


def refusal(decode: Decode, datagram: bytes) -> MalformedDatagram:
    """Return the refusal of bytes that are no packet."""
    with pytest.raises(MalformedDatagram) as caught:
        decode(datagram)
    return caught.value


def poses_in(value: object) -> list[Pose]:
    """Return the poses in a packet, in their order."""
    if isinstance(value, Pose):
        return [value]
    return [pose for part in value for pose in poses_in(part)] if isinstance(value, tuple) else []


def without_poses(value: object) -> str:
    """Return a packet in words, with nothing of its poses but that they are there."""
    if isinstance(value, Pose):
        return "a pose"
    return (
        f"{type(value).__name__}{[without_poses(part) for part in value]}" if isinstance(value, tuple) else repr(value)
    )


def assert_same(one: object, other: object) -> None:
    """Two packets are the same, and their poses in position exactly, in rotation as far as quaternions go."""
    assert without_poses(one) == without_poses(other)
    for here, there in zip(poses_in(one), poses_in(other), strict=True):
        assert here.position_m == there.position_m
        assert here.angle_rad(there) < 1e-14


def bare(wire: servo_pb2.Packet, *, version: int = PROTOCOL_VERSION) -> bytes:
    """Return a datagram of a packet made by hand."""
    wire.header.version = version
    return b"\x53" + wire.SerializeToString()


@pytest.mark.parametrize("codec", CODECS)
@given(packet=FROM_CLIENT)
def test_what_a_client_sends_comes_back(codec: ServoCodec, packet: FromClient) -> None:
    """Invariant: a packet comes back whole, but for the last requests of a command that has no room for them."""
    datagram = codec.encode_from_client(packet)
    assert len(datagram) <= MAX_SERVO_DATAGRAM_BYTES
    decoded = codec.decode_from_client(datagram)
    if isinstance(packet, Command):
        assert isinstance(decoded, Command)
        assert bool(decoded.requests) == bool(packet.requests)
        packet = packet._replace(requests=packet.requests[: len(decoded.requests)])
    assert_same(decoded, packet)


@pytest.mark.parametrize("codec", CODECS)
@given(packet=FROM_CONTROLLER)
def test_what_the_controller_sends_comes_back(codec: ServoCodec, packet: FromController) -> None:
    """Invariant: a packet comes back whole, but for the last reports and contacts of a state without room for them."""
    datagram = codec.encode_from_controller(packet)
    assert len(datagram) <= MAX_SERVO_DATAGRAM_BYTES
    decoded = codec.decode_from_controller(datagram)
    if isinstance(packet, State):
        assert isinstance(decoded, State)
        assert bool(decoded.reports) == bool(packet.reports)
        contacts = packet.snapshot.contacts[: len(decoded.snapshot.contacts)]
        snapshot = packet.snapshot._replace(contacts=contacts)
        packet = packet._replace(snapshot=snapshot, reports=packet.reports[: len(decoded.reports)])
    assert_same(decoded, packet)


SEVEN: Vector = (0.0, 0.5, -0.25, 1.0, -1.0, 1.5, 2.0)
NAN, INFINITY = float("nan"), float("inf")
POSE = Pose(0.5, -0.25, 1.0)
ESTIMATES = (ControlMode.CARTESIAN_IMPEDANCE, SEVEN, SEVEN[:6], SEVEN[1:])


def test_what_is_no_number_and_what_is_no_seven_is_the_controllers_to_judge() -> None:
    for position in ((), (NAN,) * 7, (INFINITY, -INFINITY), (0.0,) * 6, (0.0,) * MAX_VECTOR_NUMBERS):
        command = Command(1, 2, 3, requests=(SetDestination(4, 5, position, position),))
        assert repr(CODECS[0].decode_from_client(CODECS[0].encode_from_client(command))) == repr(command)


SNAPSHOT = Snapshot(
    now_ns=1_000_000,
    cycle=1,
    operator=OperatorView(
        mode=OperationMode.AUT,
        program=ProgramState.PAUSED,
        enabling=True,
        override_percent=50.0,
        safety_state=SafetyState.SAFETY_STOP_LEVEL_1,
        reason="start",
        permissive=True,
    ),
    measured_position=SEVEN,
    commanded_position=SEVEN,
    measured_torque=SEVEN,
    external_torque=SEVEN,
    flange_in_base=POSE,
    control_mode=ControlMode.JOINT_IMPEDANCE,
    external_torque_variance=SEVEN,
    flange_force=SEVEN[:6],
    flange_force_variance=SEVEN[1:],
    commander="grinder",
    motions=(
        MotionState(
            motion=1,
            kind=MotionKind.SMART_SERVO,
            phase=MotionPhase.ACTIVE,
            interpolator=FineInterpolatorState.RESTING,
            destination=SEVEN,
            destination_at_ns=500_000,
            remaining_s=0.125,
            goals_reached=2,
            received=6,
            superseded=1,
            executed=5,
            executed_at_ns=-1,
        ),
    ),
    flange_speed_mm_s=125.5,
    contacts=(Contact((0.5, -0.25, 1.0), (0.0, 1.5, -20.0)),),
)
RUNNING = OperatorView(OperationMode.AUT, ProgramState.RUNNING, False, 100.0, SafetyState.NORMAL_OPERATION, "", False)
_HEADER = "530a1d0803 110807060504030201 190200000000000000 210300000000000000"
_SINGLE = struct.pack("<7f", *SEVEN).hex()
_SEVEN = (
    "0000000000000000 000000000000e03f 000000000000d0bf 000000000000f03f"
    " 000000000000f0bf 000000000000f83f 0000000000000040"
)
_POSE = (
    "000000000000e03f 000000000000d0bf 000000000000f03f"
    " 000000000000f03f 0000000000000000 0000000000000000 0000000000000000"
)
GOLDEN: list[tuple[FromClient | FromController, str]] = [
    (
        Command(0x0102030405060708, 2, 3, 4, True),
        f"{_HEADER} 2a0b 090400000000000000 1001",
    ),
    (
        Command(0x0102030405060708, 2, 3, 4, False, (SetDestination(5, 6, SEVEN),)),
        f"{_HEADER} 2a5d 090400000000000000 1000 1a50 090500000000000000 1a45 090600000000000000 123a0a38 {_SEVEN}",
    ),
    (
        Command(0x0102030405060708, 2, 3, 4, False, (SetDestination(5, 6, None, None, POSE),)),
        f"{_HEADER} 2a5d 090400000000000000 1000 1a50 090500000000000000 1a45 090600000000000000 223a0a38 {_POSE}",
    ),
    (
        Command(0x0102030405060708, 2, 3, requests=(DescribeFrame(5, 6), LocateFlange(6, (0.5,)))),
        (f"{_HEADER} 2a26 1a0d 090500000000000000 3202 0806 1a15 090600000000000000 3a0a 0a08 000000000000e03f"),
    ),
    (
        Command(0x0102030405060708, 2, 3, requests=(StopMotion(5, 6),)),
        f"{_HEADER} 2a16 1a14 090500000000000000 2a09 090600000000000000",
    ),
    (
        Goodbye(0x0102030405060708, 2),
        "530a14 0803 110807060504030201 190200000000000000 3200",
    ),
    (
        Welcome(3, 7, 0x0102030405060708, "fri-hil 1", "lbr", 1, 1),
        (
            "530a0b 0803 110807060504030201 1a24 090700000000000000"
            " 1209 6672692d68696c2031 1a03 6c6272 2001 290100000000000000"
        ),
    ),
    (
        Refused(3, 7, "no", True),
        "530a02 0803 220f 090700000000000000 1202 6e6f 1801",
    ),
    (
        Ended(0x0102030405060708, "no"),
        "530a0b 0803 110807060504030201 4204 0a02 6e6f",
    ),
    (
        State(0x0102030405060708, 2, 3, 4, SNAPSHOT, (RequestDone(5, 6, 7),)),
        (
            f"{_HEADER} 3a8f05 090400000000000000 12e204"
            " 0940420f0000000000 110100000000000000 1802 2002 2801 310000000000004940 3802 4001"
            f" 4a38 {_SEVEN} 5238 {_SEVEN} 5a38 {_SEVEN} 6238 {_SEVEN} 82013a0a38 {_POSE}"
            f" 880102 92011c {_SINGLE} 9a0118 {_SINGLE[:48]} a20118 {_SINGLE[8:]} ad010000fb42"
            " 6a07 6772696e646572 7205 7374617274"
            f" 7a8801 090100000000000000 1002 1803 2003 2a38 {_SEVEN} 3120a1070000000000 39000000000000c03f"
            " 410200000000000000 490600000000000000 510100000000000000 590500000000000000 61ffffffffffffffff"
            " b2011c 0a0c 0000003f 000080be 0000803f 120c 00000000 0000c03f 0000a0c1"
            " 1a1f 090500000000000000 110700000000000000 1a0b 090600000000000000 1000"
        ),
    ),
]


@pytest.mark.parametrize(("packet", "expected"), GOLDEN, ids=lambda value: type(value).__name__)
def test_the_bytes_on_the_wire(packet: FromClient | FromController, expected: str) -> None:
    """Changing these changes the protocol: then PROTOCOL_VERSION must be another.

    Unless a change only adds fields, which a reader that is older skips.
    """
    codec = CODECS[0]
    datagram = bytes.fromhex(expected)
    if isinstance(packet, Hello | Command | Goodbye):
        assert codec.encode_from_client(packet).hex() == datagram.hex()
        assert codec.decode_from_client(datagram) == packet
    else:
        assert codec.encode_from_controller(packet).hex() == datagram.hex()
        assert codec.decode_from_controller(datagram) == packet


def test_the_bytes_of_a_hello() -> None:
    hello = Hello(PROTOCOL_VERSION, 7, Role.COMMANDER, 300, 5, "grinder", 30)
    datagram = CODECS[0].encode_from_client(hello)
    begin = bytes.fromhex("530a020803 12") + datagram[6:8]
    fields = bytes.fromhex("090700000000000000 1002 18ac02 2005 2a07 6772696e646572 301e 7a")
    assert datagram[: len(begin) + len(fields)] == begin + fields
    assert not any(datagram[len(begin) + len(fields) + 2 :])


@given(hello=HELLOS, version=SMALL)
def test_a_hello_is_filled_up(hello: Hello, version: int) -> None:
    for codec in CODECS:
        assert len(codec.encode_from_client(hello._replace(version=version))) == MIN_HELLO_BYTES


@pytest.mark.parametrize("version", [PROTOCOL_VERSION, PROTOCOL_VERSION + 1])
def test_a_hello_that_is_not_filled_up_is_too_short(version: int) -> None:
    wire = servo_pb2.Packet.FromString(
        CODECS[0].encode_from_client(Hello(PROTOCOL_VERSION, 7, Role.OBSERVER, 300, 5, ""))[1:]
    )
    wire.hello.padding = wire.hello.padding[1:]
    error = refusal(CODECS[0].decode_from_client, bare(wire, version=version))
    assert error.outcome is Outcome.TOO_SHORT
    assert error.detail == "a hello of 399 bytes, it is filled up to 400"


LONG = "ü" * 500
"""Two bytes a letter; no limit is a multiple of two and three at once, so that cutting meets the middle of one."""


@pytest.mark.parametrize("codec", CODECS)
def test_no_answer_to_a_hello_is_longer_than_the_hello(codec: ServoCodec) -> None:
    most, latest = 2**64 - 1, 2**63 - 1
    hello = codec.encode_from_client(Hello(PROTOCOL_VERSION, 0, Role.OBSERVER, 0, 0, ""))
    answers: list[FromController] = [
        Welcome(2**32 - 1, most, most, LONG, LONG, 2**32 - 1, latest),
        Refused(2**32 - 1, most, LONG, True),
        Ended(most, LONG),
    ]
    for answer in answers:
        assert len(codec.encode_from_controller(answer)) < MIN_HELLO_BYTES <= len(hello)


def test_texts_that_are_too_long_are_cut_between_characters() -> None:
    codec = CODECS[0]
    for text in (LONG, "x" * 1000, "€" * 500, "😀" * 300):
        refused = codec.decode_from_controller(codec.encode_from_controller(Refused(1, 2, text, False)))
        assert isinstance(refused, Refused)
        assert MAX_REASON_BYTES - 3 <= len(refused.reason.encode()) <= MAX_REASON_BYTES
        assert refused.reason.endswith("…")
        assert text.startswith(refused.reason[:-1])
    hello = Hello(PROTOCOL_VERSION, 1, Role.OBSERVER, 1, 1, "tab\tand\nline\ud800")
    decoded = codec.decode_from_client(codec.encode_from_client(hello))
    assert isinstance(decoded, Hello)
    assert decoded.name == "tab?and?line?"


LONGEST_FRAME = Frame(
    "x" * MAX_FRAME_NAME_BYTES,
    FrameKind.TOOL,
    "y" * MAX_FRAME_NAME_BYTES,
    POSE,
    Load(1.0, (1.0, 2.0, 3.0), (1.0,) * 3, (0.5,) * 3),
)


def _largest_motion(number: int) -> MotionState:
    most, latest = 2**64 - 1, 2**63 - 1
    return MotionState(
        number,
        MotionKind.PTP,
        MotionPhase.QUEUED,
        FineInterpolatorState.ENDED,
        SEVEN,
        latest,
        NAN,
        most,
        most,
        most,
        most,
        latest,
    )


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize(
    ("report", "counts", "shown"),
    [
        (RequestDone(2**64 - 1, 2**64 - 1, 2**63 - 1, RequestError.COMMAND_INVALID, LONG, LONG), (1, 1), 2),
        (MotionEnded(2**64 - 1, 2**64 - 1, 2**63 - 1, MotionEnd.FAILED, LONG, LONG), (1, 1), 2),
        (GoalReached(2**64 - 1, 2**64 - 1, 2**63 - 1, FineInterpolatorState.ENDED, SEVEN), (1, 1), 4),
        (RequestDone(2**64 - 1, 2**64 - 1, 2**63 - 1), (4, 3), 4),
        (FrameDescribed(2**64 - 1, 2**64 - 1, MAX_FRAMES, LONGEST_FRAME), (1, 1), 3),
        (FlangeLocated(2**64 - 1, 2**64 - 1, POSE), (1, 1), 4),
        (LoadValidated(2**64 - 1, 2**64 - 1, LONG), (1, 1), 3),
    ],
    ids=["refused", "ended", "goal", "taken", "frame", "flange", "load"],
)
def test_the_largest_state_fits_with_a_report_at_least(
    codec: ServoCodec, report: Report, counts: tuple[int, int], shown: int
) -> None:
    """Sixteen motions and six reports: the first four are shown, and as many reports as there is room for.

    Where all texts are the longest ones, the two that wait last are not shown. ``counts``: without a key, and with one.
    """
    motions = tuple(_largest_motion(number) for number in range(1, MAX_MOTIONS + 1))
    operator = OperatorView(
        OperationMode.AUT, ProgramState.STOPPED, True, 100.0, SafetyState.SAFETY_STOP_LEVEL_2, LONG, True
    )
    snapshot = Snapshot(2**63 - 1, 2**64 - 1, operator, SEVEN, SEVEN, SEVEN, SEVEN, POSE, *ESTIMATES, LONG, motions)
    state = State(2**64 - 1, 2**64 - 1, 2**64 - 1, 2**64 - 1, snapshot, (report,) * MAX_REPORTS_IN_PACKET)
    datagram = codec.encode_from_controller(state)
    assert len(datagram) <= MAX_SERVO_DATAGRAM_BYTES
    decoded = codec.decode_from_controller(datagram)
    assert isinstance(decoded, State)
    assert [motion.motion for motion in decoded.snapshot.motions] == list(range(1, shown + 1))
    assert decoded.snapshot.operator == operator._replace(reason=decoded.snapshot.operator.reason)
    for text, most_bytes in (
        (decoded.snapshot.operator.reason, MAX_REASON_BYTES),
        (decoded.snapshot.commander, MAX_COMMANDER_BYTES),
    ):
        assert text.endswith("…")
        assert most_bytes - 1 <= len(text.encode()) <= most_bytes
    # What one session needs cut is whole in the packets of the others.
    whole = codec.decode_from_controller(codec.encode_from_controller(state._replace(reports=())))
    assert isinstance(whole, State)
    assert len(whole.snapshot.motions) == MAX_MOTIONS_IN_PACKET
    assert decoded.reports[0].number == report.number
    assert len(decoded.reports) == counts[CODECS.index(codec)]


@pytest.mark.parametrize("codec", CODECS)
def test_the_largest_command_fits_with_a_request_at_least(codec: ServoCodec) -> None:
    largest = (INFINITY,) * MAX_VECTOR_NUMBERS
    requests: tuple[Request, ...] = tuple(SetDestination(2**64 - 1 - n, 2**64 - 1, largest, largest) for n in range(9))
    datagram = codec.encode_from_client(Command(2**64 - 1, 2**64 - 1, 2**64 - 1, 2**64 - 1, True, requests))
    assert len(datagram) <= MAX_SERVO_DATAGRAM_BYTES
    decoded = codec.decode_from_client(datagram)
    assert isinstance(decoded, Command)
    assert decoded.requests == requests[:2]
    usual_size = tuple(SetDestination(n, 1, SEVEN, SEVEN) for n in range(MAX_REQUESTS_IN_PACKET))
    starts = tuple(StartMotion(n, MotionKind.PTP, MotionParameters(), SEVEN) for n in range(MAX_REQUESTS_IN_PACKET))
    for whole in (usual_size, starts):
        decoded = codec.decode_from_client(codec.encode_from_client(Command(1, 2, 3, requests=whole)))
        assert isinstance(decoded, Command)
        assert decoded.requests == whole


def test_six_questions_fit_into_a_packet() -> None:
    questions = tuple(DescribeFrame(number, 2**32 - 1) for number in range(MAX_REQUESTS_IN_PACKET))
    places = tuple(LocateFlange(number, SEVEN) for number in range(MAX_REQUESTS_IN_PACKET))
    for requests in (questions, places):
        command = Command(1, 2, 3, requests=requests)
        assert CODECS[1].decode_from_client(CODECS[1].encode_from_client(command)) == command


def test_a_destination_as_a_pose_is_as_long_as_one_in_axis_positions() -> None:
    sizes = {
        len(CODECS[0].encode_from_client(Command(1, 2, 3, requests=(request,))))
        for request in (SetDestination(4, 5, SEVEN), SetDestination(4, 5, None, None, POSE))
    }
    assert sizes == {127}


@given(numbers=st.tuples(*[FINITE] * 3, *[st.floats(-1e300, 1e300)] * 4))
def test_a_quaternion_of_any_length_is_read_as_a_rotation(numbers: tuple[float, ...]) -> None:
    """Invariant: what the codec reads is the rotation that Pose makes of the same quaternion, or both refuse it."""
    packet = bare(_asking(_going_to(*numbers)))
    try:
        expected = Pose.from_quaternion(numbers[:3], numbers[3:])  # type: ignore[arg-type]
    except HilError:
        assert refusal(CODECS[0].decode_from_client, packet).outcome is Outcome.UNDECODABLE
        return
    decoded = CODECS[0].decode_from_client(packet)
    assert isinstance(decoded, Command)
    assert_same(decoded.requests, (SetDestination(0, 1, None, None, expected),))


def test_a_reader_that_knows_neither_speed_nor_contacts_skips_them() -> None:
    datagram = CODECS[0].encode_from_controller(State(1, 2, 3, 4, SNAPSHOT, (RequestDone(5, 6, 7),)))
    wire = servo_pb2.Packet.FromString(datagram[1:])
    wire.state.snapshot.ClearField("flange_speed_mm_s")
    wire.state.snapshot.ClearField("contact")
    older = SNAPSHOT._replace(flange_speed_mm_s=0.0, contacts=())
    assert CODECS[0].decode_from_controller(b"\x53" + wire.SerializeToString()) == State(
        1, 2, 3, 4, older, (RequestDone(5, 6, 7),)
    )


@pytest.mark.parametrize("codec", CODECS)
def test_contacts_give_way_before_motions_and_before_the_first_report(codec: ServoCodec) -> None:
    touched = tuple(Contact((0.0, 0.0, 0.0), (0.0, 0.0, float(10 - number))) for number in range(MAX_CONTACTS + 2))
    motions = tuple(_largest_motion(number) for number in range(1, MAX_MOTIONS + 1))
    shown = {}
    for count in (0, 1, 2, 4):
        snapshot = SNAPSHOT._replace(commander=LONG, motions=motions[:count], contacts=touched)
        for reports in ((), (MotionEnded(1, 2, 3, MotionEnd.FAILED, LONG, LONG),)):
            datagram = codec.encode_from_controller(State(1, 2, 3, 4, snapshot, reports))
            assert len(datagram) <= MAX_SERVO_DATAGRAM_BYTES
            decoded = codec.decode_from_controller(datagram)
            assert isinstance(decoded, State)
            assert len(decoded.reports) == len(reports)
            untouched = State(1, 2, 3, 4, snapshot._replace(contacts=()), reports)
            without = codec.decode_from_controller(codec.encode_from_controller(untouched))
            assert isinstance(without, State)
            assert repr(decoded.snapshot.motions) == repr(without.snapshot.motions)
            assert decoded.snapshot.contacts == touched[: len(decoded.snapshot.contacts)]
            shown[count, len(reports)] = len(decoded.snapshot.contacts)
    assert shown[0, 0] == shown[1, 0] == shown[2, 0] == MAX_CONTACTS
    assert shown[4, 1] < MAX_CONTACTS


def test_a_force_that_no_single_holds_is_told_as_infinite() -> None:
    huge = SNAPSHOT._replace(flange_speed_mm_s=1e300, contacts=(Contact((0.0, 0.0, 0.0), (0.0, 0.0, -1e300)),))
    decoded = CODECS[0].decode_from_controller(CODECS[0].encode_from_controller(State(1, 2, 3, 4, huge)))
    assert isinstance(decoded, State)
    assert decoded.snapshot.flange_speed_mm_s == INFINITY
    assert decoded.snapshot.contacts[0].force_n[2] == -INFINITY


def test_the_snapshot_of_a_cycle_is_written_once_and_never_mistaken_for_another() -> None:
    codec = ServoCodec()
    other = SNAPSHOT._replace(cycle=2, motions=())
    for snapshot in (SNAPSHOT, SNAPSHOT, other, SNAPSHOT, other):
        for token in (1, 2):
            state = State(token, 2, 3, 4, snapshot, (RequestDone(5, 6, 7),))
            assert codec.decode_from_controller(codec.encode_from_controller(state)) == state


def decoders(codec: ServoCodec) -> tuple[Decode, Decode]:
    return codec.decode_from_client, codec.decode_from_controller


@pytest.mark.parametrize("codec", CODECS)
@given(datagram=st.binary(max_size=MAX_SERVO_DATAGRAM_BYTES + 10), framing=st.sampled_from([b"", b"\x53", b"\x54"]))
def test_any_bytes_are_a_packet_or_a_refusal(codec: ServoCodec, datagram: bytes, framing: bytes) -> None:
    """Invariant: whatever the bytes, decode returns a packet or raises MalformedDatagram, and nothing else."""
    for decode in decoders(codec):
        with contextlib.suppress(MalformedDatagram):
            assert decode(framing + datagram) is not None


def mutated(draw: st.DrawFn, datagram: bytes) -> bytes:
    """Return a datagram with some bytes changed, cut out or put in; the framing stays."""
    body = bytearray(datagram)
    for _ in range(draw(st.integers(0, 4))):
        body[draw(st.integers(1, len(body) - 1))] = draw(st.integers(0, 255))
    if draw(st.booleans()):
        at = draw(st.integers(1, len(body)))
        body[at : at + draw(st.integers(0, 3))] = draw(st.binary(max_size=3))
    return bytes(body[: draw(st.integers(1, len(body)))]) if draw(st.booleans()) else bytes(body)


@given(data=st.data(), packet=st.one_of(FROM_CLIENT, FROM_CONTROLLER))
def test_a_broken_packet_is_a_packet_or_a_refusal(data: st.DataObject, packet: FromClient | FromController) -> None:
    """Invariant: whatever happens to a packet, decode returns one or raises MalformedDatagram, and nothing else."""
    client = isinstance(packet, Hello | Command | Goodbye)
    codec = CODECS[0]
    whole = codec.encode_from_client(packet) if client else codec.encode_from_controller(packet)  # type: ignore[arg-type]
    datagram = data.draw(st.composite(mutated)(whole))
    for decode in (*decoders(codec), *decoders(CODECS[1])):
        with contextlib.suppress(MalformedDatagram):
            assert decode(datagram) is not None


def _read(read: Decode, packet: bytes) -> str:
    try:
        return repr(read(packet))
    except MalformedDatagram as error:
        return str(error)


USUAL_COMMANDS = st.builds(
    Command,
    NUMBERS,
    NUMBERS,
    NUMBERS,
    NUMBERS,
    st.booleans(),
    st.lists(
        st.one_of(
            # All fields, because builds() makes up those of a named tuple that are left out, defaults or not.
            st.builds(SetDestination, NUMBERS, NUMBERS, SEVENS, st.one_of(st.none(), vectors()), st.none()),
            st.builds(SetDestination, NUMBERS, NUMBERS, st.none(), st.none(), POSES),
        ),
        max_size=1,
    ).map(tuple),
)
USUAL_STATES = st.builds(
    State,
    NUMBERS,
    NUMBERS,
    NUMBERS,
    NUMBERS,
    SNAPSHOTS.filter(lambda snapshot: all(len(vector) == 7 for vector in snapshot[3:7])),
    st.lists(st.tuples(NUMBERS, NUMBERS, TIMES).map(lambda done: RequestDone(*done)), max_size=6).map(tuple),
)


@given(data=st.data(), command=USUAL_COMMANDS)
def test_usual_commands_are_read_as_protobuf_reads_them(data: st.DataObject, command: Command) -> None:
    """Invariant: the short way may decline, but what it accepts is what protobuf makes of the same bytes."""
    whole = CODECS[0].encode_from_client(command)
    packet = data.draw(st.one_of(st.just(whole), st.composite(mutated)(whole)))[1:]
    read = usual.read_command(packet)
    if packet == whole[1:] and (not command.requests or command.requests[0].velocity is None):  # type: ignore[union-attr]
        assert_same(read, command)
    if read is not None:
        assert repr(read) == _read(reading.from_client, packet)


@given(data=st.data(), state=USUAL_STATES)
def test_usual_states_are_read_as_protobuf_reads_them(data: st.DataObject, state: State) -> None:
    """Invariant: the short way may decline, but what it accepts is what protobuf makes of the same bytes."""
    whole = CODECS[0].encode_from_controller(state)
    packet = data.draw(st.one_of(st.just(whole), st.composite(mutated)(whole)))[1:]
    read = usual.read_state(packet)
    usual_motions = all(len(motion.destination) == 7 for motion in state.snapshot.motions)
    usual_motions &= len(state.snapshot.external_torque_variance) == 7
    if packet == whole[1:] and usual_motions:
        assert read is not None
    if read is not None:
        assert repr(read) == _read(reading.from_controller, packet)


@pytest.mark.parametrize(
    ("written", "instead", "short"),
    [
        ("1802", "1803", False),
        ("2002", "2000", False),
        ("2002", "2005", False),
        ("2801", "2802", False),
        ("2801", "2880", False),
        ("310000000000004940", "31000000000000f87f", False),
        ("310000000000004940", "310000000000000080", True),
        ("310000000000004940", "310100000000005940", False),
        ("310000000000004940", "310000000000005940", True),
        ("3802", "3804", False),
        ("4001", "4002", False),
        ("7205", "72ff", False),
        ("7203e282ac", "7203ed a080", False),
        ("72057374617274", "7a057374617274", False),
    ],
)
def test_every_part_of_the_operators_view_is_read_as_protobuf_reads_it(written: str, instead: str, short: bool) -> None:
    """``short``: whether the short way takes it, which may decline what protobuf would read."""
    reason = "\u20ac" if "e282ac" in written else "start"
    snapshot = SNAPSHOT._replace(operator=SNAPSHOT.operator._replace(reason=reason))
    packet = CODECS[0].encode_from_controller(State(1, 2, 3, 4, snapshot))[1:]
    assert usual.read_state(packet) is not None
    assert packet.count(bytes.fromhex(written)) == 1
    changed = packet.replace(bytes.fromhex(written), bytes.fromhex(instead))
    read = usual.read_state(changed)
    assert (read is not None) is short
    if read is not None:
        assert repr(read) == _read(reading.from_controller, changed)


@pytest.mark.parametrize("size", [0, 1, 127, 128, MAX_REASON_BYTES])
def test_a_reason_of_any_size_is_read_the_short_way(size: int) -> None:
    snapshot = SNAPSHOT._replace(operator=SNAPSHOT.operator._replace(reason="x" * size))
    state = State(1, 2, 3, 4, snapshot)
    datagram = CODECS[0].encode_from_controller(state)
    assert usual.read_state(datagram[1:]) == state
    without = CODECS[0].encode_from_controller(State(1, 2, 3, 4, SNAPSHOT._replace(operator=RUNNING)))
    assert len(datagram) - len(without) == (size + 2 + (size > 127) if size else 0)


def test_a_snapshot_that_says_it_is_longer_than_its_packet_is_none() -> None:
    datagram = CODECS[0].encode_from_controller(State(1, 2, 3, 4, SNAPSHOT._replace(operator=RUNNING, motions=())))
    at = datagram.index(b"\x6a\x07grinder")
    for more in (1, 80):
        length = datagram[45] & 0x7F | datagram[46] << 7
        longer = bytes(((length + more) & 0x7F | 0x80, (length + more) >> 7))
        broken = bytearray(datagram)
        broken[45:47] = longer
        broken[at + 1] += more
        assert refusal(CODECS[0].decode_from_controller, bytes(broken)).outcome is Outcome.UNDECODABLE


def _packet(**body: object) -> servo_pb2.Packet:
    return servo_pb2.Packet(**body)  # type: ignore[arg-type]


def _asking(*requests: servo_pb2.Request) -> servo_pb2.Packet:
    return _packet(command=servo_pb2.Command(request=requests))


def _showing(snapshot: servo_pb2.Snapshot, *reports: servo_pb2.Report) -> servo_pb2.Packet:
    return _packet(state=servo_pb2.State(snapshot=snapshot, report=reports))


def _hello(name: str = "", role: int = 1) -> servo_pb2.Packet:
    hello = servo_pb2.Hello(role=role, name=name, padding=bytes(MIN_HELLO_BYTES))  # type: ignore[arg-type]
    return _packet(hello=hello)


def _shown(**fields: object) -> servo_pb2.Snapshot:
    pose = servo_pb2.Pose(value=[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    return servo_pb2.Snapshot(**{"program": 1, "flange_in_base": pose, **fields})  # type: ignore[arg-type]


_STOP = servo_pb2.Request(number=1, stop=servo_pb2.StopMotion())
_PARAMETERS = servo_pb2.MotionParameters()
_DONE = servo_pb2.Report(number=1, done=servo_pb2.RequestDone())
_MOTION = servo_pb2.MotionState(motion=1, kind=1, phase=1, interpolator=1)  # type: ignore[arg-type]
_CONTACT = servo_pb2.Contact(point_m=[0.0] * 3, force_n=[0.0] * 3)
_TOO_LONG = servo_pb2.Vector(value=[0.0] * (MAX_VECTOR_NUMBERS + 1))
NO_POSES: list[tuple[tuple[float, ...], str]] = [
    ((), "a pose of 0 numbers, 7 are needed"),
    ((0.0,) * 6, "a pose of 6 numbers, 7 are needed"),
    ((0.0,) * 8, "a pose of 8 numbers, 7 are needed"),
    ((0.0,) * 7, "length of the quaternion"),
    ((NAN, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), "valid: finite numbers"),
    ((0.0, INFINITY, 0.0, 1.0, 0.0, 0.0, 0.0), "valid: finite numbers"),
    ((0.0, 0.0, -INFINITY, 1.0, 0.0, 0.0, 0.0), "valid: finite numbers"),
    ((0.0, 0.0, 0.0, 1.0, NAN, 0.0, 0.0), "valid: finite numbers"),
    ((0.0, 0.0, 0.0, 1.0, 0.0, 0.0, INFINITY), "valid: finite numbers"),
]


def _going_to(*numbers: float) -> servo_pb2.Request:
    pose = servo_pb2.Pose(value=numbers)
    return servo_pb2.Request(destination=servo_pb2.SetDestination(motion=1, flange_in_base=pose))


def _starting_at(*numbers: float) -> servo_pb2.Request:
    start = servo_pb2.StartMotion(
        kind=servo_pb2.KIND_PTP, parameters=_PARAMETERS, flange_in_base=servo_pb2.Pose(value=numbers)
    )
    return servo_pb2.Request(start=start)


def _described(**fields: object) -> servo_pb2.Report:
    pose = servo_pb2.Pose(value=[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    frame = {"of": 3, "name": "tip", "kind": 5, "parent": "flange", "in_parent": pose, **fields}
    return servo_pb2.Report(frame=servo_pb2.FrameDescribed(**frame))  # type: ignore[arg-type]


def _load(mass: float = 1.0, centre: int = 3, inertia: int = 6, moment: float = 0.0) -> servo_pb2.Load:
    return servo_pb2.Load(mass_kg=mass, centre_m=[0.0] * centre, inertia_kg_m2=[moment] * inertia)


def _with_tool(load: servo_pb2.Load, *pose: float) -> tuple[servo_pb2.Request, ...]:
    """Return the two requests that have a tool."""
    tool = servo_pb2.AttachedTool(load=load, tcp_in_flange=servo_pb2.Pose(value=pose))
    start = servo_pb2.StartMotion(kind=servo_pb2.KIND_PTP, parameters=_PARAMETERS, tool=tool)
    return servo_pb2.Request(start=start), servo_pb2.Request(validate=servo_pb2.ValidateLoad(tool=tool))


_SOMEWHERE = (0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0)
NO_TOOLS: list[tuple[servo_pb2.Load, tuple[float, ...], str]] = [
    (_load(mass=-1.0), _SOMEWHERE, "a load no tool has: load mass"),
    (_load(mass=NAN), _SOMEWHERE, "1 finite numbers are needed"),
    (servo_pb2.Load(), _SOMEWHERE, "a centre of mass of ()"),
    (_load(), (), "a pose of 0 numbers, 7 are needed"),
    (_load(), (*_SOMEWHERE[:3], 0.0, 0.0, 0.0, 0.0), "length of the quaternion"),
]


def _under(mode: servo_pb2.ControlMode) -> tuple[servo_pb2.Request, ...]:
    """Return the two requests that have a mode."""
    start = servo_pb2.StartMotion(kind=servo_pb2.KIND_PTP, parameters=_PARAMETERS, mode=mode)
    change = servo_pb2.ChangeControlMode(motion=1, mode=mode)
    return servo_pb2.Request(start=start), servo_pb2.Request(mode=change)


def _springs(stiffness: float, count: int = 7) -> servo_pb2.ControlMode:
    return servo_pb2.ControlMode(joint=servo_pb2.JointImpedance(stiffness=[stiffness] * count, damping=[0.7] * 7))


def _held(seconds: float) -> servo_pb2.ControlMode:
    mode = wire_mode(CartesianSineImpedanceControlMode())
    assert mode is not None
    mode.cartesian.oscillation.hold_time_s = seconds
    return mode


NO_MODES: list[tuple[servo_pb2.ControlMode, str]] = [
    (servo_pb2.ControlMode(), "a control mode of no kind that is known here"),
    (servo_pb2.ControlMode.FromString(b"\x1a\x00"), "a control mode of no kind that is known here"),
    (_springs(-1.0), "joint stiffness A1 -1 is outside its range >= 0 Nm/rad"),
    (_springs(NAN), "joint stiffness A1 nan is outside its range >= 0 Nm/rad"),
    (_springs(1.0, count=6), "a control mode with 6 numbers where 7 are needed"),
    (_held(-1.0), "hold time -1 is outside its range >= 0 s"),
    (_held(NAN), "hold time nan is outside its range >= 0 s"),
]


NO_PACKET_FROM_CLIENT: list[tuple[servo_pb2.Packet, str]] = [
    (_packet(), "a packet with nothing in it"),
    (_packet(state=servo_pb2.State()), "a packet with state in it, which the other end never sends"),
    (_packet(welcome=servo_pb2.Welcome()), "a packet with welcome in it, which the other end never sends"),
    (_hello(role=0), "there is no role 0"),
    (_hello(role=4), "there is no role 4"),
    (_hello("x" * (MAX_NAME_BYTES + 1)), "a name of 64 bytes, at most 63 are allowed"),
    (_hello("ü" * 32), "a name of 64 bytes, at most 63 are allowed"),
    (_hello("\x1b[2J"), r"the name '\x1b[2J' cannot be printed"),
    (_asking(*[_STOP] * (MAX_REQUESTS_IN_PACKET + 1)), "7 requests, at most 6 are allowed"),
    (_asking(servo_pb2.Request(number=9)), "request 9 asks for nothing"),
    (
        _asking(servo_pb2.Request(number=9, start=servo_pb2.StartMotion(kind=servo_pb2.KIND_PTP))),
        "request 9 starts a motion without parameters",
    ),
    (
        _asking(servo_pb2.Request(start=servo_pb2.StartMotion(kind=4, parameters=_PARAMETERS))),  # type: ignore[arg-type]
        "there is no motion kind 4",
    ),
    (
        _asking(servo_pb2.Request(start=servo_pb2.StartMotion(parameters=_PARAMETERS))),
        "there is no motion kind 0",
    ),
    (
        _asking(servo_pb2.Request(destination=servo_pb2.SetDestination(position=_TOO_LONG))),
        "33 numbers in a vector, at most 32 are allowed",
    ),
    (
        _asking(servo_pb2.Request(destination=servo_pb2.SetDestination(velocity=_TOO_LONG))),
        "33 numbers in a vector, at most 32 are allowed",
    ),
    (
        _asking(servo_pb2.Request(locate=servo_pb2.LocateFlange(position=[0.0] * 33))),
        "33 numbers in a vector, at most 32 are allowed",
    ),
    *((_asking(_going_to(*numbers)), words) for numbers, words in NO_POSES),
    *((_asking(_starting_at(*numbers)), words) for numbers, words in NO_POSES),
    *((_asking(request), words) for mode, words in NO_MODES for request in _under(mode)),
    *((_asking(request), words) for load, pose, words in NO_TOOLS for request in _with_tool(load, *pose)),
]


@pytest.mark.parametrize(("wire", "words"), NO_PACKET_FROM_CLIENT, ids=lambda value: str(value)[:40])
def test_what_no_application_sends(wire: servo_pb2.Packet, words: str) -> None:
    error = refusal(CODECS[0].decode_from_client, bare(wire))
    assert error.outcome is Outcome.UNDECODABLE
    assert words in error.detail


NO_PACKET_FROM_CONTROLLER: list[tuple[servo_pb2.Packet, str]] = [
    (_packet(), "a packet with nothing in it"),
    (_hello(), "a packet with hello in it, which the other end never sends"),
    (_packet(command=servo_pb2.Command()), "a packet with command in it, which the other end never sends"),
    (_packet(state=servo_pb2.State()), "a state that shows nothing"),
    (_showing(servo_pb2.Snapshot()), "there is no state of the program 0"),
    (_showing(_shown(program=5)), "there is no state of the program 5"),
    (_showing(_shown(operation_mode=3)), "there is no operation mode 3"),
    (_showing(_shown(safety_state=4)), "there is no safety state 4"),
    (_showing(_shown(override_percent=NAN)), "an override of nan %, 0 ... 100 % are possible"),
    (_showing(_shown(override_percent=-1.0)), "an override of -1 %, 0 ... 100 % are possible"),
    (_showing(_shown(override_percent=100.5)), "an override of 100.5 %, 0 ... 100 % are possible"),
    (_showing(_shown(operator_reason="x" * 201)), "a reason of the operator of 201 bytes, at most 200 are allowed"),
    (_showing(_shown(motion=[_MOTION] * 5)), "5 motions, at most 4 are allowed"),
    (_showing(_shown(contact=[_CONTACT] * 9)), "9 contacts, at most 8 are allowed"),
    (_showing(_shown(contact=[servo_pb2.Contact()])), "a point of contact with 0 numbers where 3 are needed"),
    (
        _showing(_shown(contact=[servo_pb2.Contact(point_m=[0.0] * 3, force_n=[0.0] * 4)])),
        "a contact force with 4 numbers where 3 are needed",
    ),
    (_showing(_shown(), *[_DONE] * 7), "7 reports, at most 6 are allowed"),
    (_showing(_shown(commander="x" * 97)), "a commander of 97 bytes, at most 96 are allowed"),
    (_showing(_shown(measured_torque=[0.0] * 33)), "33 numbers in a vector, at most 32 are allowed"),
    (_showing(_shown(motion=[servo_pb2.MotionState()])), "there is no motion kind 0"),
    (
        _showing(_shown(motion=[servo_pb2.MotionState(kind=servo_pb2.KIND_PTP)])),
        "there is no motion phase 0",
    ),
    (_showing(_shown(), servo_pb2.Report(number=9)), "report 9 says nothing"),
    (
        _showing(_shown(), servo_pb2.Report(done=servo_pb2.RequestDone(error=4))),  # type: ignore[arg-type]
        "there is no request error 4",
    ),
    (
        _showing(_shown(), servo_pb2.Report(done=servo_pb2.RequestDone(detail="x" * 181))),
        "a detail of 181 bytes, at most 160 are allowed",
    ),
    (
        _showing(_shown(), servo_pb2.Report(goal=servo_pb2.GoalReached())),
        "there is no fine interpolator state 0",
    ),
    (
        _showing(_shown(), servo_pb2.Report(ended=servo_pb2.MotionEnded())),
        "there is no end of a motion 0",
    ),
    (_showing(servo_pb2.Snapshot(program=servo_pb2.PROGRAM_RUNNING)), "a pose of 0 numbers, 7 are needed"),
    (_showing(_shown(), _described(of=0)), "a frame of 0, there are 1 ... 64"),
    (_showing(_shown(), _described(of=65)), "a frame of 65, there are 1 ... 64"),
    (_showing(_shown(), _described(kind=0)), "there is no frame kind 0"),
    (_showing(_shown(), _described(kind=7)), "there is no frame kind 7"),
    (_showing(_shown(), _described(name="x" * 41)), "a name of a frame of 41 bytes, at most 40 are allowed"),
    (_showing(_shown(), _described(parent="ü" * 21)), "a name of a parent frame of 42 bytes, at most 40 are allowed"),
    (_showing(_shown(), _described(in_parent=servo_pb2.Pose())), "a pose of 0 numbers, 7 are needed"),
    (_showing(_shown(), _described(load=_load(mass=NAN))), "a mass of (nan,), 1 finite numbers are needed"),
    (_showing(_shown(), _described(load=_load(centre=2))), "a centre of mass of (0.0, 0.0), 3 finite numbers"),
    (_showing(_shown(), _described(load=_load(inertia=7))), "an inertia of"),
    (_showing(_shown(), _described(load=_load(moment=INFINITY))), "6 finite numbers are needed"),
    (_showing(_shown(), servo_pb2.Report(flange=servo_pb2.FlangeLocated())), "a pose of 0 numbers, 7 are needed"),
    *((_showing(_shown(flange_in_base=servo_pb2.Pose(value=numbers))), words) for numbers, words in NO_POSES),
    (_packet(refused=servo_pb2.Refused(reason="x" * 201)), "a reason of 201 bytes, at most 200 are allowed"),
    (_packet(welcome=servo_pb2.Welcome(robot="x" * 64)), "a robot of 64 bytes, at most 63 are allowed"),
]


@pytest.mark.parametrize(("wire", "words"), NO_PACKET_FROM_CONTROLLER, ids=lambda value: str(value)[:40])
def test_what_no_controller_sends(wire: servo_pb2.Packet, words: str) -> None:
    error = refusal(CODECS[0].decode_from_controller, bare(wire))
    assert error.outcome is Outcome.UNDECODABLE
    assert words in error.detail


def test_sizes_and_framing_are_named() -> None:
    for decode in decoders(CODECS[0]):
        assert refusal(decode, bytes(MAX_SERVO_DATAGRAM_BYTES + 1)).outcome is Outcome.TOO_LONG
        for size in range(5):
            assert refusal(decode, b"\x53" * size).outcome is Outcome.TOO_SHORT
        for datagram, words in (
            (bytes(20), "20 bytes that begin with 0x00 are no packet"),
            (b"\x53" + bytes(20), "20 bytes are no packet of the servo link"),
            (
                b"\x53" + servo_pb2.Packet(command=servo_pb2.Command()).SerializeToString() * 3,
                "without a protocol version",
            ),
        ):
            error = refusal(decode, datagram)
            assert (error.outcome, words in error.detail) == (Outcome.UNDECODABLE, True), error


OTHER = PROTOCOL_VERSION + 1


def test_a_hello_of_another_version_is_returned_with_what_is_frozen() -> None:
    for version in (1, 2, 4, 127, 128, 2**32 - 1):
        hello = Hello(version, 2**63 + 7, Role.COMMANDER, 300, 5, "grinder")
        decoded = CODECS[1].decode_from_client(CODECS[1].encode_from_client(hello))
        assert isinstance(decoded, Hello)
        assert (decoded.version, decoded.nonce) == (version, 2**63 + 7)


def test_an_answer_of_another_version_is_returned_with_what_is_frozen() -> None:
    codec = CODECS[1]
    refused = Refused(OTHER, 7, "speak version 3", True)
    assert codec.decode_from_controller(codec.encode_from_controller(refused)) == refused
    welcome = codec.decode_from_controller(codec.encode_from_controller(Welcome(OTHER, 7, 8, "fri-hil 9", "lbr", 1, 1)))
    assert welcome == Welcome(OTHER, 7, 8, "fri-hil 9", "", 0, 0)


def test_a_later_version_may_change_everything_that_is_not_frozen() -> None:
    """Fields of ours with other types, texts that are no UTF-8, bodies we do not know: the version is still read."""
    header = bytes.fromhex("0a02 0804")
    nonce = bytes.fromhex("090700000000000000")
    strange = bytes.fromhex("1201ff 1a01ff 2a01ff 7aac02") + bytes(300)
    hello = b"\x53" + header + field(b"\x12", nonce + strange) + field(b"\x7a", bytes(90))
    decoded = CODECS[0].decode_from_client(hello)
    assert isinstance(decoded, Hello)
    assert (decoded.version, decoded.nonce) == (OTHER, 7)
    refused = b"\x53" + header + field(b"\x22", nonce + bytes.fromhex("1203fffefd 2a01ff"))
    assert CODECS[0].decode_from_controller(refused) == Refused(OTHER, 7, "\ufffd" * 3, False)
    for body in (b"\x2a\x01\xff", b"\x3a\x01\xff", b"\x9a\x06\x00", b""):
        for decode in decoders(CODECS[0]):
            error = refusal(decode, b"\x53" + header + body)
            assert error.outcome is Outcome.OTHER_VERSION
            assert "version 4 of the servo link, this side speaks 3" in error.detail


@given(
    version=st.integers(1, 2**32 - 1).filter(lambda version: version != PROTOCOL_VERSION),
    packet=st.one_of(COMMANDS, STATES),
)
def test_commands_and_states_of_another_version_are_named(version: int, packet: Command | State) -> None:
    codec = CODECS[0]
    if isinstance(packet, Command):
        wire = servo_pb2.Packet.FromString(codec.encode_from_client(packet)[1:])
        assert refusal(codec.decode_from_client, bare(wire, version=version)).outcome is Outcome.OTHER_VERSION
    else:
        wire = servo_pb2.Packet.FromString(codec.encode_from_controller(packet)[1:])
        assert refusal(codec.decode_from_controller, bare(wire, version=version)).outcome is Outcome.OTHER_VERSION


@pytest.mark.parametrize(
    ("packet", "words"),
    [
        (Command(1, 2, 3, requests=(SetDestination(4, 5, (0.0,) * 33),)), "a vector of 33 numbers, at most 32"),
        (Command(1, 2, 3, requests=(SetDestination(4, 5, (None,) * 7),)), "a Command cannot be sent"),  # type: ignore[arg-type]
        (Command(1, 2, 3, requests=(SetDestination(4, 5, ("0",) * 3),)), "a Command cannot be sent"),  # type: ignore[arg-type]
        (
            Command(1, 2, 3, requests=(SetDestination(4, 5, None, None, Pose(NAN, 0.0, 0.0)),)),
            "a pose with the numbers",
        ),
        (
            Command(1, 2, 3, requests=(SetDestination(4, 5, SEVEN, None, Pose(0.0, INFINITY, 0.0)),)),
            "a pose with the numbers",
        ),
        (Command(1, 2, 3, requests=(DescribeFrame(4, -1),)), "a Command cannot be sent"),
        (Command(1, 2, 3, requests=(LocateFlange(4, (0.0,) * 33),)), "a vector of 33 numbers, at most 32"),
        (Command(2**64, 2, 3), "a Command cannot be sent"),
        (Hello(1, 2, Role.OBSERVER, -1, 5, ""), "a Hello cannot be sent"),
        (Hello(1, 2, Role.OBSERVER, 300, 5, "", -1), "a Hello cannot be sent"),
        (Goodbye(1, -1), "a Goodbye cannot be sent"),
    ],
)
def test_what_no_packet_can_carry_is_refused_in_words(packet: FromClient, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        CODECS[0].encode_from_client(packet)
