"""The asyncio client on loopback, against the stand-in controller."""

import asyncio
import gc
import threading
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator

import pytest

from hil.client.servo import (
    AsyncDirectServo,
    AsyncPTP,
    AsyncServoClient,
    AsyncSmartServo,
    AsyncSmartServoRuntime,
    CommandInvalidException,
    ControllerSilent,
    IllegalArgumentException,
    IllegalStateException,
    ProgramState,
    Role,
    SessionEnded,
    SessionRefused,
    UsageError,
    Vector,
)
from hil.values.servo import PROTOCOL_VERSION, Command, Refused, SetDestination, SetRuntimeParameters
from tests.support.servo_controller import FIRST, PAUSED, PRESS_START, RUNNING, START, UNIX_EPOCH_NS, StandIn
from tests.support.servo_served import PATIENCE_S, Served, served
from transport.servo import ServoCodec

KEY = bytes(range(32))


@pytest.fixture
def controller() -> Iterator[Served]:
    """A stand-in on a free port."""
    with served() as stand_in:
        yield stand_in


@pytest.fixture
async def client(controller: Served) -> AsyncIterator[AsyncServoClient]:
    """A commander."""
    async with AsyncServoClient(controller.address, name="test") as robot:
        yield robot


def hold(controller: Served) -> None:
    """Let motions reach nothing until they are told to."""
    controller.do(lambda stand_in: setattr(stand_in, "holds", True))


def arrive(controller: Served) -> None:
    controller.do(StandIn.arrive)


async def smart(client: AsyncServoClient) -> AsyncSmartServoRuntime:
    """Start a SmartServo and return its runtime."""
    motion = AsyncSmartServo()
    await client.move_async(motion)
    return await motion.get_runtime()


def raised(value: float) -> Vector:
    return (*START[:3], START[3] + value, *START[4:])


async def again_and_again(call: Callable[[], Awaitable[object]]) -> None:
    """Call until it raises."""
    while True:
        await call()


class Listener:
    """Hears of goals; ``act`` is called with the first."""

    def __init__(self, act: Callable[[], None] = lambda: None) -> None:
        self.heard: list[tuple[str, Vector, tuple[int, int]]] = []
        self.came = asyncio.Event()
        self._act = act

    def on_goal_reached_event(self, state: str, current_axis_pos: Vector, os_timestamp: tuple[int, int]) -> None:
        self.heard.append((state, current_axis_pos, os_timestamp))
        self.came.set()
        self._act()


async def test_a_whole_session(controller: Served) -> None:
    async with AsyncServoClient(controller.address, name="whole") as robot:
        assert robot.read_state().measured_position == START
        await robot.move(AsyncPTP(raised(0.1)))
        assert robot.read_state().measured_position == raised(0.1)
        motion = AsyncSmartServo()
        await robot.move_async(motion)
        runtime = await motion.get_runtime()
        at_ns = await runtime.set_destination(raised(0.2))
        assert runtime.get_time_stamp_of_set_realtime_destination() == at_ns
        while not runtime.is_destination_reached():
            await runtime.update_with_realtime_system()
        assert runtime.get_axis_q_msr_on_controller() == raised(0.2)
        assert str(runtime).startswith(
            f"SmartServo {FIRST + 1} ACTIVE, interpolator RESTING, remaining 0.000 s\ntiming update"
        )
        assert await runtime.stop_motion()
        assert not await runtime.stop_motion()
        assert not await motion.stop_motion()
        with pytest.raises(CommandInvalidException, match="because stopped by the application"):
            await runtime.update_with_realtime_system()
        with pytest.raises(CommandInvalidException, match="because stopped by the application"):
            await motion.wait_until_ended()
    controller.until(lambda stand_in: stand_in.left == 1)
    assert threading.active_count() == 2  # this one and the stand-in's


async def test_runtime_parameters_and_velocities(client: AsyncServoClient, controller: Served) -> None:
    runtime = await smart(client)
    await runtime.set_minimum_trajectory_execution_time(0.05)
    await runtime.activate_velocity_planning()
    await runtime.activate_wait_for_pause_during_set_destination(False)
    await runtime.set_destination(raised(0.1), [0.1] * 7)
    assert controller.do(lambda stand_in: stand_in.taken[1:]) == [
        SetRuntimeParameters(FIRST + 1, FIRST, 0.05, None, None),
        SetRuntimeParameters(FIRST + 2, FIRST, None, True, None),
        SetRuntimeParameters(FIRST + 3, FIRST, None, None, False),
        SetDestination(FIRST + 4, FIRST, raised(0.1), (0.1,) * 7),
    ]
    direct = AsyncDirectServo()
    await client.move_async(direct)
    waiting = await direct.get_runtime()
    with pytest.raises(IllegalArgumentException, match="a DirectServo takes no target velocity"):
        await waiting.set_destination(raised(0.1), [0.1] * 7)
    with pytest.raises(IllegalStateException, match="RealtimeMotion is not active"):
        await waiting.stop_motion()
    third = AsyncSmartServo()
    await client.move_async(third)
    with pytest.raises(IllegalStateException, match="waitForTransferred timeout"):
        await third.get_runtime(timeout_s=0.03)


