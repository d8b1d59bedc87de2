"""The simulators as servers of a state stream at 1 kHz: each started as its user starts it."""

import os
import re
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Final, NamedTuple

from hil.values.errors import EndpointError
from hil.values.fri import Release
from tools.bench.peers.environment import PeerEnvironment
from tools.bench.processes import start_process
from transport.child import module_environment
from transport.udp import free_port

_HOST: Final = "127.0.0.1"
_FRANKY_SERVES: Final = re.compile(r"using '(\S+)' as the robot IP address")
_FRANKA_SERVES: Final = re.compile("Starting MuJoCo simulation loop")
_END_S: Final = 20.0
ARM_VARIABLE: Final = "FR3_MJCF"
"""Where franka-sim looks for a model before it fetches one from the network."""


class Server(NamedTuple):
    """A running one, and what the stream's client must be told."""

    process: int
    client_arguments: tuple[object, ...]


@contextmanager
def our_server(*, robot: str, release: Release) -> Iterator[Server]:
    """``hil run`` with a MuJoCo arm and an FRI client."""
    port = free_port(_HOST)
    with _ended(
        start_process(
            "hil.cli.main",
            *("run", "--robot", robot, "--backend", "mujoco", "--fri-version", release, "--servo", "off"),
            *("--fri-client", f"{_HOST}:{port}", "--pad", "off", "--progress", 0),
        )
    ) as process:
        yield Server(process.pid, ("fri", "--port", port, "--fri-version", release))


@contextmanager
def franky_server(environment: PeerEnvironment) -> Iterator[Server]:
    """``franky-sim`` with its default options, but for the simulator: the default one ends where Genesis is missing."""
    command: list[str | Path] = [environment.python, "-u", environment.program, "--simulator", "mujoco"]
    with _ended(_start(command, os.environ)) as process:
        yield Server(process.pid, ("franka", "--host", _said(process, _FRANKY_SERVES)[1]))


@contextmanager
def franka_server(environment: PeerEnvironment, *, arm: Path) -> Iterator[Server]:
    """``run-franka-sim-server`` with its default options and a model that is here, where it would fetch one."""
    command: list[str | Path] = [environment.python, "-u", environment.program]
    with _ended(_start(command, {**os.environ, ARM_VARIABLE: str(arm)})) as process:
        _said(process, _FRANKA_SERVES)
        yield Server(process.pid, ("franka", "--host", _HOST))


def run_client(server: Server, *arguments: object, at_most_s: float) -> None:
    """Run the stream's client to its end; raise :class:`EndpointError` with what it said last if it fails."""
    command = [sys.executable, "-m", "tools.bench.peers.stream_client", *map(str, server.client_arguments)]
    command += ["--server", str(server.process), *map(str, arguments)]
    try:
        ran = subprocess.run(
            command, check=False, capture_output=True, text=True, timeout=at_most_s, env=module_environment()
        )
    except subprocess.TimeoutExpired:
        raise EndpointError(f"the client of the state stream did not end within {at_most_s:g} s") from None
    if ran.returncode:
        raise EndpointError(f"the client of the state stream failed: {(ran.stderr.strip() or 'silently')[-500:]}")


def _start(command: Sequence[str | Path], environment: Mapping[str, str]) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=environment)


def _said(process: "subprocess.Popen[bytes]", wanted: re.Pattern[str]) -> re.Match[str]:
    """Wait until a server says that it is there; from then on what it says is read and forgotten."""
    last = ""
    if process.stdout is not None:
        for line in process.stdout:
            last = line.decode(errors="replace").strip() or last
            if found := wanted.search(last):
                threading.Thread(target=_forget, args=(process.stdout,), daemon=True).start()
                return found
        process.stdout.close()
    raise EndpointError(f"{process.args!r} ended before it served; the last it said: {last}")


def _forget(stream: IO[bytes]) -> None:
    with stream:
        deque(stream, 0)


@contextmanager
def _ended(process: "subprocess.Popen[bytes]") -> Iterator["subprocess.Popen[bytes]"]:
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(_END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
