"""``hil bench rate``: the real process against a real client process over UDP; pacing, missed cycles, answers."""

import json
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.clock import elapsed_ns
from hil.values.errors import EndpointError
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
    progress: Callable[[float], None],
) -> RateReport:
    """Run controller and client for ``seconds`` after the client's first packet."""
    with tempfile.TemporaryDirectory(prefix="fri-hil-bench-") as folder:
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


def start_to_first_packet(*, robot: str, backend: str, release: Release) -> float:
    """Return the seconds from starting ``hil run`` to its first datagram."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind((_HOST, 0))
        listener.settimeout(20)
        before_ns = elapsed_ns()
        controller = start_process(
            "hil.cli.main",
            *("run", "--robot", robot, "--backend", backend, "--fri-version", release),
            *("--fri-client", f"{_HOST}:{listener.getsockname()[1]}", "--servo", f"{_HOST}:0"),
            *("--duration", 0.2, "--progress", 0),
        )
        try:
            listener.recv(2048)
        except TimeoutError:
            raise EndpointError("hil run sent nothing within 20 s of its start") from None
        finally:
            controller.terminate()
            controller.communicate()
        return (elapsed_ns() - before_ns) / 1e9


def start_process(module: str, *arguments: object) -> "subprocess.Popen[bytes]":
    """Start a module of ours, silent."""
    return subprocess.Popen(
        [sys.executable, "-m", module, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


def wait_for_end(process: "subprocess.Popen[bytes]", at_most_s: float, progress: Callable[[float], None]) -> None:
    """Wait for a process, and tell ``progress`` how long that took so far; raise :class:`EndpointError`."""
    waited_s = 0.0
    while waited_s < at_most_s:
        try:
            process.wait(0.5)
        except subprocess.TimeoutExpired:
            waited_s += 0.5
            progress(waited_s)
        else:
            return
    process.kill()
    process.wait()
    raise EndpointError(f"{process.args!r} did not end within {at_most_s:g} s")
