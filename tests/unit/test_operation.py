"""The operator's side in the whole controller: pausing, waiting, modes, stops and drives; on both links."""

import itertools
import math
import random
from collections.abc import Callable

import pytest

from backends.mujoco import MujocoBackend
from backends.robots import load_pinocchio, robot_names
from hil.core.events import ArmStopped, DrivesChanged, OperatorActed
from hil.core.model import ArmModel
from hil.core.motion.executive import Phase
from hil.values.arm import ArmState
from hil.values.fri import ControlMode, DriveState, OperationMode, SafetyState, SessionState
from hil.values.motion import ErrorReason, Fault, MotionEnd, MotionKind, MotionParameters, MotionPhase
from hil.values.operator import PadKey, ProgramState, SetOverride, StopCategory
from hil.values.robot import RobotDescription, Seven
from hil.values.servo import (
    Request,
    RequestDone,
    RequestError,
    SetDestination,
    SetRuntimeParameters,
    StartMotion,
    StopMotion,
)
from tests.support.cases import cases
from tests.support.servo_virtual import Application, ServoBench, offset
from tests.support.virtual import Bench, RecordingBackend

K = PadKey
T1, T2, AUT = OperationMode.T1, OperationMode.T2, OperationMode.AUT
SLOW = MotionParameters(joint_velocity_rel=0.1)
WAITING = SLOW
RUNNING_ON = MotionParameters(joint_velocity_rel=0.1, wait_for_pause=False)
ALL_OFF = (DriveState.OFF,) * 7
ALL_ACTIVE = (DriveState.ACTIVE,) * 7


def joined(mode: OperationMode = T1, *, enabled: bool = True, watchdog_ms: int = 1000) -> Application:
    application = Application(ServoBench(mode=mode, enabled=enabled), watchdog_ms=watchdog_ms)
    application.join()
    return application


def start_of(application: Application) -> tuple[float, ...]:
    return application.bench.description.initial_position_rad


def moving(application: Application, parameters: MotionParameters = SLOW) -> int:
    """Start a SmartServo to far away, and let it get going."""
    number = application.start(MotionKind.SMART_SERVO, offset(start_of(application), A4=0.6), parameters)
    application.run(0.5)
    assert stands(application) is False
    return number


def stands(application: Application) -> bool:
    commanded = application.bench.commanded(3)
    return commanded[-1] == commanded[-2]


def program(bench: Bench | ServoBench) -> ProgramState:
    return bench.controller.operator.program


def drives(application: Application) -> tuple[DriveState, ...]:
    return application.bench.backend.read().drive_states


def later(application: Application, *requests: Request) -> list[RequestDone]:
    """Send requests and return what became of them within two cycles."""
    application.command(*requests)
    application.bench.cycle()
    application.command()
    application.bench.cycle()
    numbers = [request.number for request in requests]
    return [done for done in application.done if done.request in numbers]


@pytest.mark.parametrize("mode", [T1, T2])
@pytest.mark.parametrize("key", [K.RELEASE, K.PAUSE])
def test_a_released_key_pauses_the_motion_and_start_lets_it_go_on(mode: OperationMode, key: PadKey) -> None:
    application = joined(mode)
    bench = application.bench
    number = moving(application)
    bench.press(key)
    application.run(0.5)
    assert stands(application)
    assert application.motion(number).phase is MotionPhase.ACTIVE
    assert not application.ends
    assert not bench.controller.stops
    assert drives(application) == (ALL_OFF if key is K.RELEASE else ALL_ACTIVE)
    here = bench.commanded(3)[-1]
    if key is K.RELEASE:
        bench.press(K.ENABLE)
        application.run(1.0)
        assert drives(application) == ALL_ACTIVE
    application.run(1.0)
    assert bench.commanded(3)[-1] == here, "nothing resumes by itself"
    bench.press(K.START)
    application.run(10.0)
    assert bench.commanded(3)[-1] == start_of(application)[3] + 0.6


def test_a_pause_in_aut_needs_only_the_start_key() -> None:
    application = joined(AUT, enabled=False)
    moving(application)
    application.bench.press(K.RELEASE)
    application.run(0.2)
    assert not stands(application)
    application.bench.press(K.PAUSE)
    application.run(0.5)
    assert stands(application)
    application.bench.press(K.START)
    application.run(0.3)
    assert not stands(application)


