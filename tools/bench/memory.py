"""``hil bench memory``: what a controller keeps resident, and whether that grows, in virtual time.

An FRI client commands all the time, as in ``hil bench cycle``. Growth is what lies between the second quarter and the
last one (medians: the allocator gives and takes a page), an hour of virtual time; before that, what is bounded fills
up: histories, rings, caches of libraries.
"""

import gc
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Final

from hil.config.station import RobotConfig
from hil.runtime.assembly import open_parts
from hil.values.errors import ConfigurationError
from tools.bench.bounds import Bound, at_most
from tools.bench.clients import BenchMotion, recorded_client
from tools.bench.cycle import WARM_UP_CYCLES, CycleLoop

GROWTH_MB_AN_HOUR: Final = 1.0
"""The bound is none; a page here and there is the allocator's."""
SAMPLES: Final = 20
_STATUS: Final = Path("/proc/self/status")


@dataclass(frozen=True, slots=True)
class MemoryReport:
    """Resident memory in MB and Python's blocks, evenly spread over the run."""

    virtual_s: float
    resident_mb: tuple[float, ...]
    blocks: tuple[int, ...]

    @property
    def growth_mb_an_hour(self) -> float:
        """Return what was added an hour of virtual time."""
        return round(_growth(self.resident_mb) * 3600.0 / self.virtual_s, 3)

    @property
    def blocks_a_minute(self) -> float:
        """Return how many of Python's memory blocks were added a minute of virtual time."""
        return round(_growth(self.blocks) * 60.0 / self.virtual_s, 1)

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound."""
        return [at_most("growth an hour of virtual time", self.growth_mb_an_hour, GROWTH_MB_AN_HOUR, "MB")]


def bench_memory(config: RobotConfig, *, minutes: float, progress: Callable[[float], None]) -> MemoryReport:
    """Run a controller and a client for so many minutes of virtual time; raise :class:`ConfigurationError`."""
    if not _STATUS.exists():
        raise ConfigurationError("resident memory is read from /proc, which this system has not")
    client = recorded_client(config, BenchMotion.FRI_OVERLAY)
    cycles = round(minutes * 60_000 / config.cycle_ms)
    resident, blocks = [], []
    parts = open_parts(config)
    try:
        loop = CycleLoop(config, parts)
        said = client.answer(loop.outgoing)
        for done in range(WARM_UP_CYCLES + cycles + 1):
            if done >= WARM_UP_CYCLES and (done - WARM_UP_CYCLES) % max(1, cycles // SAMPLES) == 0:
                gc.collect()
                resident.append(_resident_mb())
                blocks.append(sys.getallocatedblocks())
                progress((done - WARM_UP_CYCLES) * config.cycle_ms / 60_000)
            loop.cycle(said)
            said = client.answer(loop.outgoing)
        client.check(loop.controller)
    finally:
        parts.backend.close()
    return MemoryReport(minutes * 60.0, tuple(resident[: SAMPLES + 1]), tuple(blocks[: SAMPLES + 1]))


def _growth(samples: Sequence[float]) -> float:
    """Return what would be added in the whole time, at the pace between the second quarter and the last one."""
    quarter = len(samples) // 4
    added = median(samples[-quarter:]) - median(samples[quarter : 2 * quarter])
    return added * (len(samples) - 1) / (len(samples) - 2 * quarter)


def _resident_mb() -> float:
    for line in _STATUS.read_text(encoding="ascii").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024.0
    raise ConfigurationError(f"{_STATUS} has no VmRSS")
