"""Unmodified clients in virtual time: the same every time, and what cannot be is said."""

import asyncio
import math
import threading
from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

from hil.client.fri import (
    AsyncFriClient,
    Command,
    FriClient,
    FriHandler,
    FriState,
    NothingHeard,
    Quality,
    Release,
    SessionState,
)
from hil.client.pad import PadRefused
from hil.client.servo import (
    PTP,
    AsyncPTP,
    AsyncServoClient,
    CommandInvalidException,
    ControllerSilent,
    Role,
    ServoClient,
    SessionEnded,
    SmartServo,
)
from hil.testkit import Direction, NeverHappened, VirtualController, VirtualTimeOver
from hil.values.errors import EndpointError, UsageError
from tests.support.virtual_controller import controller

START = (0.0, math.radians(30.0), 0.0, math.radians(40.0), 0.0, math.radians(90.0), 0.0)
PROGRAM = ModuleType("a_program")
exec(  # noqa: S102  # a program as others write them: it sleeps, and reads clocks
    """
import time

def rest(seconds):
    time.sleep(seconds)

def read():
    return time.monotonic(), time.monotonic_ns(), time.perf_counter(), time.time()

def spin(seconds):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        pass
""",
    PROGRAM.__dict__,
)


DOOR = [{"name": "Cell", "signal": [{"name": "Door", "type": "boolean", "direction": "input"}]}]


def raised(rad: float) -> tuple[float, ...]:
    return (*START[:3], START[3] + rad, *START[4:])


class Raise(FriHandler):
    """Raises axis 4 at 0.02 rad/s."""

    raised_rad = 0.0

    def on_state_change(self, old: SessionState, new: SessionState) -> None:
        self.raised_rad = 0.0

    def command(self, state: FriState) -> Command:
        self.raised_rad += 0.02 * state.sample_time_s
        position = list(state.interpolator_position_rad)
        position[3] += self.raised_rad
        return Command(joint_position_rad=tuple(position))


def servo_program() -> list[float]:
    """A program with a PTP, and a SmartServo with destinations; the times it sees, in s."""
    seen = []
    with ServoClient("my-cabinet.example", name="a program") as robot:
        robot.move(PTP(raised(0.1)))
        motion = SmartServo()
        robot.move_async(motion)
        runtime = motion.get_runtime()
        for step in range(20):
            seen.append(runtime.set_destination(raised(0.1 + 0.002 * step)) * 1e-9)
            PROGRAM.rest(0.02)
            seen.append(PROGRAM.read()[0])
        motion.stop_motion()
    return seen


def test_a_servo_program_is_the_same_every_time() -> None:
    runs = []
    for _ in range(2):
        with controller(backend="mujoco") as made:
            made.network.arm("loss=10%", "jitter=2ms", seed=3)
            seen = servo_program()
            runs.append((seen, made.told(), made.measured_position_rad, dict(made.network.packets), made.report()))
    assert runs[0] == runs[1]
    assert runs[0][0] == sorted(runs[0][0])


def test_between_its_calls_a_servo_client_keeps_its_session_alive_and_tells_goals() -> None:
    told: list[tuple[str, float]] = []

    class Listener:
        def on_goal_reached_event(self, state: str, position: Any, stamp: tuple[int, int]) -> None:
            told.append((state, made.now_s))

    with controller(fri=None) as made, ServoClient(watchdog_ms=100) as robot:
        motion = SmartServo()
        robot.move_async(motion)
        runtime = motion.get_runtime()
        runtime.set_goal_reached_event_handler(Listener())
        runtime.set_destination(raised(0.05))
        PROGRAM.rest(5.0)
        assert [state for state, _ in told] == ["RESTING"]
        assert told[0][1] < 1.0
        assert robot.read_state().commander
        assert made.now_s > 5.0


def test_a_handler_of_goals_may_use_its_client() -> None:
    class Again:
        left = 3

        def on_goal_reached_event(self, state: str, position: Any, stamp: tuple[int, int]) -> None:
            if self.left:
                self.left -= 1
                runtime.set_destination(raised(0.01 * self.left))

    with controller(fri=None) as made, ServoClient() as robot:
        motion = SmartServo()
        robot.move_async(motion)
        runtime = motion.get_runtime()
        again = Again()
        runtime.set_goal_reached_event_handler(again)
        runtime.set_destination(raised(0.05))
        PROGRAM.rest(5.0)
        assert again.left == 0
        assert made.measured_position_rad == pytest.approx(START, abs=1e-6)