@pytest.mark.parametrize("enabled", [False, True])
def test_t1_begins_with_dropped_drives_unless_it_is_enabled(enabled: bool) -> None:
    application = joined(T1, enabled=enabled)
    application.run(0.1)
    assert drives(application) == (ALL_ACTIVE if enabled else ALL_OFF)
    number = application.start(MotionKind.PTP, offset(start_of(application), A4=0.02))
    application.run(1.0)
    moved = application.bench.commanded(3)[-1] != start_of(application)[3]
    assert moved is enabled
    if not enabled:
        assert application.motion(number).phase is MotionPhase.QUEUED, "the runtime of a paused program times out"
        assert application.bench.press(K.ENABLE, K.START) == []
        application.run(2.0)
        assert application.bench.commanded(3)[-1] == start_of(application)[3] + 0.02
        states = [event.state for event in application.bench.events if isinstance(event, DrivesChanged)]
        assert states == [DriveState.OFF, DriveState.TRANSITIONING, DriveState.ACTIVE]


def test_a_destination_waits_for_the_end_of_the_pause() -> None:
    application = joined()
    bench = application.bench
    number = moving(application, WAITING)
    bench.press(K.PAUSE)
    application.run(0.5)
    goal = offset(start_of(application), A4=0.1)
    assert later(application, SetDestination(100, number, goal)) == []
    application.run(1.0)
    assert [done for done in application.done if done.request == 100] == []
    bench.press(K.START)
    application.run(0.005)
    [done] = [done for done in application.done if done.request == 100]
    assert done.error is RequestError.NONE
    application.run(8.0)
    assert bench.commanded(3)[-1] == goal[3]


def test_without_waiting_the_application_is_answered_at_once() -> None:
    application = joined()
    bench = application.bench
    number = moving(application, RUNNING_ON)
    bench.press(K.PAUSE)
    application.run(0.5)
    goal = offset(start_of(application), A4=0.1)
    [done] = later(application, SetDestination(100, number, goal))
    assert done.error is RequestError.NONE
    application.run(0.5)
    assert stands(application)
    bench.press(K.START)
    application.run(8.0)
    assert bench.commanded(3)[-1] == goal[3]


def test_a_newer_destination_replaces_one_that_waits() -> None:
    application = joined()
    number = moving(application)
    application.bench.press(K.PAUSE)
    application.run(0.5)
    goals = [offset(start_of(application), A4=0.1 * place) for place in range(1, 4)]
    for place, goal in enumerate(goals):
        done = later(application, SetDestination(100 + place, number, goal))
        assert done == []
    answered = [done.request for done in application.done if done.request >= 100]
    assert answered == [100, 101]
    application.bench.press(K.START)
    application.run(8.0)
    assert application.bench.commanded(3)[-1] == goals[-1][3]


def test_stopping_and_not_waiting_any_more_release_what_waits() -> None:
    for release in (
        StopMotion,
        lambda number, motion: SetRuntimeParameters(number, motion, wait_for_pause=False),
    ):
        application = joined()
        number = moving(application)
        application.bench.press(K.PAUSE)
        application.run(0.5)
        goal = offset(start_of(application), A4=0.1)
        assert later(application, SetDestination(100, number, goal)) == []
        [first, second] = later(application, SetDestination(100, number, goal), release(101, number))
        assert (first.request, second.request) == (100, 101)
        assert second.error is RequestError.NONE
        application.run(0.3)
        assert stands(application)


@pytest.mark.parametrize("key", [K.EMERGENCY_STOP, None])
def test_a_stop_during_a_pause_answers_what_waits_with_its_reason(key: PadKey | None) -> None:
    application = joined()
    number = moving(application)
    application.bench.press(K.PAUSE)
    application.run(0.5)
    assert later(application, SetDestination(100, number, start_of(application))) == []
    if key is None:
        application.bench.select(AUT)
    else:
        application.bench.press(key)
    application.run(0.01)
    [done] = [done for done in application.done if done.request == 100]
    assert done.error is RequestError.COMMAND_INVALID
    assert done.reason in {"the emergency stop was pressed", "the operation mode was changed"}
    assert application.ends[0].end is MotionEnd.FAILED


