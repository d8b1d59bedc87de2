"""The blocking client on loopback, against the stand-in controller."""

import gc
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from apps._servo_sample import Sine, run_sample
from hil.client.servo import (
    PTP,
    CommandInvalidException,
    ControllerSilent,
    DirectServo,
    EndpointError,
    FineInterpolatorState,
    IllegalArgumentException,
    IllegalStateException,
    MotionPhase,
    OperatorView,
    OutOfRange,
    ProgramState,
    Role,
    ServoClient,
    SessionEnded,
    SessionRefused,
    SmartServo,
    SmartServoRuntime,
    UsageError,
    Vector,
)
from hil.values.servo import (
    PROTOCOL_VERSION,
    Command,
    Refused,
    SetDestination,
    SetRuntimeParameters,
    StartMotion,
)
from tests.support.servo_controller import (
    FIRST,
    MS,
    PAUSED,
    PRESS_START,
    ROBOT,
    RUNNING,
    SOFTWARE,
    START,
    TICKS_TO_GOAL,
    UNIX_EPOCH_NS,
    StandIn,
)
from tests.support.servo_served import PATIENCE_S, Served, served
from transport.servo import ServoCodec

KEY = bytes(range(32))
NOT_ACTIVE = "waitForTransferred called prematurely - RealtimeMotion is not active"


@pytest.fixture
def controller() -> Iterator[Served]:
    """A stand-in on a free port."""
    with served() as stand_in:
        yield stand_in
    # A thread somebody forgot shows now, in the test that forgot it.
    assert [thread.name for thread in threading.enumerate()] == ["MainThread"]


@pytest.fixture
def client(controller: Served) -> Iterator[ServoClient]:
    """A commander."""
    with ServoClient(controller.address, name="test") as robot:
        yield robot


@pytest.fixture
def held(controller: Served) -> Served:
    """The stand-in, whose motions reach nothing until they are told to."""
    controller.do(lambda stand_in: setattr(stand_in, "holds", True))
    return controller


def arrive(controller: Served) -> None:
    controller.do(StandIn.arrive)


def smart(client: ServoClient) -> SmartServoRuntime:
    """Start a SmartServo and return its runtime."""
    motion = SmartServo()
    client.move_async(motion)
    return motion.get_runtime()


def raised(value: float) -> Vector:
    return (*START[:3], START[3] + value, *START[4:])


def again_and_again(call: Callable[[], object]) -> None:
    """Call until it raises."""
    while True:
        call()


class Listener:
    """Hears of goals; ``act`` is called with the first."""

    def __init__(self, act: Callable[[], None] = lambda: None) -> None:
        self.heard: list[tuple[str, Vector, tuple[int, int]]] = []
        self.threads: list[str] = []
        self.came = threading.Semaphore(0)
        self._act = act

    def on_goal_reached_event(self, state: str, current_axis_pos: Vector, os_timestamp: tuple[int, int]) -> None:
        self.heard.append((state, current_axis_pos, os_timestamp))
        self.threads.append(threading.current_thread().name)
        try:
            self._act()
        finally:
            self.came.release()


