"""``hil bench peers``: our controller and its peers in turn, on the same work, with the same number of cycles.

Cycles of both simulators are measured in processes of their own; streams are measured from a client's process, once
with a client that listens and once with one that commands a sine over axis 4. All repeats are in turn, ours first, so
that what the host does besides meets both.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from hil.values.errors import EndpointError
from hil.values.fri import Release
from tools.bench.cycle import WARM_UP_CYCLES
from tools.bench.peers.environment import PeerEnvironment
from tools.bench.peers.figures import Cycles, Stream, cycles_of, stream_of
from tools.bench.peers.servers import Server, franky_server, our_server, run_client
from transport.child import module_environment

OURS: Final = "fri-hil"
FRANKY: Final = "franky-sim"
BARE: Final = "bare"
"""Cycles from the bytes of a command to the bytes of a state, no sockets."""
LOOP: Final = "loop"
"""The same with sockets and a client over loopback."""
LISTENS: Final = "listens"
COMMANDS: Final = "commands"
SETTLE_S: Final = 4.0
"""Of each stream, not measured; an FRI session is commanding by then."""
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
    peer_versions: dict[str, str]
    simulators: dict[str, Simulator]

    def as_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class _Step:
    simulator: str
    what: str


def bench_peers(
    *,
    environment: PeerEnvironment,
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
        cycles, seconds, repeats, environment.versions(), {name: Simulator() for name in (OURS, FRANKY)}
    )
    with tempfile.TemporaryDirectory(prefix="fri-hil-bench-") as folder:
        out = Path(folder, "found.json")
        for done, step in enumerate(_steps(repeats)):
            progress(done, f"{step.simulator}: {step.what}")
            found = report.simulators[step.simulator]
            if step.what == LOOP:
                _loops(step.simulator, environment, robot, release, cycles, out)
                for kind, measured in json.loads(out.read_text(encoding="utf-8")).items():
                    found.cycles[kind].append(cycles_of(measured["samples_ns"]))
            else:
                with _server(step.simulator, environment, robot, release) as server:
                    run_client(
                        server,
                        *("--out", out, "--seconds", seconds, "--settle", SETTLE_S),
                        *(["--command"] if step.what == COMMANDS else []),
                        at_most_s=seconds + SETTLE_S + _START_AND_END_S,
                    )
                found.streams[step.what].append(stream_of(json.loads(out.read_text(encoding="utf-8"))))
    return report


def steps(repeats: int) -> int:
    """Return how many things are measured one after the other."""
    return len(list(_steps(repeats)))


def _steps(repeats: int) -> Iterator[_Step]:
    for _ in range(repeats):
        for what in (LOOP, LISTENS, COMMANDS):
            for simulator in (OURS, FRANKY):
                yield _Step(simulator, what)


def _loops(  # noqa: PLR0917
    simulator: str, environment: PeerEnvironment, robot: str, release: Release, cycles: int, out: Path
) -> None:
    if simulator == OURS:
        command = [sys.executable, "-m", "tools.bench.peers.our_loop", "--robot", robot, "--fri-version", release]
    else:
        command = [str(environment.python), "-m", "tools.bench.peers.franky_loop", "--warm-up", str(WARM_UP_CYCLES)]
    command += ["--cycles", str(cycles), "--out", str(out)]
    ran = subprocess.run(
        command, check=False, capture_output=True, text=True, timeout=_LOOPS_S, env=module_environment()
    )
    if ran.returncode:
        raise EndpointError(f"the cycles of {simulator} failed: {(ran.stderr.strip() or 'silently')[-500:]}")


def _server(
    simulator: str, environment: PeerEnvironment, robot: str, release: Release
) -> AbstractContextManager[Server]:
    return our_server(robot=robot, release=release) if simulator == OURS else franky_server(environment)
