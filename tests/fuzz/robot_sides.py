"""Robot sides that are peers of their own: a Cabinet on the network, drives on a CAN bus. Bytes in, words out."""

import math
from functools import partial

from backends.can402.drive import Drive
from backends.can402.options import AxisOptions
from backends.can402.scaling import AxisScale
from hil.values.arm import JointCommand
from hil.values.errors import BackendError
from hil.values.fri import Release, SessionState
from tests.fuzz.sessions import pieces, script
from tests.fuzz.target import Target, refusal
from tests.support.cabinet_link import CABINET, MS, STILL, STRANGER, Link

_PERIOD_NS = 4_000_000


def _cabinet(data: bytes) -> None:
    release = Release.V2_7 if data[:1] and data[0] & 1 else Release.V1_15
    link = Link(release)
    link.say()
    try:
        assert refusal(partial(_conversation, link, data[1:]), BackendError).isprintable()
    finally:
        link.backend.close()


def _conversation(link: Link, data: bytes) -> None:
    backend = link.backend
    for piece in pieces(data):
        how = piece[0] if piece else 0
        link.now_ns += MS * (1 + (how >> 1 & 3))
        backend.receive(piece[1:], STRANGER if how & 1 else CABINET, now_ns=link.now_ns)
        backend.advance(now_ns=link.now_ns)
        state = backend.read()
        assert all(map(math.isfinite, state.position_rad))
        backend.write(JointCommand(state.position_rad, STILL))
        backend.step()
        sent = backend.outgoing()
        assert len(sent) <= 1
        for answer, receiver in sent:
            assert receiver == CABINET
            link.codec.decode_command(answer)
        assert backend.condition().reason.isprintable()


def _cabinet_seeds() -> list[bytes]:
    found = []
    for how, release in enumerate((Release.V1_15, Release.V2_7)):
        link = Link(release)
        said = []
        for state in (
            *[SessionState.MONITORING_READY] * 3,
            *[SessionState.COMMANDING_WAIT] * 3,
            SessionState.COMMANDING_ACTIVE,
        ):
            link.counter += 1
            said.append(b"\0" + link.codec.encode_monitoring(link.message(state)))
        link.backend.close()
        found.append(bytes([how]) + script(said))
    return found


def _drive(data: bytes) -> None:
    drive = Drive("node 1 (A1)", AxisScale(AxisOptions()), lost_after=10, heartbeat_ms=100)
    drive.began(0x27, 0)
    for piece in pieces(data):
        what, content = piece[:1], piece[1:9]
        told = ""
        match (what[0] if what else 0) % 6:
            case 0 | 1 as part:
                told = drive.answer(part, content)
            case 2:
                told = drive.emergency(content)
            case 3:
                drive.heartbeat(content)
            case 4:
                drive.synchronised()
                drive.count_silence(_PERIOD_NS)
            case _:
                drive.reset_fault()
        assert told.isprintable()
        assert drive.failure().isprintable()
        assert len(drive.command(drive.counts, enabled=not drive.failure())) == 6


TARGETS = (
    Target(
        "cabinet",
        "Whatever comes to the link to a Cabinet, one readable answer a cycle goes there at most, and to nobody else.",
        _cabinet,
        _cabinet_seeds,
    ),
    Target(
        "can402",
        "Whatever a drive says, what is wrong with it is told in printable words, and its next command is one.",
        _drive,
        lambda: [script([b"\x04", b"\x00\x27\x00\x05\x00\x00\x00", b"\x01" + bytes(8), b"\x03\x05", b"\x02\x10\x73"])],
    ),
)
