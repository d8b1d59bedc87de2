"""Each monitor stops the arm for its reason; and without it, what it is there for happens."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from backends.ideal import IdealBackend
from backends.robots import load_description, load_pinocchio
from hil.core.events import WouldHaveStopped
from hil.core.model import ArmModel
from hil.core.motion.set_point import STILL, SetPoint
from hil.core.safety.margins import MonitorName
from hil.core.safety.monitors import CATEGORIES, NOT_FINITE, PERMISSIVE
from hil.core.safety.set_point_monitors import OUTSIDE
from hil.core.safety.state_monitors import SILENT, STALE_TIME_MS, TORQUE_TIME_MS
from hil.core.settings import SafetySettings
from hil.values.arm import ArmState
from hil.values.fri import DriveState, OperationMode, SafetyState
from hil.values.motion import ErrorReason, Fault, MotionKind, MotionParameters
from hil.values.operator import PadKey, ProgramState, StopCategory
from hil.values.robot import RobotDescription, Seven
from hil.values.servo import RequestError, StartMotion
from tests.support.servo_virtual import Application, ServoBench, offset
from tests.support.virtual import RecordingBackend

ROBOT = load_description("lbr-iiwa-14-r820")
LIMITS = ROBOT.limits
MODEL = ArmModel(load_pinocchio(ROBOT.name))


class Arm(RecordingBackend):
    """The ideal arm, whose measured state can be made to lie."""

    def __init__(self, description: RobotDescription) -> None:
        super().__init__(description)
        self.lie: Callable[[ArmState], ArmState] = lambda state: state

    def read(self) -> ArmState:
        return self.lie(super().read())


class StuckArm(Arm):
    """An arm whose joints are blocked."""

    def _step(self) -> None:
        return


@dataclass
class Case:
    """A monitor, how it is provoked, what it says, and what happened if nothing stopped it."""

    monitor: MonitorName
    provoke: Callable[[Application], None]
    reason: str
    went_wrong: Callable[[Application], bool]
    arm: type[IdealBackend] = Arm
    mode: OperationMode = OperationMode.AUT


def arm_of(application: Application) -> Arm:
    arm = application.bench.backend
    assert isinstance(arm, Arm)
    return arm


def rogue(application: Application, wrong: Callable[[SetPoint, int], SetPoint], *, seconds: float = 6.0) -> None:
    """Put an interpolator behind a running motion that makes of a set point and its number what ``wrong`` says."""
    motion = application.bench.controller.motion
    application.start(MotionKind.SMART_SERVO)
    propose = motion.propose
    count = 0

    def wrongly(
        *, measured_rad: Seven, now_ns: int, started_ns: int, measured_rad_s: Seven = STILL
    ) -> SetPoint | Fault:
        nonlocal count
        proposed = propose(
            measured_rad=measured_rad, now_ns=now_ns, started_ns=started_ns, measured_rad_s=measured_rad_s
        )
        if isinstance(proposed, Fault) or motion.applications.active is None:
            return proposed
        count += 1
        return wrong(motion.set_point, count)

    motion.propose = wrongly  # type: ignore[method-assign]
    application.run(seconds)


def beyond_the_range(before: SetPoint, _count: int) -> SetPoint:
    speed = 0.8 * LIMITS.velocity_rad_s[0]
    if before.position_rad[0] > LIMITS.position_max_rad[0] + 0.1:
        return SetPoint(before.position_rad, STILL)
    return SetPoint(offset(before.position_rad, A1=speed * 1e-3), offset(STILL, A1=speed))  # type: ignore[arg-type]


def too_fast(before: SetPoint, count: int) -> SetPoint:
    if count > 20:
        return SetPoint(before.position_rad, STILL)
    return SetPoint(offset(before.position_rad, A3=1e-4), offset(STILL, A3=1.1 * LIMITS.velocity_rad_s[2]))  # type: ignore[arg-type]


def too_far(before: SetPoint, count: int) -> SetPoint:
    step = 1.1e-3 * LIMITS.velocity_rad_s[4] if count == 20 else 0.0
    return SetPoint(offset(before.position_rad, A5=-step), STILL)  # type: ignore[arg-type]


def fast_in_t1(application: Application) -> None:
    parameters = MotionParameters(joint_jerk_percent=500, acceleration_override=20)
    goal = offset(application.bench.description.initial_position_rad, A1=1.5)
    application.start(MotionKind.SMART_SERVO, goal, parameters)
    application.run(3.0)


def stuck(application: Application) -> None:
    goal = offset(application.bench.description.initial_position_rad, A2=0.5)
    application.start(MotionKind.SMART_SERVO, goal)
    application.run(3.0)


def lying(lie: Callable[[ArmState], ArmState], *, seconds: float = 0.5) -> Callable[[Application], None]:
    def provoke(application: Application) -> None:
        application.start(MotionKind.SMART_SERVO)
        application.run(0.1)
        arm_of(application).lie = lie
        application.run(seconds)

    return provoke


def overloaded(state: ArmState) -> ArmState:
    return state._replace(commanded_torque_nm=offset(STILL, A4=-1.01 * LIMITS.torque_nm[3]))  # type: ignore[arg-type]


def pushed(state: ArmState) -> ArmState:
    return state._replace(velocity_rad_s=offset(STILL, A1=1.0))  # type: ignore[arg-type]


def flange_speed(application: Application) -> float:
    return max(MODEL.flange_speed_mm_s(one.position_rad, one.velocity_rad_s) for one in arm_of(application).commands)


def largest(application: Application, axis: int, *, velocity: bool = False) -> float:
    return max(
        abs((one.velocity_rad_s if velocity else one.position_rad)[axis]) for one in arm_of(application).commands
    )


def step(application: Application, axis: int) -> float:
    positions = application.bench.commanded(axis)
    return max(abs(there - here) for here, there in itertools.pairwise(positions))


def goes_on(application: Application) -> bool:
    return application.bench.controller.operator.program is ProgramState.RUNNING


CASES = [
    Case(
        MonitorName.AXIS_RANGE,
        lambda application: rogue(application, beyond_the_range),
        OUTSIDE,
        lambda application: largest(application, 0) > LIMITS.position_max_rad[0] + 1e-9,
    ),
    Case(
        MonitorName.AXIS_VELOCITY,
        lambda application: rogue(application, too_fast),
        ErrorReason.SPEED_LIMIT,
        lambda application: largest(application, 2, velocity=True) > LIMITS.velocity_rad_s[2] * 1.01,
    ),
    Case(
        MonitorName.STEP_SIZE,
        lambda application: rogue(application, too_far),
        ErrorReason.SPEED_LIMIT,
        lambda application: step(application, 4) > LIMITS.velocity_rad_s[4] * 1.01e-3,
    ),
    Case(
        MonitorName.COMMANDED_T1,
        fast_in_t1,
        ErrorReason.COMMANDED_T1,
        lambda application: flange_speed(application) > 250.0,
        mode=OperationMode.T1,
    ),
    Case(
        MonitorName.FRESH,
        lying(lambda state: state._replace(sample=7)),
        SILENT,
        goes_on,
    ),
    Case(MonitorName.TRACKING, stuck, ErrorReason.TRACKING_ERROR, goes_on, arm=StuckArm),
    Case(MonitorName.AXIS_TORQUE, lying(overloaded), ErrorReason.AXIS_TORQUE_LIMIT, goes_on),
    Case(MonitorName.MEASURED_T1, lying(pushed), ErrorReason.MEASURED_T1, goes_on, mode=OperationMode.T1),
]
NAMES = [case.monitor.name for case in CASES]


def provoked(case: Case, *, without: bool = False) -> Application:
    bench = ServoBench(backend=case.arm, mode=case.mode)
    if without:
        bench.controller._safety.monitors._only_report = frozenset({case.monitor})
    application = Application(bench)
    application.join()
    case.provoke(application)
    return application


def test_there_is_a_case_for_every_monitor() -> None:
    assert {case.monitor for case in CASES} == PERMISSIVE
    assert set(CATEGORIES) == set(MonitorName)


@pytest.mark.parametrize("case", CASES, ids=NAMES)
def test_it_stops_the_arm_for_its_reason(case: Case) -> None:
    application = provoked(case)
    controller = application.bench.controller
    [stop] = controller.stops
    category = CATEGORIES[case.monitor]
    assert stop.category is category
    assert stop.reason.startswith(case.reason + ": ")
    assert any(character.isdigit() for character in stop.reason), "the reason has figures"
    assert not case.went_wrong(application)
    assert controller.motion.at_rest
    assert controller.operator.program is ProgramState.STOPPED
    assert controller.operator.safety_state is category.safety_state
    [end] = application.ends
    assert end.reason == case.reason
    drives = controller._arm.drive_states
    assert drives == (DriveState.ACTIVE if category is StopCategory.BRAKE_AND_HOLD else DriveState.OFF,) * 7


@pytest.mark.parametrize("case", CASES, ids=NAMES)
def test_without_it_what_it_is_there_for_happens(case: Case) -> None:
    application = provoked(case, without=True)
    assert case.went_wrong(application)
    controller = application.bench.controller
    assert controller.report()["would_have_stopped"] == {case.monitor.value: pytest.approx(1, abs=10_000)}
    [*told] = [event for event in application.bench.events if isinstance(event, WouldHaveStopped)]
    assert told
    assert all(event.monitor == case.monitor.value for event in told)
    assert len(told) <= 8, "at most one a second"
    assert str(told[0]).startswith("PERMISSIVE: would have been a stop of category ")


@pytest.mark.parametrize("case", CASES, ids=NAMES)
def test_after_it_only_an_acknowledgement_and_a_fresh_start_let_motions_run(case: Case) -> None:
    application = provoked(case)
    bench, controller = application.bench, application.bench.controller
    arm_of(application).lie = lambda state: state
    if isinstance(bench.backend, StuckArm):
        bench.backend._step = lambda: IdealBackend._step(bench.backend)  # type: ignore[method-assign, arg-type]
    vars(controller.motion).pop("propose", None)

    def refusal() -> str:
        [done] = application.ask(lambda number: StartMotion(number, MotionKind.PTP, MotionParameters(), goal))
        assert done.error in {RequestError.NONE, RequestError.ILLEGAL_STATE}
        return done.reason

    goal = offset(bench.backend.read().position_rad, A1=-0.05)
    assert case.reason in refusal()
    assert "hil pad reset" in refusal()
    [refused] = bench.press(PadKey.START)
    assert "acknowledge the stop (hil pad reset) first" in refused
    assert bench.press(PadKey.RESET) == []
    application.run(0.5)
    position = bench.backend.read().position_rad
    assert refusal() == ""
    application.run(1.0)
    assert bench.backend.read().position_rad == position, "acknowledged is not started"
    assert bench.press(PadKey.START) == []
    application.run(2.0)
    assert bench.backend.read().position_rad == goal
    assert controller.operator.safety_state is SafetyState.NORMAL_OPERATION


def test_what_is_not_finite_never_reaches_the_arm_and_is_never_only_reported() -> None:
    for value in (math.nan, math.inf, -math.inf):
        for part in range(3):

            def broken(before: SetPoint, count: int, value: float = value, part: int = part) -> SetPoint:
                parts = [before.position_rad, STILL, STILL]
                parts[part] = (*parts[part][:5], value, parts[part][6])
                return SetPoint(*parts) if count > 3 else before

            application = Application(ServoBench(backend=Arm, safety=SafetySettings(permissive=True)))
            application.join()
            rogue(application, broken, seconds=0.2)
            [stop] = application.bench.controller.stops
            assert stop.reason.startswith(ErrorReason.INVALID_INPUT_VALUES)
            assert all(math.isfinite(sum(map(sum, command[:3]))) for command in arm_of(application).commands)


@pytest.mark.parametrize("permissive", [False, True])
@pytest.mark.parametrize("value", [math.nan, math.inf])
@pytest.mark.parametrize("part", ["position_rad", "velocity_rad_s", "commanded_torque_nm"])
def test_a_measured_state_that_is_not_finite_drops_the_drives_even_at_rest(
    value: float, part: str, permissive: bool
) -> None:
    bench = ServoBench(backend=Arm, safety=SafetySettings(permissive=permissive))
    bench.run(0.1)
    assert isinstance(bench.backend, Arm)
    bench.backend.lie = lambda state: state._replace(**{part: (value, *STILL[1:])})  # type: ignore[arg-type]
    bench.run(0.1)
    [stop] = bench.controller.stops
    assert (stop.category, stop.reason) == (StopCategory.DROP, NOT_FINITE)
    assert bench.backend.read().drive_states == (DriveState.OFF,) * 7


def test_a_peak_of_torque_is_no_overload() -> None:
    bench = ServoBench(backend=Arm)
    bench.run(0.05)
    assert isinstance(bench.backend, Arm)
    for _ in range(3):
        bench.backend.lie = overloaded
        bench.run((TORQUE_TIME_MS - 1) * 1e-3)
        bench.backend.lie = lambda state: state
        bench.run(0.002)
    assert not bench.controller.stops
    bench.backend.lie = overloaded
    bench.run(TORQUE_TIME_MS * 1e-3)
    assert bench.controller.stops


def test_a_state_may_be_old_up_to_its_limit() -> None:
    bench = ServoBench(backend=Arm)
    bench.run(0.05)
    assert isinstance(bench.backend, Arm)
    sample = bench.backend.read().sample
    bench.backend.lie = lambda state: state._replace(sample=sample)
    bench.run((STALE_TIME_MS + 1) * 1e-3)
    assert not bench.controller.stops
    bench.run(0.001)
    [stop] = bench.controller.stops
    assert stop.reason == f"{SILENT}: its last state is {STALE_TIME_MS + 1} ms old, {STALE_TIME_MS} ms are allowed"


def test_margins_say_how_near_a_run_came_when_and_on_which_axis() -> None:
    application = Application(ServoBench(backend=Arm, mode=OperationMode.T1))
    application.join()
    start = application.bench.description.initial_position_rad
    application.start(MotionKind.SMART_SERVO, offset(start, A4=0.3), MotionParameters(joint_velocity_rel=0.2))
    application.run(3.0)
    report = application.bench.controller.report()
    margins = report["margins"]
    assert isinstance(margins, dict)
    t1 = margins["T1, commanded"]
    assert t1["axis"] == "A4"
    assert 0.3 < t1["used"] < 1.0
    assert margins["axis velocity"]["axis"] == "A4"
    assert margins["axis velocity"]["used"] == pytest.approx(0.2, abs=0.01)
    speeds = [MODEL.flange_speed_mm_s(one.position_rad, one.velocity_rad_s) for one in arm_of(application).commands]
    assert t1["used"] == pytest.approx(max(speeds) / 250.0, abs=1e-3)
    assert speeds.index(max(speeds)) * 1e-3 == pytest.approx(t1["at_s"], abs=2e-2)
    name, closest = max(margins.items(), key=lambda entry: entry[1]["used"])
    assert (
        report["closest"]
        == f"closest to {name}: {closest['used']:.0%} at {closest['at_s']:.1f} s, axis {closest['axis']}"
    )


def test_limits_of_a_station_are_what_the_monitors_hold_the_arm_to() -> None:
    safety = SafetySettings(t1_flange_speed_mm_s=100.0)
    application = Application(ServoBench(backend=Arm, mode=OperationMode.T1, safety=safety))
    application.join()
    fast_in_t1(application)
    [stop] = application.bench.controller.stops
    assert stop.reason.endswith("the limit is 100 mm/s")
    assert flange_speed(application) <= 100.0
