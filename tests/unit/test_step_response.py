"""``hil step-response``: the manual's statements of 7.12 hold on the MuJoCo arm, and what trips is told."""

import json
import math
import re
from pathlib import Path

import pytest

from hil.config.limits import LimitsConfig
from hil.config.station import RobotConfig, ServoConfig
from hil.core.settings import ReactionSettings
from hil.values.errors import ConfigurationError
from tests.support.cli import cli
from tools.step_response.drawing import COLOURS, STEP_COLOUR
from tools.step_response.figures_of_merit import peak
from tools.step_response.measuring import (
    CASES,
    DIRECT,
    FAST,
    LARGEST_STEP_DEG,
    SMART,
    Step,
    check_step,
    measure_step,
    measure_steps,
)
from tools.step_response.report import StepResponseReport

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "step-response.md").read_text(encoding="utf-8")
CONFIG = RobotConfig(servo=ServoConfig())
A2 = 1


def reported(*steps: Step) -> StepResponseReport:
    return StepResponseReport("a robot", "an arm", ReactionSettings(), (0.0,) * 7, 5.0, steps)


@pytest.fixture(scope="module")
def report() -> StepResponseReport:
    """A2 of the default robot, which carries the most."""
    done: list[int] = []
    steps = measure_steps(CONFIG, step_deg=LARGEST_STEP_DEG, axes=[A2], progress=done.append)
    assert done == [1, 2, 3]
    return reported(*steps)


def by_case(report: StepResponseReport) -> tuple[Step, Step, Step]:
    smart, fast, direct = report.steps
    assert (smart.case, fast.case, direct.case) == (SMART, FAST, DIRECT)
    return smart, fast, direct


def test_the_manuals_statements_hold(report: StepResponseReport) -> None:
    assert [statement.verdict for statement in report.statements()] == ["holds"] * 4
    assert not report.tripped()


def test_reaction_times_are_22_and_12_ms_within_a_cycle(report: StepResponseReport) -> None:
    smart, fast, direct = (step.figures() for step in by_case(report))
    assert smart.reaction == pytest.approx(22.0, abs=1.0)
    assert direct.reaction == pytest.approx(12.0, abs=1.0)
    assert fast.reaction is not None
    assert fast.reaction <= 22.1


def test_fast_is_faster_in_every_figure(report: StepResponseReport) -> None:
    smart, fast, _ = (step.figures() for step in by_case(report))
    for name in ("seen", "rise", "settling"):
        assert getattr(fast, name) < getattr(smart, name)


def test_jerk_is_bounded_for_smart_servo_only(report: StepResponseReport) -> None:
    smart, fast, direct = by_case(report)
    for step in (smart, fast):
        assert step.jerk_limit_deg_s3 is not None
        assert peak(step.course.jerk_deg_s3) == pytest.approx(step.jerk_limit_deg_s3)
    assert direct.jerk_limit_deg_s3 is None
    assert peak(direct.course.jerk_deg_s3) > 10 * peak(fast.course.jerk_deg_s3)


def test_the_arm_is_at_its_destination_and_hardly_passed_it(report: StepResponseReport) -> None:
    for step in report.steps:
        assert step.course.measured_deg[-1] == pytest.approx(5.0, abs=0.01)
        assert step.figures().overshoot_percent < 0.1


def test_a_step_repeats_to_the_bit_and_towards_minus_is_no_worse(report: StepResponseReport) -> None:
    assert measure_step(CONFIG, DIRECT, axis=A2, step_deg=LARGEST_STEP_DEG) == report.steps[2]
    down = measure_step(CONFIG, DIRECT, axis=A2, step_deg=-2.0)
    assert down.course.measured_deg[-1] == pytest.approx(-2.0, abs=0.01)
    assert down.figures().reaction == pytest.approx(12.0, abs=1.0)


def test_a_monitor_that_trips_is_told_with_its_reason() -> None:
    config = RobotConfig(servo=ServoConfig(), limits=LimitsConfig(tracking_deg=0.01))
    tripped = measure_step(config, DIRECT, axis=A2, step_deg=LARGEST_STEP_DEG)
    assert "stop of category" in tripped.tripped
    report = reported(tripped)
    assert report.rows()[0][:3] == ("A2", "DirectServo", "tripped")
    assert report.tripped() == [f"A2, DirectServo: {tripped.tripped}"]
    assert report.as_dict()["steps"][0]["tripped"] == tripped.tripped
    assert tripped.tripped in report.markdown()
    assert {statement.verdict for statement in report.statements()} == {"not measured"}


