"""The reasons of the manual's chapter 10 that the monitors give, and those of a paused program, over real sockets."""

import asyncio
import re

import pytest

from backends.ideal import IdealBackend
from backends.mujoco import MujocoBackend
from hil.client.servo import (
    AsyncPTP,
    AsyncServoClient,
    AsyncSmartServo,
    AsyncSmartServoRuntime,
    ErrorReason,
    IllegalStateException,
    ProgramState,
)
from hil.config.station import Mode
from hil.runtime.robot_process import RobotProcess
from hil.values.arm import ArmState
from hil.values.operator import PadKey, Press
from hil.values.robot import RobotDescription
from tests.support.controller_in_loop import application, connected, refused, serving, start_position

PATIENCE_S = 10


class PushedArm(IdealBackend):
    """An arm that is pushed a while after its start: it moves faster than it is told."""

    def _read(self) -> ArmState:
        state = super()._read()
        return state if self._sample < 1500 else state._replace(velocity_rad_s=(1.0, *state.velocity_rad_s[1:]))


class LoadedArm(MujocoBackend):
    """An arm with a tool that is too heavy for it: 40 kg at the flange."""

    def __init__(self, description: RobotDescription) -> None:
        super().__init__(description)
        self._model.body_mass[-1] += 40.0


async def goes_on(runtime: AsyncSmartServoRuntime) -> None:
    """Keep asking until that fails."""
    while True:
        await runtime.update_with_realtime_system()


def press(process: RobotProcess, *keys: PadKey) -> list[str]:
    return [process.operate(Press(key)) for key in keys]


async def until(robot: AsyncServoClient, program: ProgramState) -> None:
    while robot.operator.program is not program:
        await robot.wait_for_state()


async def test_a_destination_that_is_too_fast_for_t1() -> None:
    async with connected(mode=Mode.T1) as robot:
        start = start_position(robot)
        motion = AsyncSmartServo().set_joint_jerk(500).override_joint_acceleration(20)
        await robot.move_async(motion)
        runtime = await motion.get_runtime()
        await runtime.set_destination((1.5, *start[1:]))
        watched = asyncio.wait_for(goes_on(runtime), PATIENCE_S)
        error = await refused(watched, "cmd T1 illegal speed limit detected")
        assert error.detail.endswith("mm/s, the limit is 250 mm/s")
        await refused(runtime.set_destination(start), "cmd T1 illegal speed limit detected")


async def test_a_ptp_in_t1_is_slow_enough_by_itself() -> None:
    async with connected(mode=Mode.T1) as robot:
        start = start_position(robot)
        goal = (0.3, *start[1:])
        await asyncio.wait_for(robot.move(AsyncPTP(goal)), PATIENCE_S)
        assert robot.read_state().commanded_position == goal


async def test_an_arm_that_is_pushed_in_t1() -> None:
    async with connected(mode=Mode.T1, arm=PushedArm) as robot:
        motion = AsyncSmartServo()
        await robot.move_async(motion)
        watched = asyncio.wait_for(goes_on(await motion.get_runtime()), PATIENCE_S)
        error = await refused(watched, "msr T1 illegal speed limit detected")
        assert "mm/s, the limit is 250 mm/s" in error.detail


async def test_a_tool_that_is_too_heavy() -> None:
    async with connected(arm=LoadedArm) as robot:
        motion = AsyncSmartServo((0.0, 1.5, 0.0, 0.0, 0.0, 0.0, 0.0))
        await robot.move_async(motion)

        async def watch() -> None:
            await goes_on(await motion.get_runtime())

        error = await refused(asyncio.wait_for(watch(), PATIENCE_S), "checkAxisTorqueLimit")
        assert re.match(r"A\d is asked for [+-]\d+\.\d Nm, its limit is \d+ Nm; 10 ms above it", error.detail)


async def test_a_stop_lets_no_motion_in_until_it_is_acknowledged_and_started() -> None:
    async with serving(mode=Mode.T1) as process, application(process) as robot:
        start = start_position(robot)
        motion = AsyncSmartServo((1.5, *start[1:])).set_joint_jerk(500).override_joint_acceleration(20)
        await robot.move_async(motion)
        await refused(asyncio.wait_for(motion.wait_until_ended(), PATIENCE_S), ErrorReason.COMMANDED_T1)
        await until(robot, ProgramState.STOPPED)
        for _ in range(2):
            with pytest.raises(IllegalStateException) as caught:
                await robot.move_async(AsyncPTP(start))
            assert str(caught.value).startswith(
                "acknowledge the stop (hil pad reset) and press start (hil pad start): the arm is stopped: cmd T1"
            )
        [refusal] = press(process, PadKey.START)
        assert "acknowledge the stop (hil pad reset) first" in refusal
        while press(process, PadKey.RESET) != [""]:
            await robot.wait_for_state()
        assert press(process, PadKey.START) == [""]
        await until(robot, ProgramState.RUNNING)
        await asyncio.wait_for(robot.move(AsyncPTP(start)), PATIENCE_S)


async def test_the_runtime_of_a_paused_program_is_not_transferred_in_time() -> None:
    async with serving(mode=Mode.T1) as process, application(process) as robot:
        start = start_position(robot)
        assert press(process, PadKey.RELEASE) == [""]
        motion = AsyncSmartServo((start[0] + 0.02, *start[1:]))
        await robot.move_async(motion)
        with pytest.raises(IllegalStateException) as caught:
            await motion.get_runtime(timeout_s=0.3)
        assert str(caught.value) == "waitForTransferred timeout to become activated in realtime-system"
        assert press(process, PadKey.ENABLE, PadKey.START) == ["", ""]
        runtime = await motion.get_runtime()
        while not runtime.is_destination_reached():
            await runtime.update_with_realtime_system()


@pytest.mark.parametrize("waits", [True, False])
async def test_set_destination_waits_for_the_end_of_a_pause_or_is_answered_at_once(waits: bool) -> None:
    async with serving(mode=Mode.T1) as process, application(process) as robot:
        start = start_position(robot)
        motion = AsyncSmartServo((start[0] + 0.2, *start[1:])).set_joint_velocity_rel(0.1)
        await robot.move_async(motion)
        runtime = await motion.get_runtime()
        await runtime.activate_wait_for_pause_during_set_destination(waits)
        press(process, PadKey.RELEASE)
        await until(robot, ProgramState.PAUSED)
        setting = asyncio.create_task(runtime.set_destination(start))
        done, _ = await asyncio.wait({setting}, timeout=0.3)
        assert bool(done) is not waits
        assert press(process, PadKey.ENABLE, PadKey.START) == ["", ""]
        await asyncio.wait_for(setting, PATIENCE_S)
        while not runtime.is_destination_reached():
            await runtime.update_with_realtime_system()
        # A pause leaves the arm a part of a cycle behind its motion.
        assert robot.read_state().commanded_position == pytest.approx(start, abs=1e-7)
