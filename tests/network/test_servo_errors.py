"""Every error of the manual's chapter 10 that needs no Cartesian or impedance part, over real sockets.

Those of T1, torque and pausing are in ``test_safety_errors.py``.

The controller's shell and the client share an event loop here, so that a robot side and an interpolator of the test's
own can be behind the socket: that is the only way to an arm that cannot follow, and to the internal errors of an
interpolator that has none.
"""

import asyncio
import math
from collections.abc import Callable

import pytest
from ruckig import InputParameter, Result, Ruckig, Synchronization, Trajectory

from backends.ideal import IdealBackend
from hil.client.servo import (
    AsyncDirectServo,
    AsyncPTP,
    AsyncServoClient,
    AsyncSmartServo,
    ErrorReason,
    IllegalArgumentException,
    IllegalStateException,
)
from hil.core.motion import planner
from hil.values.arm import JointCommand
from hil.values.motion import MotionParameters
from hil.values.servo import Request, RequestDone, RequestError, SetDestination
from tests.support.controller_in_loop import connected, refused, start_position

DEGREE = math.pi / 180
NOT_ACTIVE = "waitForTransferred called prematurely - RealtimeMotion is not active"


class StuckArm(IdealBackend):
    """An arm whose joints are blocked."""

    def _write(self, command: JointCommand) -> None:
        super()._write(JointCommand(self._position, (0.0,) * 7))


Change = Callable[[tuple[float, ...]], tuple[float, ...]]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda start: (3.1, *start[1:]), "interpolation error: RML_ERROR_POSITIONAL_LIMITS"),
        (lambda start: (math.nan, *start[1:]), "interpolation error: ERROR_INVALID_INPUT_VALUES"),
        (lambda start: (math.inf, *start[1:]), "interpolation error: ERROR_INVALID_INPUT_VALUES"),
        (lambda start: start[:6], "interpolation error: ERROR_NUMBER_OF_DOFS"),
        (lambda start: (*start, 0.0), "interpolation error: ERROR_NUMBER_OF_DOFS"),
    ],
)
async def test_smart_servo_destinations_that_cannot_be(change: Change, reason: str) -> None:
    async with connected() as robot:
        start = start_position(robot)
        motion = AsyncSmartServo((0.5, *start[1:]))
        await robot.move_async(motion)
        runtime = await motion.get_runtime()
        await asyncio.wait_for(_until_moving(runtime), 5)
        error = await refused(runtime.set_destination(change(start)), reason)
        assert error.detail
        await refused(runtime.update_with_realtime_system(), reason)
        await refused(runtime.set_destination(start), reason)
        again = AsyncSmartServo()
        await robot.move_async(again)
        await (await again.get_runtime()).set_destination(start)


async def _until_moving(runtime: object) -> None:
    before = None
    while True:
        await runtime.update_with_realtime_system()  # type: ignore[attr-defined]
        position = runtime.get_command_result_of_interpolation()  # type: ignore[attr-defined]
        if before is not None and position != before:
            return
        before = position


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda start: (start[0] + 6 * DEGREE, *start[1:]), "directServo: Target Outside accepted Delta"),
        (lambda start: (math.nan, *start[1:]), "interpolation error: ERROR_INVALID_INPUT_VALUES"),
        (lambda start: start[:3], "interpolation error: ERROR_NUMBER_OF_DOFS"),
    ],
)
async def test_direct_servo_destinations_that_cannot_be(change: Change, reason: str) -> None:
    async with connected() as robot:
        start = start_position(robot)
        motion = AsyncDirectServo()
        await robot.move_async(motion)
        runtime = await motion.get_runtime()
        await runtime.set_destination((start[0] + 4 * DEGREE, *start[1:]))
        await refused(runtime.set_destination(change(start)), reason)