def test_a_step_that_is_refused_is_told_too() -> None:
    refused = measure_step(CONFIG, DIRECT, axis=A2, step_deg=6.0)
    assert "directServo: Target Outside accepted Delta" in refused.tripped
    assert peak(refused.course.set_point_deg) == 0.0


def test_steps_out_of_the_range_of_an_axis_are_refused_before_anything_moves() -> None:
    narrow = RobotConfig(
        servo=ServoConfig(), limits=LimitsConfig(position_max_deg=[100.0, 32.0, 100.0, 100.0, 100.0, 100.0, 100.0])
    )
    with pytest.raises(ConfigurationError, match=r"would bring A2 to 35 degrees, outside its range -120\.\.32 degrees"):
        measure_steps(narrow, step_deg=5.0, axes=[A2], progress=lambda _: None)


@pytest.mark.parametrize("step_deg", [5.1, -6.0, 0.0, math.nan])
def test_steps_that_cannot_be_compared_are_refused(step_deg: float) -> None:
    from backends.robots import load_description

    with pytest.raises(ConfigurationError, match="DirectServo takes no more"):
        check_step(load_description("lbr-iiwa-7-r800"), step_deg=step_deg, axes=[0])


def test_the_command_draws_writes_and_prints(tmp_path: Path) -> None:
    ended = cli("step-response", "-o", tmp_path / "new", "--axes", "a7", "--backend", "ideal", "--json")
    assert ended.code == 0, ended.err
    told = json.loads(ended.out)
    assert [(step["axis"], step["motion"]) for step in told["steps"]] == [("A7", case.name) for case in CASES]
    assert json.loads((tmp_path / "new" / "step-response.json").read_text(encoding="utf-8")) == told
    assert "| A7 | DirectServo | " in (tmp_path / "new" / "step-response.md").read_text(encoding="utf-8")
    pictures = {picture.name for picture in (tmp_path / "new").glob("*.png")}
    assert pictures == {"step-response.png", "step-response-A7.png", "step-response-A7-advanced.png"}


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--robot", "kr6"), "unknown robot 'kr6'; valid: lbr-iiwa-7-r800"),
        (("--backend", "wood"), "unknown backend 'wood'; valid: cabinet, can402, ideal, mujoco"),
        (("--axes", "A1,A8"), "unknown axis 'A8'; valid: A1, A2, A3, A4, A5, A6, A7"),
        (("--axes", ","), "unknown axis ','"),
        (("--step-deg", "7"), "step 7 is outside its range 0.01..5 degrees, either way; DirectServo takes no more"),
        ((), "that is a file, not a folder"),
    ],
)
def test_bad_input_is_a_sentence(tmp_path: Path, arguments: tuple[str, ...], sentence: str) -> None:
    folder = tmp_path / "folder"
    if not arguments:
        folder.touch()
    ended = cli("step-response", "-o", folder, *arguments)
    assert ended.code == 2
    assert ended.err.startswith("hil: ")
    assert sentence in ended.err
    assert ended.out == ""


def test_a_folder_that_cannot_be_made_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    ended = cli("step-response", "-o", tmp_path / "file" / "below")
    assert (ended.code, ended.out) == (2, "")
    assert "cannot write into the folder" in ended.err


def test_the_colours_are_the_manuals() -> None:
    """Blue step, green default, light blue fast, red DirectServo (manual 7.12.1)."""

    def strongest(colour: str) -> int:
        parts = [int(colour[place : place + 2], 16) for place in (1, 3, 5)]
        return parts.index(max(parts))

    assert [strongest(colour) for colour in (STEP_COLOUR, *(COLOURS[case.name] for case in CASES))] == [2, 1, 2, 0]


def test_the_page_has_what_the_tool_measures(report: StepResponseReport) -> None:
    for row in report.rows():
        assert f"| {' | '.join(row)} |" in PAGE
    for statement in ("responds after 22 ms", "responds after 12 ms"):
        assert statement in PAGE
    for picture in re.findall(r"\]\((step-response[\w-]*\.png)\)", PAGE):
        assert (ROOT / "docs" / picture).exists()
