"""The table of methods is whole, and what it names is there."""

import re
from pathlib import Path

import pytest

import hil.client.servo as public
from hil.client.servo import (
    PTP,
    AsyncDirectServo,
    AsyncDirectServoRuntime,
    AsyncPTP,
    AsyncServoClient,
    AsyncSmartServo,
    AsyncSmartServoRuntime,
    DirectServo,
    DirectServoRuntime,
    ErrorReason,
    ServoClient,
    SmartServo,
    SmartServoRuntime,
    StatisticTimer,
)
from hil.client.servo.errors import (
    BASE_IS_NOT_STATIC,
    BASE_IS_NULL,
    CALLED_PREMATURELY,
    FRAME_IS_NOT_ON_FLANGE,
    FRAME_ON_FLANGE_IS_NULL,
    NOT_TRANSFERRED_IN_TIME,
)

PAGE = (Path(__file__).parents[2] / "docs" / "servo-api.md").read_text(encoding="utf-8")
ROWS = [
    [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in PAGE.splitlines() if line.startswith("|")
]
METHOD_ROWS = [row for row in ROWS if len(row) == 5 and not row[0].startswith(("manual", "---"))]
HOLDERS = {
    "client": (ServoClient, AsyncServoClient),
    "motion": (SmartServo, AsyncSmartServo, DirectServo, AsyncDirectServo, PTP, AsyncPTP),
    "runtime": (SmartServoRuntime, AsyncSmartServoRuntime, DirectServoRuntime, AsyncDirectServoRuntime),
    "timing": (StatisticTimer,),
}
INNER = {"bind", "must_not_run", "request", "started", "record", "kind"}
"""What motions have for the client's own use."""


def public_names(kind: type[object]) -> set[str]:
    return {name for name in dir(kind) if not name.startswith("_")} - INNER


def test_no_cell_is_empty() -> None:
    assert len(METHOD_ROWS) > 50
    assert all(all(row) for row in ROWS)


@pytest.mark.parametrize(("holder", "kinds"), HOLDERS.items())
def test_every_method_the_page_names_is_there(holder: str, kinds: tuple[type[object], ...]) -> None:
    named = set(re.findall(rf"`{holder}\.(\w+)\(", PAGE))
    assert named <= set().union(*(public_names(kind) for kind in kinds))
    for name in named:
        twins = [hasattr(kind, name) for kind in kinds]
        assert twins[::2] == twins[1::2] or len(kinds) == 1, f"{name} is not in blocking and asyncio alike"


@pytest.mark.parametrize("holder", ["motion", "runtime"])
def test_every_method_that_is_there_is_on_the_page(holder: str) -> None:
    for kind in HOLDERS[holder]:
        for name in public_names(kind):
            assert f"{name}(" in PAGE or f"`{holder}.{name}`" in PAGE, f"{kind.__name__}.{name} is not on the page"


def test_names_are_the_manuals_in_snake_case() -> None:
    checked = 0
    for row in METHOD_ROWS:
        java = re.fullmatch(r"`(?:\w+\.)?([a-z]\w+)\(.*\)`", row[0])
        python = re.fullmatch(r"`(?:\w+\.)?(\w+)\(.*\)`", row[1])
        if java is None or python is None or java[1] in {"toString", "ptp"}:
            continue
        assert python[1] == re.sub(r"(?<!^)(?=[A-Z])", "_", java[1]).lower()
        checked += 1
    assert checked > 30


def test_every_text_of_chapter_10_is_on_the_page() -> None:
    for reason in ErrorReason:
        short = reason.value.removeprefix("interpolation error: ")
        assert f"`{reason.value}`" in PAGE or f"`... {short}`" in PAGE, reason
    for text in (
        NOT_TRANSFERRED_IN_TIME,
        CALLED_PREMATURELY,
        FRAME_ON_FLANGE_IS_NULL,
        FRAME_IS_NOT_ON_FLANGE,
        BASE_IS_NULL,
        BASE_IS_NOT_STATIC,
    ):
        assert f"| `{text}` | `Illegal" in PAGE, text


def test_nothing_of_the_cartesian_interface_is_missing() -> None:
    chapter = PAGE.split("### Cartesian interface (7.5.3)")[1].split("###")[0]
    assert len(re.findall(r"^\| `(set|get)", chapter, re.MULTILINE)) == 5
    assert "not there yet" not in chapter


def test_the_examples_import_what_is_there() -> None:
    imported = re.findall(r"^from hil\.client\.servo import (.+)$", PAGE, re.MULTILINE)
    assert len(imported) == 4
    for names in imported:
        assert all(hasattr(public, name.strip()) for name in names.split(","))
    for example in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        compile(example, "docs/servo-api.md", "exec")