@pytest.mark.parametrize("kind", list(MotionKind))
def test_the_emergency_stop_brakes_and_drops_and_asks_for_everything_anew(kind: MotionKind) -> None:
    application = joined(AUT)
    bench = application.bench
    goal = offset(start_of(application), A4=0.06)
    application.start(kind, goal, SLOW)
    application.run(0.3)
    bench.press(K.EMERGENCY_STOP)
    braking = 0
    while not stands(application):
        application.run(0.001)
        braking += 1
    assert braking < 300
    application.run(0.1)
    assert drives(application) == ALL_OFF
    [stop] = bench.controller.stops
    assert (stop.category, stop.reason) == (StopCategory.BRAKE_AND_DROP, "the emergency stop was pressed")
    [end] = application.ends
    assert end.reason == "the emergency stop was pressed"
    view = application.states[-1].snapshot.operator
    assert (view.program, view.safety_state) == (ProgramState.EMERGENCY_STOP, SafetyState.SAFETY_STOP_LEVEL_1)
    [done] = application.ask(lambda number: StartMotion(number, kind, SLOW, goal))
    assert done.error is RequestError.ILLEGAL_STATE
    assert "hil pad reset" in done.reason
    here = bench.commanded(3)[-1]
    for key in (K.RESET, K.START):
        assert bench.press(key) == []
        application.run(1.0)
        assert bench.commanded(3)[-1] == here, "a stopped motion does not come back"
    application.start(kind, goal, SLOW)
    application.run(3.0)
    assert bench.commanded(3)[-1] == goal[3]


@pytest.mark.parametrize(("old", "new"), [(AUT, T1), (T2, T1), (T1, AUT), (T1, T2)])
def test_another_mode_stops_what_moves(old: OperationMode, new: OperationMode) -> None:
    application = joined(old)
    moving(application)
    application.bench.select(new)
    application.run(0.5)
    assert stands(application)
    [end] = application.ends
    assert end.reason == "the operation mode was changed"
    assert end.detail == f"{old.name} -> {new.name}"
    assert program(application.bench) is ProgramState.STOPPED
    assert application.states[-1].snapshot.operator.mode is new


def test_another_mode_at_rest_only_needs_a_start() -> None:
    application = joined(T1)
    application.bench.select(AUT)
    assert program(application.bench) is ProgramState.PAUSED
    assert not application.bench.controller.stops
    assert application.bench.press(K.START) == []
    application.start(MotionKind.PTP, offset(start_of(application), A4=0.02))
    application.run(1.0)
    assert application.bench.commanded(3)[-1] == start_of(application)[3] + 0.02


def test_what_brakes_from_a_faster_mode_brakes_as_rated_and_not_within_a_cycle() -> None:
    application = joined(AUT)
    limits = application.bench.description.limits
    application.start(MotionKind.PTP, offset(start_of(application), A1=1.2))
    application.run(0.6)
    application.bench.select(T1)
    application.run(1.0)
    speeds = [command.velocity_rad_s[0] for command in application.bench.backend.commands]  # type: ignore[attr-defined]
    changes = [(there - here) / 1e-3 for here, there in itertools.pairwise(speeds)]
    assert max(speeds) > 1.0
    assert max(map(abs, changes)) <= 1.01 * limits.acceleration_rad_s2[0]
    assert len(application.bench.controller.stops) == 1


def test_a_ptp_plans_itself_slow_enough_for_t1() -> None:
    for goal in (
        {"A1": 1.5},
        {"A2": 0.9, "A4": -0.8},
        {"A1": -1.0, "A2": 0.5, "A3": 0.7, "A4": 0.6, "A5": -0.5, "A6": -0.9, "A7": 1.0},
    ):
        for robot in ("lbr-iiwa-7-r800", "lbr-iiwa-14-r820"):
            application = Application(ServoBench(mode=T1, robot=robot))
            application.join()
            point = offset(start_of(application), **goal)
            application.start(MotionKind.PTP, point)
            application.run(12.0)
            assert application.bench.controller.motion.set_point.position_rad == point
            assert not application.bench.controller.stops
            margins = application.bench.controller.report()["margins"]
            assert isinstance(margins, dict)
            assert 0.9 < margins["T1, commanded"]["used"] <= 1.0, "not slower than it has to be"


