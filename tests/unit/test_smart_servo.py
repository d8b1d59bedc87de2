"""SmartServo: limits kept and destinations reached exactly at every retarget; states, dead time, faults."""

import itertools
import math
import random
from dataclasses import replace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ruckig import Result

from backends.robots import load_description, robot_names
from hil.core.motion import planner
from hil.core.motion.application_motion import Accounting
from hil.core.motion.destinations import MAX_WAITING
from hil.core.motion.motion_limits import smart_servo_limits
from hil.core.motion.set_point import STILL, SetPoint
from hil.core.motion.smart_servo import SmartServo
from hil.values.motion import ErrorReason, Fault, FineInterpolatorState, MotionKind, MotionParameters
from hil.values.robot import JOINT_COUNT
from hil.values.servo import Vector
from tests.support.cases import cases
from tests.support.interpolation import (
    FAST,
    SMART_SERVO_SETTINGS,
    START,
    Run,
    assert_in_range,
    assert_no_jump,
    assert_within,
    at,
    basis_of,
    began,
    make,
    moved,
    place,
    smart,
)

SEEDS = st.integers(0, 2**32)
SETTINGS = st.sampled_from(SMART_SERVO_SETTINGS)
ROBOTS = st.sampled_from(robot_names())
S = FineInterpolatorState


@settings(max_examples=cases(80))
@given(seed=SEEDS, robot=ROBOTS, parameters=SETTINGS, cycle_ms=st.sampled_from((1, 1, 1, 2, 5)))
def test_limits_are_kept_and_the_destination_reached_whatever_is_set_when(
    seed: int, robot: str, parameters: MotionParameters, cycle_ms: int
) -> None:
    source = random.Random(seed)
    basis = basis_of(robot, cycle_ms=cycle_ms)
    motion = SmartServo(parameters, basis=basis, destination=None)
    run = began(motion, at(place(source, basis.limits, STILL)))
    longest = source.choice((2, 30, 400))
    for _ in range(25):
        motion.set_runtime_parameters(
            minimum_execution_time_s=source.choice((0.0, 0.01, 0.01, 0.5)), velocity_planning=None, wait_for_pause=None
        )
        assert run.go_to(place(source, basis.limits, run.now.position_rad)) is None
        run.cycle(source.randint(1, longest))
    goal = place(source, basis.limits, run.now.position_rad)
    assert run.go_to(goal) is None
    run.cycle(5)
    if parameters.joint_velocity_rel > 0.1 and parameters.joint_acceleration_rel == 1.0:
        run.until(lambda: motion.interpolator is S.RESTING)
        assert run.now == SetPoint(goal, STILL, STILL)
    assert_within(run, smart_servo_limits(basis, parameters))
    assert_no_jump(run)
    assert_in_range(run)


@pytest.mark.parametrize(
    ("where", "goal", "time_s"),
    list(itertools.product(("start", "low", "high"), ("start", "low", "high"), (0.0, 1e-6, 0.01, 1.0, 20.0))),
)
def test_from_and_to_the_very_ends_of_the_range(where: str, goal: str, time_s: float) -> None:
    limits = basis_of().limits
    places = {"start": START, "low": limits.position_min_rad, "high": limits.position_max_rad}
    motion = smart(replace(FAST, minimum_execution_time_s=time_s))
    run = began(motion, at(places[where]))
    assert run.go_to(places[goal]) is None
    cycles = run.until(lambda: motion.interpolator is S.RESTING)
    assert run.now == SetPoint(places[goal], STILL, STILL)
    assert cycles * 1e-3 >= time_s - 1e-9
    assert_within(run, smart_servo_limits(motion.basis, motion.parameters))
    assert_in_range(run)


