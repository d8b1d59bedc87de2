"""What times make of themselves: the cost of cycles, and the rate and jitter of a stream from its arrivals."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np

from hil.values.errors import EndpointError
from hil.values.fri import SEQUENCE_MODULUS

NOMINAL_US: Final = 1000.0
LATE_US: Final = 2.0 * NOMINAL_US
"""A state that comes so long after the one before has cost its client a cycle."""
_CYCLE_NS: Final = 1_000_000
_LEAST_STATES: Final = 3


@dataclass(frozen=True, slots=True)
class Quantiles:
    """Median and tail in microseconds."""

    p50: float
    p99: float
    p99_9: float
    max: float

    @staticmethod
    def of(values_us: Sequence[float]) -> "Quantiles":
        """Return those of a series, which has at least one value."""
        found = np.quantile(np.asarray(values_us, dtype=np.float64), (0.5, 0.99, 0.999, 1.0))
        return Quantiles(*(round(float(value), 2) for value in found))


@dataclass(frozen=True, slots=True)
class Cycles:
    """What cycles of 1 ms cost."""

    cost_us: Quantiles
    virtual_time_factor: float
    """Simulated seconds in a second, when cycles follow one another without a pause."""


@dataclass(frozen=True, slots=True)
class Stream:
    """A state stream as its client saw it."""

    states: int
    lost: int
    """Numbers that are missing between the first state and the last one."""
    rate_hz: float
    interval_us: Quantiles
    """From one state to the next."""
    jitter_us: Quantiles
    """How far intervals are from 1 ms, on either side."""
    late_percent: float
    """Share of intervals of more than 2 ms."""
    state_bytes: int
    server_cores: float
    """Processor time of the server, as a share of one core."""
    moved_rad: float
    """How far axis 4 went."""


def cycles_of(samples_ns: Sequence[int]) -> Cycles:
    """Return the figures of a loop's samples, each of which simulated 1 ms."""
    costs = np.asarray(samples_ns, dtype=np.float64)
    factor = _CYCLE_NS * len(costs) / float(costs.sum())
    return Cycles(Quantiles.of((costs / 1000.0).tolist()), round(factor, 2))


def stream_of(found: dict[str, Any]) -> Stream:
    """Return the figures of what the stream's client wrote; raise :class:`EndpointError` if that is no stream."""
    arrived_ns, counters = found["arrived_ns"], found["counters"]
    if len(arrived_ns) < _LEAST_STATES:
        raise EndpointError(f"{len(arrived_ns)} states are no stream; at least {_LEAST_STATES} are needed")
    intervals_us = np.asarray([after - before for before, after in pairwise(arrived_ns)], dtype=np.float64) / 1000.0
    passed_s = (arrived_ns[-1] - arrived_ns[0]) * 1e-9
    # FRI counts modulo 2**32; a libfranka counter is wider, and does not get there in years.
    numbered = (counters[-1] - counters[0]) % SEQUENCE_MODULUS + 1
    return Stream(
        states=len(arrived_ns),
        lost=numbered - len(arrived_ns),
        rate_hz=round((len(arrived_ns) - 1) / passed_s, 3),
        interval_us=Quantiles.of(intervals_us.tolist()),
        jitter_us=Quantiles.of(np.abs(intervals_us - NOMINAL_US).tolist()),
        late_percent=round(100.0 * float(np.mean(intervals_us > LATE_US)), 4),
        state_bytes=found["state_bytes"],
        server_cores=round(found["server_cores"], 3),
        moved_rad=round(found["moved_rad"], 4),
    )