def test_a_whole_session(controller: Served) -> None:
    with ServoClient(controller.address, name="whole") as robot:
        assert (robot.controller.software, robot.controller.robot) == (SOFTWARE, ROBOT)
        assert robot.commander == "test"
        assert robot.read_state().measured_position == START
        robot.move(PTP(raised(0.1)).set_joint_velocity_rel(0.5))
        assert robot.read_state().measured_position == raised(0.1)
        controller.do(lambda stand_in: setattr(stand_in, "holds", True))
        motion = SmartServo().set_joint_jerk(500)
        robot.move_async(motion)
        runtime = motion.get_runtime()
        at_ns = runtime.set_destination(np.array(raised(0.2)))
        assert runtime.get_time_stamp_of_set_realtime_destination() == at_ns
        assert runtime.get_current_joint_destination() == raised(0.2)
        assert (runtime.motion_state.phase, runtime.motion_state.received) == (MotionPhase.ACTIVE, 1)
        assert runtime.get_fine_ipo_state() is FineInterpolatorState.MOVING
        assert 0 < runtime.get_remaining_time() <= TICKS_TO_GOAL * 1e-3
        assert not runtime.is_destination_reached()
        arrive(controller)
        while not runtime.has_fine_ipo_goal_reached():
            runtime.update_with_realtime_system()
        assert runtime.get_remaining_time() == 0.0
        assert runtime.get_time_stamp_of_update() > at_ns
        assert runtime.get_axis_q_msr_on_controller() == runtime.get_command_result_of_interpolation() == raised(0.2)
        torque = robot.read_state().external_torque
        assert runtime.get_ext_torque_vector() == runtime.get_axis_tau_ext_msr() == torque
        assert len(torque) == 7
        assert runtime.stop_motion()
        assert not runtime.stop_motion()
        assert not motion.stop_motion()
        with pytest.raises(CommandInvalidException, match="because stopped by the application"):
            runtime.update_with_realtime_system()
    taken = controller.do(lambda stand_in: stand_in.taken)
    # Stopping what is known to have ended asks for nothing.
    assert [type(request).__name__ for request in taken] == [
        "StartMotion",
        "StartMotion",
        "SetDestination",
        "StopMotion",
    ]
    assert isinstance(taken[0], StartMotion)
    assert taken[0].parameters.joint_velocity_rel == 0.5
    controller.until(lambda stand_in: stand_in.left == 1)


def test_getters_read_the_last_update_only(client: ServoClient, held: Served) -> None:
    runtime = smart(client)
    runtime.set_destination(raised(0.1))
    before = runtime.get_time_stamp_of_update()
    arrive(held)
    while client.read_state().measured_position != raised(0.1):
        client.wait_for_state()
    assert runtime.get_time_stamp_of_update() == before
    assert runtime.get_fine_ipo_state() is FineInterpolatorState.MOVING
    runtime.update_with_realtime_system()
    assert runtime.get_fine_ipo_state() is FineInterpolatorState.RESTING
    assert runtime.get_time_stamp_of_update() > before


def test_an_update_is_sent_after_the_call(client: ServoClient, controller: Served) -> None:
    runtime = smart(client)
    for _ in range(20):
        called_ns = controller.do(lambda stand_in: stand_in.now_ns)
        runtime.update_with_realtime_system()
        assert runtime.get_time_stamp_of_update() > called_ns


def test_the_three_texts_of_a_runtime(client: ServoClient, held: Served) -> None:
    runtime = smart(client)
    runtime.set_destination(raised(0.1))
    short = str(runtime).splitlines()
    assert short[0].startswith(f"SmartServo {FIRST} ACTIVE, interpolator MOVING, remaining 0.00")
    assert short[1].startswith("timing update Controller n(1) T(")
    assert short[2].startswith("timing SetDestination n(1) T(")
    assert len(short) == 3
    runtime.set_detailed_output(2)
    longer = str(runtime).splitlines()
    assert longer[:3] == short
    assert any(line.startswith("destination [0.000000, 0.500000, 0.000000, 0.800000,") for line in longer)
    assert any(line.startswith("destinations received 1, superseded 0, executed 1") for line in longer)
    runtime.set_detailed_output(3)
    longest = str(runtime).splitlines()
    assert longest[: len(longer)] == longer
    assert any("session running: " in line and "0 requests outstanding" in line for line in longest)
    assert any(line.startswith(f"controller {SOFTWARE}, {ROBOT}, cycle 1 ms; mode AUT") for line in longest)
    for wrong in (0, 4):
        with pytest.raises(OutOfRange, match=f"detailed output {wrong} is outside its range 1, 2, 3"):
            runtime.set_detailed_output(wrong)
    runtime.stop_motion()
    assert str(runtime).startswith(f"SmartServo {FIRST} ENDED (STOPPED): stopped by the application")