@example(seed=826)  # the way of one axis, as quick as it can be, turns round behind the end
@example(seed=1363)  # a way that waits for another axis does
@given(seed=SEEDS)
def test_no_cycle_on_the_way_to_the_ends_of_the_range_is_beyond_them(seed: int) -> None:
    """Ruckig meets a place to 1e-8 rad only, on either side of it."""
    source = random.Random(seed)
    ends = basis_of().limits.position_max_rad
    motion = smart(FAST)
    run = began(motion, at(tuple(high - source.uniform(0.0, 0.1) for high in ends)))  # type: ignore[arg-type]
    for _ in range(4):
        run.go_to(tuple(high - source.uniform(0.0, 0.1) for high in ends))
        run.cycle(source.randint(1, 100))
        run.go_to(ends)
        run.until(lambda: motion.interpolator is S.RESTING)
        assert run.now.position_rad == ends
    assert_in_range(run)


def test_an_acceleration_it_cannot_carry_is_dropped_at_the_take_over() -> None:
    limits = basis_of().limits
    fastest = limits.velocity_rad_s[0]
    start = SetPoint(START, (0.999 * fastest, 0.5, *(0.0,) * 5), (60.0, -17.0, *(0.0,) * 5))
    for goal in (moved(A1=1.5), None):
        motion = smart(destination=goal)
        run = began(motion, start)
        run.until(lambda: motion.interpolator is S.RESTING)  # noqa: B023
        assert_within(run, smart_servo_limits(motion.basis, motion.parameters), after_take_over=1)
        assert_no_jump(run)


@given(way=st.floats(1e-14, 1e-3), axis=st.integers(0, 6))
def test_the_shortest_ways(way: float, axis: int) -> None:
    motion = smart()
    run = began(motion, at())
    goal = moved(**{f"A{axis + 1}": way})
    assert run.go_to(goal) is None
    run.until(lambda: motion.interpolator is S.RESTING)
    assert run.now == SetPoint(goal, STILL, STILL)
    assert_within(run, smart_servo_limits(motion.basis, motion.parameters))


def test_the_same_calls_give_the_same_set_points() -> None:
    def path() -> list[SetPoint]:
        source = random.Random(4)
        run = began(smart(FAST), at())
        for _ in range(40):
            run.go_to(place(source, run.motion.basis.limits, run.now.position_rad))
            run.cycle(7)
        return run.set_points

    assert path() == path()


@pytest.mark.parametrize("robot", robot_names())
def test_the_fast_setting_uses_the_reserves_the_default_leaves(robot: str) -> None:
    """Manual 7.12: a step with the conservative default, and with override 20 and jerk 500 %."""

    def time_s(parameters: MotionParameters, axis: int) -> float:
        start = load_description(robot).initial_position_rad
        goal = tuple(value + (math.radians(5.0) if place == axis else 0.0) for place, value in enumerate(start))
        motion = SmartServo(parameters, basis=basis_of(robot), destination=goal)
        run = Run(motion, at(start))
        assert run.refused is None
        return run.until(lambda: motion.interpolator is S.RESTING) * 1e-3

    for axis in range(JOINT_COUNT):
        default, fast = time_s(MotionParameters(), axis), time_s(FAST, axis)
        assert 0.3 < default < 0.7, axis
        assert 0.12 < fast < 0.21, axis
        assert default > 2.0 * fast, axis


def test_all_axes_arrive_together() -> None:
    motion = smart(destination=moved(A1=0.5, A3=-0.1, A7=0.02))
    run = began(motion, at())
    run.until(lambda: motion.interpolator is S.RESTING)
    before = run.set_points[-3]
    for axis in (0, 2, 6):
        assert before.position_rad[axis] != run.now.position_rad[axis]


def test_at_rest_the_same_set_point_comes_again() -> None:
    run = began(smart(), at())
    assert run.cycle() is run.cycle()


def test_it_rests_where_it_takes_over_without_a_destination() -> None:
    motion = smart()
    run = began(motion, at())
    assert (motion.interpolator, motion.destination, motion.goals_reached) == (S.RESTING, START, 0)
    assert motion.accounting == Accounting()
    assert run.cycle(10) == at()
    assert motion.remaining_s(now_ns=run.now_ns) == 0.0


