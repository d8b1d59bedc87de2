"""The bounds of the design page, and whether a figure keeps them."""

from typing import NamedTuple

CYCLE_MEDIAN_US = 60.0
BOTH_LINKS_MEDIAN_US = 45.0
"""Of one cycle with MuJoCo, FRI link and servo link (issue "Faster than its peers")."""
BOTH_LINKS_P99_US = 90.0
MONITORS_US = 15.0
"""Of all monitors together (issue "Safety and admission")."""
VIRTUAL_TIME_FACTOR = 15.0
RATE_HZ = 1000.0
RATE_TOLERANCE_HZ = 0.05
LATENESS_P99_US = 200.0
MISSED_SHARE = 0.001
START_S = 1.0
DESTINATION_MEDIAN_US = 1000.0
PICTURES_PER_S = 30.0
"""Of the page, with two arms on two cores."""


class Bound(NamedTuple):
    """One figure against its bound."""

    name: str
    figure: float
    unit: str
    bound: str
    kept: bool


def at_most(name: str, figure: float, limit: float, unit: str) -> Bound:
    """Return a bound from above."""
    return Bound(name, figure, unit, f"<= {limit:g}", figure <= limit)


def at_least(name: str, figure: float, limit: float, unit: str) -> Bound:
    """Return a bound from below."""
    return Bound(name, figure, unit, f">= {limit:g}", figure >= limit)


def near(name: str, figure: float, target: float, tolerance: float, unit: str) -> Bound:
    """Return a bound from both sides."""
    return Bound(name, figure, unit, f"{target:.2f} +- {tolerance:g}", abs(figure - target) <= tolerance)