def test_runtime_parameters(client: ServoClient, controller: Served) -> None:
    runtime = smart(client)
    runtime.set_minimum_trajectory_execution_time(0.05)
    runtime.activate_velocity_planning()
    runtime.activate_wait_for_pause_during_set_destination(False)
    assert controller.do(lambda stand_in: stand_in.taken[1:]) == [
        SetRuntimeParameters(FIRST + 1, FIRST, 0.05, None, None),
        SetRuntimeParameters(FIRST + 2, FIRST, None, True, None),
        SetRuntimeParameters(FIRST + 3, FIRST, None, None, False),
    ]
    with pytest.raises(OutOfRange, match="minimum trajectory execution time -1 is outside its range >= 0 s"):
        runtime.set_minimum_trajectory_execution_time(-1)
    with pytest.raises(IllegalArgumentException, match="too long for a test") as caught:
        runtime.set_minimum_trajectory_execution_time(1e9)
    assert caught.value.__notes__ == ["1e9 s"]


def test_a_target_velocity_is_for_a_smart_servo(client: ServoClient, controller: Served) -> None:
    smart(client).set_destination(raised(0.1), [0.1] * 7)
    assert controller.do(lambda stand_in: stand_in.taken[-1]) == SetDestination(
        FIRST + 1, FIRST, raised(0.1), (0.1,) * 7
    )
    direct = DirectServo()
    client.move_async(direct)
    with pytest.raises(IllegalArgumentException, match=r"^a DirectServo takes no target velocity"):
        direct.get_runtime().set_destination(raised(0.1), [0.1] * 7)
    assert len(controller.do(lambda stand_in: stand_in.taken)) == 3


def test_a_wrong_destination_ends_the_motion_and_not_the_session(client: ServoClient) -> None:
    runtime = smart(client)
    with pytest.raises(CommandInvalidException) as caught:
        runtime.set_destination([0.0] * 6)
    assert str(caught.value) == "Command is no longer active, because interpolation error: ERROR_NUMBER_OF_DOFS"
    assert caught.value.__notes__ == ["6 axes"]
    with pytest.raises(CommandInvalidException, match="ERROR_NUMBER_OF_DOFS"):
        runtime.set_destination(START)
    smart(client).set_destination(START)


def test_motions_wait_for_each_other(client: ServoClient) -> None:
    first, second, third = SmartServo(), DirectServo(), SmartServo()
    for motion in (first, second, third):
        client.move_async(motion)
    waiting = second.get_runtime()
    assert "TRANSFERRED" in str(waiting)
    with pytest.raises(IllegalStateException) as caught:
        third.get_runtime(timeout_s=0.03)
    assert str(caught.value) == "waitForTransferred timeout to become activated in realtime-system"
    with pytest.raises(IllegalStateException) as caught:
        waiting.stop_motion()
    assert str(caught.value) == NOT_ACTIVE
    assert [motion.phase for motion in client.read_state().motions] == [
        MotionPhase.ACTIVE,
        MotionPhase.TRANSFERRED,
        MotionPhase.QUEUED,
    ]
    assert first.stop_motion()
    third.get_runtime()
    assert waiting.stop_motion()


def test_a_motion_is_started_again_when_it_has_ended(client: ServoClient, controller: Served) -> None:
    motion = SmartServo()
    client.move_async(motion)
    for call in (lambda: client.move_async(motion), lambda: client.move(motion), lambda: motion.set_joint_jerk(200)):
        with pytest.raises(IllegalStateException, match="this motion runs or waits already"):
            call()
    assert not motion.wait_until_ended(0.01)
    motion.stop_motion()
    with pytest.raises(CommandInvalidException, match="stopped by the application"):
        motion.get_runtime()
    with pytest.raises(CommandInvalidException, match="stopped by the application"):
        motion.wait_until_ended()
    client.move_async(motion.set_timeout_after_goal_reach(0.002))
    assert motion.wait_until_ended(PATIENCE_S)


# Goals


def test_goals_are_told_in_the_clients_own_thread(client: ServoClient, held: Served) -> None:
    runtime, listener = smart(client), Listener()
    runtime.set_goal_reached_event_handler(listener)
    at_ns = runtime.set_destination(raised(0.1))
    arrive(held)
    assert listener.came.acquire(timeout=PATIENCE_S)
    state, position, (seconds, nanoseconds) = listener.heard[0]
    assert (state, position) == ("RESTING", raised(0.1))
    reached_ns = seconds * 10**9 + nanoseconds - UNIX_EPOCH_NS
    assert 0 <= nanoseconds < 10**9
    assert at_ns < reached_ns <= held.do(lambda stand_in: stand_in.now_ns)
    assert listener.threads == ["hil servo client"]
    runtime.set_goal_reached_event_handler(None)
    runtime.set_destination(raised(0.2))
    arrive(held)
    while not runtime.is_destination_reached():
        runtime.update_with_realtime_system()
    assert len(listener.heard) == 1