def test_what_a_handler_of_goals_raises_the_next_call_raises() -> None:
    class Broken:
        def on_goal_reached_event(self, state: str, position: Any, stamp: tuple[int, int]) -> None:
            raise RuntimeError("broken")

    with controller(fri=None), ServoClient() as robot:
        motion = SmartServo()
        robot.move_async(motion)
        runtime = motion.get_runtime()
        runtime.set_goal_reached_event_handler(Broken())
        runtime.set_destination(raised(0.05))
        PROGRAM.rest(1.0)
        with pytest.raises(RuntimeError, match="broken"):
            robot.read_state()


def test_two_servo_clients_in_one_program() -> None:
    with controller(backend="mujoco", fri=None) as made, ServoClient(name="one") as one:
        with ServoClient(name="other", role=Role.OBSERVER) as other:
            one.move(PTP(raised(0.05)))
            assert other.read_state().commander.startswith("one")
            assert other.wait_for_state(1.0) is not None
        assert made.commander.startswith("one")


def test_a_silent_controller_ends_the_session_after_a_second() -> None:
    with controller(fri=None) as made, ServoClient() as robot:
        made.network.arm("half-open=to-peer")
        before_s = made.now_s
        with pytest.raises(SessionEnded, match="nothing was heard"):
            robot.move(PTP(raised(0.5)))
        assert 1.0 <= made.now_s - before_s < 1.2


def test_a_controller_at_another_port_or_without_that_link_is_silent() -> None:
    with controller() as made:
        with pytest.raises(ControllerSilent), ServoClient("127.0.0.1:30301", connect_timeout_s=0.5):
            pass
        assert made.now_s == pytest.approx(0.5, abs=0.01)
        with pytest.raises(NothingHeard), FriClient(Raise(), release=Release.V1_15, port=30201) as client:
            client.run(duration_s=0.5)
    with controller(servo=None), pytest.raises(ControllerSilent), ServoClient(connect_timeout_s=0.5):
        pass


@pytest.mark.parametrize(("release", "period_ms"), [("1.15", 1), ("2.7", 4)])
def test_an_fri_client_runs_in_virtual_time(release: str, period_ms: int) -> None:
    with controller(fri={"release": release, "send_period_ms": period_ms}) as made:
        with FriClient(Raise(), release=Release(release)) as client:
            client.run(duration_s=3.0)
        assert made.now_s == 3.0
        assert client.session.answered == 3000 // period_ms
        assert made.quality is Quality.EXCELLENT
        assert made.session_state is SessionState.COMMANDING_ACTIVE
        assert made.measured_position_rad[3] - START[3] == pytest.approx(0.02 * 1.95, abs=0.002)


def test_an_fri_client_sees_the_controller_shut_down() -> None:
    with controller() as made:
        made.after(2.0, made.shut_down)
        with FriClient(Raise(), release=Release.V1_15) as client:
            client.run()
        assert client.session.ended
        assert made.closed
        assert 2.0 < made.now_s < 2.5


def test_an_fri_client_that_waits_for_ever_meets_the_limit() -> None:
    with controller(limit_s=2.0) as made, FriClient(Raise(), release=Release.V1_15) as client:
        with pytest.raises(VirtualTimeOver, match=r"limit of 2 s.*COMMANDING_ACTIVE"):
            client.run()
        assert made.now_s == pytest.approx(2.0, abs=0.002)


def test_one_fri_port_has_one_client() -> None:
    with (
        controller(),
        FriClient(Raise(), release=Release.V1_15),
        pytest.raises(EndpointError, match="30200 is in use"),
        FriClient(Raise(), release=Release.V1_15),
    ):
        pass


def test_datagrams_nobody_reads_are_lost_as_in_a_kernels_buffer() -> None:
    with controller() as made, FriClient(Raise(), release=Release.V1_15) as client:
        made.run(1.0)
        client.run(duration_s=0.1)
        assert client.session.received == pytest.approx(256 + 100, abs=2)


def test_a_handler_alone_answers_while_the_test_goes_on() -> None:
    with controller() as made:
        attached = made.attach_fri(Raise())
        made.run_until(lambda: made.session_state is SessionState.COMMANDING_ACTIVE)
        made.run(0.5)
        assert attached.session.answered == pytest.approx(made.now_s * 1000, abs=3)
        attached.detach()
        made.run_until(lambda: made.stops)
        assert "client lost" in str(made.last_stop)