async def test_direct_servo_out_of_its_axis_range() -> None:
    async with connected() as robot:
        start = start_position(robot)
        end = 175 * DEGREE
        smart = AsyncSmartServo((*start[:6], end - DEGREE))
        smart.set_joint_jerk(500).override_joint_acceleration(20)
        await robot.move_async(smart)
        runtime = await smart.get_runtime()
        while not runtime.is_destination_reached():
            await runtime.update_with_realtime_system()
        await runtime.stop_motion()
        direct = AsyncDirectServo()
        await robot.move_async(direct)
        reason = "directServo: Target Outside Joint Limit"
        await refused((await direct.get_runtime()).set_destination((*start[:6], end + DEGREE)), reason)


async def test_a_target_velocity_beyond_the_axis() -> None:
    async with connected() as robot:
        start = start_position(robot)
        motion = AsyncSmartServo()
        await robot.move_async(motion)
        runtime = await motion.get_runtime()
        error = await refused(runtime.set_destination((0.3, *start[1:]), (5.0, *[0.0] * 6)), "speed limit exceeded")
        assert "A1" in error.detail


async def test_a_target_velocity_for_direct_servo_is_refused_at_the_call() -> None:
    async with connected() as robot:
        start = start_position(robot)
        motion = AsyncDirectServo()
        await robot.move_async(motion)
        runtime = await motion.get_runtime()
        with pytest.raises(IllegalArgumentException, match="SmartServo"):
            await runtime.set_destination(start, (0.1,) * 7)
        await runtime.set_destination(start)


async def test_an_arm_that_cannot_follow() -> None:
    async with connected(arm=StuckArm) as robot:
        start = start_position(robot)
        motion = AsyncSmartServo((0.8, *start[1:]))
        await robot.move_async(motion)
        runtime = await motion.get_runtime()

        async def watch() -> None:
            while True:
                await runtime.update_with_realtime_system()

        error = await refused(asyncio.wait_for(watch(), 10), "tracking error")
        assert "A1 is +0.1" in error.detail


async def test_a_time_that_is_too_long() -> None:
    async with connected() as robot:
        start = start_position(robot)
        motion = AsyncSmartServo((1.0, *start[1:])).set_joint_velocity_rel(1e-6)
        await robot.move_async(motion)
        await refused(motion.get_runtime(), "interpolation error: ERROR_EXECUTION_TIME_TOO_BIG")


@pytest.mark.parametrize(
    ("result", "reason"),
    [
        (Result.Error, "interpolation error: ERROR"),
        (Result.ErrorInvalidInput, "interpolation error: ERROR_INVALID_INPUT_VALUES"),
        (Result.ErrorExecutionTimeCalculation, "interpolation error: ERROR_EXECUTION_TIME_CALCULATION"),
        (Result.ErrorSynchronizationCalculation, "interpolation error: ERROR_SYNCHRONIZATION"),
        (Result.ErrorPositionalLimits, "interpolation error: RML_ERROR_POSITIONAL_LIMITS"),
    ],
)
async def test_internal_errors_of_the_interpolator(
    monkeypatch: pytest.MonkeyPatch, result: Result, reason: str
) -> None:
    class Broken:
        def __init__(self, *_: object) -> None:
            return

        def calculate(self, *_: object) -> Result:
            return result

    async with connected() as robot:
        start = start_position(robot)
        monkeypatch.setattr(planner, "Ruckig", Broken)
        motion = AsyncSmartServo((0.5, *start[1:]))
        await robot.move_async(motion)

        async def watch() -> None:
            runtime = await motion.get_runtime()
            while True:
                await runtime.update_with_realtime_system()

        await refused(asyncio.wait_for(watch(), 10), reason)