async def test_tasks_share_a_runtime(client: AsyncServoClient, controller: Served) -> None:
    runtime = await smart(client)
    stamps = await asyncio.gather(*(runtime.set_destination(raised(place * 1e-3)) for place in range(200)))
    taken = controller.do(lambda stand_in: stand_in.taken[1:])
    # Those that were superseded before the controller had them share the outcome of a newer one.
    assert [request.position for request in taken if isinstance(request, SetDestination)][-1] == raised(0.199)
    assert len(taken) + client.session.requests.superseded >= 200
    assert stamps == sorted(stamps)


async def test_goals_are_told_and_a_handlers_error_is_raised_by_the_next_call(
    client: AsyncServoClient, controller: Served
) -> None:
    def fail() -> None:
        raise KeyError("a bug")

    hold(controller)
    runtime, listener = await smart(client), Listener(fail)
    runtime.set_goal_reached_event_handler(listener)
    at_ns = await runtime.set_destination(raised(0.1))
    arrive(controller)
    await asyncio.wait_for(listener.came.wait(), PATIENCE_S)
    state, position, (seconds, nanoseconds) = listener.heard[0]
    assert (state, position) == ("RESTING", raised(0.1))
    assert seconds * 10**9 + nanoseconds - UNIX_EPOCH_NS > at_ns
    with pytest.raises(KeyError, match="a bug") as caught:
        await runtime.update_with_realtime_system()
    assert caught.value.__notes__ == ["raised by on_goal_reached_event, in the client's own thread or task"]
    await runtime.update_with_realtime_system()


async def test_what_a_handler_raised_is_not_lost_when_the_block_ends(controller: Served) -> None:
    def fail() -> None:
        raise KeyError("a bug")

    async def block() -> None:
        async with AsyncServoClient(controller.address) as robot:
            hold(controller)
            runtime, listener = await smart(robot), Listener(fail)
            runtime.set_goal_reached_event_handler(listener)
            arrive(controller)
            await listener.came.wait()

    with pytest.raises(KeyError, match="a bug"):
        await asyncio.wait_for(block(), PATIENCE_S)


async def test_a_cancelled_wait_leaves_the_client_usable(client: AsyncServoClient) -> None:
    runtime = await smart(client)
    moving = asyncio.create_task(client.move(AsyncSmartServo()))
    await runtime.update_with_realtime_system()
    moving.cancel()
    with pytest.raises(asyncio.CancelledError):
        await moving
    await runtime.set_destination(raised(0.1))
    assert not client._open()._waiting


async def test_an_idle_client_keeps_its_session_alive(controller: Served) -> None:
    loop, enough = asyncio.get_running_loop(), asyncio.Event()

    def count(_: Command) -> None:
        if controller.controller.commands > 20:
            loop.call_soon_threadsafe(enough.set)

    controller.controller.on_command = count
    async with AsyncServoClient(controller.address, watchdog_ms=50):
        await asyncio.wait_for(enough.wait(), PATIENCE_S)


async def test_closing_ends_what_other_tasks_wait_for(controller: Served) -> None:
    client = AsyncServoClient(controller.address)
    await client.connect()
    moving = asyncio.create_task(client.move(AsyncSmartServo()))
    while not client.read_state().motions:
        await client.wait_for_state()
    await client.close()
    with pytest.raises(SessionEnded, match="the application closed it"):
        await moving
    await client.close()
    with pytest.raises(UsageError, match="not open"):
        client.read_state()
    with pytest.raises(UsageError, match="not open"):
        await client.wait_for_state()


async def test_a_client_connects_again(controller: Served) -> None:
    client = AsyncServoClient(controller.address)
    for session in range(1, 3):
        async with client:
            await (await smart(client)).set_destination(raised(0.1))
        controller.until(lambda stand_in, left=session: stand_in.left == left)  # type: ignore[misc]


async def test_a_session_the_controller_ends(client: AsyncServoClient, controller: Served) -> None:
    runtime = await smart(client)
    controller.do(lambda stand_in: stand_in.end("the operator took over"))
    with pytest.raises(SessionEnded, match="is over: the operator took over"):
        await again_and_again(runtime.update_with_realtime_system)
    with pytest.raises(SessionEnded):
        client.read_state()
    with pytest.raises(SessionEnded):
        await client.wait_for_state()


async def test_a_controller_that_falls_silent(controller: Served) -> None:
    async with AsyncServoClient(controller.address, watchdog_ms=20) as client:
        runtime = await smart(client)
        controller.deaf = True
        with pytest.raises(SessionEnded, match="over: nothing was heard of the controller for 1 s"):
            await runtime.set_destination(START)


