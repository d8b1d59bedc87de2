"""``hil bench chain``: what the link to a Cabinet costs: from the Cabinet's message to the answer, over UDP.

Our own controller stands for the Cabinet. Measured twice, one after the other: with a plain FRI client of ours, and
with a second controller on the backend ``cabinet``, which has an FRI client of its own behind it. Times are those of
the Cabinet: from the departure of its message to the kernel's stamp of the answer, so way and kernel are in both.
"""

import json
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from hil.values.errors import EndpointError
from hil.values.fri import Release
from tools.bench.bounds import Bound, at_most
from tools.bench.processes import start_process, wait_for_end
from transport.udp import free_port

_HOST = "127.0.0.1"
LINK_MS = 1.0
"""What the link may add, by the design: less than one millisecond."""


@dataclass(frozen=True, slots=True)
class ChainReport:
    """Status files of the Cabinet's robot without and with the link, and that of the controller between."""

    plain: dict[str, Any]
    cabinet: dict[str, Any]
    controller: dict[str, Any]

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound."""
        latency = self.cabinet["answer_latency_us"]
        return [
            at_most("Cabinet's message to our answer, median", latency["p50"] / 1e3, LINK_MS, "ms"),
            at_most("Cabinet's message to our answer, p99", latency["p99"] / 1e3, LINK_MS, "ms"),
        ]


def bench_chain(
    *,
    robot: str,
    backend: str,
    release: Release,
    send_period_ms: int,
    seconds: float,
    progress: Callable[[float], None],
) -> ChainReport:
    """Run both for ``seconds`` each."""
    with tempfile.TemporaryDirectory(prefix="fri-hil-bench-") as folder:
        plain_file, cabinet_file, controller_file = (
            Path(folder, name) for name in ("plain.json", "cabinet.json", "controller.json")
        )
        controller = partial(_controller, robot=robot, release=release, send_period_ms=send_period_ms)
        port, outer_port = free_port(_HOST), free_port(_HOST)
        plain = [controller(port, plain_file, seconds, backend), _client(port, release, seconds + 10)]
        _run_all(plain, seconds, progress)
        link = ("-o", f"bind={_HOST}:{port}", "-o", f"release={release}", "--cycle", send_period_ms)
        chained = [
            controller(port, cabinet_file, seconds, backend),
            controller(outer_port, controller_file, seconds + 2, "cabinet", extra=link),
            _client(outer_port, release, seconds + 10),
        ]
        _run_all(chained, seconds, lambda done_s: progress(seconds + done_s))
        return ChainReport(*(_robot(file) for file in (plain_file, cabinet_file, controller_file)))


def _controller(
    client_port: int,
    status: Path,
    seconds: float,
    backend: str,
    *,
    robot: str,
    release: Release,
    send_period_ms: int,
    extra: tuple[object, ...] = (),
) -> "subprocess.Popen[bytes]":
    return start_process(
        "hil.cli.main",
        *("run", "--robot", robot, "--backend", backend, "--fri-client", f"{_HOST}:{client_port}", "--servo", "off"),
        *("--pad", "off", "--fri-version", release, "--send-period", send_period_ms, "--duration", seconds),
        *("--status-json", status, "--progress", 0, *extra),
    )


def _client(port: int, release: Release, seconds: float) -> "subprocess.Popen[bytes]":
    return start_process(
        "apps.fri_joint_sine",
        *("--fri-version", release, "--bind", _HOST, "--port", port, "--seconds", seconds),
    )


def _run_all(processes: list["subprocess.Popen[bytes]"], seconds: float, progress: Callable[[float], None]) -> None:
    try:
        wait_for_end(processes[0], seconds + 20, progress)
        for process in processes[1:]:
            wait_for_end(process, 30, lambda _: None)
    finally:
        for process in processes:
            if process.poll() is None:
                process.kill()
                process.wait()


def _robot(file: Path) -> dict[str, Any]:
    if not file.exists():
        raise EndpointError("a controller of the chain ended without a status file: run the three by hand to see why")
    robots: dict[str, dict[str, Any]] = json.loads(file.read_text(encoding="utf-8"))["robots"]
    return robots["arm"]
