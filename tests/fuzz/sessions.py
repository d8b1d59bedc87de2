"""Sessions: bytes and times in; they neither raise nor grow, whatever the other side says."""

from collections.abc import Iterator
from functools import partial

from apps.fri_joint_sine import JointSine
from hil.client.fri import ClientSession, NotAvailable
from hil.client.servo import ServoSession
from hil.kst.jobs import Ended, Outcome
from hil.kst.log import TOLD_MOST
from hil.values.fri import Release
from hil.values.kst import KstSettings
from hil.values.motion import MotionEnd
from hil.values.servo import (
    PROTOCOL_VERSION,
    FromController,
    MotionEnded,
    Refused,
    RequestDone,
    Role,
    State,
    Welcome,
)
from hil.values.servo import (
    Ended as SessionEnded,
)
from tests.fuzz import seeds
from tests.fuzz.target import Target, refusal
from tests.support.kst_session import MS, STATES, Bench
from transport.servo import ServoCodec

LONGEST_PIECE = 2047
_OUTCOMES = tuple(Outcome)


def pieces(data: bytes) -> Iterator[bytes]:
    """Yield what a script of lengths and bytes has: each piece begins with its length, two bytes, 2047 at most."""
    at = 0
    while at < len(data):
        length = int.from_bytes(data[at : at + 2], "little") & LONGEST_PIECE
        yield data[at + 2 : at + 2 + length]
        at += 2 + length


def script(parts: list[bytes]) -> bytes:
    """Return the script of pieces."""
    return b"".join(len(part).to_bytes(2, "little") + part for part in parts)


def _kst(data: bytes) -> None:
    strict, data = bool(data[:1] and data[0] & 1), data[1:]
    bench = Bench(settings=KstSettings((-2.9,) * 7, (2.9,) * 7, (1.5,) * 7, strict=strict))
    jobs = 0
    for piece in pieces(data):
        bench.now_ns += 30 * MS
        writes = bench.send(piece)
        if len(bench.arm.begun) > jobs and piece[-1:] and piece[-1] % 3 == 0:
            jobs = len(bench.arm.begun)
            bench.session.ended(Ended(_OUTCOMES[piece[-1] % len(_OUTCOMES)]), now_ns=bench.now_ns)
        writes += bench.wait(200)
        assert all(0 < len(write) <= 1024 for write in writes)
        assert len(bench.session.log.told) <= TOLD_MOST
        assert all(line.isprintable() for line in bench.session.log.told)
        assert len(bench.arm.begun) - jobs <= 1, "two jobs at once"


def _servo_client(data: bytes) -> None:
    session = ServoSession(ServoCodec(), role=Role.COMMANDER, watchdog_ms=300, state_period_ms=5, name="fuzz", nonce=1)
    session.knock()
    for piece in pieces(data):
        session.outgoing()
        session.receive(piece)
        assert len(session.goals) <= 256


def _fri_client(data: bytes) -> None:
    for release in (Release.V1_15, Release.V2_7):
        session = ClientSession(release, JointSine())
        for piece in pieces(data):
            # A message may leave out what an application reads: that has an error of its own.
            refusal(partial(session.receive, piece), NotAvailable)


def _servo_conversation() -> list[bytes]:
    """Return what a controller says in a session that the client of the target has asked for."""
    codec, snapshot = ServoCodec(), STATES["bent"]
    done = RequestDone(1, 1, 7)
    ended = MotionEnded(2, 1, 8, MotionEnd.FINISHED, "the point was reached", "")
    packets: list[FromController] = [
        Refused(PROTOCOL_VERSION, 1, "later", try_again=True),
        Welcome(PROTOCOL_VERSION, 1, 5, "fri-hil", "lbr-iiwa-14-r820", 1, 0),
        State(5, 1, 1, 0, snapshot),
        State(5, 2, 2, 1, snapshot, (done, ended)),
        SessionEnded(5, "the controller shuts down"),
    ]
    return [codec.encode_from_controller(packet) for packet in packets]


def _kst_seeds() -> list[bytes]:
    lines = []
    for text in seeds.files("kst/*.txt"):
        told = [line[2:].replace(b"\\n", b"\n") for line in text.splitlines() if line.startswith(b"C ")]
        lines.append(b"\x00" + script(told))
        lines.append(b"\x01" + script(told))
    return lines


TARGETS = (
    Target(
        "kst-session",
        "Whatever a KST client sends, every write is short, the log is bounded and printable, and the arm has one job.",
        _kst,
        _kst_seeds,
    ),
    Target(
        "servo-client",
        "Whatever a controller sends, a servo client's session neither raises nor keeps more than its bounds.",
        _servo_client,
        lambda: [script(_servo_conversation())],
    ),
    Target(
        "fri-client",
        "Whatever a controller sends, an FRI client's session raises nothing but that a value is not there.",
        _fri_client,
        lambda: [script(list(seeds.recorded(release, from_controller=True))[:20]) for release in ("1.15", "2.7")],
    ),
)