def test_goals_are_told_while_the_application_calls_without_pause(client: ServoClient, held: Served) -> None:
    runtime, listener = smart(client), Listener()
    runtime.set_goal_reached_event_handler(listener)
    arrive(held)
    while not listener.came.acquire(blocking=False):
        runtime.update_with_realtime_system()
    assert listener.threads == ["hil servo client"]


def test_a_handler_may_call_the_client(client: ServoClient, held: Served) -> None:
    def act() -> None:
        runtime.update_with_realtime_system()
        reached.append(runtime.is_destination_reached())
        runtime.set_destination(raised(len(reached) * 0.1))

    reached: list[bool] = []
    runtime, listener = smart(client), Listener(act)
    runtime.set_goal_reached_event_handler(listener)
    for _ in range(3):
        arrive(held)
        assert listener.came.acquire(timeout=PATIENCE_S)
    assert [position for _, position, _ in listener.heard] == [START, raised(0.1), raised(0.2)]
    assert reached == [True, True, True]


def test_what_a_handler_raises_the_next_call_raises(client: ServoClient, held: Served) -> None:
    def fail() -> None:
        if len(listener.heard) == 1:
            raise KeyError("a bug")

    runtime, listener = smart(client), Listener(fail)
    runtime.set_goal_reached_event_handler(listener)
    arrive(held)
    assert listener.came.acquire(timeout=PATIENCE_S)
    with pytest.raises(KeyError, match="a bug") as caught:
        again_and_again(client.wait_for_state)
    assert caught.value.__notes__ == ["raised by on_goal_reached_event, in the client's own thread or task"]
    runtime.set_destination(raised(0.2))
    arrive(held)
    assert listener.came.acquire(timeout=PATIENCE_S)


@pytest.mark.parametrize("another", [False, True])
def test_what_a_handler_raised_is_not_lost_when_the_block_ends(held: Served, another: bool) -> None:
    def fail() -> None:
        raise KeyError("a bug")

    def block() -> None:
        with ServoClient(held.address) as robot:
            runtime, listener = smart(robot), Listener(fail)
            runtime.set_goal_reached_event_handler(listener)
            arrive(held)
            assert listener.came.acquire(timeout=PATIENCE_S)
            if another:
                raise RuntimeError("another")

    with pytest.raises(RuntimeError if another else KeyError) as caught:
        block()
    assert "on_goal_reached_event" in caught.value.__notes__[0]


def test_a_handler_that_is_a_coroutine_is_refused(client: ServoClient) -> None:
    class Wrong:
        async def on_goal_reached_event(self, *_: object) -> None: ...

    with pytest.raises(IllegalArgumentException, match="is a coroutine function; a plain one is needed"):
        smart(client).set_goal_reached_event_handler(Wrong())  # type: ignore[arg-type]


# Threads


def test_one_thread_stops_what_another_waits_for(client: ServoClient) -> None:
    motion = SmartServo()
    with ThreadPoolExecutor(1) as pool:
        moving = pool.submit(client.move, motion)
        while not client.read_state().motions:
            client.wait_for_state()
        assert motion.stop_motion()
        with pytest.raises(CommandInvalidException, match="stopped by the application"):
            moving.result(PATIENCE_S)


def test_many_threads_share_a_runtime(client: ServoClient, controller: Served) -> None:
    runtime = smart(client)
    with ThreadPoolExecutor(4) as pool:
        stamps = list(pool.map(lambda place: runtime.set_destination(raised(place * 1e-3)), range(100)))
    assert len(stamps) == 100
    assert "timing SetDestination n(100)" in str(runtime)
    taken = controller.do(lambda stand_in: stand_in.taken[1:])
    assert len(taken) + client.session.requests.superseded >= 100


