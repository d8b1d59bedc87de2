"""``hil conformance``: known differences between two arms are found, named, and told of the right axis."""

import json
from collections import deque
from dataclasses import replace
from pathlib import Path

import pytest

from backends.ideal import CAPABILITIES, IdealBackend
from backends.rig import InProcessRig
from backends.robots import load_description
from hil.values.arm import ArmState, Capabilities, JointCommand, seven
from hil.values.errors import HilError
from hil.values.robot import RobotDescription
from tests.support.cli import cli
from tests.support.processes import ROOT
from tools.conformance.compare import Comparison, compare, run_stream
from tools.conformance.stream import Moment, captured_stream, planned_stream

ROBOT = "lbr-iiwa-7-r800"
DATA = ROOT / "tests/data"
STREAM = planned_stream(robot=ROBOT, cycle_ms=4)


class Lagging(IdealBackend):
    """Does what it was told two cycles before."""

    def __init__(self, description: RobotDescription) -> None:
        super().__init__(description)
        self._waiting = deque([JointCommand(description.initial_position_rad, (0.0,) * 7)] * 2)

    def _write(self, command: JointCommand) -> None:
        self._waiting.append(command)
        super()._write(self._waiting.popleft())


class Altered(IdealBackend):
    """Measures something else than there is."""

    def _read(self) -> ArmState:
        state = super()._read()
        return state._replace(position_rad=seven(self.altered(list(state.position_rad))))

    def altered(self, position: list[float]) -> list[float]:
        raise NotImplementedError


class Gain(Altered):
    def altered(self, position: list[float]) -> list[float]:
        position[2] *= 1.1
        return position


class Swapped(Altered):
    def altered(self, position: list[float]) -> list[float]:
        position[4], position[6] = position[6], position[4]
        return position


class Reversed(Altered):
    def altered(self, position: list[float]) -> list[float]:
        position[0] = -position[0]
        return position


class Drifting(Altered):
    def altered(self, position: list[float]) -> list[float]:
        position[5] += self._sample * 4e-6
        return position


class Torqued(IdealBackend):
    """Takes torques, which the ideal arm does not."""

    @property
    def capabilities(self) -> Capabilities:
        return replace(CAPABILITIES, takes_torque=True)


def compared(other: type[IdealBackend]) -> Comparison:
    description = load_description(ROBOT)
    courses = [
        run_stream(InProcessRig(arm(description)), STREAM, name=arm.__name__, cycle_ms=4, progress=lambda _: None)
        for arm in (IdealBackend, other)
    ]
    return compare(courses[0], courses[1], STREAM, robot=ROBOT, cycle_ms=4)


def test_an_arm_is_like_itself() -> None:
    found = compared(IdealBackend)
    assert found.latency_ms == pytest.approx(0.0, abs=1e-6)
    assert found.worst_position.worst == pytest.approx(0.0, abs=1e-9)
    assert found.unlike() == []
    assert found.verdict(1e-3).startswith("IdealBackend does what IdealBackend does: it follows at the same time")


def test_a_lag_is_a_latency_and_no_other_difference() -> None:
    found = compared(Lagging)
    assert found.latency_ms == pytest.approx(8.0, abs=0.05)
    assert abs(found.worst_position.worst) < 0.3
    assert found.worst_position.as_it_was > 1.0
    assert "it follows 8.00 ms later" in found.verdict(1e-3)


@pytest.mark.parametrize(
    ("other", "axis", "at_least_mrad"),
    [(Gain, "A3", 15.0), (Swapped, "A5", 100.0), (Reversed, "A1", 500.0), (Drifting, "A6", 3.0)],
)
def test_a_difference_is_told_of_its_axis(other: type[IdealBackend], axis: str, at_least_mrad: float) -> None:
    found = compared(other)
    assert found.worst_position.axis == axis
    assert abs(found.worst_position.worst) > at_least_mrad
    assert found.verdict(1e-3).startswith(f"{other.__name__} differs from IdealBackend: ")
    assert f"on {axis} at {found.worst_position.at_s:.2f} s ({found.worst_position.part})" in found.verdict(1e-3)
    alike = {"A1", "A2", "A4"} - {axis}
    assert all(abs(one.worst) < 0.1 for one in found.differences if one.quantity == "position" and one.axis in alike)