def test_in_t1_ptps_are_not_blended() -> None:
    application = joined(T1)
    blended = MotionParameters(blending_rel=0.4)
    points = [
        offset(start_of(application), A1=0.5),
        offset(start_of(application), A1=0.5, A2=0.4),
        start_of(application),
    ]
    for point in points:
        application.start(MotionKind.PTP, point, blended)
    application.run(14.0)
    assert application.bench.controller.motion.set_point.position_rad == points[-1]
    assert [end.reason for end in application.ends] == ["the point was reached"] * 3
    assert not application.bench.controller.stops


def test_the_override_slows_applications_and_is_told() -> None:
    application = joined(AUT)
    bench = application.bench
    bench.controller.operate(SetOverride(20.0), now_ns=bench.now_ns)
    application.start(MotionKind.PTP, offset(start_of(application), A1=1.5))
    application.run(3.0)
    speeds = [command.velocity_rad_s[0] for command in bench.backend.commands]  # type: ignore[attr-defined]
    assert max(speeds) == pytest.approx(0.2 * bench.description.limits.velocity_rad_s[0], rel=1e-6)
    assert application.states[-1].snapshot.operator.override_percent == 20.0
    remaining_s = application.states[-1].snapshot.motions[0].remaining_s
    application.run(remaining_s - 0.1)
    assert not stands(application) or bench.controller.motion.phase is Phase.APPLICATION
    application.run(0.2)
    assert bench.controller.motion.phase is Phase.HOLDING
    refusal = bench.controller.operate(SetOverride(101.0), now_ns=bench.now_ns)
    assert refusal == "program override 101 is outside its range 0 ... 100 %"


class MovedArm(RecordingBackend):
    """An arm somebody moves by hand while its drives are off."""

    def __init__(self, description: RobotDescription) -> None:
        super().__init__(description)
        self.by_rad = 0.0

    def _read(self) -> ArmState:
        state = super()._read()
        return state._replace(position_rad=offset(state.position_rad, A2=self.by_rad))  # type: ignore[arg-type]


def test_an_arm_that_was_moved_while_its_drives_were_off_does_not_go_on() -> None:
    application = Application(ServoBench(mode=T1, backend=MovedArm), watchdog_ms=1000)
    application.join()
    moving(application)
    bench = application.bench
    bench.press(K.RELEASE)
    application.run(0.5)
    assert isinstance(bench.backend, MovedArm)
    bench.backend.by_rad = 0.02
    application.run(0.1)
    bench.press(K.ENABLE, K.START)
    application.run(1.0)
    [end] = application.ends
    assert end.reason == ErrorReason.TRACKING_ERROR
    assert "A2 was moved by +0.0200 rad while its drives were off" in end.detail
    assert program(bench) is ProgramState.STOPPED


def test_a_session_may_end_while_its_motion_is_paused() -> None:
    for how in ("goodbye", "silence"):
        application = joined(T1, watchdog_ms=100)
        moving(application)
        application.bench.press(K.PAUSE)
        application.run(0.5)
        if how == "goodbye":
            application.goodbye()
        application.bench.run(0.3)
        assert application.bench.controller.motion.at_rest
        application.bench.press(K.START)
        application.bench.run(0.5)
        assert application.bench.controller.motion.at_rest
        again = Application(application.bench, nonce=8)
        again.join()
        again.start(MotionKind.PTP, offset(start_of(application), A4=0.02))
        again.run(3.0)
        assert application.bench.commanded(3)[-1] == start_of(application)[3] + 0.02


def test_the_controller_closes_from_every_state() -> None:
    for keys in ((), (K.PAUSE,), (K.RELEASE,), (K.EMERGENCY_STOP,)):
        application = joined(T1)
        moving(application)
        application.bench.press(*keys)
        application.run(0.02)
        controller = application.bench.controller
        for _ in range(1500):
            controller.close(now_ns=application.bench.now_ns)
            application.bench.cycle()
        assert controller.closed, keys
        assert application.bench.press(K.START) == ["the controller shuts down"]


def test_a_stop_is_acknowledged_when_the_arm_stands_still() -> None:
    application = joined(AUT)
    moving(application)
    assert application.bench.press(K.EMERGENCY_STOP, K.RESET) == [
        "the arm still brakes; acknowledge the stop when it stands still"
    ]
    assert program(application.bench) is ProgramState.EMERGENCY_STOP
    application.run(0.5)
    assert application.bench.press(K.RESET, K.START) == []