async def paused(client: AsyncServoClient, controller: Served) -> AsyncSmartServoRuntime:
    """Start a motion, let go of the start key, and let the client know."""
    runtime = await smart(client)
    controller.do(StandIn.pause)
    while client.operator.program is not ProgramState.PAUSED:
        await client.wait_for_state()
    return runtime


async def waits(client: AsyncServoClient, controller: Served) -> None:
    """Let states come until the controller has what waits for its pause."""
    while not controller.do(lambda stand_in: stand_in.waiting):
        await client.wait_for_state()


async def test_a_destination_waits_while_the_program_is_paused(client: AsyncServoClient, controller: Served) -> None:
    assert client.operator == RUNNING
    runtime = await paused(client, controller)
    assert client.operator == PAUSED
    setting = asyncio.create_task(runtime.set_destination(raised(0.1)))
    await waits(client, controller)
    for _ in range(5):
        await client.wait_for_state()
    assert not setting.done()
    controller.do(StandIn.resume)
    await asyncio.wait_for(setting, PATIENCE_S)
    assert runtime.get_current_joint_destination() == raised(0.1)


async def test_a_motion_that_does_not_wait_for_pause_is_answered_at_once(
    client: AsyncServoClient, controller: Served
) -> None:
    runtime = await paused(client, controller)
    setting = asyncio.create_task(runtime.set_destination(raised(0.1)))
    await waits(client, controller)
    await runtime.activate_wait_for_pause_during_set_destination(False)
    await asyncio.wait_for(setting, PATIENCE_S)
    await asyncio.wait_for(runtime.set_destination(raised(0.2)), PATIENCE_S)
    assert client.operator == PAUSED


async def test_stopping_a_motion_ends_what_waits_for_its_pause(client: AsyncServoClient, controller: Served) -> None:
    runtime = await paused(client, controller)
    setting = asyncio.create_task(runtime.set_destination(raised(0.1)))
    await waits(client, controller)
    assert await runtime.stop_motion()
    with pytest.raises(CommandInvalidException, match="because stopped by the application"):
        await asyncio.wait_for(setting, PATIENCE_S)
    motion = AsyncSmartServo()
    await client.move_async(motion)
    with pytest.raises(IllegalStateException, match="waitForTransferred timeout") as caught:
        await motion.get_runtime(timeout_s=0.03)
    assert caught.value.detail == PRESS_START


async def test_a_paused_controller_that_falls_silent(controller: Served) -> None:
    async with AsyncServoClient(controller.address, watchdog_ms=20, latency_budget_ms=20) as client:
        assert controller.do(lambda stand_in: stand_in.hellos[-1]).latency_budget_ms == 20
        runtime = await paused(client, controller)
        setting = asyncio.create_task(runtime.set_destination(raised(0.1)))
        await waits(client, controller)
        controller.deaf = True
        with pytest.raises(SessionEnded, match="over: nothing was heard of the controller for 1 s"):
            await asyncio.wait_for(setting, PATIENCE_S)


async def test_nobody_listens() -> None:
    with served() as stand_in:
        address = stand_in.address
    with pytest.raises(ControllerSilent, match=r"within 0\.12 s \(Connection refused\); does a controller"):
        await AsyncServoClient(address, connect_timeout_s=0.12).connect()
    gc.collect()


async def test_the_other_side_has_another_key() -> None:
    with served(key=KEY) as stand_in:
        with pytest.raises(ControllerSilent, match="with this key"):
            await AsyncServoClient(stand_in.address, connect_timeout_s=0.12).connect()
        async with AsyncServoClient(stand_in.address, key=KEY) as right:
            assert right.commander == "test"


async def test_a_refusal_has_the_controllers_words() -> None:
    refusal = Refused(PROTOCOL_VERSION, 0, "observers only", try_again=False)
    with (
        served(StandIn(ServoCodec(), refusal=refusal)) as stand_in,
        pytest.raises(SessionRefused, match="gives no session: observers only"),
    ):
        await AsyncServoClient(stand_in.address).connect()


async def test_an_observer_sees_states(controller: Served) -> None:
    async with AsyncServoClient(controller.address, role=Role.OBSERVER, state_period_ms=1) as observer:
        seen = []
        async for snapshot in observer.states():
            seen.append(snapshot.now_ns)
            if len(seen) == 5:
                break
        assert seen == sorted(set(seen))
        controller.deaf = True
        while await observer.wait_for_state(0.05) is not None:
            pass


async def test_a_failure_of_the_clients_own_task_is_told(client: AsyncServoClient) -> None:
    def fail() -> None:
        raise RuntimeError("a bug of ours")

    client._open().link.tell_goals = fail  # type: ignore[method-assign]
    with pytest.raises(SessionEnded, match=r"own task failed: RuntimeError\('a bug of ours'\)"):
        await again_and_again(client.wait_for_state)
