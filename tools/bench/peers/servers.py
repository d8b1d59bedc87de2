"""The simulators as servers of a state stream at 1 kHz: each started as its user starts it."""

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final, NamedTuple

from hil.values.errors import EndpointError
from hil.values.fri import Release
from tools.bench.peers.environment import PeerEnvironment
from tools.bench.processes import start_process
from transport.child import module_environment
from transport.udp import free_port

_HOST: Final = "127.0.0.1"
_SERVES_AT: Final = re.compile(r"using '(\S+)' as the robot IP address")
_END_S: Final = 20.0


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
    command: list[str | Path] = [environment.python, "-u", environment.franky_sim, "--simulator", "mujoco"]
    with _ended(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)) as process:
        yield Server(process.pid, ("franka", "--host", _address(process)))


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


def _address(process: "subprocess.Popen[bytes]") -> str:
    if process.stdout is not None:
        for line in process.stdout:
            if found := _SERVES_AT.search(line.decode(errors="replace")):
                return found[1]
    raise EndpointError("franky-sim ended without saying where it serves; run it by hand to see why")


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
        if process.stdout is not None:
            process.stdout.close()
