"""Quantities of faults in words: durations, shares, rates and sizes, written as they are read."""

from typing import Final

DURATION_NS: Final = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
RATE_BITS_PER_S: Final = {"Gbit": 1_000_000_000, "Mbit": 1_000_000, "kbit": 1_000, "bit": 1}
SIZE_BYTES: Final = {"MB": 1_000_000, "kB": 1_000, "B": 1}


def percent_text(share: float) -> str:
    """Return ``2%`` for 0.02."""
    return f"{100.0 * share:.10g}%"


def duration_text(duration_ns: int) -> str:
    """Return ``1.5ms`` for 1 500 000."""
    return _quantity_text(duration_ns, DURATION_NS)


def rate_text(bits_per_s: int) -> str:
    """Return ``1Mbit`` for a million bits a second."""
    return _quantity_text(bits_per_s, RATE_BITS_PER_S)


def size_text(size_bytes: int) -> str:
    """Return ``64kB`` for 64 000."""
    return _quantity_text(size_bytes, SIZE_BYTES)


def _quantity_text(value: int, units: dict[str, int]) -> str:
    """Return ``value`` in the largest unit that takes no more than three decimals; the smallest takes none."""
    for name, unit in units.items():
        if value >= unit and value * 1000 % unit == 0:
            return f"{value // unit}{f'.{value % unit * 1000 // unit:03d}'.rstrip('0').rstrip('.')}{name}"
    return f"{value}{name}"