def test_a_capability_that_is_not_there_is_named() -> None:
    found = compared(Torqued)
    assert found.unlike() == [
        ("takes torque", "no", "yes"),
        (
            "refuses",
            "torque: IdealBackend takes no torque commands; push: IdealBackend cannot be pushed",
            "push: Torqued cannot be pushed",
        ),
    ]
    assert found.verdict(1e-3).endswith("; not alike: takes torque, refuses")


def test_a_recording_of_ours_is_a_stream() -> None:
    robot, cycle_ms, moments = captured_stream(DATA / "smart-servo-2ms.pcapng")
    assert (robot, cycle_ms, len(moments)) == ("lbr-iiwa-14-r820", 2, 301)
    assert captured_stream(DATA / "smart-servo-2ms.pcapng")[2] == moments
    assert any(any(moment.command.velocity_rad_s) for moment in moments)


@pytest.mark.parametrize(
    ("capture", "sentence"),
    [
        ("fri-2.5-torque-4ms.pcapng", "its arm is under impedance control at"),
        ("tcp/no-delay.pcapng", "is no recording of one of our controllers"),
        ("nowhere.pcapng", "cannot be read"),
    ],
)
def test_a_recording_that_is_no_stream_is_refused(capture: str, sentence: str) -> None:
    with pytest.raises(HilError, match=sentence):
        captured_stream(DATA / capture)


def test_a_recording_has_its_own_robot_and_cycle() -> None:
    ended = cli("conformance", "ideal", "mujoco", "--stream", DATA / "smart-servo-2ms.pcapng", "--cycle", 5)
    assert ended.code == 2
    assert "--robot and --cycle are those of the recording" in ended.err


def test_the_stream_has_what_applications_do() -> None:
    parts = {moment.part for moment in STREAM}
    assert parts == {"rest", "PTP", "SmartServo", "stop of SmartServo", "DirectServo", "stop of DirectServo"}
    assert [moment for moment in STREAM if isinstance(moment, Moment)] == planned_stream(robot=ROBOT, cycle_ms=4)


def test_the_command_tells_the_difference_draws_it_and_ends_with_a_code(tmp_path: Path) -> None:
    picture, result = tmp_path / "c.png", tmp_path / "c.json"
    ended = cli("conformance", "ideal", "mujoco", "--cycle", 4, "--plot", picture, "--json", result)
    assert ended.code == 0, ended.err
    assert "mujoco does what ideal does" in ended.out
    assert "takes torque" in ended.out
    assert picture.read_bytes().startswith(b"\x89PNG")
    found = json.loads(result.read_text())
    assert found["drive_states"]["a"] == found["drive_states"]["b"] == "ACTIVE OFF TRANSITIONING ACTIVE"
    strict = cli("conformance", "ideal", "mujoco", "--cycle", 4, "--tolerance-rad", 1e-6)
    assert strict.code == 1
    assert "mujoco differs from ideal" in strict.out


def test_seeds_are_another_torque_and_nothing_else() -> None:
    ended = cli("conformance", "mujoco:seed=1", "mujoco:seed=2", "--cycle", 5, "--json", "-")
    found = json.loads(ended.out)
    worst = {
        name: max(abs(one["worst"]) for one in found["differences"] if one["quantity"] == name)
        for name in ("position", "torque")
    }
    assert worst["position"] < 1e-9
    assert 0.0 < worst["torque"] < 0.5


@pytest.mark.parametrize(
    ("sides", "sentence"),
    [
        (("ideal", "nothing"), "unknown backend 'nothing'"),
        (("ideal", "mujoco:seed"), "'seed' is no OPTION=VALUE"),
        (("ideal", "mujoco:seed=-1"), "seed -1 is no whole number"),
        (("ideal", "ideal:x=1"), "has no options"),
        (("cabinet:arm=real", "ideal"), "unknown arm of a chained Cabinet 'real'"),
        (("cabinet:relase=2.5", "ideal"), "there is no 'relase'"),
        (("ideal", "can402", "--cycle", "1"), "% of the bus at 1000 kbit/s"),
        (("ideal", "ideal", "--cycle", "3"), "a control cycle of 3 ms"),
    ],
)
def test_what_cannot_be_compared_is_refused(sides: tuple[str, ...], sentence: str) -> None:
    ended = cli("conformance", *sides)
    assert ended.code == 2
    assert sentence in ended.err
