"""``hil bench peers``: our controller and its peers in turn, on the same work, with the same number of cycles.

Cycles of both simulators are measured in processes of their own; streams are measured from a client's process, once
with a client that listens and once with one that commands a sine over axis 4. All repeats are in turn, ours first, so
that what the host does besides meets both.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from hil.values.errors import EndpointError
from hil.values.fri import Release
from tools.bench.cycle import WARM_UP_CYCLES
from tools.bench.peers.environment import FRANKA, FRANKY, PEERS, PeerEnvironment
from tools.bench.peers.figures import Cycles, Stream, cycles_of, stream_of
from tools.bench.peers.servers import ARM_VARIABLE, Server, franka_server, franky_server, our_server, run_client
from tools.bench.peers.sine import FREQUENCY_HZ, MOVED_RAD
from transport.child import module_environment

OURS: Final = "fri-hil"
SIMULATORS: Final = (OURS, *PEERS)
BARE: Final = "bare"
"""Cycles from the bytes of a command to the bytes of a state, no sockets."""
LOOP: Final = "loop"
"""The same with sockets and a client over loopback."""
LISTENS: Final = "listens"
COMMANDS: Final = "commands"
SETTLE_S: Final = 4.0
"""Of each stream, not measured; an FRI session is commanding by then."""
_LOOP_MODULES: Final = {FRANKY: "tools.bench.peers.franky_loop", FRANKA: "tools.bench.peers.franka_loop"}
_PERIOD_CYCLES: Final = int(1000 / FREQUENCY_HZ)
_LOOPS_S: Final = 600.0
_START_AND_END_S: Final = 60.0


@dataclass(slots=True)
class Simulator:
    """All runs of one simulator, by what was measured."""

    cycles: dict[str, list[Cycles]] = field(default_factory=lambda: {BARE: [], LOOP: []})
    streams: dict[str, list[Stream]] = field(default_factory=lambda: {LISTENS: [], COMMANDS: []})


@dataclass(frozen=True, slots=True)
class PeersReport:
    """One benchmark run."""

    cycles: int
    """Of each repeat of each loop."""
    seconds: float
    """Of each repeat of each stream."""
    repeats: int
    peer_versions: dict[str, dict[str, str]]
    simulators: dict[str, Simulator]
    load_average: tuple[float, float, float]
    """Of the machine before the first measurement: processes that wanted to run, over 1, 5 and 15 minutes."""

    def as_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class _Step:
    simulator: str
    what: str


def bench_peers(
    *,
    environments: Mapping[str, PeerEnvironment],
    robot: str,
    release: Release,
    cycles: int,
    seconds: float,
    repeats: int,
    progress: Callable[[int, str], None],
) -> PeersReport:
    """Measure everything; ``progress`` is told how many of :func:`steps` are done and what comes next.

    Raises :class:`EndpointError` where a simulator does not do what it should.
    """
    report = PeersReport(
        cycles,
        seconds,
        repeats,
        {peer: environment.versions() for peer, environment in environments.items()},
        {name: Simulator() for name in SIMULATORS},
        os.getloadavg(),
    )
    with tempfile.TemporaryDirectory(prefix="fri-hil-bench-") as folder:
        out, arm = Path(folder, "found.json"), Path(folder, "fr3.xml")
        arm.write_text(environments[FRANKY].arm(), encoding="utf-8")
        starter = _Starter(environments, robot, release, arm)
        for done, step in enumerate(_steps(repeats)):
            progress(done, f"{step.simulator}: {step.what}")
            found = report.simulators[step.simulator]
            if step.what == LOOP:
                starter.run_loops(step.simulator, cycles, out)
                for kind, measured in json.loads(out.read_text(encoding="utf-8")).items():
                    _check_moved(step.simulator, measured, cycles)
                    found.cycles[kind].append(cycles_of(measured["samples_ns"]))
            else:
                with starter.server(step.simulator) as server:
                    run_client(
                        server,
                        *("--out", out, "--seconds", seconds, "--settle", SETTLE_S),
                        *(["--command"] if step.what == COMMANDS else []),
                        at_most_s=seconds + SETTLE_S + _START_AND_END_S,
                    )
                found.streams[step.what].append(stream_of(json.loads(out.read_text(encoding="utf-8"))))
    return report


def _check_moved(simulator: str, measured: dict[str, Any], cycles: int) -> None:
    """Raise where an arm stood still; ours is checked by its session's state."""
    moved_rad = measured.get("moved_rad")
    if moved_rad is not None and cycles >= _PERIOD_CYCLES and moved_rad < MOVED_RAD:
        raise EndpointError(f"the arm of {simulator} moved {moved_rad:.4f} rad: it does not follow the sine")


def steps(repeats: int) -> int:
    """Return how many things are measured one after the other."""
    return len(list(_steps(repeats)))


def _steps(repeats: int) -> Iterator[_Step]:
    for _ in range(repeats):
        for what in (LOOP, LISTENS, COMMANDS):
            for simulator in SIMULATORS:
                yield _Step(simulator, what)


@dataclass(frozen=True, slots=True)
class _Starter:
    """Starts each simulator, for its loops and as a server."""

    environments: Mapping[str, PeerEnvironment]
    robot: str
    release: Release
    arm: Path

    def run_loops(self, simulator: str, cycles: int, out: Path) -> None:
        """Measure cycles as fast as they go, in a process of their own."""
        if simulator == OURS:
            command = [sys.executable, "-m", "tools.bench.peers.our_loop"]
            command += ["--robot", self.robot, "--fri-version", self.release]
        else:
            command = [str(self.environments[simulator].python), "-m", _LOOP_MODULES[simulator]]
            command += ["--warm-up", str(WARM_UP_CYCLES)]
        ran = subprocess.run(
            [*command, "--cycles", str(cycles), "--out", str(out)],
            check=False,
            capture_output=True,
            text=True,
            timeout=_LOOPS_S,
            env={**module_environment(), ARM_VARIABLE: str(self.arm)},
        )
        if ran.returncode:
            raise EndpointError(f"the cycles of {simulator} failed: {(ran.stderr.strip() or 'silently')[-500:]}")

    @contextmanager
    def server(self, simulator: str) -> Iterator[Server]:
        """Run it as a server while the block lasts."""
        if simulator == OURS:
            running = our_server(robot=self.robot, release=self.release)
        elif simulator == FRANKY:
            running = franky_server(self.environments[FRANKY])
        else:
            running = franka_server(self.environments[FRANKA], arm=self.arm)
        with running as server:
            yield server