def test_what_the_operator_does_is_told_with_its_refusal() -> None:
    application = joined(T1, enabled=False)
    application.bench.press(K.START, K.ENABLE, K.START)
    application.run(0.01)
    told = [str(event) for event in application.bench.events if isinstance(event, OperatorActed)]
    assert told == [
        "pad: start refused: T1: the enabling switch is not held; hold it first (hil pad enable)",
        "pad: enable: the program is paused: press start (hil pad start)",
        "pad: start: motions may run",
    ]


# FRI


def commanding(mode: OperationMode = AUT) -> Bench:
    bench = Bench(mode=mode)
    bench.keep_messages = True
    bench.client.amplitude_rad = 0.01
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(1.0)
    return bench


def state_of(bench: Bench) -> SessionState:
    return bench.state


def told_by_fri(bench: Bench) -> tuple[object, ...]:
    robot = bench.monitoring[-1].robot
    assert robot is not None
    return (robot.safety_state, robot.drive_states, robot.operation_mode, robot.control_mode)


@pytest.mark.parametrize(
    ("mode", "key", "told"),
    [
        (AUT, K.PAUSE, (SafetyState.NORMAL_OPERATION, ALL_ACTIVE, AUT, ControlMode.POSITION)),
        (T1, K.PAUSE, (SafetyState.NORMAL_OPERATION, ALL_ACTIVE, T1, ControlMode.POSITION)),
        (T1, K.RELEASE, (SafetyState.SAFETY_STOP_LEVEL_1, ALL_OFF, T1, ControlMode.NO_CONTROL)),
        (T2, K.RELEASE, (SafetyState.SAFETY_STOP_LEVEL_1, ALL_OFF, T2, ControlMode.NO_CONTROL)),
        (AUT, K.EMERGENCY_STOP, (SafetyState.SAFETY_STOP_LEVEL_1, ALL_OFF, AUT, ControlMode.NO_CONTROL)),
    ],
)
def test_an_fri_client_leaves_commanding_and_is_told_the_truth(
    mode: OperationMode, key: PadKey, told: tuple[object, ...]
) -> None:
    bench = commanding(mode)
    assert told_by_fri(bench) == (SafetyState.NORMAL_OPERATION, ALL_ACTIVE, mode, ControlMode.POSITION)
    bench.press(key)
    bench.run(3.0)
    assert state_of(bench) is SessionState.MONITORING_READY
    assert told_by_fri(bench) == told
    refused = bench.report()["session"]["refused"]  # type: ignore[index]
    assert "hil pad" in refused[-1]["reason"]
    if key is K.RELEASE:
        bench.press(K.ENABLE)
    if key is K.EMERGENCY_STOP:
        bench.press(K.RESET)
    bench.run(2.0)
    assert state_of(bench) is SessionState.MONITORING_READY, "nothing resumes by itself"
    bench.press(K.START)
    bench.run(2.0)
    assert state_of(bench) is SessionState.COMMANDING_ACTIVE
    assert told_by_fri(bench) == (SafetyState.NORMAL_OPERATION, ALL_ACTIVE, mode, ControlMode.POSITION)


def test_another_mode_ends_an_overlay() -> None:
    bench = commanding(AUT)
    bench.select(T1)
    bench.run(0.5)
    assert state_of(bench) is SessionState.MONITORING_READY
    assert bench.reasons() == ["the operation mode was changed: AUT -> T1"]


def test_in_t1_an_fri_client_that_is_too_fast_is_stopped_until_it_is_acknowledged() -> None:
    bench = Bench(mode=T1)
    bench.keep_messages = True
    bench.client.amplitude_rad = 1.0
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(3.0)
    [stop] = bench.controller.stops
    assert stop.category is StopCategory.BRAKE_AND_HOLD
    assert stop.reason.startswith("cmd T1 illegal speed limit detected: ")
    assert state_of(bench) is SessionState.MONITORING_READY
    assert told_by_fri(bench)[:2] == (SafetyState.SAFETY_STOP_LEVEL_2, ALL_ACTIVE)
    model = ArmModel(load_pinocchio("lbr-iiwa-14-r820"))
    commands = bench.backend.commands  # type: ignore[attr-defined]
    assert max(model.flange_speed_mm_s(command.position_rad, command.velocity_rad_s) for command in commands) <= 250.0


