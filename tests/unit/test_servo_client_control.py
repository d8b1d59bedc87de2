"""Control modes, load validation and pushes as both clients ask for them, against the stand-in controller."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from hil.client.servo import (
    PTP,
    AsyncServoClient,
    AsyncSmartServo,
    AttachedTool,
    CartesianImpedanceControlMode,
    DirectServo,
    IllegalArgumentException,
    IllegalStateException,
    JointImpedanceControlMode,
    Load,
    OutOfRange,
    Pose,
    Role,
    ServoClient,
    SmartServo,
    by_translation,
)
from hil.values.frames import FLANGE
from hil.values.servo import ChangeControlMode, PushArm, StartMotion, ValidateLoad
from tests.support.servo_controller import START
from tests.support.servo_served import Served, served

SOFT = CartesianImpedanceControlMode(stiffness=by_translation(500.0, 150.0))
STIFFER = CartesianImpedanceControlMode(stiffness=by_translation(1000.0, 150.0))


@pytest.fixture
def controller() -> Iterator[Served]:
    """A stand-in on a free port, whose gripper has the load it is said to have."""
    with served() as stand_in:
        stand_in.do(lambda one: setattr(one, "valid_frames", {"gripper"}))
        yield stand_in


def taken(controller: Served, kind: type[Any]) -> list[Any]:
    return controller.do(lambda stand_in: [request for request in stand_in.taken if isinstance(request, kind)])


@pytest.mark.parametrize("make", [SmartServo, DirectServo, lambda: PTP(START)])
def test_a_motion_tells_its_mode_and_what_it_moves(
    controller: Served, make: Callable[[], SmartServo | DirectServo | PTP]
) -> None:
    # What has ended may be changed, and started again: it is to be on its way.
    controller.do(lambda stand_in: setattr(stand_in, "holds", True))
    with ServoClient(controller.address) as robot:
        motion = make()
        assert motion.set_mode(SOFT) is motion
        robot.move_async(motion, "tip")
        [start] = taken(controller, StartMotion)
        assert (start.mode, start.frame) == (SOFT, "tip")
        with pytest.raises(IllegalStateException, match="its control mode is set before move_async"):
            motion.set_mode(STIFFER)


def test_a_tool_of_the_program_s_own_travels_with_the_motion(controller: Served) -> None:
    tool = AttachedTool(Load(1.5, (0.0, 0.0, 0.05)), Pose(0.0, 0.0, 0.1))
    goal = Pose(0.4, 0.0, 0.6)
    with ServoClient(controller.address) as robot:
        robot.validate_for_impedance_mode(tool)
        robot.move_async(PTP(goal), tool)
        [start] = taken(controller, StartMotion)
        asked = taken(controller, ValidateLoad)[-1]
        assert (start.tool, start.frame, asked.tool) == (tool, FLANGE, tool)
        assert start.flange_in_base.position_m == pytest.approx((0.4, 0.0, 0.5))
        with pytest.raises(IllegalArgumentException, match="finite"):
            robot.move_async(SmartServo(), AttachedTool(Load(), Pose(math.nan, 0.0, 0.0)))


def test_the_parameters_change_while_the_motion_runs_and_the_kind_does_not(controller: Served) -> None:
    with ServoClient(controller.address) as robot:
        motion = SmartServo().set_mode(SOFT)
        robot.move_async(motion)
        runtime = motion.get_runtime()
        runtime.change_control_mode_settings(STIFFER)
        with pytest.raises(IllegalArgumentException, match="the kind stays"):
            runtime.change_control_mode_settings(JointImpedanceControlMode())
        with pytest.raises(IllegalArgumentException, match="is no control mode"):
            runtime.change_control_mode_settings("soft")  # type: ignore[arg-type]
        assert [request.mode for request in taken(controller, ChangeControlMode)] == [
            STIFFER,
            JointImpedanceControlMode(),
        ]


def test_a_validation_says_why_it_failed_until_one_does_not(controller: Served) -> None:
    with ServoClient(controller.address) as robot:
        assert not robot.validate_for_impedance_mode()
        assert robot.validation_failure == "the load is another"
        assert robot.validate_for_impedance_mode("gripper")
        assert robot.validation_failure == ""
        with pytest.raises(IllegalArgumentException, match="frameOnFlange is not frame below"):
            robot.validate_for_impedance_mode("table")


async def test_the_asyncio_client_does_the_same(controller: Served) -> None:
    async with AsyncServoClient(controller.address) as robot:
        assert not await robot.validate_for_impedance_mode()
        assert robot.validation_failure == "the load is another"
        assert await robot.validate_for_impedance_mode("gripper")
        motion = AsyncSmartServo().set_mode(SOFT)
        await robot.move_async(motion, "tip")
        await (await motion.get_runtime()).change_control_mode_settings(STIFFER)
    assert [request.mode for request in taken(controller, ChangeControlMode)] == [STIFFER]
    async with AsyncServoClient(controller.address, role=Role.OPERATOR) as operator:
        with pytest.raises(OutOfRange, match=r"link 8 is outside its range 1 ... 7"):
            await operator.push((1.0, 0.0, 0.0), link=8)
        await operator.push((1.0, 2.0, 3.0))
    assert taken(controller, PushArm)[-1][1:] == (7, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0), 1.0)


NO_PUSHES: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"link": -1}, OutOfRange, r"link -1 is outside its range 1 ... 7"),
    ({"link": 2**40}, OutOfRange, r"outside its range 1 ... 7"),
    ({"link": 1.5}, IllegalArgumentException, r"link is 1.5; a whole number, 1 ... 7, is needed"),
    ({"force_n": (1.0, 501.0, 0.0)}, OutOfRange, r"force along y 501 is outside its range -500 ... 500 N"),
    ({"force_n": (1.0, 0.0)}, IllegalArgumentException, r"three numbers x, y, z in N are needed"),
    ({"force_n": None}, IllegalArgumentException, r"three numbers x, y, z in N are needed"),
    ({"moment_nm": (0.0, 0.0, math.nan)}, OutOfRange, r"moment along z nan is outside its range -100 ... 100 Nm"),
    ({"duration_s": 61.0}, OutOfRange, r"duration of a push 61 is outside its range 0 ... 60 s"),
    ({"duration_s": None}, IllegalArgumentException, r"duration of a push is None; a number of seconds is needed"),
]


@pytest.mark.parametrize(("wrong", "error", "words"), NO_PUSHES)
def test_a_wrong_push_is_refused_at_the_call_and_the_session_lives(
    controller: Served, wrong: dict[str, Any], error: type[Exception], words: str
) -> None:
    """What no packet can carry must not get among the requests: from there it would spoil every later packet."""
    with ServoClient(controller.address, role=Role.OPERATOR) as operator:
        with pytest.raises(error, match=words):
            operator.push(**{"force_n": (1.0, 0.0, 0.0), **wrong})
        operator.push((5.0, 0.0, 0.0), link=4, moment_nm=(0.0, 1.0, 0.0), duration_s=2.0)
        [push] = taken(controller, PushArm)
        assert push[1:] == (4, (5.0, 0.0, 0.0), (0.0, 1.0, 0.0), 2.0)


def test_only_an_operator_pushes(controller: Served) -> None:
    with ServoClient(controller.address) as robot, pytest.raises(IllegalStateException, match="only an operator"):
        robot.push((1.0, 0.0, 0.0))