def test_a_handler_that_waits_answers_late() -> None:
    class Slow(Raise):
        def command(self, state: FriState) -> Command:
            PROGRAM.rest(0.003)
            return super().command(state)

    with controller() as made:
        made.attach_fri(Slow())
        made.run(2.0)
        assert made.report()["packets"]["dropped"]["late"] > 10


def test_an_error_of_a_handler_reaches_the_test() -> None:
    class Broken(FriHandler):
        def monitor(self, state: FriState) -> None:
            raise RuntimeError("broken")

    with controller() as made:
        made.attach_fri(Broken())
        with pytest.raises(RuntimeError, match="broken"):
            made.run(1.0)


async def async_servo_program(made: VirtualController) -> float:
    async with AsyncServoClient() as robot:
        await robot.move(AsyncPTP(raised(0.1)))
        return made.now_s


async def async_fri_program() -> int:
    async with AsyncFriClient(Raise(), release=Release.V1_15) as client:
        await client.run(duration_s=1.0)
    return client.session.answered


def test_asyncio_clients_run_in_an_event_loop_of_virtual_time() -> None:
    async def both() -> tuple[float, int]:
        async with asyncio.TaskGroup() as group:
            servo, fri = group.create_task(async_servo_program(made)), group.create_task(async_fri_program())
        return servo.result(), fri.result()

    with controller() as made:
        arrived_s, answered = made.run_async(both())
        assert 0.1 < arrived_s < 0.5
        assert answered == pytest.approx(999, abs=2)
        assert made.now_s == pytest.approx(1.0, abs=0.02)
        assert made.measured_position_rad == pytest.approx(raised(0.1), abs=1e-6)


def test_in_virtual_time_a_program_may_still_ask_a_thread() -> None:
    async def program() -> int:
        return await asyncio.get_running_loop().run_in_executor(None, lambda: 7)

    with controller(fri=None) as made:
        assert made.run_async(program()) == 7


@pytest.mark.parametrize("program", [async_fri_program, lambda: async_servo_program(None)])  # type: ignore[arg-type]
def test_in_an_ordinary_event_loop_asyncio_clients_say_what_to_do(program: Callable[[], Any]) -> None:
    with controller(), pytest.raises(UsageError, match="run_async"):
        asyncio.run(program())


def test_sleeping_and_reading_clocks_is_virtual_for_programs_alone() -> None:
    with controller(fri=None, servo=None) as made:
        before = PROGRAM.read()
        PROGRAM.rest(30.0)
        after = PROGRAM.read()
        differences = [after[0] - before[0], (after[1] - before[1]) * 1e-9, after[2] - before[2], after[3] - before[3]]
        assert differences == pytest.approx([30.0] * 4, abs=1e-4)
        assert before[3] == pytest.approx(1_767_225_600.0, abs=0.1)
        PROGRAM.spin(0.01)
        assert made.now_s == pytest.approx(30.01, abs=1e-3)
        with pytest.raises(ValueError, match="non-negative"):
            PROGRAM.rest(-1.0)

        async def real() -> None:
            async with asyncio.timeout(0.001):
                await asyncio.get_running_loop().create_future()

        with pytest.raises(TimeoutError):
            asyncio.run(real())
    again = PROGRAM.read()
    assert abs(again[3] - before[3]) > 1000.0


def test_other_threads_have_real_time_and_no_virtual_clients() -> None:
    raised_there: list[BaseException] = []

    def elsewhere() -> None:
        PROGRAM.rest(0.0)
        try:
            with ServoClient():
                pass
        except UsageError as error:
            raised_there.append(error)

    with controller() as made:
        thread = threading.Thread(target=elsewhere)
        thread.start()
        thread.join()
        assert made.now_s == 0.0
    assert "hil_process" in str(raised_there[0])


