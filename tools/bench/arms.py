"""``hil bench arms``: how many arms keep their pace, in one process and in several.

Each arm has a MuJoCo arm, a servo link, and an FRI link whose client listens and does not answer: that is the
controller's own work of every cycle, without what clients take of the same cores. A client that answers costs more on
both sides: ``hil bench rate`` measures one.
"""

import json
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
from tools.bench.processes import start_process, wait_for_end

ARMS_AT_1_KHZ: Final = 4
"""In one process, by the design."""
_HOST: Final = "127.0.0.1"
_SETTLE_S: Final = 2.0


@dataclass(frozen=True, slots=True)
class ArmsReport:
    """The worst of the arms of one setup."""

    arms: int
    processes: int
    rate_hz: float
    lateness_p99_us: float
    missed_percent: float
    cycle_p50_us: float

    @property
    def keeps_pace(self) -> bool:
        """Whether each arm keeps the rate, and misses no more cycles than one alone may."""
        return abs(self.rate_hz - RATE_HZ) <= RATE_TOLERANCE_HZ and self.missed_percent <= 100.0 * MISSED_SHARE


def bounds_of(reports: Sequence[ArmsReport]) -> list[Bound]:
    """Return the figures that have a bound: those of four arms in one process, where that was measured."""
    found = [report for report in reports if (report.arms, report.processes) == (ARMS_AT_1_KHZ, 1)]
    return [
        bound
        for report in found
        for bound in (
            near("4 arms in one process, slowest rate", report.rate_hz, RATE_HZ, RATE_TOLERANCE_HZ, "Hz"),
            at_most("4 arms in one process, missed cycles", report.missed_percent, 100.0 * MISSED_SHARE, "%"),
            at_most("4 arms in one process, lateness p99", report.lateness_p99_us, LATENESS_P99_US, "us"),
        )
    ]


def bench_arms(
    setups: Sequence[tuple[int, int]], *, robot: str, backend: str, seconds: float, progress: Callable[[float], None]
) -> list[ArmsReport]:
    """Run each setup of (arms, processes) for ``seconds``; raise :class:`EndpointError` where one does not run."""
    reports = []
    for place, (arms, processes) in enumerate(setups):
        told = partial(_later, progress, place * seconds)
        reports.append(_run(arms, processes, robot, backend, seconds, told))
    return reports


def _later(progress: Callable[[float], None], before_s: float, done_s: float) -> None:
    progress(before_s + done_s)


def _run(  # noqa: PLR0917
    arms: int, processes: int, robot: str, backend: str, seconds: float, progress: Callable[[float], None]
) -> ArmsReport:
    with tempfile.TemporaryDirectory(prefix="fri-hil-bench-") as folder, ExitStack() as clients:
        running = []
        shares = [arms // processes + (place < arms % processes) for place in range(processes)]
        for place, share in enumerate(filter(None, shares)):
            station, status = Path(folder, f"{place}.toml"), Path(folder, f"{place}.json")
            station.write_text(_station(share, robot, backend, clients), encoding="utf-8")
            arguments = ("run", station, "--duration", seconds + _SETTLE_S, "--settle", _SETTLE_S, "--pad", "off")
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
    )


def _station(arms: int, robot: str, backend: str, clients: ExitStack) -> str:
    """Return a station file; its FRI clients are sockets that take what comes, and what is too much is dropped."""
    robots = []
    for number in range(arms):
        client = clients.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        client.bind((_HOST, 0))
        robots.append(
            f'[[robot]]\nname = "arm{number}"\nmodel = "{robot}"\nbackend = "{backend}"\n'
            f'fri = {{ client = "{_HOST}:{client.getsockname()[1]}" }}\nservo = {{ bind = "{_HOST}:0" }}\n'
        )
    return "".join(robots)


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
