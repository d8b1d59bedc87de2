"""The soak itself: its laws can be broken, its shifts do something, and the same seed does the same."""

from dataclasses import asdict

import pytest

from backends.robots import load_description, load_pinocchio
from hil.core.model import ArmModel
from hil.values.arm import JointCommand
from hil.values.robot import Seven
from tests.soak.shift import Shift
from tests.support.laws import BRAKING_CYCLES, Laws

ROBOT = "lbr-iiwa-7-r800"
HOME: Seven = (0.0, 0.4, 0.0, -1.2, 0.0, 1.0, 0.0)
STILL: Seven = (0.0,) * 7


def command(position_rad: Seven = HOME, velocity_rad_s: Seven = STILL) -> JointCommand:
    return JointCommand(position_rad, velocity_rad_s, STILL)


def turned(axis: int, by_rad: float) -> Seven:
    position = list(HOME)
    position[axis] += by_rad
    return tuple(position)  # type: ignore[return-value]


@pytest.fixture
def laws() -> Laws:
    return Laws(load_description(ROBOT).limits, ArmModel(load_pinocchio(ROBOT)))


@pytest.mark.parametrize(
    ("wrong", "t1"),
    [
        (command(turned(0, float("nan"))), False),
        (command(turned(1, 3.0)), False),
        (command(velocity_rad_s=(0.0, 9.0, 0.0, 0.0, 0.0, 0.0, 0.0)), False),
        (command(turned(0, 0.01)), False),
        (command(velocity_rad_s=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)), True),
        (command(turned(0, 0.001)), True),
    ],
    ids=["not finite", "out of range", "too fast", "too long a step", "too fast for T1", "too long a step for T1"],
)
def test_each_law_can_be_broken(laws: Laws, wrong: JointCommand, t1: bool) -> None:
    laws.check(command(), t1=t1, running=True)
    with pytest.raises(AssertionError):
        laws.check(wrong, t1=t1, running=True)


def test_an_arm_that_may_not_move_has_its_time_to_brake(laws: Laws) -> None:
    for cycle in range(BRAKING_CYCLES):
        laws.check(command(turned(0, 1e-5 * cycle)), t1=False, running=False)
    assert laws.moved == BRAKING_CYCLES - 1
    with pytest.raises(AssertionError, match="an arm that may not move moves"):
        laws.check(command(turned(0, 1e-5 * BRAKING_CYCLES)), t1=False, running=False)


def test_a_shift_does_something_and_the_same_seed_does_the_same() -> None:
    report = Shift(3, seconds=4.0, reconnects=6).run()
    assert report.reconnects >= 4
    assert report.commands == pytest.approx(report.virtual_s * 1e3, abs=2)
    assert report.moved > 500
    assert sum(report.done.values()) > 2
    assert asdict(Shift(3, seconds=4.0, reconnects=6).run()) == asdict(report)


def test_a_shift_sees_a_law_that_is_broken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.support.laws._T1_MM_S", 1.0)
    with pytest.raises(AssertionError):
        Shift(3, seconds=4.0, reconnects=6).run()