def test_ctrl_c_during_a_wait_leaves_the_client_usable(client: ServoClient, controller: Served) -> None:
    runtime = smart(client)
    waits = threading.Event()

    def interrupt() -> None:
        assert waits.wait(PATIENCE_S)
        os.kill(os.getpid(), signal.SIGINT)

    def starts(command: Command) -> None:
        if any(isinstance(request, StartMotion) for request in command.requests):
            waits.set()

    controller.do(lambda stand_in: setattr(stand_in, "on_command", starts))
    interrupter = threading.Thread(target=interrupt)
    interrupter.start()
    motion = SmartServo()
    with pytest.raises(KeyboardInterrupt):
        client.move(motion)
    interrupter.join()
    runtime.set_destination(raised(0.1))
    assert runtime.stop_motion()
    motion.get_runtime()
    assert motion.stop_motion()


def test_an_idle_client_keeps_its_session_alive(controller: Served) -> None:
    enough = threading.Event()

    def count(_: Command) -> None:
        if controller.controller.commands > 20:
            enough.set()

    controller.controller.on_command = count
    with ServoClient(controller.address, watchdog_ms=50):
        assert enough.wait(PATIENCE_S)


def test_closing_ends_what_other_threads_wait_for(controller: Served) -> None:
    client = ServoClient(controller.address)
    client.connect()
    with ThreadPoolExecutor(1) as pool:
        moving = pool.submit(client.move, SmartServo())
        while not client.read_state().motions:
            client.wait_for_state()
        client.close()
        with pytest.raises(SessionEnded, match="the application closed it"):
            moving.result(PATIENCE_S)
    client.close()
    with pytest.raises(UsageError, match="not open"):
        client.read_state()


def test_a_handler_may_close_the_client(held: Served) -> None:
    client = ServoClient(held.address)
    client.connect()
    runtime, listener = smart(client), Listener(client.close)
    own_thread = next(thread for thread in threading.enumerate() if thread.name == "hil servo client")
    runtime.set_goal_reached_event_handler(listener)
    arrive(held)
    assert listener.came.acquire(timeout=PATIENCE_S)
    own_thread.join(PATIENCE_S)
    with pytest.raises(UsageError, match="not open"):
        runtime.set_destination(START)


def test_a_client_connects_again(controller: Served) -> None:
    client = ServoClient(controller.address)
    motion = SmartServo()
    for session in range(1, 3):
        with client:
            client.move_async(motion)
            motion.get_runtime().set_destination(raised(0.1))
        controller.until(lambda stand_in, left=session: stand_in.left == left)  # type: ignore[misc]


# The operator


def show(controller: Served, view: OperatorView) -> None:
    controller.do(lambda stand_in: setattr(stand_in, "operator", view))


def wait_for_program(client: ServoClient, program: ProgramState) -> None:
    while client.operator.program is not program:
        assert client.wait_for_state(PATIENCE_S) is not None


def paused(client: ServoClient, controller: Served) -> None:
    """Let go of the start key, and let the client know."""
    controller.do(StandIn.pause)
    wait_for_program(client, ProgramState.PAUSED)


def test_what_the_pad_shows_is_read(client: ServoClient, controller: Served) -> None:
    assert client.operator == client.read_state().operator == RUNNING
    paused(client, controller)
    assert client.operator == PAUSED
    controller.do(StandIn.resume)
    wait_for_program(client, ProgramState.RUNNING)


def test_a_destination_waits_while_the_program_is_paused(client: ServoClient, controller: Served) -> None:
    runtime = smart(client)
    paused(client, controller)
    with ThreadPoolExecutor(1) as pool:
        setting = pool.submit(runtime.set_destination, raised(0.1))
        controller.until(lambda stand_in: bool(stand_in.waiting))
        commands = controller.do(lambda stand_in: stand_in.commands)
        controller.until(lambda stand_in: stand_in.commands > commands + 5)
        assert not setting.done()
        assert [type(request) for request in controller.do(lambda stand_in: stand_in.taken)] == [StartMotion]
        controller.do(StandIn.resume)
        setting.result(PATIENCE_S)
    assert runtime.get_current_joint_destination() == raised(0.1)
    assert runtime.motion_state.received == 1


