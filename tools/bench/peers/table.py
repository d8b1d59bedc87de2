"""The comparison as rows of text: medians of the repeats, with their spread where there are several."""

from collections.abc import Callable, Sequence
from statistics import median
from typing import Final, NamedTuple

from tools.bench.peers.compare import BARE, COMMANDS, LISTENS, LOOP, OURS, SIMULATORS, PeersReport, Simulator
from tools.bench.peers.environment import FRANKA, FRANKY
from tools.bench.peers.figures import Cycles, Stream
from tools.bench.peers.sine import FREQUENCY_HZ, MOVED_RAD

DIFFERENCES: Final = (
    (
        "Same host, same MuJoCo step of 1 ms, same number of cycles, same sine over axis 4, each with its defaults. "
        "What differs:"
    ),
    (
        f"- the arm: {OURS} an LBR iiwa with 7 axes that touches nothing; {FRANKY} an FR3 with 7 axes, a hand with 2 "
        f"more and its controller, a ground it may touch, and a second server for the hand; {FRANKA} the same model, "
        "because it would fetch its own from the network, with an older MuJoCo, which it asks for"
    ),
    (
        f"- a cycle: {OURS} admits, limits and monitors each command and keeps an FRI session; {FRANKY} checks no "
        "limits and raises no control errors, but works out more of the state it sends, velocities and accelerations "
        f"of what is desired among them; {FRANKA} spreads a cycle over three threads and checks limits in them. * Its "
        "row is a part of a cycle: control law, step and state packet, without reading and checking the command"
    ),
    (
        f"- pacing: {OURS} has absolute due times and catches up; {FRANKY} sleeps what is left of 1 ms, so that its "
        f"clock falls behind by what each sleep takes too long; {FRANKA} has absolute due times for arm and stream "
        "apart, skips what it misses, and waits for the answer of a client that commands before it sends the next state"
    ),
    (
        f"- virtual time: {OURS} has a virtual clock for all it does; {FRANKY} has none, but its loop can be told not "
        "to pace (run_once(realtime=False), from Python, not from its command line). That loop sleeps 0 s a cycle, "
        f"which is in its row with sockets; without sockets it is neither paced nor put to sleep. {FRANKA} serves in "
        "real time only: its row steps the simulation without its server"
    ),
)


_BARE: Final = "from a command's bytes to a state's bytes, no sockets"


class Row(NamedTuple):
    """A figure of each simulator, ours first; a row without cells is a heading."""

    label: str
    cells: tuple[str, ...] = ()


class _Figure(NamedTuple):
    label: str
    digits: int
    of: Callable[[Simulator], list[float]]


def rows(report: PeersReport) -> list[Row]:
    """Return the table of a report."""
    found = []
    for heading, figures in _SECTIONS:
        found.append(Row(heading))
        for figure in figures:
            cells = [spread(figure.of(report.simulators[name]), figure.digits) for name in SIMULATORS]
            if heading == _BARE:
                cells[SIMULATORS.index(FRANKA)] += " *"
            found.append(Row(figure.label, tuple(cells)))
    return found


def complaints(report: PeersReport) -> list[str]:
    """Return a sentence for each simulator whose arm did not follow a client that commanded it."""
    if report.seconds * FREQUENCY_HZ < 1.0:
        return ["The streams are shorter than a period of the sine: whether arms followed was not looked at."]
    found = []
    for name, simulator in report.simulators.items():
        runs = simulator.streams[COMMANDS]
        followed = sum(run.moved_rad > MOVED_RAD for run in runs)
        if followed < len(runs):
            found.append(
                f"{name} followed its client in {followed} of {len(runs)} runs: in the others its rows say what it "
                "costs to send states, and no more. A machine that others load does that."
            )
    return found


def spread(values: Sequence[float], digits: int) -> str:
    """Return the median of repeats and, where there are several, the smallest and the largest; - without any."""
    if not values:
        return "-"
    if len(values) == 1:
        return f"{values[0]:.{digits}f}"
    return f"{median(values):.{digits}f} ({min(values):.{digits}f} .. {max(values):.{digits}f})"


def _cycle(label: str, digits: int, kind: str, of: Callable[[Cycles], float]) -> _Figure:
    return _Figure(label, digits, lambda simulator: [of(run) for run in simulator.cycles[kind]])


def _cycles(kind: str) -> tuple[_Figure, ...]:
    return (
        _cycle("one cycle, p50 us", 1, kind, lambda run: run.cost_us.p50),
        _cycle("one cycle, p99 us", 1, kind, lambda run: run.cost_us.p99),
        _cycle("one cycle, max us", 0, kind, lambda run: run.cost_us.max),
        _cycle("virtual time, x real time", 1, kind, lambda run: run.virtual_time_factor),
    )


def _streamed(label: str, digits: int, kind: str, of: Callable[[Stream], float]) -> _Figure:
    return _Figure(label, digits, lambda simulator: [of(run) for run in simulator.streams[kind]])


def _streams(kind: str) -> tuple[_Figure, ...]:
    return (
        _streamed("rate, Hz", 2, kind, lambda run: run.rate_hz),
        _streamed("interval, p50 us", 0, kind, lambda run: run.interval_us.p50),
        _streamed("interval, p99 us", 0, kind, lambda run: run.interval_us.p99),
        _streamed("interval, max us", 0, kind, lambda run: run.interval_us.max),
        _streamed("off 1 ms, p50 us", 0, kind, lambda run: run.jitter_us.p50),
        _streamed("off 1 ms, p99 us", 0, kind, lambda run: run.jitter_us.p99),
        _streamed("off 1 ms, p99.9 us", 0, kind, lambda run: run.jitter_us.p99_9),
        _streamed("more than 2 ms, % of intervals", 3, kind, lambda run: run.late_percent),
        _streamed("lost", 0, kind, lambda run: run.lost),
        _streamed("server, of one core", 2, kind, lambda run: run.server_cores),
        _streamed("a state, bytes", 0, kind, lambda run: run.state_bytes),
        _streamed("axis 4 went, mrad", 1, kind, lambda run: 1000.0 * run.moved_rad),
    )


_SECTIONS: Final = (
    (_BARE, _cycles(BARE)),
    ("the same with sockets and a client over loopback", _cycles(LOOP)),
    ("state stream at 1 kHz, the client listens", _streams(LISTENS)),
    ("state stream at 1 kHz, the client commands a sine", _streams(COMMANDS)),
)
