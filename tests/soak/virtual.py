"""Hours of virtual time: shifts of :mod:`tests.soak.shift` on all cores; some are recorded, and replay to the byte."""

import os
import resource
import tempfile
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Final

from hil.arithmetic import fix_arithmetic
from hil.clock import elapsed_ns
from hil.replay.replay import replay_file
from tests.soak.shift import Shift, ShiftReport

SHIFT_S: Final = 300.0
RECORDED_EVERY: Final = 6
"""One shift of so many is recorded, and its recording replayed."""


@dataclass
class Played:
    """A shift, and what it cost."""

    report: ShiftReport
    wall_s: float
    resident_mb: float
    worker: int
    replayed: bool = False


@dataclass
class VirtualReport:
    """All shifts together."""

    shifts: int = 0
    virtual_s: float = 0.0
    wall_s: float = 0.0
    commands: int = 0
    moved: int = 0
    reconnects: int = 0
    stops: int = 0
    replayed: int = 0
    done: Counter[str] = field(default_factory=Counter)
    refusals: Counter[str] = field(default_factory=Counter)
    resident_mb: dict[int, list[float]] = field(default_factory=dict)
    """Of each worker, after each of its shifts."""
    findings: list[str] = field(default_factory=list)

    def add(self, played: Played) -> None:
        """Take a shift."""
        report = played.report
        self.shifts += 1
        self.virtual_s += report.virtual_s
        self.commands += report.commands
        self.moved += report.moved
        self.reconnects += report.reconnects
        self.stops += report.stops
        self.replayed += played.replayed
        self.done += report.done
        self.refusals += report.refusals
        self.resident_mb.setdefault(played.worker, []).append(round(played.resident_mb, 1))


def play(seed: int, reconnects: int, seconds: float = SHIFT_S) -> Played:
    """Play one shift, and replay its recording where it has one; raise AssertionError for a finding."""
    fix_arithmetic()
    began_ns = elapsed_ns()
    record = seed % RECORDED_EVERY == 0
    with tempfile.TemporaryDirectory(prefix="hil-soak-") as folder:
        capture = Path(folder) / "shift.pcapng" if record else None
        report = Shift(seed, seconds=seconds, reconnects=reconnects, capture=capture).run()
        if capture is not None:
            result = replay_file(capture)
            assert result.equal, f"the recording of shift {seed} does not replay: {result.verdict}"
            assert result.complete
    resident_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return Played(report, (elapsed_ns() - began_ns) * 1e-9, resident_mb, os.getpid(), record)


def soak(
    *, hours: float, reconnects: int, first_seed: int, workers: int, progress: Callable[[float, int], None]
) -> VirtualReport:
    """Play ``hours`` of virtual time; ``progress`` is told hours and findings so far."""
    shifts = max(1, round(hours * 3600.0 / SHIFT_S))
    each = -(-reconnects // shifts)
    found = VirtualReport()
    began_ns = elapsed_ns()
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        playing = {pool.submit(play, seed, each): seed for seed in range(first_seed, first_seed + shifts)}
        for future in as_completed(playing):
            error = future.exception()
            if error is None:
                found.add(future.result())
            else:
                found.findings.append(f"shift {playing[future]}: {type(error).__name__}: {error}")
            progress(found.virtual_s / 3600.0, len(found.findings))
    found.wall_s = (elapsed_ns() - began_ns) * 1e-9
    return found
