"""A recorded run in virtual time whose controller, client and wire misbehave as told."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from hil.core.events import Diagnosed, Event
from hil.values.finding import Finding
from tests.support.recordings import fri_robot
from tools.bench.clients import BenchMotion, recorded_client
from tools.bench.recording import VirtualRun
from transport.capture.reading import read_records
from transport.capture.records import CapturedDatagram, Packet
from transport.capture.writing import PcapngWriter

MS = 1_000_000
USUAL_ANSWER_NS = 400_000
USUAL_LATENESS_NS = 30_000
EXCELLENT_S = 1.6
"""The session commands, and the quality is EXCELLENT, after that time."""


class FaultyRun(VirtualRun):
    """A message each 5 ms; ``lateness``, ``answer`` and ``unread`` are asked with the time of the cycle in ms."""

    def __init__(self, file: Path, **config: Any) -> None:
        robot = fri_robot(**{"fri": {"send_period_ms": 5}, **config})
        super().__init__(robot, recorded_client(robot, BenchMotion.FRI_OVERLAY), file)
        self.found: list[Finding] = []
        self.lateness: Callable[[int], int] = lambda _: USUAL_LATENESS_NS
        self.answer: Callable[[int], int | None] = lambda _: USUAL_ANSWER_NS
        self.unread: Callable[[int], bool] = lambda _: False
        """Whether what came before the cycle is read behind it only."""

    def lateness_ns(self) -> int:
        return self.lateness(self.now_ns // MS)

    def answer_ns(self) -> int | None:
        return self.answer(self.now_ns // MS)

    def read_until_ns(self) -> int:
        return -1 if self.unread(self.now_ns // MS) else self.now_ns

    def events(self, events: list[Event]) -> None:
        self.found += [event.finding for event in events if isinstance(event, Diagnosed)]

    def skip(self, cycles: int) -> None:
        """Miss control cycles."""
        self.now_ns += cycles * MS


def seen_from_outside(file: Path, to: Path, hosts: dict[int, str]) -> Path:
    """Write the packets of a recording of ours as another recorder would have, with other addresses by their port."""
    with PcapngWriter(to) as writer:
        for record in read_records(file):
            if isinstance(record, Packet):
                source, destination = (
                    (hosts.get(port, host), port) for host, port in (record.source, record.destination)
                )
                writer.write(CapturedDatagram(record.at_unix_ns, source, destination, record.payload))
    return to
