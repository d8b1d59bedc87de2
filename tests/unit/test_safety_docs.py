"""docs/safety.md says what the code does: every monitor with its category and text, and tests that are there."""

import re
from pathlib import Path

import pytest

from hil.core.safety import monitors, operator, set_point_monitors, state_monitors
from hil.core.safety.margins import MonitorName
from hil.core.settings import T1_SPEED_LIMIT_MM_S, TRACKING_LIMIT_RAD
from hil.values.motion import ErrorReason

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "safety.md").read_text(encoding="utf-8")
REASONS = {
    MonitorName.FINITE: ErrorReason.INVALID_INPUT_VALUES,
    MonitorName.AXIS_RANGE: set_point_monitors.OUTSIDE,
    MonitorName.AXIS_VELOCITY: ErrorReason.SPEED_LIMIT,
    MonitorName.STEP_SIZE: ErrorReason.SPEED_LIMIT,
    MonitorName.COMMANDED_T1: ErrorReason.COMMANDED_T1,
    MonitorName.STATE: monitors.NOT_FINITE,
    MonitorName.FRESH: state_monitors.SILENT,
    MonitorName.TRACKING: ErrorReason.TRACKING_ERROR,
    MonitorName.AXIS_TORQUE: ErrorReason.AXIS_TORQUE_LIMIT,
    MonitorName.MEASURED_T1: ErrorReason.MEASURED_T1,
}


def rows() -> dict[str, list[str]]:
    """Rows of the page's tables by their first cell."""
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in PAGE.splitlines() if line[:1] == "|"]
    return {row[0]: row[1:] for row in cells}


def test_the_page_opens_by_saying_what_this_is_not() -> None:
    assert PAGE.splitlines()[2].startswith("**None of this is a safety function.**")


@pytest.mark.parametrize("monitor", list(MonitorName))
def test_every_monitor_has_a_row_that_is_true(monitor: MonitorName) -> None:
    _limit, _source, reaction, reason, test = rows()[monitor.value]
    assert f"category {monitors.CATEGORIES[monitor].value}" in reaction
    assert ("never only reported" in reaction) is (monitor not in monitors.PERMISSIVE)
    assert reason == f"`{REASONS[monitor]}`"
    assert test.startswith("`test_")


def test_figures_of_the_page_are_those_of_the_code() -> None:
    assert f"flange {T1_SPEED_LIMIT_MM_S:g} mm/s" in PAGE
    assert f"{TRACKING_LIMIT_RAD:g} rad from the set point" in PAGE
    assert f"a new one within {state_monitors.STALE_TIME_MS} ms" in PAGE
    assert f"for {state_monitors.TORQUE_TIME_MS} ms in a row" in PAGE
    assert operator.diagram() in PAGE


def test_every_test_the_page_names_is_there() -> None:
    names = set(re.findall(r"`(test_\w+)(?:\[\w+\])?`", PAGE))
    written = "\n".join(file.read_text(encoding="utf-8") for file in (ROOT / "tests").rglob("test_*.py"))
    assert len(names) >= 14
    assert {name for name in names if f"def {name}(" not in written} == set()
    files = set(re.findall(r"test_\w+\.py", PAGE))
    assert {file for file in files if not list((ROOT / "tests").rglob(file))} == set()
