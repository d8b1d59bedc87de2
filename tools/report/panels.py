"""The parts of the page that are drawn: what its script is told."""

from base64 import b64encode
from typing import Any, Final

import numpy as np

from hil.values.robot import JOINT_NAMES
from tools.report.envelope import Floats
from tools.report.record import COMMANDED, DIFFERENCE, FLANGE_SPEED, MEASURED, RobotRecord

_MILLI: Final = 1e3
_MICRO: Final = 1e-6
_MOST_STEPS: Final = 4e9


def drawn(robot: RobotRecord) -> dict[str, Any]:
    """Return the series of a robot; times in s, positions in rad, differences in mrad, latencies in ms, mm/s."""
    arm = robot.arm
    axes = [
        {
            "name": name,
            "commanded": _series(*arm.points(COMMANDED + axis)),
            "measured": _series(*arm.points(MEASURED + axis)),
            "difference": _series(*_scaled(arm.points(DIFFERENCE + axis))),
        }
        for axis, name in enumerate(JOINT_NAMES)
    ]
    return {
        "name": robot.name,
        "end": robot.end_s,
        "lanes": [
            {"name": lane.name, "spans": [list(span) for span in lane.spans]}
            for lane in robot.lanes.values()
            if lane.spans
        ],
        "marks": [[mark.at_s, mark.kind.value, mark.text] for mark in robot.marks],
        "axes": axes,
        "moved": _most_moved(robot),
        "speed": _series(*arm.points(FLANGE_SPEED)),
        "t1": robot.t1_mm_s,
        "latency": _series(*robot.latencies.series.points(0)) if robot.latencies.count else None,
        "largest": robot.latencies.largest_ms,
        "bars": [[low, min(high, 10.0 * low or high), count] for low, high, count in robot.latencies.bars()],
        "budget": robot.budget_ms,
    }


def _scaled(points: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    times, values = points
    return times, values * _MILLI


def _most_moved(robot: RobotRecord) -> int:
    spans = [
        float(np.ptp(values)) if len(values) else 0.0
        for values in (robot.arm.points(MEASURED + axis)[1] for axis in range(len(JOINT_NAMES)))
    ]
    return spans.index(max(spans))


def _series(times: Floats, values: Floats) -> dict[str, Any]:
    """Times in whole steps, of a microsecond up to 66 minutes; values with the seven digits of a single float."""
    finite = np.isfinite(values)
    times, values = times[finite], values[finite]
    step = max(_MICRO, float(times[-1]) / _MOST_STEPS) if len(times) else _MICRO
    steps = np.clip(np.round(times / step), 0, _MOST_STEPS)
    return {"x": _packed(steps.astype("<u4")), "y": _packed(values.astype("<f4")), "step": step}


def _packed(values: "np.ndarray[Any, Any]") -> str:
    return b64encode(values.tobytes()).decode()
