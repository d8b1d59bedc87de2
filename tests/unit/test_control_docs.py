"""docs/control.md says what the code does: ranges and defaults, tests that are there, pictures that can be drawn."""

import re
from pathlib import Path

import pytest

from hil.core.control import load_validation
from hil.values import control
from hil.values.motion import ParameterRange
from tools.control_plots import main

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "control.md").read_text(encoding="utf-8")
RANGES = (
    control.TRANSLATIONAL_STIFFNESS,
    control.ROTATIONAL_STIFFNESS,
    control.CARTESIAN_DAMPING,
    control.NULL_SPACE_STIFFNESS,
    control.NULL_SPACE_DAMPING,
    control.JOINT_STIFFNESS,
    control.JOINT_DAMPING,
    control.FREQUENCY,
)


@pytest.mark.parametrize("parameter", RANGES, ids=lambda parameter: parameter.name)
def test_ranges_and_defaults_are_those_of_the_code(parameter: ParameterRange) -> None:
    assert f"| {parameter.name} | {parameter._range()} | {parameter.default:g} |" in PAGE


def test_thresholds_of_the_validation_are_those_of_the_code() -> None:
    assert f"within {load_validation.SINGULAR_RAD:g} rad" in PAGE
    assert f"faster than {load_validation.AT_REST_RAD_S:g} rad/s" in PAGE
    assert f"{load_validation.OFFSET_NM:g} Nm and half a percent" in PAGE
    assert load_validation.SHARE_OF_TORQUE == 0.005


def test_every_test_the_page_names_is_there() -> None:
    names = set(re.findall(r"`(test_\w+)`", PAGE))
    written = "\n".join(file.read_text(encoding="utf-8") for file in (ROOT / "tests").rglob("test_*.py"))
    assert len(names) >= 10
    assert {name for name in names if f"def {name}(" not in written} == set()


def test_its_pictures_are_drawn_and_their_figures_are_those_of_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(tmp_path)
    said = capsys.readouterr().out
    for picture in re.findall(r"\]\((control-\w+\.png)\)", PAGE):
        assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")
        assert (ROOT / "docs" / picture).exists()
    page = " ".join(PAGE.split())
    rests = [float(number) for number in re.findall(r"at rest at (\d+\.\d+) mm", said)]
    assert rests == pytest.approx([float(number) for number in _figures(page, "ends at {}, {} and {} mm")], abs=0.02)
    wall, springs, felt = map(float, re.findall(r"-?(\d+\.\d+) N", said)[:3])
    told = _figures(page, "pushes with {} N where springs in series say {} N, and {} N are estimated")
    assert [wall, springs, felt] == pytest.approx([float(number) for number in told], abs=0.05)
    assert wall == pytest.approx(springs, rel=0.03)
    assert felt == pytest.approx(wall, abs=0.5)
    moved = re.search(r"the flange moves by ([+-]\d+\.\d+) mm", said)
    assert moved is not None
    assert abs(float(moved[1])) == pytest.approx(float(_figures(page, "the flange moves by {} mm")[0]), abs=0.02)
    overshoots = [int(number) for number in re.findall(r"overshoot (\d+) %", said)]
    assert overshoots == sorted(overshoots, reverse=True)
    told = _figures(page, "overshoots by {}, {} and {} %")
    assert overshoots == pytest.approx([int(number) for number in told], abs=1)
    assert overshoots[-1] <= 1


def _figures(page: str, sentence: str) -> tuple[str, ...]:
    """Return the numbers the page has in a sentence."""
    found = re.search(re.escape(sentence).replace(r"\{\}", r"(\d+(?:\.\d+)?)"), page)
    assert found is not None, sentence
    return found.groups()