def test_without_a_destination_a_moving_arm_stops_as_soon_as_it_can_and_rests_there() -> None:
    motion = smart()
    start = SetPoint(START, (0.4, 0.0, -0.3, 0.0, 0.1, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    run = began(motion, start)
    assert motion.interpolator is S.MOVING
    promised = motion.destination
    remaining = motion.remaining_s(now_ns=0)
    cycles = run.until(lambda: motion.interpolator is S.RESTING)
    assert promised is not None
    assert run.now == SetPoint(promised, STILL, STILL)
    assert motion.goals_reached == 0
    assert cycles * 1e-3 == pytest.approx(remaining, abs=1e-3)
    assert_within(run, smart_servo_limits(motion.basis, motion.parameters))
    assert START[0] + 0.4**2 / (2 * 3.5) < run.now.position_rad[0] < START[0] + 0.1


def test_a_motion_that_cannot_stop_in_the_range_says_so() -> None:
    high = basis_of().limits.position_max_rad[1]
    start = SetPoint((0.0, high - 0.05, *(0.0,) * 5), (0.0, 1.0, *(0.0,) * 5))
    for goal in (None, (0.0,) * 7):
        refused = Run(smart(destination=goal), start).refused
        assert refused is not None
        assert refused.reason == ErrorReason.POSITIONAL_LIMITS
        assert refused.detail.startswith("A2 would go to")


def test_an_initial_destination_is_planned_without_dead_time() -> None:
    motion = smart(destination=moved(A1=0.1), dead_time_ms=18.0)
    run = began(motion, at())
    run.cycle()
    assert run.now.position_rad[0] > START[0]
    assert motion.accounting == Accounting(received=1, superseded=0, executed=1, executed_at_ns=0)


def test_a_destination_set_while_it_waits_replaces_the_one_it_was_made_with() -> None:
    motion = smart(destination=moved(A1=0.1))
    assert motion.set_destination(moved(A2=0.1), None, measured_rad=START, arrived_ns=5) is None
    assert motion.set_destination(moved(A3=0.1), None, measured_rad=START, arrived_ns=6) is None
    assert motion.set_destination((9.0,) * 7, None, measured_rad=START, arrived_ns=7) is not None
    assert (motion.destination, motion.destination_at_ns) == (moved(A3=0.1), 6)
    run = began(motion, at())
    run.until(lambda: motion.interpolator is S.RESTING)
    assert run.now.position_rad == moved(A3=0.1)
    assert motion.accounting == Accounting(received=3, superseded=2, executed=1, executed_at_ns=0)
    assert motion.goals_reached == 1


@pytest.mark.parametrize(("dead_time_ms", "cycles"), [(0.0, 1), (0.3, 1), (1.0, 1), (1.1, 2), (18.0, 18)])
def test_a_destination_is_there_in_the_first_cycle_after_its_dead_time(dead_time_ms: float, cycles: int) -> None:
    motion = smart(dead_time_ms=dead_time_ms)
    run = began(motion, at())
    run.cycle(10)
    assert run.go_to(moved(A1=0.2)) is None
    assert motion.interpolator is S.MOVING
    assert run.until(lambda: run.now.position_rad != START) == cycles
    jerk = motion.basis.servo.jerk_rad_s3[0]
    assert run.now.position_rad[0] - START[0] == pytest.approx(jerk * 1e-9 / 6, rel=1e-3)
    assert motion.accounting.executed_at_ns == run.now_ns


def test_of_destinations_due_in_one_cycle_only_the_newest_is_planned() -> None:
    motion = smart(dead_time_ms=5.0)
    run = began(motion, at())
    for step in range(4):
        assert run.go_to(moved(A1=0.1 + 0.5 * step)) is None
    run.cycle(3)
    assert run.go_to(moved(A1=0.03)) is None
    assert motion.accounting == Accounting(5, 0, 0, 0)
    run.cycle(2)
    assert motion.accounting == Accounting(5, 3, 1, run.now_ns)
    assert motion.destination == moved(A1=0.03)
    run.until(lambda: motion.interpolator is S.RESTING)
    assert motion.accounting == Accounting(5, 3, 2, 8_000_000)
    assert run.now.position_rad == moved(A1=0.03)
    assert motion.goals_reached == 1


def test_the_line_of_waiting_destinations_is_bounded() -> None:
    motion = smart(dead_time_ms=100.0)
    run = began(motion, at())
    for step in range(MAX_WAITING + 10):
        assert run.go_to(moved(A1=1e-4 * step)) is None
    assert motion.accounting == Accounting(MAX_WAITING + 10, 10, 0, 0)
    run.cycle(100)
    assert motion.accounting == Accounting(MAX_WAITING + 10, MAX_WAITING + 9, 1, run.now_ns)


def test_the_remaining_time_holds_from_the_arrival_of_the_destination_on() -> None:
    motion = smart(FAST, dead_time_ms=18.0)
    run = began(motion, at())
    assert run.go_to(moved(A1=0.5)) is None
    run.cycle(100)
    assert run.go_to(moved(A1=0.1, A2=0.3)) is None
    told = [motion.remaining_s(now_ns=run.now_ns)]
    while motion.interpolator is not S.RESTING:
        run.cycle()
        told.append(motion.remaining_s(now_ns=run.now_ns))
    took = [1e-3 * (len(told) - 1 - index) for index in range(len(told))]
    assert told == pytest.approx(took, abs=1.01e-3)
    assert told[-1] == 0.0


def test_an_older_goal_reached_while_a_newer_waits_is_no_goal_and_ends_nothing() -> None:
    motion = smart(replace(FAST, timeout_after_goal_s=0.0), dead_time_ms=50.0)
    run = began(motion, at())
    assert run.go_to(moved(A1=1e-3)) is None
    run.cycle(60)
    assert run.go_to(moved(A1=0.1)) is None
    run.cycle(49)
    assert run.now.position_rad == moved(A1=1e-3)
    assert (motion.interpolator, motion.goals_reached) == (S.MOVING, 0)
    run.until(lambda: motion.ended)
    assert run.now.position_rad == moved(A1=0.1)
    assert motion.goals_reached == 1


def test_the_destination_under_way_sent_again_each_cycle_is_reached_all_the_same() -> None:
    motion = smart(replace(FAST, minimum_execution_time_s=0.3))
    run = began(motion, at())
    assert run.go_to(moved(A1=0.02)) is None
    cycles = run.until(lambda: motion.goals_reached == 1 or run.go_to(moved(A1=0.02)) is not None)
    assert cycles == pytest.approx(300, abs=1)
    assert motion.accounting.executed == cycles


def test_it_rests_and_ends_after_its_timeout_unless_a_new_destination_comes() -> None:
    motion = smart(MotionParameters(timeout_after_goal_s=0.2), moved(A1=0.01))
    run = began(motion, at())
    run.until(lambda: motion.interpolator is S.RESTING)
    run.cycle(150)
    assert run.go_to(moved(A1=0.02)) is None
    run.until(lambda: motion.interpolator is S.RESTING)
    assert run.until(lambda: motion.ended) == 200
    assert motion.interpolator is S.ENDED
    assert motion.goals_reached == 2
    assert run.cycle(3) == SetPoint(moved(A1=0.02), STILL)


def test_a_minimum_execution_time_counts_from_the_next_destination_on() -> None:
    motion = smart(FAST)
    run = began(motion, at())
    assert run.go_to(moved(A1=0.05)) is None
    run.cycle(3)
    bad = motion.set_runtime_parameters(minimum_execution_time_s=5000.0, velocity_planning=True, wait_for_pause=None)
    assert bad is not None
    assert bad.reason == ErrorReason.USER_TIME_OUT_OF_RANGE
    assert not motion.parameters.velocity_planning
    motion.set_runtime_parameters(minimum_execution_time_s=2.0, velocity_planning=None, wait_for_pause=None)
    run.until(lambda: motion.interpolator is S.RESTING, at_most=200)
    assert run.go_to(moved(A1=0.02)) is None
    assert run.until(lambda: motion.interpolator is S.RESTING) == 2000


@pytest.mark.parametrize(
    ("position", "velocity", "reason"),
    [
        (None, None, ErrorReason.NULL_POINTER),
        (None, (math.nan,) * 6, ErrorReason.NULL_POINTER),
        ((), None, ErrorReason.NUMBER_OF_DOFS),
        ((math.nan,) * 6, None, ErrorReason.NUMBER_OF_DOFS),
        ((0.0,) * 8, None, ErrorReason.NUMBER_OF_DOFS),
        ((0.0,) * 7, (0.0,) * 6, ErrorReason.NUMBER_OF_DOFS),
        ((9.0,) * 6 + (math.nan,), None, ErrorReason.INVALID_INPUT_VALUES),
        ((-math.inf,) + (0.0,) * 6, None, ErrorReason.INVALID_INPUT_VALUES),
        ((9.0,) * 7, (math.nan,) * 7, ErrorReason.INVALID_INPUT_VALUES),
        ((1e308,) * 7, None, ErrorReason.POSITIONAL_LIMITS),
        ((3.0,) + (0.0,) * 6, (99.0,) * 7, ErrorReason.POSITIONAL_LIMITS),
        ((0.0,) * 7, (0.0,) * 6 + (-3.2,), ErrorReason.SPEED_LIMIT),
    ],
)
def test_a_destination_that_cannot_be_is_refused_and_changes_nothing(
    position: Vector | None, velocity: Vector | None, reason: ErrorReason
) -> None:
    motion, untouched = smart(FAST, moved(A1=0.3)), smart(FAST, moved(A1=0.3))
    run, other = began(motion, at()), began(untouched, at())
    run.cycle(30)
    other.cycle(30)
    fault = run.go_to(position, velocity)
    assert fault is not None
    assert fault.reason == reason
    assert fault.detail
    assert motion.accounting == untouched.accounting
    assert motion.destination == untouched.destination
    assert run.cycle(200) == other.cycle(200)
    assert run.set_points == other.set_points


@pytest.mark.parametrize(
    ("goal", "reason"),
    [
        ((1.0,) * 6, ErrorReason.NUMBER_OF_DOFS),
        ((math.inf,) * 7, ErrorReason.INVALID_INPUT_VALUES),
        ((4.0,) * 7, ErrorReason.POSITIONAL_LIMITS),
    ],
)
def test_a_motion_made_with_a_bad_destination_does_not_begin(goal: Vector, reason: ErrorReason) -> None:
    refused = Run(smart(destination=goal), at()).refused
    assert refused is not None
    assert refused.reason == reason


def test_a_motion_with_bad_parameters_does_not_begin() -> None:
    refused = Run(smart(MotionParameters(joint_jerk_percent=0.0)), at()).refused
    assert refused == Fault(ErrorReason.INVALID_INPUT_VALUES, "joint jerk is 0, nothing would move")


@pytest.mark.parametrize("result", [result for result in Result if result not in (Result.Working, Result.Finished)])
def test_an_internal_error_of_the_interpolator_is_a_fault_of_the_cycle(
    monkeypatch: pytest.MonkeyPatch, result: Result
) -> None:
    class Broken:
        def __init__(self, *_: object) -> None:
            return

        def calculate(self, *_: object) -> Result:
            return result

    monkeypatch.setattr(planner, "Ruckig", Broken)
    motion = make(MotionKind.SMART_SERVO, basis_of())
    run = began(motion, at())
    assert run.go_to(moved(A1=0.1)) is None
    fault = motion.interpolate(now_ns=1_000_000, started_ns=1_000_000)
    assert isinstance(fault, Fault)
    assert fault.reason == planner.RESULTS[result]
    refused = Run(make(MotionKind.SMART_SERVO, basis_of(), moved(A1=0.1)), at()).refused
    assert refused is not None
    assert refused.reason == planner.RESULTS[result]