@pytest.mark.parametrize("while_it_waits", [False, True])
def test_a_motion_that_does_not_wait_for_pause_is_answered_at_once(
    client: ServoClient, controller: Served, while_it_waits: bool
) -> None:
    runtime = smart(client)
    if not while_it_waits:
        runtime.activate_wait_for_pause_during_set_destination(False)
    paused(client, controller)
    with ThreadPoolExecutor(1) as pool:
        setting = pool.submit(runtime.set_destination, raised(0.1))
        if while_it_waits:
            controller.until(lambda stand_in: bool(stand_in.waiting))
            runtime.activate_wait_for_pause_during_set_destination(False)
        setting.result(PATIENCE_S)
    assert client.operator.program is ProgramState.PAUSED
    assert controller.do(lambda stand_in: stand_in.motions[0].destination) == raised(0.1)


def test_stopping_a_motion_ends_what_waits_for_its_pause(client: ServoClient, controller: Served) -> None:
    runtime = smart(client)
    paused(client, controller)
    with ThreadPoolExecutor(1) as pool:
        setting = pool.submit(runtime.set_destination, raised(0.1))
        controller.until(lambda stand_in: bool(stand_in.waiting))
        assert runtime.stop_motion()
        with pytest.raises(CommandInvalidException, match="because stopped by the application"):
            setting.result(PATIENCE_S)
    assert client.operator.program is ProgramState.PAUSED


def test_a_newer_destination_takes_the_place_of_one_that_waits(client: ServoClient, controller: Served) -> None:
    runtime = smart(client)
    paused(client, controller)
    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(runtime.set_destination, raised(0.1))
        controller.until(lambda stand_in: bool(stand_in.waiting))
        second = pool.submit(runtime.set_destination, raised(0.2))
        controller.until(lambda stand_in: [request.number for request in stand_in.waiting] == [FIRST + 2])
        controller.do(StandIn.resume)
        assert first.result(PATIENCE_S) == second.result(PATIENCE_S)
    taken = controller.do(lambda stand_in: stand_in.taken[1:])
    assert taken == [SetDestination(FIRST + 2, FIRST, raised(0.2))]


def test_a_paused_controller_that_falls_silent(controller: Served) -> None:
    with ServoClient(controller.address, watchdog_ms=20) as client:
        runtime = smart(client)
        paused(client, controller)
        with ThreadPoolExecutor(1) as pool:
            setting = pool.submit(runtime.set_destination, raised(0.1))
            controller.until(lambda stand_in: bool(stand_in.waiting))
            controller.deaf = True
            with pytest.raises(SessionEnded, match="over: nothing was heard of the controller for 1 s"):
                setting.result(PATIENCE_S)


def test_a_paused_controller_that_ends_the_session(client: ServoClient, controller: Served) -> None:
    runtime = smart(client)
    paused(client, controller)
    with ThreadPoolExecutor(1) as pool:
        setting = pool.submit(runtime.set_destination, raised(0.1))
        controller.until(lambda stand_in: bool(stand_in.waiting))
        controller.do(lambda stand_in: stand_in.end("the operator took over"))
        with pytest.raises(SessionEnded, match="the operator took over"):
            setting.result(PATIENCE_S)


def test_a_motion_that_cannot_begin_times_out_with_the_manuals_text_and_the_operators_reason(
    client: ServoClient, controller: Served
) -> None:
    paused(client, controller)
    motion = SmartServo()
    client.move_async(motion)
    with pytest.raises(IllegalStateException) as caught:
        motion.get_runtime(timeout_s=0.03)
    assert str(caught.value) == "waitForTransferred timeout to become activated in realtime-system"
    assert caught.value.detail == PRESS_START
    assert caught.value.__notes__ == [PRESS_START]
    controller.do(StandIn.resume)
    motion.get_runtime()