def test_actions_come_at_their_time_and_once() -> None:
    happened: list[str] = []
    with controller(fri=None) as made, ServoClient() as robot:
        made.after(0.1, lambda: happened.append(f"{made.now_s:.3f}"))
        made.when(lambda: made.flange_speed_mm_s > 1.0, lambda: happened.append("moves"))
        made.when(lambda: made.measured_position_rad[3] > START[3] + 0.1, made.operator.emergency_stop)
        with pytest.raises(CommandInvalidException, match="emergency stop"):
            robot.move(PTP(raised(0.5)))
        assert happened == ["moves", "0.104"]
        assert made.stands or made.flange_speed_mm_s > 0.0
        assert made.never_happened() == ""
        made.when(lambda: False, made.shut_down)
        made.after(100.0, made.shut_down)
        assert "the action 100 s after" in made.never_happened()


def test_an_action_cannot_wait() -> None:
    with controller() as made:
        made.after(0.01, lambda: made.run(1.0))
        with pytest.raises(UsageError, match="cannot wait"):
            made.run(1.0)


def test_run_until_says_what_happened_instead() -> None:
    with controller() as made, pytest.raises(NeverHappened, match=r"within 0.5 s.*MONITORING_WAIT"):
        made.run_until(lambda: False, at_most_s=0.5)


@pytest.mark.parametrize("seconds", [-1.0, math.nan, math.inf])
def test_time_does_not_go_back(seconds: float) -> None:
    with controller() as made, pytest.raises(UsageError, match="0 s or more"):
        made.run(seconds)


def test_the_operator_has_a_pad() -> None:
    with controller(mode="T1", fri=None, io=DOOR) as made:
        operator = made.operator
        reasons = [made.pad.reason]
        operator.enable()
        operator.start()
        reasons.append(made.pad.reason)
        operator.override(30)
        assert made.pad.override_percent == 30.0
        operator.pause()
        reasons.append(made.pad.reason)
        operator.release()
        reasons.append(made.pad.reason)
        assert ["enabling switch" in reason for reason in reasons] == [True, False, False, True]
        operator.set_input("Cell.Door", True)
        assert made.signal("Cell.Door") is True
        with pytest.raises(UsageError, match=r"valid: Cell\.Door"):
            made.signal("Cell.Gate")
        operator.mode("AUT")
        operator.start()
        operator.emergency_stop()
        with pytest.raises(PadRefused, match="reset"):
            operator.start()
        operator.reset()
        with pytest.raises(PadRefused, match="no simulation"):
            operator.push((10.0, 0.0, 0.0))
        with pytest.raises(UsageError, match="T1, T2, AUT"):
            operator.mode("T3")
        with pytest.raises(UsageError, match="x, y and z"):
            operator.push((1.0, 2.0))


def test_a_push_moves_a_soft_arm_only() -> None:
    with controller(backend="mujoco", fri=None) as made:
        made.run(0.1)
        made.operator.push((0.0, 0.0, -50.0), duration_s=0.5)
        before = made.flange
        made.run(0.4)
        assert abs(made.flange.z_m - before.z_m) < 1e-3


def test_faults_are_armed_late_and_disarmed() -> None:
    with controller(servo=None) as made:
        made.attach_fri(Raise())
        made.run(2.0)
        made.network.arm("loss=100%:to-controller")
        made.run(0.5)
        made.network.disarm()
        made.run(0.001)
        [report] = made.network.reports()
        assert report.fired == pytest.approx(500, abs=2)
        assert {packet.direction for packet in report.packets} == {Direction.TO_CONTROLLER}
        assert "client lost" in str(made.last_stop)
        made.run(3.0)
        assert made.session_state is SessionState.COMMANDING_ACTIVE
        assert made.network.packets[Direction.TO_PEER] == pytest.approx(5500, abs=2)
        made.network.require_fired()
        made.network.arm("delay=5ms:to-peer")
        assert "never fired: delay=5ms" in made.never_happened()


def test_faults_armed_one_after_another_add_up() -> None:
    with controller(fri=None) as made, ServoClient() as robot:
        round_trips = []
        for fault in (None, "delay=10ms:to-peer", "delay=20ms:to-controller"):
            if fault is not None:
                made.network.arm(fault)
            made.run(0.1)
            before_s = made.now_s
            robot.validate_for_impedance_mode()
            round_trips.append(made.now_s - before_s)
        assert round_trips[1] - round_trips[0] == pytest.approx(0.010, abs=0.0021)
        assert round_trips[2] - round_trips[1] == pytest.approx(0.020, abs=0.0021)


@pytest.mark.parametrize("fault", ["less=3%", 5])
def test_what_is_no_fault_is_refused(fault: Any) -> None:
    with controller() as made, pytest.raises(UsageError):
        made.network.arm(fault)
