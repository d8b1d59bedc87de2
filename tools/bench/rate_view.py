"""``hil bench rate --view``: what ``hil bench rate`` runs, in turn without the view, with it, and with a browser too.

The browser draws with the processor, which a user's does not. So there are runs with the page open and nothing drawn:
what the page itself costs on the controller's machine.

All runs serve applications and have a pad, so they differ in the view alone. The spread between the runs without it is
the noise by which the others are judged.
"""

import json
import subprocess
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, Final, NamedTuple

from hil.clock import elapsed_ns
from hil.values.fri import Release
from tools.bench.page import controller_with_words, open_page, wait_for_page
from tools.bench.processes import start_process, wait_for_end
from tools.view.chromium import CHROMIUM
from transport.udp import free_port

_HOST: Final = "127.0.0.1"
_SETTLE_S: Final = 15.0
"""Of each run, not measured: the page is served and opened meanwhile, and viser chooses its pixel ratio."""
_MESHES: Final = 8
_PATIENCE_S: Final = 30.0


class Watching(StrEnum):
    """Who looks on while the controller is measured."""

    NOBODY = "without"
    VIEW = "view"
    UNDRAWN = "view and browser, nothing drawn"
    BROWSER = "view and browser"


class Figure(NamedTuple):
    """What is compared; all of them are better when they are smaller, but the rate, which is to be 1000 Hz."""

    name: str
    unit: str
    of: Callable[[dict[str, Any]], float]
    resolution: float = 0.0
    """What differs by less is not worse."""


def _lateness(quantile: str) -> Callable[[dict[str, Any]], float]:
    return lambda robot: float(robot["lateness_us"][quantile] or 0.0)


FIGURES: Final = (
    Figure("lateness p50", "us", _lateness("p50")),
    Figure("lateness p99", "us", _lateness("p99")),
    Figure("lateness p99.9", "us", _lateness("p99_9")),
    Figure("missed cycles", "%", lambda robot: 100.0 * robot["missed_cycles"] / max(1, robot["measured_s"] * 1000.0)),
    # From the first cycle to the last one, either of which may be late by some tenths of a millisecond.
    Figure("rate", "Hz", lambda robot: float(robot["rate_hz"]), 0.02),
)


class Compared(NamedTuple):
    """A figure of the runs with somebody looking on, beside that of the runs without."""

    figure: Figure
    watching: Watching
    median: float
    spread: float
    without: float
    noise: float
    """Largest less smallest of the runs without."""

    @property
    def worse_by(self) -> float:
        """How much worse it is than without; negative where it is better."""
        if self.figure.unit == "Hz":
            return abs(self.median - 1000.0) - abs(self.without - 1000.0)
        return self.median - self.without

    @property
    def within(self) -> bool:
        """Whether it is worse by no more than the runs without differ among themselves."""
        return self.worse_by <= max(self.noise, self.figure.resolution)


@dataclass(frozen=True, slots=True)
class RateViewReport:
    """The status file's figures of the robot, of each run, in the order of the runs."""

    seconds: float
    runs: dict[Watching, list[dict[str, Any]]] = field(default_factory=dict)
    late: list[float] = field(default_factory=list)
    """Seconds after which the page was drawn, where that was in the time that is measured."""

    def spread(self, figure: Figure, watching: Watching) -> tuple[float, float, float]:
        """Return the smallest, the median and the largest of the runs of one kind."""
        values = [figure.of(robot) for robot in self.runs[watching]]
        return min(values), median(values), max(values)

    def compared(self) -> list[Compared]:
        """Return each figure of each kind of run beside that of the runs without."""
        found = []
        for figure in FIGURES:
            least, without, most = self.spread(figure, Watching.NOBODY)
            for watching in self.runs:
                if watching is not Watching.NOBODY:
                    low, middle, high = self.spread(figure, watching)
                    found.append(Compared(figure, watching, middle, high - low, without, most - least))
        return found

    def sentences(self) -> list[str]:
        """Say for each kind of run what the comparison says, and what it does not."""
        told = []
        alone = len(self.runs[Watching.NOBODY]) == 1
        if alone:
            told.append("one run of a kind has no spread, so there is no noise to judge by: --repeats 3 or more")
        for watching in self.runs:
            if alone or watching is Watching.NOBODY:
                continue
            beyond = [one for one in self.compared() if one.watching is watching and not one.within]
            if not beyond:
                told.append(f"{watching.value}: no figure is worse than without by more than the runs without differ")
                continue
            worse = ", ".join(
                f"{one.figure.name} by {one.worse_by:.3g} {one.figure.unit} (noise {one.noise:.3g})" for one in beyond
            )
            told.append(f"{watching.value}: NOT within the noise of the runs without: worse are {worse}")
        if self.late:
            took = ", ".join(f"{took_s:.0f} s" for took_s in self.late)
            told.append(f"{len(self.late)} runs with the browser have its start in them: it took {took}")
        return told

    def as_dict(self) -> dict[str, Any]:
        """Return the report for JSON."""
        return {
            "seconds": self.seconds,
            "browser": Watching.BROWSER in self.runs,
            "runs": {
                watching.value: [{figure.name: round(figure.of(robot), 4) for figure in FIGURES} for robot in robots]
                for watching, robots in self.runs.items()
            },
            "compared": [
                {
                    "figure": one.figure.name,
                    "unit": one.figure.unit,
                    "with": one.watching.value,
                    "median": round(one.median, 4),
                    "spread": round(one.spread, 4),
                    "median_without": round(one.without, 4),
                    "noise": round(one.noise, 4),
                    "within_noise": one.within,
                }
                for one in self.compared()
            ],
            "sentences": self.sentences(),
        }


