"""A controller's shell and an application in one event loop, over real sockets, with a robot side of the test's own.

That is the only way to an arm that cannot follow, and to an interpolator that fails.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest

from backends.base import InProcessBackend
from hil.client.servo import AsyncServoClient, CommandInvalidException
from hil.clock import MonotonicClock, unix_time_ns
from hil.config.frames import FrameConfig, ToolConfig
from hil.config.station import Mode, Reaction, ReactionConfig, RobotConfig, ServoConfig
from hil.core.servo.link import SERVO_LINK
from hil.runtime import robot_process
from hil.runtime.assembly import RobotParts, link_addresses, open_parts
from hil.runtime.robot_process import RobotProcess
from hil.values.robot import RobotDescription
from tests.support.processes import own_host


@asynccontextmanager
async def serving(
    *,
    mode: Mode = Mode.AUT,
    arm: Callable[[RobotDescription], InProcessBackend] | None = None,
    tools: tuple[ToolConfig, ...] = (),
    frames: tuple[FrameConfig, ...] = (),
) -> AsyncIterator[RobotProcess]:
    """Run a controller in this event loop, enabled, with the ideal arm or another one."""
    config = RobotConfig(
        backend="ideal",
        mode=mode,
        enabled=True,
        servo=ServoConfig(bind=f"{own_host()}:0"),
        reaction=ReactionConfig(profile=Reaction.IDEAL),
        tool=tools,
        frame=frames,
    )

    def with_arm(config: RobotConfig, **more: Any) -> RobotParts:
        parts = open_parts(config, **more)
        if arm is None:
            return parts
        parts.backend.close()
        own = arm(parts.description)
        own.open(period_ns=1_000_000)
        return RobotParts(parts.description, parts.model, own, parts.servo_codec)

    process = RobotProcess(
        config,
        addresses=link_addresses(config),
        clock=MonotonicClock(),
        tell=lambda _, __: None,
        on_fault=lambda: process.stop(),  # noqa: PLW0108  # there is no process yet
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(robot_process, "open_parts", with_arm)
        await process.open()
    process.start(unix_epoch_ns=unix_time_ns(), epoch_ns=MonotonicClock().now_ns())
    running = asyncio.create_task(process.run())
    try:
        yield process
    finally:
        process.stop()
        await running
        process.close()


@asynccontextmanager
async def connected(
    *,
    mode: Mode = Mode.AUT,
    arm: Callable[[RobotDescription], InProcessBackend] | None = None,
    tools: tuple[ToolConfig, ...] = (),
    frames: tuple[FrameConfig, ...] = (),
) -> AsyncIterator[AsyncServoClient]:
    """Run a controller in this event loop and a client that is connected to it over UDP."""
    async with serving(mode=mode, arm=arm, tools=tools, frames=frames) as process, application(process) as robot:
        yield robot


def application(process: RobotProcess) -> AsyncServoClient:
    """Return a client of the controller, not connected yet."""
    return AsyncServoClient(str(process.local_address(SERVO_LINK)), name="errors", state_period_ms=2)


def start_position(robot: AsyncServoClient) -> tuple[float, ...]:
    """Where the arm is."""
    return robot.read_state().measured_position


async def refused(what: Awaitable[object], reason: str) -> CommandInvalidException:
    """Await what must fail with ``reason``, and compare the text word for word."""
    with pytest.raises(CommandInvalidException) as caught:
        await what
    assert str(caught.value) == f"Command is no longer active, because {reason}"
    assert caught.value.error_reason == reason
    return caught.value