@pytest.mark.parametrize(
    ("view", "words"),
    [
        (RUNNING, "mode AUT; commander"),
        (PAUSED, f"mode AUT, program PAUSED ({PRESS_START}); commander"),
        (PAUSED._replace(reason=""), "mode AUT, program PAUSED; commander"),
        (RUNNING._replace(override_percent=12.5), "mode AUT, override 12.5 %; commander"),
        (RUNNING._replace(permissive=True), "mode AUT; PERMISSIVE: monitors only report; commander"),
    ],
    ids=["running", "paused", "no reason", "override", "permissive"],
)
def test_the_text_of_a_runtime_says_what_the_pad_shows(
    client: ServoClient, controller: Served, view: OperatorView, words: str
) -> None:
    runtime = smart(client)
    show(controller, view)
    while client.operator != view:
        client.wait_for_state()
    runtime.update_with_realtime_system()
    assert str(runtime).count("PERMISSIVE: monitors only report") == view.permissive
    runtime.set_detailed_output(3)
    [line] = [line for line in str(runtime).splitlines() if line.startswith("controller ")]
    assert f"cycle 1 ms; {words}" in line
    assert ("PERMISSIVE" in str(runtime).splitlines()[0]) is view.permissive
    runtime.stop_motion()
    assert ("PERMISSIVE" in str(runtime).splitlines()[0]) is view.permissive


def test_a_sample_says_what_the_operator_must_do(controller: Served) -> None:
    said: list[str] = []

    def say(words: str) -> None:
        said.append(words)
        if words.startswith("nothing moves yet"):
            controller.do(StandIn.resume)

    controller.do(StandIn.pause)
    sine = Sine(axis=4, amplitude_rad=0.1, frequency_hz=1.0)
    run_sample(SmartServo(), sine, controller=controller.address, key_file=None, seconds=0.05, period_s=0.0, say=say)
    assert said[1] == f"nothing moves yet, the program is PAUSED: {PRESS_START}"


def test_the_latency_budget_is_said_with_the_hello(controller: Served) -> None:
    for latency_budget_ms, said_ms in ((None, 0), (15, 15), (300, 300)):
        with ServoClient(controller.address, latency_budget_ms=latency_budget_ms):
            hello = controller.do(lambda stand_in: stand_in.hellos[-1])
        assert hello.latency_budget_ms == said_ms


def test_a_command_reflects_what_had_come_before_the_call(controller: Served) -> None:
    commands: list[Command] = []
    controller.controller.on_command = commands.append
    with ServoClient(controller.address, state_period_ms=1) as client:
        controller.do(lambda stand_in: setattr(stand_in, "state_period", 1))
        runtime = smart(client)
        for place in range(20):
            sent, ticks = controller.do(lambda stand_in: (stand_in.states_sent, stand_in.now_ns))
            # What a tick sends has left before the next one.
            controller.until(lambda stand_in, ticks=ticks: stand_in.now_ns >= ticks + 3 * MS)  # type: ignore[misc]
            runtime.set_destination(raised(place * 1e-3))
            number = controller.do(lambda stand_in: stand_in.taken[-1].number)
            [first, *_] = [c for c in commands if any(request.number == number for request in c.requests)]
            assert first.reflected_sequence >= sent


# What goes wrong


def test_a_session_the_controller_ends(client: ServoClient, controller: Served) -> None:
    runtime = smart(client)
    controller.do(lambda stand_in: stand_in.end("the operator took over"))
    with pytest.raises(SessionEnded, match="the session with the controller is over: the operator took over"):
        again_and_again(runtime.update_with_realtime_system)
    for call in (client.read_state, client.wait_for_state, runtime.stop_motion, lambda: runtime.set_destination(START)):
        with pytest.raises(SessionEnded, match="the operator took over"):
            call()


def test_a_controller_that_falls_silent(controller: Served) -> None:
    with ServoClient(controller.address, watchdog_ms=20) as client:
        runtime = smart(client)
        controller.deaf = True
        with pytest.raises(SessionEnded, match="over: nothing was heard of the controller for 1 s") as caught:
            runtime.set_destination(START)
        assert isinstance(caught.value, EndpointError)
        controller.deaf = False
        with pytest.raises(SessionEnded):
            runtime.set_destination(START)


