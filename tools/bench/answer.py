"""``hil bench answer``: from a packet in the kernel to the interpolator, and to the packet that follows from it.

A real controller records itself while a client process talks to it; the recording has the kernel's stamp of what came,
when each cycle was due and began, and when what it said left. A cycle uses what came before it, so most of the time is
waiting for the cycle's due time, by design; what is left of it is the controller's own.
"""

import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from hil.core.controller import FRI_LINK
from hil.core.servo.link import SERVO_LINK
from hil.runtime.capture_header import read_header
from hil.values.errors import EndpointError
from hil.values.fri import Release
from hil.values.link import Address
from tools.bench.bounds import Bound, at_most
from tools.bench.cycle import Distribution
from tools.bench.processes import start_process, wait_for_end
from tools.bench.servo import one_after_the_other, servo_controller
from transport.capture.journal import TickEntry, read_entries
from transport.capture.reading import read_records, read_section_comment
from transport.capture.records import CaptureRecord, Notes
from transport.udp import free_port

OWN_P99_US: Final = 500.0
"""Of the controller's own share: half a cycle of 1 ms."""
_HOST: Final = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class Answers:
    """Of the packets of one link; microseconds."""

    link: str
    packets: int
    to_interpolator: Distribution
    """From the kernel's stamp to the beginning of the cycle that uses it."""
    waiting: Distribution
    """Of that: until the cycle was due."""
    to_packet_out: Distribution
    """From the kernel's stamp to the departure of what that cycle said on the link; of cycles that said something."""
    own: Distribution
    """From when the cycle was due to that departure: lateness and the cycle itself."""


@dataclass(frozen=True, slots=True)
class AnswerReport:
    """Both links."""

    robot: str
    backend: str
    links: tuple[Answers, ...]

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound."""
        return [
            at_most(f"{one.link}: the controller's own share, p99", one.own.p99_us, OWN_P99_US, "us")
            for one in self.links
        ]

    def as_dict(self) -> dict[str, Any]:
        """Return the report for JSON."""
        return {
            "robot": self.robot,
            "backend": self.backend,
            "links": [
                {
                    "link": one.link,
                    "packets": one.packets,
                    "to_interpolator_us": one.to_interpolator.as_dict(),
                    "waiting_us": one.waiting.as_dict(),
                    "to_packet_out_us": one.to_packet_out.as_dict(),
                    "own_us": one.own.as_dict(),
                }
                for one in self.links
            ],
            "bounds": [bound._asdict() for bound in self.bounds()],
        }


def bench_answer(
    *, robot: str, backend: str, release: Release, seconds: float, progress: Callable[[float], None]
) -> AnswerReport:
    """Measure ``seconds`` on each link."""
    with tempfile.TemporaryDirectory(prefix="fri-hil-bench-") as folder:
        fri, servo = Path(folder, "fri.pcapng"), Path(folder, "servo.pcapng")
        _run_fri(fri, robot, backend, release, seconds, progress)
        _run_servo(servo, robot, backend, seconds, lambda done: progress(seconds + done))
        links = answers_in(fri, FRI_LINK), answers_in(servo, SERVO_LINK)
    return AnswerReport(robot, backend, links)


def answers_in(file: Path, link: str) -> Answers:
    """Return what a recording of ours shows of the packets that came on ``link``; raise :class:`EndpointError`."""
    header = read_header(read_section_comment(file))
    start = None if header is None else header.robots[0]
    bound = None if start is None else start.address(link)
    if start is None or bound is None:
        raise EndpointError(f"{file} is no recording of a controller with the link {link}")
    return evaluated(read_records(file), link, bound, start.unix_epoch_ns)


def evaluated(records: Iterable[CaptureRecord], link: str, bound: Address, unix_epoch_ns: int) -> Answers:
    """Return what ``records`` show of the packets that came to ``bound``; raise :class:`EndpointError` without any."""
    came: list[int] = []
    used: list[int] = []
    tick: TickEntry | None = None
    to_interpolator: list[int] = []
    waiting: list[int] = []
    to_packet_out: list[int] = []
    own: list[int] = []
    for record in records:
        if isinstance(record, Notes):
            for entry in read_entries(record.entries):
                if isinstance(entry, TickEntry):
                    tick, used, came = entry, came, []
                    begin_ns = entry.due_ns + entry.lateness_ns
                    to_interpolator += [begin_ns - at_ns for at_ns in used]
                    waiting += [max(0, entry.due_ns - at_ns) for at_ns in used]
        elif Address(*record.destination) == bound:
            came.append(record.at_unix_ns - unix_epoch_ns)
        elif Address(*record.source) == bound and tick is not None and used:
            departed_ns = record.at_unix_ns - unix_epoch_ns
            to_packet_out += [departed_ns - at_ns for at_ns in used]
            own.append(departed_ns - tick.due_ns)
            used = []
    if not to_packet_out:
        raise EndpointError(f"nothing was answered on the link {link}: run hil run by hand to see why")
    samples = to_interpolator, waiting, to_packet_out, own
    return Answers(link, len(to_interpolator), *map(Distribution.of, samples))


def _run_fri(  # noqa: PLR0917
    capture: Path, robot: str, backend: str, release: Release, seconds: float, progress: Callable[[float], None]
) -> None:
    port = free_port(_HOST)
    client = start_process(
        "apps.fri_joint_sine", "--fri-version", release, "--bind", _HOST, "--port", port, "--seconds", seconds + 10.0
    )
    controller = start_process(
        "hil.cli.main",
        *("run", "--robot", robot, "--backend", backend, "--fri-client", f"{_HOST}:{port}", "--servo", "off"),
        *("--fri-version", release, "--duration", seconds, "--pad", "off", "--progress", 0, "--capture", capture),
    )
    wait_for_end(controller, seconds + 20.0, progress)
    wait_for_end(client, 20.0, lambda _: None)


def _run_servo(capture: Path, robot: str, backend: str, seconds: float, progress: Callable[[float], None]) -> None:
    with servo_controller(robot, backend, "--pad", "off", "--capture", str(capture)) as address:
        one_after_the_other(address, seconds, progress)