@pytest.mark.parametrize("category", list(StopCategory))
def test_the_mujoco_arm_stands_still_after_each_category(category: StopCategory) -> None:
    application = Application(ServoBench(backend=MujocoBackend))
    application.join()
    application.start(MotionKind.PTP, offset(start_of(application), A1=1.2, A2=0.5))
    application.run(0.8)
    bench = application.bench
    assert max(map(abs, bench.backend.read().velocity_rad_s)) > 0.5
    bench.controller._safety.stop(Fault(ErrorReason.TRACKING_ERROR), bench.now_ns, category)
    application.run(0.5)
    state = bench.backend.read()
    assert max(map(abs, state.velocity_rad_s)) < 1e-3
    assert state.drive_states == (ALL_ACTIVE if category is StopCategory.BRAKE_AND_HOLD else ALL_OFF)
    application.run(2.0)
    after = bench.backend.read().position_rad
    assert after == pytest.approx(state.position_rad, abs=1e-4)
    assert bench.press(K.RESET, K.START) == []
    application.run(1.0)
    assert bench.backend.read().position_rad == pytest.approx(after, abs=1e-3)
    application.start(MotionKind.PTP, start_of(application))
    application.run(3.0)
    assert bench.backend.read().position_rad == pytest.approx(start_of(application), abs=1e-3)
    assert len(bench.controller.stops) == 1
    assert [event.category for event in bench.events if isinstance(event, ArmStopped)] == [category]


# Found by attack


@pytest.mark.parametrize("robot", robot_names())
def test_an_arm_at_the_end_of_a_range_is_held_there_when_its_drives_come_back(robot: str) -> None:
    application = Application(ServoBench(robot=robot, mode=T1, backend=MujocoBackend), watchdog_ms=1000)
    application.join()
    bench = application.bench
    high = bench.description.limits.position_max_rad
    application.start(MotionKind.PTP, (*start_of(application)[:3], high[3], *start_of(application)[4:]))
    application.run(8.0)
    assert bench.controller.motion.set_point.position_rad[3] == high[3]
    for _ in range(2):
        bench.press(K.RELEASE)
        application.run(0.5)
        bench.press(K.ENABLE, K.START)
        application.run(1.0)
    assert not bench.controller.stops
    application.start(MotionKind.PTP, start_of(application))
    application.run(8.0)
    assert bench.controller.motion.set_point.position_rad == start_of(application)


@pytest.mark.parametrize(("percent", "cycle_ms"), [(50.0, 1), (50.0, 4), (30.0, 5), (90.0, 2)])
def test_in_t1_no_step_is_longer_than_its_speed_says_whatever_the_override(percent: float, cycle_ms: int) -> None:
    model = ArmModel(load_pinocchio("lbr-iiwa-14-r820"))
    fastest = 0.0
    for away in range(10, 86, 3):
        application = Application(ServoBench(mode=T1, cycle_ms=cycle_ms), watchdog_ms=1000, state_period_ms=20)
        application.join()
        bench = application.bench
        bench.controller.operate(SetOverride(percent), now_ns=bench.now_ns)
        number = application.start(MotionKind.DIRECT_SERVO)
        step = away * 1e-3
        application.set_destination(number, offset(start_of(application), A1=step, A2=step, A4=-step))
        application.run(0.3)
        commands = bench.backend.commands  # type: ignore[attr-defined]
        for before, after in itertools.pairwise(commands):
            way = zip(before.position_rad, after.position_rad, strict=True)
            rate: Seven = tuple((there - here) / (cycle_ms * 1e-3) for here, there in way)
            fastest = max(fastest, model.flange_speed_mm_s(after.position_rad, rate))
    # The fastest that is legal depends on where the destinations happen to be.
    assert 215.0 < fastest <= 250.0


def test_a_stop_is_done_however_much_waits_before_it() -> None:
    application = joined()
    other = moving(application)
    second = application.start(MotionKind.SMART_SERVO)
    application.bench.press(K.PAUSE)
    application.run(0.5)
    waiting: list[Request] = [SetDestination(100, other, start_of(application))]
    waiting += [SetRuntimeParameters(101 + place, other, 0.02) for place in range(8)]
    application.command(*waiting[:6])
    application.run(0.006)
    assert application.states[-1].requests_done >= 105, "what the controller has is not sent again"
    application.command(*waiting[6:])
    application.command(StopMotion(120, second))
    application.run(0.01)
    assert {done.request for done in application.done} >= set(range(100, 109)) | {120}
    assert [end.motion for end in application.ends] == [second]