def test_nobody_listens() -> None:
    with served() as stand_in:
        address = stand_in.address
    client = ServoClient(address, connect_timeout_s=0.12)
    with pytest.raises(ControllerSilent, match=r"within 0\.12 s \(Connection refused\); does a controller"):
        client.connect()
    gc.collect()


def test_the_other_side_has_another_key() -> None:
    with served(key=KEY) as stand_in:
        client = ServoClient(stand_in.address, connect_timeout_s=0.12, key=KEY[::-1])
        with pytest.raises(ControllerSilent, match="with this key"):
            client.connect()
        with ServoClient(stand_in.address, key=KEY) as right:
            assert right.read_state().measured_position == START


def test_a_refusal_has_the_controllers_words() -> None:
    refusal = Refused(PROTOCOL_VERSION, 0, "the arm is commanded by somebody", try_again=True)
    with served(StandIn(ServoCodec(), refusal=refusal)) as stand_in:
        client = ServoClient(stand_in.address, connect_timeout_s=0.12)
        with pytest.raises(SessionRefused, match="gives no session: the arm is commanded by somebody"):
            client.connect()


def test_an_observer_sees_states(controller: Served) -> None:
    with ServoClient(controller.address, role=Role.OBSERVER, state_period_ms=1) as observer:
        seen = [snapshot.now_ns for snapshot, _ in zip(observer.states(), range(5), strict=False)]
        assert seen == sorted(set(seen))
        assert observer.wait_for_state(PATIENCE_S) is not None
        controller.deaf = True
        while observer.wait_for_state(0.05) is not None:
            pass
    hello = controller.do(lambda stand_in: stand_in.hellos[0])
    assert (hello.role, hello.state_period_ms, hello.watchdog_ms) == (Role.OBSERVER, 1, 300)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_failure_of_the_clients_own_thread_is_told(client: ServoClient) -> None:
    def fail() -> None:
        raise RuntimeError("a bug of ours")

    assert client._pump is not None
    client._pump.link.tell_goals = fail  # type: ignore[method-assign]
    with pytest.raises(SessionEnded, match=r"own thread failed: RuntimeError\('a bug of ours'\)"):
        again_and_again(client.wait_for_state)


def test_arguments_of_the_wrong_kind_are_refused_and_the_session_lives(client: ServoClient, held: Served) -> None:
    for wrong in (None, 3, SmartServo):
        with pytest.raises(IllegalArgumentException, match="is no motion; a SmartServo, a DirectServo or a PTP"):
            client.move_async(wrong)  # type: ignore[arg-type]
    motion = SmartServo(raised(0.1))
    client.move_async(motion)
    runtime = motion.get_runtime()
    with pytest.raises(IllegalArgumentException, match="velocity planning is 'yes'; True or False is needed"):
        runtime.activate_velocity_planning("yes")  # type: ignore[arg-type]
    with pytest.raises(IllegalArgumentException, match="waiting for pause is 1; True or False is needed"):
        runtime.activate_wait_for_pause_during_set_destination(1)  # type: ignore[arg-type]
    with pytest.raises(IllegalArgumentException, match="has no method on_goal_reached_event"):
        runtime.set_goal_reached_event_handler(3)  # type: ignore[arg-type]
    runtime.activate_velocity_planning()
    assert str(runtime.get_fine_ipo_state()) == "MOVING"
    assert runtime.stop_motion()


@pytest.mark.parametrize("for_ever_s", [1e10, 1e300, float("inf")])
def test_a_timeout_longer_than_anybody_lives_is_for_ever(client: ServoClient, for_ever_s: float) -> None:
    assert client.wait_for_state(for_ever_s) is not None
    motion = PTP(START)
    client.move_async(motion)
    assert motion.wait_until_ended(for_ever_s)


def test_what_is_no_time_is_refused(client: ServoClient) -> None:
    with pytest.raises(UsageError, match="a timeout of nan s"):
        client.wait_for_state(float("nan"))
    for too_long_s in (1e308, float("inf"), float("nan")):
        with pytest.raises(OutOfRange, match="connect timeout"):
            ServoClient(connect_timeout_s=too_long_s)
