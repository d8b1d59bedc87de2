"""``hil bench kst``: set-points a second that a KST program gets acknowledged, when it waits for each of them.

The loop of published clients: a set-point more than two milliseconds after the last reply, then one read for the next.
With a MuJoCo arm that follows it, and an FRI client that watches, all of them processes on this machine.
"""

import json
import math
import re
import socket
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from hil.clock import elapsed_ns
from hil.values.errors import EndpointError
from tools.bench.bounds import Bound, at_least, at_most
from tools.bench.processes import start_process
from transport.child import module_command, module_environment
from transport.udp import free_port

RATE_HZ: Final = 400.0
P99_MS: Final = 4.0
_HOST: Final = "127.0.0.1"
_OWN_PAUSE_NS: Final = 2_000_000
"""Between a reply and the next set-point of a published client."""
_AMPLITUDE_RAD: Final = 0.2
_AMPLITUDE_MM: Final = 30.0
_FREQUENCY_HZ: Final = 0.25
_START: Final = "jp_0.0_0.0_0.0_-1.5707_0.0_1.5708_0.0_\n"
_PATIENCE_S: Final = 30.0


@dataclass(frozen=True, slots=True)
class Loop:
    """One kind of set-point: what starts the mode, and the line of an instant in s, from a pose in mm and rad."""

    name: str
    start: str
    line: Callable[[float, list[float]], str]
    pause_ns: int = _OWN_PAUSE_NS


def _joints(token: str) -> Callable[[float, list[float]], str]:
    def line(now_s: float, _pose: list[float]) -> str:
        swing_rad = _AMPLITUDE_RAD * math.sin(2.0 * math.pi * _FREQUENCY_HZ * now_s)
        return f"{token}_{swing_rad:.4f}_0.0_0.0_-1.5707_0.0_1.5708_0.0_\n\n"

    return line


def _pose(token: str) -> Callable[[float, list[float]], str]:
    def line(now_s: float, pose: list[float]) -> str:
        x, y, z, *angles = pose
        z += _AMPLITUDE_MM * math.sin(2.0 * math.pi * _FREQUENCY_HZ * now_s)
        return f"{token}_{x:.4f}_{y:.4f}_{z:.4f}_{'_'.join(map(repr, angles))}_\n\n"

    return line


LOOPS: Final = (
    Loop("joint, acknowledged", "startDirectServoJoints", _joints("jp")),
    Loop("joint, measured torques back", "startDirectServoJoints", _joints("jpMT")),
    Loop("Cartesian, joint positions back", "stDcEEf_", _pose("DcSeCarJP")),
    Loop("joint, as fast as it can", "startDirectServoJoints", _joints("jp"), 0),
)


@dataclass(frozen=True, slots=True)
class LoopReport:
    """What one loop measured."""

    name: str
    rate_hz: float
    round_trip_ms: dict[str, float]


@dataclass(frozen=True, slots=True)
class KstReport:
    """All loops, and the status file of the robot."""

    loops: tuple[LoopReport, ...]
    robot: dict[str, Any]

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound: those of the first loop."""
        first = self.loops[0]
        return [
            at_least("joint set-points acknowledged", first.rate_hz, RATE_HZ, "Hz"),
            at_most("set-point to acknowledgement, p99", first.round_trip_ms["p99"], P99_MS, "ms"),
        ]


def bench_kst(*, robot: str, backend: str, seconds: float, nagle: bool, progress: Callable[[float], None]) -> KstReport:
    """Run each loop for ``seconds``; raise :class:`EndpointError` where the server does not serve."""
    with tempfile.TemporaryDirectory(prefix="fri-hil-bench-") as folder:
        status, port = Path(folder, "status.json"), free_port(_HOST)
        controller = subprocess.Popen(
            module_command(
                "hil.cli.main",
                *(
                    "run",
                    "--robot",
                    robot,
                    "--backend",
                    backend,
                    "--fri-client",
                    f"{_HOST}:{port}",
                    "--overlay",
                    "none",
                ),
                *("--servo", f"{_HOST}:0", "--kst", f"{_HOST}:0", "--pad", "off", "--progress", "0"),
                *("--status-json", str(status), *(("--kst-nagle",) if nagle else ())),
            ),
            env=module_environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        watcher = start_process(
            "apps.fri_joint_sine", "--bind", _HOST, "--port", port, "--seconds", len(LOOPS) * (seconds + 15.0)
        )
        try:
            address = _address(controller)
            loops = _measured(address, seconds, progress)
            controller.terminate()
            _, last_words = controller.communicate(timeout=_PATIENCE_S)
        finally:
            for process in (controller, watcher):
                if process.poll() is None:
                    process.kill()
                process.wait()
        if not status.exists():
            raise EndpointError(f"the controller ended without a status file: {last_words[-200:]}")
        return KstReport(loops, json.loads(status.read_text(encoding="utf-8"))["robots"]["arm"])


def _address(controller: "subprocess.Popen[str]") -> tuple[str, int]:
    for line in controller.stderr or ():
        found = re.search(r"KST programs at TCP ([\d.]+):(\d+)", line)
        if found is not None:
            return found[1], int(found[2])
    raise EndpointError("the controller serves no KST programs; run `hil run --kst 127.0.0.1` by hand to see why")


def _measured(address: tuple[str, int], seconds: float, progress: Callable[[float], None]) -> tuple[LoopReport, ...]:
    with socket.create_connection(address, timeout=_PATIENCE_S) as link:
        reports = []
        for number, loop in enumerate(LOOPS):
            for line in ("jRelVel_0.5_", _START, "doPTPinJS"):
                _ask(link, line)
            link.recv(1024)
            pose = [float(text) for text in _ask(link, "Eef_pos").split("_")[:-1]]
            _ask(link, loop.start)
            reports.append(_run(link, loop, pose, seconds))
            _ask(link, "stopDirectServoJoints")
            progress((number + 1) * seconds)
        link.sendall(b"end\n")
        return tuple(reports)


def _run(link: socket.socket, loop: Loop, pose: list[float], seconds: float) -> LoopReport:
    taken_ns: list[int] = []
    began_ns = replied_ns = elapsed_ns()
    until_ns = began_ns + int(seconds * 1e9)
    while replied_ns < until_ns:
        sent_ns = elapsed_ns()
        if sent_ns - replied_ns <= loop.pause_ns:
            continue
        link.sendall(loop.line((sent_ns - began_ns) * 1e-9, pose).encode())
        if not link.recv(1024):
            raise EndpointError("the server closed the connection in the middle of a measurement")
        replied_ns = elapsed_ns()
        taken_ns.append(replied_ns - sent_ns)
    taken_ns.sort()
    shares = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999, "max": 1.0}
    figures = {
        name: taken_ns[min(len(taken_ns) - 1, int(share * len(taken_ns)))] / 1e6 for name, share in shares.items()
    }
    return LoopReport(loop.name, len(taken_ns) / ((replied_ns - began_ns) * 1e-9), figures)


def _ask(link: socket.socket, line: str) -> str:
    link.sendall(f"{line}\n".encode())
    return link.recv(1024).decode("ascii", "replace")