async def asked(robot: AsyncServoClient, make: Callable[[int], Request]) -> RequestDone:
    """Ask for what the client library would have refused at the call, and return what became of it."""
    pending = robot.session.ask(make)
    while pending.done is None:
        await robot.wait_for_state()
    return pending.done


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        (MotionParameters(acceleration_override=21.0), "interpolation error: RML_ERROR_OVERRIDE_OUT_OF_RANGE"),
        (MotionParameters(joint_velocity_rel=1.01), "interpolation error: RML_ERROR_OVERRIDE_OUT_OF_RANGE"),
        (MotionParameters(minimum_execution_time_s=-0.1), "interpolation error: RML_ERROR_USER_TIME_OUT_OF_RANGE"),
    ],
)
async def test_parameters_no_client_of_ours_would_send(parameters: MotionParameters, reason: str) -> None:
    async with connected() as robot:
        motion = AsyncSmartServo(start_position(robot))
        motion.parameters = parameters
        await robot.move_async(motion)
        error = await refused(motion.get_runtime(), reason)
        assert error.detail


async def test_a_destination_no_client_of_ours_would_send() -> None:
    async with connected() as robot:
        motion = AsyncSmartServo()
        await robot.move_async(motion)
        runtime = await motion.get_runtime()
        number = next(iter(robot.session.motions))
        done = await asked(robot, lambda request: SetDestination(request, number, None))
        assert (done.error, done.reason) == (
            RequestError.COMMAND_INVALID,
            "interpolation error: ERROR_NULL_POINTER",
        )
        await refused(runtime.update_with_realtime_system(), "interpolation error: ERROR_NULL_POINTER")


async def test_a_ptp_that_would_leave_its_straight_line(monkeypatch: pytest.MonkeyPatch) -> None:
    class Crooked:
        def __init__(self, joints: int, cycle_s: float) -> None:
            self._solver = Ruckig(joints, cycle_s)

        def calculate(self, request: InputParameter, trajectory: Trajectory) -> Result:
            request.synchronization = Synchronization.No
            request.max_velocity = [0.5] * 7
            return self._solver.calculate(request, trajectory)

    async with connected() as robot:
        start = start_position(robot)
        monkeypatch.setattr(planner, "Ruckig", Crooked)
        motion = AsyncPTP((0.4, start[1] + 0.1, *start[2:]))
        await refused(robot.move(motion), "interpolation error: ERROR_NO_PHASE_SYNCHRONIZATION")


async def test_runtime_before_and_long_after() -> None:
    async with connected() as robot:
        start = start_position(robot)
        early = AsyncSmartServo()
        for call in (early.get_runtime, early.stop_motion):
            with pytest.raises(IllegalStateException) as caught:
                await call()
            assert str(caught.value) == NOT_ACTIVE
        await robot.move_async(AsyncSmartServo((1.0, *start[1:])))
        second, third = AsyncSmartServo(), AsyncSmartServo()
        await robot.move_async(second)
        await robot.move_async(third)
        await second.get_runtime()
        with pytest.raises(IllegalStateException) as caught:
            await third.get_runtime(timeout_s=0.2)
        assert str(caught.value) == "waitForTransferred timeout to become activated in realtime-system"
        assert await third.stop_motion()
        assert not await third.stop_motion()


def test_every_reason_of_this_part_has_the_manuals_words() -> None:
    assert {reason.value for reason in ErrorReason} >= {
        "tracking error",
        "speed limit exceeded",
        "checkAxisTorqueLimit",
        "msr T1 illegal speed limit detected",
        "cmd T1 illegal speed limit detected",
        "directServo: Target Outside accepted Delta",
        "directServo: Target Outside Joint Limit",
        "interpolation error: RML_ERROR_POSITIONAL_LIMITS",
        "interpolation error: ERROR_INVALID_INPUT_VALUES",
        "interpolation error: ERROR",
        "interpolation error: ERROR_EXECUTION_TIME_CALCULATION",
        "interpolation error: ERROR_SYNCHRONIZATION",
        "interpolation error: ERROR_NUMBER_OF_DOFS",
        "interpolation error: ERROR_NO_PHASE_SYNCHRONIZATION",
        "interpolation error: ERROR_NULL_POINTER",
        "interpolation error: ERROR_EXECUTION_TIME_TOO_BIG",
        "interpolation error: RML_ERROR_USER_TIME_OUT_OF_RANGE",
        "interpolation error: RML_ERROR_OVERRIDE_OUT_OF_RANGE",
    }
