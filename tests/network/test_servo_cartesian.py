"""The Cartesian interface over real sockets: its errors in the manual's words, and what they leave alone."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest

from hil.client.servo import (
    AsyncDirectServo,
    AsyncPTP,
    AsyncServoClient,
    AsyncSmartServo,
    AsyncSmartServoRuntime,
    IllegalArgumentException,
    Pose,
)
from hil.config.frames import FrameConfig, ToolConfig, ToolFrameConfig
from hil.values.motion import MotionPhase
from tests.support.controller_in_loop import connected, refused, start_position

FRAME_IS_NULL = "frameOnFlange is null"
NOT_ON_FLANGE = "frameOnFlange is not frame below or equal to the flange of this robot"
BASE_IS_NULL = "base is null"
NOT_STATIC = "base is not static relative to the base of this robot"
LIMITS = "interpolation error: RML_ERROR_POSITIONAL_LIMITS"
DIRECT_LIMIT = "directServo: Target Outside Joint Limit"
TOOLS = (ToolConfig(name="gripper", z_mm=45.0, mass_kg=1.5, frame=(ToolFrameConfig(name="tip", z_mm=150.0),)),)
FRAMES = (FrameConfig(name="table", x_mm=500.0, c_deg=180.0), FrameConfig(name="hole", parent="table", x_mm=100.0))
FAR = Pose(2.5, 0.0, 0.5)


@asynccontextmanager
async def in_cell() -> AsyncIterator[AsyncServoClient]:
    """Run a controller with a tool and two reference frames, and a client of it."""
    async with connected(tools=TOOLS, frames=FRAMES) as robot:
        yield robot


async def running(robot: AsyncServoClient, frame: str = "tip") -> AsyncSmartServoRuntime:
    """Return the runtime of a SmartServo that rests where the arm is."""
    motion = AsyncSmartServo()
    await robot.move_async(motion, frame)
    return await motion.get_runtime()


async def assert_lives(runtime: AsyncSmartServoRuntime) -> None:
    """The motion takes a destination and reaches it."""
    here = runtime.get_current_cartesian_position("tip", "hole")
    there = here._replace(z_m=here.z_m + 0.01)
    await runtime.set_destination(there, "hole")
    while not runtime.is_destination_reached():
        await runtime.update_with_realtime_system()
    assert runtime.motion_state.phase is MotionPhase.ACTIVE
    reached = runtime.get_current_cartesian_position("tip", "hole")
    assert reached.distance_m(there) < 1e-6
    assert reached.angle_rad(there) < 1e-6


async def refused_at_the_call(call: Callable[[], Any], text: str) -> IllegalArgumentException:
    """Do what must be refused, awaited where it waits, and compare the text word for word."""

    async def do() -> None:
        made = call()
        if isinstance(made, Awaitable):
            await made

    with pytest.raises(IllegalArgumentException) as caught:
        await do()
    assert str(caught.value) == text
    return caught.value


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        (None, FRAME_IS_NULL),
        ("table", NOT_ON_FLANGE),
        ("base", NOT_ON_FLANGE),
        ("world", NOT_ON_FLANGE),
        ("grinder", NOT_ON_FLANGE),
    ],
)
async def test_a_frame_that_is_not_on_the_flange(frame: Any, text: str) -> None:
    async with in_cell() as robot:
        runtime = await running(robot)
        calls: tuple[Callable[[], Any], ...] = (
            lambda: runtime.get_current_cartesian_position(frame),
            lambda: runtime.get_current_cartesian_position(frame, "table"),
            lambda: runtime.get_current_cartesian_destination(frame),
            lambda: runtime.get_current_cartesian_destination(frame, "table"),
            lambda: robot.move_async(AsyncSmartServo(), frame),
            lambda: robot.move(AsyncPTP(start_position(robot)), frame),
        )
        for call in calls:
            error = await refused_at_the_call(call, text)
            assert bool(error.detail) is (frame is not None)
        await assert_lives(runtime)


@pytest.mark.parametrize(
    ("reference", "text", "detail"),
    [
        (None, BASE_IS_NULL, ""),
        ("flange", NOT_STATIC, "'flange' moves with the flange"),
        ("gripper", NOT_STATIC, "'gripper' moves with the flange"),
        ("tip", NOT_STATIC, "'tip' moves with the flange"),
        ("tabel", NOT_STATIC, "this robot has no such frame: unknown frame 'tabel'"),
    ],
)
async def test_a_reference_that_is_none_or_on_the_flange(reference: Any, text: str, detail: str) -> None:
    async with in_cell() as robot:
        runtime = await running(robot)
        here = runtime.get_current_cartesian_position("tip")
        calls: tuple[Callable[[], Any], ...] = (
            lambda: runtime.get_current_cartesian_position("tip", reference),
            lambda: runtime.get_current_cartesian_destination("tip", reference),
            lambda: runtime.set_destination(here, reference),
        )
        for call in calls:
            error = await refused_at_the_call(call, text)
            assert error.detail.startswith(detail)
            assert bool(error.detail) is bool(detail)
        assert runtime.motion_state.received == 0
        await assert_lives(runtime)


async def test_no_frame_is_checked_before_no_reference() -> None:
    async with in_cell() as robot:
        runtime = await running(robot)
        nothing: Any = None
        await refused_at_the_call(lambda: runtime.get_current_cartesian_position(nothing, nothing), FRAME_IS_NULL)


@pytest.mark.parametrize(("kind", "reason"), [(AsyncSmartServo, LIMITS), (AsyncDirectServo, DIRECT_LIMIT)])
async def test_a_pose_out_of_reach(kind: type[AsyncSmartServo | AsyncDirectServo], reason: str) -> None:
    async with in_cell() as robot:
        motion = kind()
        await robot.move_async(motion, "tip")
        runtime = await motion.get_runtime()
        error = await refused(runtime.set_destination(FAR, "table"), reason)
        assert error.detail.startswith("unreachable: the wrist centre is ")
        await refused(runtime.update_with_realtime_system(), reason)
        await assert_lives(await running(robot))


async def test_a_pose_outside_the_axis_limits() -> None:
    """Right above the foot of the arm, flange down: A4 alone would have to go beyond its range."""
    async with in_cell() as robot:
        runtime = await running(robot, "flange")
        foot = Pose.from_abc_deg((0.15, 0.0, 0.45), 0.0, 180.0, 0.0)
        error = await refused(runtime.set_destination(foot), LIMITS)
        assert error.detail.startswith("outside its limits: A")
        assert "; valid: -" in error.detail


async def test_motions_made_for_a_pose_out_of_reach_end_as_they_begin() -> None:
    async with in_cell() as robot:
        await refused(robot.move(AsyncPTP(FAR), "tip"), LIMITS)
        for motion, reason in ((AsyncSmartServo(FAR), LIMITS), (AsyncDirectServo(FAR), DIRECT_LIMIT)):
            await robot.move_async(motion, "tip")
            error = await refused(motion.get_runtime(), reason)
            assert error.detail.startswith("unreachable")
        await assert_lives(await running(robot))


async def test_a_direct_servo_pose_beyond_five_degrees() -> None:
    async with in_cell() as robot:
        motion = AsyncDirectServo()
        await robot.move_async(motion, "tip")
        runtime = await motion.get_runtime()
        here = runtime.get_current_cartesian_position("tip")
        turned = Pose.from_abc_deg((0.0, 0.0, 0.0), 6.0, 0.0, 0.0) @ here
        await refused(runtime.set_destination(turned), "directServo: Target Outside accepted Delta")


async def test_a_pose_that_is_none_is_refused_at_the_call() -> None:
    async with in_cell() as robot:
        runtime = await running(robot)
        here = runtime.get_current_cartesian_position("tip")
        hole = here._replace(rotation=(float("nan"), *here.rotation[1:]))
        for pose in (hole, here._replace(x_m=float("inf"))):
            with pytest.raises(IllegalArgumentException, match="a Pose of finite numbers in m with a rotation matrix"):
                await runtime.set_destination(pose)
        await assert_lives(runtime)


async def test_a_ptp_to_a_pose_of_a_tool_in_a_frame() -> None:
    async with in_cell() as robot:
        # The table's z axis points down, as the tip does.
        goal = robot.frames.in_base("table") @ Pose(0.05, 0.1, -0.3)
        await asyncio.wait_for(robot.move(AsyncPTP(goal), "tip"), 20)
        there = robot.read_state().flange_in_base @ robot.frames.in_flange("tip")
        assert there.distance_m(goal) < 1e-6
        assert there.angle_rad(goal) < 1e-6
        runtime = await running(robot)
        position = runtime.get_current_cartesian_position("tip", "table")
        assert position.position_m == pytest.approx((0.05, 0.1, -0.3), abs=1e-6)
