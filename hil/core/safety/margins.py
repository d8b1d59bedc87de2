"""How near each monitor came to its trip: the largest share of its limit that was used, when, and on which axis."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from hil.core.motion.set_point import STILL
from hil.values.robot import JOINT_NAMES, Seven


class MonitorName(StrEnum):
    """The monitors, as reports name them."""

    FINITE = "finite"
    AXIS_RANGE = "axis range"
    AXIS_VELOCITY = "axis velocity"
    STEP_SIZE = "step size"
    COMMANDED_T1 = "T1, commanded"
    STATE = "measured state"
    FRESH = "fresh state"
    TRACKING = "tracking"
    AXIS_TORQUE = "axis torque"
    MEASURED_T1 = "T1, measured"


@dataclass(slots=True)
class Margin:
    """Largest use of one limit so far. ``position_rad`` and ``velocity_rad_s`` are those of T1's largest speed."""

    used: float = 0.0
    no_news: float = 0.0
    """What is not above it is no new maximum and no trip."""
    at_ns: int = 0
    axis: int = -1
    position_rad: Seven = STILL
    velocity_rad_s: Seven = STILL

    def note(self, shares: Sequence[float], now_ns: int) -> float:
        """Return the largest share of a limit that an axis uses; keep it if none was larger before."""
        used = max(map(abs, shares))
        if used > self.used:
            self.used, self.at_ns, self.axis = used, now_ns, worst(shares)
            self.no_news = min(used, 1.0)
        return used


def worst(values: Sequence[float]) -> int:
    """Return the axis (0 for A1) with the largest amount."""
    return max(range(len(values)), key=lambda axis: abs(values[axis]))


def report(
    margins: Mapping[MonitorName, Margin], *, main_axis: Callable[[Seven, Seven], int]
) -> dict[str, dict[str, object]]:
    """Return what was used of each limit, for the status file; ``main_axis`` tells who moves the flange most."""
    told: dict[str, dict[str, object]] = {}
    for name, margin in margins.items():
        axis = margin.axis
        if axis < 0 and margin.velocity_rad_s != STILL:
            axis = main_axis(margin.position_rad, margin.velocity_rad_s)
        told[name.value] = {
            "used": round(margin.used, 4),
            "at_s": round(margin.at_ns / 1e9, 6),
            "axis": JOINT_NAMES[axis] if axis >= 0 else None,
        }
    return told


def closest(told: Mapping[str, Mapping[str, object]]) -> str:
    """Return the smallest margin of a run in words; empty when nothing was used of any limit."""
    if not told:
        return ""
    name, margin = max(told.items(), key=lambda entry: _used(entry[1]))
    if _used(margin) == 0.0:
        return ""
    axis = "" if margin["axis"] is None else f", axis {margin['axis']}"
    return f"closest to {name}: {_used(margin):.0%} at {margin['at_s']:.1f} s{axis}"


def _used(margin: Mapping[str, object]) -> float:
    used = margin["used"]
    return used if isinstance(used, float) else 0.0
