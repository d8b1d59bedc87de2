"""``hil bench can402``: what a cycle of seven drives costs on python-can's virtual bus, simulated drives included."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from backends.robots import load_description
from hil.clock import elapsed_ns
from hil.core.statistics import Histogram
from hil.values.arm import JointCommand, seven
from tools.bench.bounds import Bound, at_most
from tools.conformance.simulated_drives import SimulatedDrivesRig

CYCLE_MS = 4
_SPEED_RAD_S = 0.05


@dataclass(frozen=True, slots=True)
class Can402Report:
    """Costs in microseconds; load of the bus at 1 Mbit/s as it would be on a wire."""

    cycle_us: dict[str, Any]
    over: int
    cycles: int
    bus_load_percent: float

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound: a cycle is held if all of it fits."""
        return [
            at_most("one cycle, median", self.cycle_us["p50"] / 1e3, CYCLE_MS, "ms"),
            at_most("one cycle, p99", self.cycle_us["p99"] / 1e3, CYCLE_MS, "ms"),
        ]


def bench_can402(*, robot: str, cycles: int, progress: Callable[[int], None]) -> Can402Report:
    """Move seven simulated drives for so many cycles of 4 ms, as fast as the machine can."""
    rig = SimulatedDrivesRig(load_description(robot))
    costs = Histogram()
    over = 0
    try:
        rig.open(period_ns=CYCLE_MS * 1_000_000)
        start = rig.get_ready().position_rad
        for count in range(cycles):
            swing = _SPEED_RAD_S * CYCLE_MS * 1e-3 * (count % 1000 if count % 2000 < 1000 else 1000 - count % 1000)
            command = JointCommand(seven([value + swing for value in start]), (_SPEED_RAD_S,) * 7)
            before_ns = elapsed_ns()
            rig.cycle(command)
            cost_ns = elapsed_ns() - before_ns
            costs.add(cost_ns)
            over += cost_ns > CYCLE_MS * 1_000_000
            if count % 250 == 0:
                progress(count)
        load = 0.0 if rig.load is None else 100.0 * rig.load.share
    finally:
        rig.close()
    return Can402Report(costs.summary_us(), over, cycles, round(load, 1))