def test_a_dropped_arm_is_acknowledged_when_it_stands_still() -> None:
    application = Application(ServoBench(backend=MujocoBackend), watchdog_ms=1000)
    application.join()
    bench = application.bench
    application.start(MotionKind.PTP, offset(start_of(application), A1=1.2))
    application.run(0.9)
    assert abs(bench.backend.read().velocity_rad_s[0]) > 0.8
    bench.controller._safety.stop(Fault("somebody pulled the plug"), bench.now_ns, StopCategory.DROP)
    for _ in range(400):
        if not bench.press(K.RESET):
            break
        application.run(0.001)
    assert abs(bench.backend.read().velocity_rad_s[0]) <= 0.01
    assert drives(application) == ALL_OFF
    bench.press(K.START)
    application.run(1.0)
    assert len(bench.controller.stops) == 1


class LyingArm(RecordingBackend):
    """An arm whose measured state a test may change."""

    def __init__(self, description: RobotDescription) -> None:
        super().__init__(description)
        self.lie: Callable[[ArmState], ArmState] = lambda state: state

    def read(self) -> ArmState:
        return self.lie(super().read())


def test_nothing_that_is_not_finite_is_followed_with_dropped_drives() -> None:
    bench = ServoBench(mode=T1, enabled=False, backend=LyingArm)
    bench.run(0.1)
    assert isinstance(bench.backend, LyingArm)
    bench.backend.lie = lambda state: state._replace(position_rad=(math.nan,) * 7)
    bench.run(0.01)
    bench.backend.lie = lambda state: state
    bench.run(0.1)
    assert all(math.isfinite(sum(command.position_rad)) for command in bench.backend.commands)


def test_a_released_switch_makes_a_stop_that_holds_one_that_dropped() -> None:
    application = joined(T1)
    bench = application.bench
    bench.controller._safety.stop(Fault("held"), bench.now_ns, StopCategory.BRAKE_AND_HOLD)
    application.run(0.1)
    bench.press(K.RELEASE)
    application.run(0.1)
    told = [state.snapshot.operator.safety_state for state in application.states]
    assert told[-25] is SafetyState.SAFETY_STOP_LEVEL_2
    assert told[-1] is SafetyState.SAFETY_STOP_LEVEL_1
    assert drives(application) == ALL_OFF


def test_drives_that_stop_holding_by_themselves_are_a_stop() -> None:
    application = Application(ServoBench(backend=LyingArm), watchdog_ms=1000)
    application.join()
    bench = application.bench
    assert isinstance(bench.backend, LyingArm)
    application.start(MotionKind.SMART_SERVO, offset(start_of(application), A4=0.3), SLOW)
    application.run(0.3)
    bench.backend.lie = lambda state: state._replace(drive_states=ALL_OFF)
    application.run(0.05)
    bench.backend.lie = lambda state: state
    application.run(1.0)
    [stop] = bench.controller.stops
    assert (stop.category, stop.reason) == (StopCategory.DROP, "the drives stopped holding the arm: they are OFF")
    assert program(bench) is ProgramState.STOPPED
    assert stands(application)


@pytest.mark.parametrize("seed", range(cases(10)))
def test_ptps_behind_stopped_and_paused_ones_keep_t1(seed: int) -> None:
    rng = random.Random(seed)
    application = Application(ServoBench(mode=T1, robot=rng.choice(robot_names())), watchdog_ms=1000)
    application.join()
    bench = application.bench
    numbers = [
        application.start(MotionKind.PTP, tuple(value + rng.uniform(-0.45, 0.45) for value in start_of(application)))
        for _ in range(4)
    ]
    for number in numbers[:3]:
        application.run(rng.uniform(0.2, 2.5))
        if rng.random() < 0.5:
            bench.press(K.PAUSE)
            application.run(rng.uniform(0.01, 0.2))
            bench.press(K.START)
        if bench.controller.motion.applications.find(number) is not None:
            application.stop(number)
    application.run(15.0)
    assert [end.end for end in application.ends][-1] is MotionEnd.FINISHED
    assert not bench.controller.stops
