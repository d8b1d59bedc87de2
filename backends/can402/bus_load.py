"""How full a cycle makes the bus, frame by frame, with the worst stuffing.

A data frame of CAN 2.0A with n bytes has 47 + 8 n bits with the pause behind it, and at worst one more after each
fourth of the 34 + 8 n that are stuffed: Davis, Burns, Bril, Lukkien 2007, "Controller Area Network (CAN) schedulability
analysis: refuted, revisited and revised", Real-Time Systems 35, equation 1.
"""

from typing import Final, NamedTuple

from backends.can402.objects import ANSWERS, COMMANDS
from hil.values.errors import ConfigurationError
from hil.values.robot import JOINT_COUNT

MOST_LOAD: Final = 0.9
"""Share of a cycle that the cyclic frames may take; the rest is for heartbeats and emergencies. Ours."""
_CYCLES_MS: Final = (1, 2, 4, 5)
_BITRATES: Final = (125_000, 250_000, 500_000, 800_000, 1_000_000)


class BusLoad(NamedTuple):
    """One cycle on the bus."""

    frames: int
    bits: int
    share: float
    """Of the cycle."""


def frame_bits(data_bytes: int) -> int:
    """Return the longest a data frame with an 11-bit identifier can be, in bits."""
    return 47 + 8 * data_bytes + (34 + 8 * data_bytes - 1) // 4


def bus_load(*, bitrate: int, period_ns: int) -> BusLoad:
    """Return what SYNC, seven commands and fourteen answers take of a cycle."""
    lengths = [sum(part.bits for part in mapping) // 8 for mapping in (*COMMANDS.values(), *ANSWERS.values())]
    bits = frame_bits(0) + JOINT_COUNT * sum(map(frame_bits, lengths))
    return BusLoad(1 + JOINT_COUNT * len(lengths), bits, bits / (bitrate * period_ns * 1e-9))


def check_bus_load(*, bitrate: int, period_ns: int) -> BusLoad:
    """Return the load; raise :class:`ConfigurationError` with the figure, and what would fit, where it is too much."""
    load = bus_load(bitrate=bitrate, period_ns=period_ns)
    if load.share <= MOST_LOAD:
        return load
    fits = [
        f"{cycle} ms" for cycle in _CYCLES_MS if bus_load(bitrate=bitrate, period_ns=cycle * 10**6).share <= MOST_LOAD
    ][:1]
    fits += [
        f"{rate // 1000} kbit/s"
        for rate in _BITRATES
        if rate > bitrate and bus_load(bitrate=rate, period_ns=period_ns).share <= MOST_LOAD
    ][:1]
    raise ConfigurationError(
        f"{JOINT_COUNT} drives need {load.frames} frames of {load.bits} bits in a cycle of {period_ns / 1e6:g} ms: "
        f"{100 * load.share:.0f} % of the bus at {bitrate / 1000:g} kbit/s, {100 * MOST_LOAD:g} % are allowed; "
        f"what would fit: {' or '.join(fits) or 'no cycle of 1 to 5 ms at this bit rate'}"
    )
