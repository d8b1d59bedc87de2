"""``hil bench rate``: the real process against a real client process over UDP; pacing, missed cycles, answers."""

import json
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.values.fri import Release
from tools.bench.bounds import (
    LATENESS_P99_US,
    MISSED_SHARE,
    RATE_HZ,
    RATE_TOLERANCE_HZ,
    START_S,
    Bound,
    at_most,
    near,
)
from tools.bench.processes import burning_core, start_process, wait_for_end
from tools.bench.start import start_to_first_packet
from transport.udp import free_port

_HOST = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class RateReport:
    """One benchmark run: the status file's figures of the robot, and the client's own result."""

    robot: dict[str, Any]
    client: dict[str, Any]
    start_to_first_packet_s: float

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound."""
        robot = self.robot
        return [
            near("rate", robot["rate_hz"], RATE_HZ, RATE_TOLERANCE_HZ, "Hz"),
            at_most("lateness p99", robot["lateness_us"]["p99"], LATENESS_P99_US, "us"),
            at_most("missed cycles", 100 * robot["missed_cycles"] / robot["ticks"], 100 * MISSED_SHARE, "%"),
            at_most("start to first packet", self.start_to_first_packet_s, START_S, "s"),
        ]


def bench_rate(
    *,
    robot: str,
    backend: str,
    release: Release,
    seconds: float,
    capture: bool,
    realtime: bool,
    load: bool = False,
    progress: Callable[[float], None],
) -> RateReport:
    """Run controller and client for ``seconds`` after the client's first packet; ``load``: with a busy last core."""
    with tempfile.TemporaryDirectory(prefix="fri-hil-bench-") as folder, ExitStack() as stack:
        if load:
            stack.enter_context(burning_core())
        status, result = Path(folder, "status.json"), Path(folder, "client.json")
        first_s = start_to_first_packet(robot=robot, backend=backend, release=release)
        port = free_port(_HOST)
        client = start_process(
            "apps.fri_joint_sine",
            *("--fri-version", release, "--bind", _HOST, "--port", port, "--seconds", seconds + 10, "--json", result),
        )
        extra: list[object] = ["--capture", Path(folder, "run.pcapng")] if capture else []
        controller = start_process(
            "hil.cli.main",
            *("run", "--robot", robot, "--backend", backend, "--fri-client", f"{_HOST}:{port}", "--servo", "off"),
            *("--fri-version", release, "--duration", seconds, "--status-json", status, "--progress", 0),
            *extra,
            *(["--realtime"] if realtime else []),
        )
        wait_for_end(controller, seconds + 20, progress)
        wait_for_end(client, 20, lambda _: None)
        return RateReport(
            robot=json.loads(status.read_text())["robots"]["arm"],
            client=json.loads(result.read_text()),
            start_to_first_packet_s=round(first_s, 3),
        )
