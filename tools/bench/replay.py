"""``hil bench replay``: how fast a recording of ours replays, and in how much memory."""

import resource
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from hil.config.station import RobotConfig
from hil.replay.replay import replay_file
from hil.values.errors import ConfigurationError
from tools.bench.bounds import Bound, at_least
from tools.bench.clients import BenchMotion, recorded_client
from tools.bench.recording import VirtualRun

REPLAY_FACTOR = 25.0
"""Of the issue "Faster than its peers", on either simulated arm."""


class ReplayReport(NamedTuple):
    """Seconds of the recording and of the replays; sizes in MB."""

    robot: str
    backend: str
    motion: str
    recorded_s: float
    file_mb: float
    datagrams: int
    replayed_s: tuple[float, ...]
    grown_mb: float
    """How much the process grew between the first and the last replay."""
    resident_mb: float
    """Most memory the process ever had."""

    @property
    def factor(self) -> float:
        """Times real time, of the fastest replay."""
        return self.recorded_s / min(self.replayed_s)

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound."""
        return [at_least("replay", round(self.factor, 2), REPLAY_FACTOR, "x real time")]


def bench_replay(
    config: RobotConfig, *, motion: BenchMotion, seconds: float, repeats: int, progress: Callable[[float], None]
) -> ReplayReport:
    """Record ``seconds`` in virtual time, then replay them ``repeats`` times; raise where they are not identical."""
    with tempfile.TemporaryDirectory(prefix="hil-bench-") as folder:
        file = Path(folder) / "bench.pcapng"
        run = VirtualRun(config, recorded_client(config, motion), file)
        run.run(seconds, progress=progress)
        run.check()
        run.close()
        took: list[float] = []
        grown_kb = 0
        for _ in range(repeats):
            before_kb = _resident_kb()
            result = replay_file(file)
            if not result.equal or not result.complete:
                raise ConfigurationError(f"the replay is not identical: {result.verdict}")
            took.append(result.took_s)
            if len(took) > 1:
                grown_kb += _resident_kb() - before_kb
            progress(seconds * (1 + len(took) / repeats))
        return ReplayReport(
            robot=config.model,
            backend=config.backend,
            motion=motion.value,
            recorded_s=result.recorded_s,
            file_mb=file.stat().st_size / 1e6,
            datagrams=result.compared + result.inputs,
            replayed_s=tuple(took),
            grown_mb=grown_kb / 1e3,
            resident_mb=_resident_kb() / 1e3,
        )


def as_dict(report: ReplayReport) -> dict[str, Any]:
    """Return the report for JSON."""
    return {
        "robot": report.robot,
        "backend": report.backend,
        "motion": report.motion,
        "recorded_s": report.recorded_s,
        "file_mb": round(report.file_mb, 2),
        "datagrams": report.datagrams,
        "replayed_s": [round(seconds, 3) for seconds in report.replayed_s],
        "real_time_factor": round(report.factor, 2),
        "us_a_cycle": round(min(report.replayed_s) / report.recorded_s * 1e3, 2),
        "grown_mb": round(report.grown_mb, 2),
        "resident_mb": round(report.resident_mb, 1),
        "bounds": [bound._asdict() for bound in report.bounds()],
    }


def _resident_kb() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
