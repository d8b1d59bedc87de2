"""``hil bench campaign``: scenarios a second that a campaign plays, with one worker and with more."""

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hil.clock import elapsed_ns
from hil.values.errors import EndpointError
from tools.bench.bounds import Bound, at_least
from tools.campaign.local import play_locally
from tools.campaign.plan import load_plan
from tools.campaign.scenario import Scenario

SPEED_UP_OF_TWO = 1.7
"""Of two workers on two cores against one; what is below is lost to what they share."""
_PLAN = """
seconds = 20
seeds = {seeds}
robot = {{ backend = "{backend}" }}
[[application]]
name = "FRI"
run = "apps.fri_joint_sine"
arguments = ["--seconds", "4"]
[[application]]
name = "SmartServo"
run = "apps.smart_servo_joint_motion"
arguments = ["--seconds", "3"]
[[impairment]]
name = "perfect"
[[impairment]]
name = "jitter"
faults = ["jitter=0.2ms"]
"""


@dataclass(frozen=True, slots=True)
class Throughput:
    """Of one number of workers. The workers' start is in ``seconds``, as it is for a user."""

    workers: int
    scenarios: int
    seconds: float
    virtual_s: float

    @property
    def per_minute(self) -> float:
        """Scenarios a minute."""
        return 60.0 * self.scenarios / self.seconds

    @property
    def factor(self) -> float:
        """Virtual time over real time, of all workers together."""
        return self.virtual_s / self.seconds


@dataclass(frozen=True, slots=True)
class CampaignReport:
    """One worker, and more."""

    backend: str
    runs: tuple[Throughput, ...]

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound, where there are two cores for two workers."""
        one = next((run for run in self.runs if run.workers == 1), None)
        two = next((run for run in self.runs if run.workers == 2), None)
        if one is None or two is None or (os.cpu_count() or 1) < 2:
            return []
        return [at_least("two workers against one", round(two.per_minute / one.per_minute, 2), SPEED_UP_OF_TWO, "x")]

    def as_dict(self) -> dict[str, Any]:
        """Return the report for JSON."""
        runs = [{**asdict(run), "per_minute": run.per_minute, "factor": run.factor} for run in self.runs]
        return {"backend": self.backend, "runs": runs, "bounds": [bound._asdict() for bound in self.bounds()]}


def bench_campaign(
    *, backend: str, seeds: int, workers: Sequence[int], progress: Callable[[int], None]
) -> CampaignReport:
    """Play four times ``seeds`` scenarios with each number of ``workers``."""
    with tempfile.TemporaryDirectory(prefix="fri-hil-bench-") as folder:
        file = Path(folder, "bench.toml")
        file.write_text(_PLAN.format(seeds=seeds, backend=backend), encoding="utf-8")
        scenarios = load_plan(file).scenarios
    return CampaignReport(backend, tuple(_played(scenarios, count, progress) for count in workers))


def _played(scenarios: Sequence[Scenario], workers: int, progress: Callable[[int], None]) -> Throughput:
    began_ns = elapsed_ns()
    virtual_s = 0.0
    for row in play_locally(scenarios, workers=workers, patience_s=120.0, retries=0):
        if row["outcome"] != "passed":
            raise EndpointError(f"a scenario of the benchmark did not pass: {row['scenario']}: {row['reason']}")
        virtual_s += row["virtual_s"]
        progress(1)
    return Throughput(workers, len(scenarios), (elapsed_ns() - began_ns) * 1e-9, virtual_s)
