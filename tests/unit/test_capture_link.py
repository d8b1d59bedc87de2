"""The recorder's end of the way to a writer that is anybody."""

import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from hil.config.station import RobotConfig, Station
from hil.runtime.captures import Captures
from transport.capture.link import CaptureLink

ENDS = ("127.0.0.1", 1), ("127.0.0.1", 2)


@pytest.fixture
def ends() -> Iterator[tuple[CaptureLink, socket.socket]]:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        link = CaptureLink(ours, Path("run.pcapng"))
        link.begin("{}")
        yield link, theirs


@pytest.mark.parametrize(
    "report",
    [
        b"[]",
        b"{}",
        b"7",
        b"\xff\xfe",
        b"[" * 50_000,
        b'{"written": "a", "removed": 0, "error": null}',
        b'{"written": true, "removed": 0, "error": null}',
        b'{"written": 1e400, "removed": 0, "error": null}',
        b'{"written": -1, "removed": 0, "error": null}',
        b'{"written": 4, "removed": 0, "error": null}',
        b'{"written": 2, "removed": 2, "error": null}',
        b'{"written": 1, "removed": 0, "error": []}',
    ],
)
def test_what_is_no_report_confirms_nothing(ends: tuple[CaptureLink, socket.socket], report: bytes) -> None:
    link, writer = ends
    for i in range(3):
        link.put(i, *ENDS, b"x")
    writer.send(report)
    summary = link.close()
    assert (summary.written, summary.dropped, summary.removed) == (0, 3, 0)
    assert summary.error == "the writing process did not report; what the file holds is not confirmed"


def test_a_writer_that_takes_a_little_now_and_then_is_not_waited_for(ends: tuple[CaptureLink, socket.socket]) -> None:
    link, writer = ends
    link.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 130_000)  # some machines would grant room for all
    taken: list[int] = []
    over = threading.Event()

    def trickle() -> None:
        while not over.wait(0.02) and (size := len(writer.recv(1 << 17))):
            taken.append(size)

    for i in range(100):
        link.put(i, *ENDS, bytes(60_000))
    thread = threading.Thread(target=trickle)
    thread.start()
    try:
        summary = link.close(timeout_s=0.2)
    finally:
        over.set()
        thread.join()
    assert summary.error is not None
    assert summary.dropped == 100
    assert len(taken) < 50


@pytest.mark.parametrize("writer", ["\ud800", "a\0b", "\0nobody", "x" * 300, "/dev/null", "/"])
def test_a_writer_that_cannot_be_is_refused_in_a_sentence(writer: str) -> None:
    station = Station(robot=[RobotConfig()])
    refusal = Captures(station, ()).start(Path(writer), Path("run.pcapng"), None)
    assert refusal.startswith("no writer of a capture listens at ")