def bench_rate_view(
    *,
    robot: str,
    backend: str,
    release: Release,
    seconds: float,
    repeats: int,
    realtime: bool,
    progress: Callable[[float], None],
) -> RateViewReport:
    """Run each kind ``repeats`` times in turn, ``seconds`` each; ``progress`` is told the seconds done."""
    kinds = _kinds()
    report = RateViewReport(seconds, {kind: [] for kind in kinds})
    run = _Run(robot, backend, release, seconds, realtime=realtime)
    done = 0
    for repeat in range(repeats):
        # The other way round each second time, so that what changes slowly favours none of them.
        for kind in kinds if repeat % 2 == 0 else kinds[::-1]:
            before_s = done * seconds
            before_s = done * (seconds + _SETTLE_S)
            report.runs[kind].append(run.watched_by(kind, report.late, partial(_add, before_s, progress)))
            done += 1
    return report


def _kinds() -> list[Watching]:
    return list(Watching) if CHROMIUM is not None else [Watching.NOBODY, Watching.VIEW]


def length_s(seconds: float, repeats: int) -> float:
    """Return how long all of it takes on this machine."""
    return len(_kinds()) * repeats * (seconds + _SETTLE_S)


class _Run(NamedTuple):
    robot: str
    backend: str
    release: Release
    seconds: float
    realtime: bool

    def watched_by(self, watching: Watching, late: list[float], progress: Callable[[float], None]) -> dict[str, Any]:
        """Run it once; return the status file's figures of the robot."""
        with tempfile.TemporaryDirectory(prefix="fri-hil-bench-") as folder, ExitStack() as opened:
            status, said, port = Path(folder, "status.json"), Path(folder, "said"), free_port(_HOST)
            arguments: list[object] = [
                *("--robot", self.robot, "--backend", self.backend, "--fri-version", self.release),
                *("--fri-client", f"{_HOST}:{port}", "--servo", f"{_HOST}:0", "--pad", Path(folder, "pad.sock")),
                *(
                    "--settle",
                    _SETTLE_S,
                    "--duration",
                    _SETTLE_S + self.seconds,
                    "--status-json",
                    status,
                    "--progress",
                    0,
                ),
                *(["--realtime"] if self.realtime else []),
            ]
            if watching is not Watching.NOBODY:
                arguments += ["--view-at", f"{_HOST}:{free_port(_HOST)}"]
            client = start_process(
                "apps.fri_joint_sine",
                *(
                    "--fri-version",
                    self.release,
                    "--bind",
                    _HOST,
                    "--port",
                    port,
                    "--seconds",
                    _SETTLE_S + self.seconds + 30,
                ),
            )
            opened.callback(_end, client)
            began_ns = elapsed_ns()
            controller = opened.enter_context(controller_with_words(said, *arguments))
            if watching in {Watching.UNDRAWN, Watching.BROWSER}:
                page = opened.enter_context(open_page(wait_for_page(controller, said), reaches=_HOST))
                page.wait_until_drawn(_MESHES)
                if watching is Watching.UNDRAWN:
                    page.draw_nothing()
                took_s = (elapsed_ns() - began_ns) * 1e-9
                if took_s > _SETTLE_S:
                    late.append(took_s)
            wait_for_end(controller, _SETTLE_S + self.seconds + _PATIENCE_S, progress)
            robots: dict[str, dict[str, Any]] = json.loads(status.read_text(encoding="utf-8"))["robots"]
            return {**robots["arm"], "measured_s": self.seconds}


def _add(before_s: float, progress: Callable[[float], None], run_s: float) -> None:
    progress(before_s + run_s)


def _end(process: "subprocess.Popen[bytes]") -> None:
    process.terminate()
    process.communicate()
