"""``hil bench arms``: how many arms keep their pace, in one process and in several.

Each arm has a MuJoCo arm, a servo link, and an FRI link. One process has the clients of all of them, which answer every
message; that takes its share of the same cores, as clients do. With ``listening`` they only listen: what is left is the
controller's own work without answers.
"""

import json
import os
import socket
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

from hil.values.errors import EndpointError
from tools.bench.bounds import LATENESS_P99_US, MISSED_SHARE, RATE_HZ, RATE_TOLERANCE_HZ, Bound, at_most, near
from tools.bench.processes import burning_core, start_process, wait_for_end
from transport.udp import free_port

BOUND_SETUPS: Final = frozenset({(4, 1), (8, 2)})
"""Arms and processes that keep 1 kHz, by the design."""
_HOST: Final = "127.0.0.1"
_SETTLE_S: Final = 2.0


@dataclass(frozen=True, slots=True)
class Beside:
    """What else goes on: clients that only listen, a capture, a load on the last core."""

    listening: bool = False
    capture: bool = False
    load: bool = False
    realtime: bool = False
    """Ask for real-time scheduling."""


@dataclass(frozen=True, slots=True)
class ArmsReport:
    """The worst of the arms of one setup."""

    arms: int
    processes: int
    rate_hz: float
    lateness_p99_us: float
    missed_percent: float
    cycle_p50_us: float
    commanding: int
    """Arms whose client got them once, and kept them to the end."""

    @property
    def keeps_pace(self) -> bool:
        """Whether each arm keeps the rate, and misses no more cycles than one alone may."""
        return abs(self.rate_hz - RATE_HZ) <= RATE_TOLERANCE_HZ and self.missed_percent <= 100.0 * MISSED_SHARE


def bounds_of(reports: Sequence[ArmsReport]) -> list[Bound]:
    """Return the figures that have a bound, as far as their setups were measured."""
    bounds = []
    for report in reports:
        if (report.arms, report.processes) in BOUND_SETUPS:
            name = f"{report.arms} arms in {report.processes} process{'es' if report.processes > 1 else ''}"
            bounds += [
                near(f"{name}, slowest rate", report.rate_hz, RATE_HZ, RATE_TOLERANCE_HZ, "Hz"),
                at_most(f"{name}, missed cycles", report.missed_percent, 100.0 * MISSED_SHARE, "%"),
                at_most(f"{name}, lateness p99", report.lateness_p99_us, LATENESS_P99_US, "us"),
            ]
    return bounds


def bench_arms(
    setups: Sequence[tuple[int, int]],
    *,
    robot: str,
    backend: str,
    seconds: float,
    beside: Beside,
    progress: Callable[[float], None],
) -> list[ArmsReport]:
    """Run each setup of (arms, processes) for ``seconds``; raise :class:`EndpointError` where one does not run."""
    reports = []
    for place, (arms, processes) in enumerate(setups):
        told = partial(_later, progress, place * seconds)
        with ExitStack() as stack:
            if beside.load:
                stack.enter_context(burning_core())
            reports.append(_run(arms, processes, robot, backend, seconds, beside, told))
    return reports


def _later(progress: Callable[[float], None], before_s: float, done_s: float) -> None:
    progress(before_s + done_s)


def _run(  # noqa: PLR0917
    arms: int,
    processes: int,
    robot: str,
    backend: str,
    seconds: float,
    beside: Beside,
    progress: Callable[[float], None],
) -> ArmsReport:
    with tempfile.TemporaryDirectory(prefix="fri-hil-bench-") as folder, ExitStack() as stack:
        running = []
        shares = [arms // processes + (place < arms % processes) for place in range(processes)]
        ports = _clients(arms, stack, listening=beside.listening)
        for place, share in enumerate(filter(None, shares)):
            station, status = Path(folder, f"{place}.toml"), Path(folder, f"{place}.json")
            station.write_text(_station([ports.pop() for _ in range(share)], robot, backend), encoding="utf-8")
            arguments = ["run", station, "--duration", seconds + _SETTLE_S, "--settle", _SETTLE_S, "--pad", "off"]
            if beside.capture:
                arguments += ["--capture", Path(folder, f"{place}.pcapng")]
            if beside.realtime:
                arguments.append("--realtime")
            running.append(
                (start_process("hil.cli.main", *arguments, "--status-json", status, "--progress", 0), status)
            )
        try:
            for process, _ in running:
                wait_for_end(process, seconds + _SETTLE_S + 30.0, progress)
        finally:
            _kill(process for process, _ in running)
        robots = [one for _, status in running for one in _robots(status)]
    return ArmsReport(
        arms,
        processes,
        rate_hz=min((one["rate_hz"] for one in robots), key=lambda rate: -abs(rate - RATE_HZ)),
        lateness_p99_us=max(one["lateness_us"]["p99"] for one in robots),
        missed_percent=round(max(100.0 * one["missed_cycles"] / one["ticks"] for one in robots), 4),
        cycle_p50_us=max(one["cycle_us"]["p50"] for one in robots),
        commanding=sum(_commanded(one) for one in robots),
    )


def _commanded(robot: dict[str, Any]) -> bool:
    """Whether the client got its arm, and kept it to the end: it never had to come back."""
    begun = sum(1 for change in robot["session"]["history"] if change["to"] == "COMMANDING_ACTIVE")
    return begun == 1


def _clients(arms: int, stack: ExitStack, *, listening: bool) -> list[int]:
    """Start the FRI clients of all arms, and return their ports."""
    if listening:
        sockets = [stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(arms)]
        for client in sockets:
            client.bind((_HOST, 0))
        return [client.getsockname()[1] for client in sockets]
    ports = [free_port(_HOST) for _ in range(arms)]
    process = start_process("tools.bench.answering", os.getpid(), _HOST, *ports)
    stack.callback(_kill, [process])
    return ports


def _station(ports: Sequence[int], robot: str, backend: str) -> str:
    """Return a station file."""
    return "".join(
        f'[[robot]]\nname = "arm{number}"\nmodel = "{robot}"\nbackend = "{backend}"\n'
        f'fri = {{ client = "{_HOST}:{port}" }}\nservo = {{ bind = "{_HOST}:0" }}\n'
        for number, port in enumerate(ports)
    )


def _robots(status: Path) -> list[dict[str, Any]]:
    if not status.exists():
        raise EndpointError("a controller ended without a status file: run it by hand to see why")
    robots: dict[str, dict[str, Any]] = json.loads(status.read_text(encoding="utf-8"))["robots"]
    return list(robots.values())


def _kill(processes: Iterable["subprocess.Popen[bytes]"]) -> None:
    for process in processes:
        if process.poll() is None:
            process.kill()
        process.wait()
