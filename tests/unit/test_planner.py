"""The planner: what Ruckig answers becomes the manual's reason, ways stay in range, lines are straight."""

import itertools
import math
import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruckig import InputParameter, Result, Ruckig, RuckigError, Synchronization, Trajectory

from hil.core.motion.axis_range import extremes
from hil.core.motion.motion_limits import (
    LONGEST_EXECUTION_TIME_S,
    SMART_SERVO_CHECKS,
    admissible,
    bad_parameter,
    smart_servo_limits,
    stopping_distance_rad,
)
from hil.core.motion.planner import RESULTS, Plan, TrajectoryPlanner
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.motion import ErrorReason, Fault, MotionParameters
from hil.values.robot import JOINT_COUNT, Seven
from tests.support.interpolation import basis_of, place, shares

BASIS = basis_of()
SEEDS = st.integers(0, 2**32)
AT_ZERO = SetPoint(STILL, STILL)
GOAL: Seven = (0.5, -0.3, 0.2, 0.4, 0.0, 0.1, -0.6)


class Answering:
    """A solver that answers the same each time, and counts."""

    def __init__(self, *answers: object) -> None:
        self._answers = list(answers)
        self.asked: list[object] = []

    def calculate(self, request: InputParameter, trajectory: Trajectory) -> object:
        self.asked.append(request.synchronization)
        answer = self._answers.pop(0) if len(self._answers) > 1 else self._answers[0]
        if isinstance(answer, Exception):
            raise type(answer)(*answer.args)  # a fresh one: pytest keeps the parameters
        return answer


def planner_of(solver: object = None, **parameters: float) -> TrajectoryPlanner:
    limits = smart_servo_limits(BASIS, MotionParameters(**parameters))  # type: ignore[arg-type]
    return TrajectoryPlanner(limits, cycle_s=1e-3, solver=solver)  # type: ignore[arg-type]


def planned(answer: Plan | Fault) -> Plan:
    assert isinstance(answer, Plan), answer
    return answer


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        *((result, RESULTS[result]) for result in Result if result not in (Result.Working, Result.Finished)),
        (RuckigError("\n[ruckig] zero limits conflict in step 1, dof: 0"), ErrorReason.INVALID_INPUT_VALUES),
        (RuckigError("\n[ruckig] error in step 1, dof: 0 input:"), ErrorReason.EXECUTION_TIME_CALCULATION),
        (RuckigError("\n[ruckig] error in step 2 in dof: 2 for t sync"), ErrorReason.SYNCHRONIZATION),
        (RuckigError("\n[ruckig] error in time synchronization: 1e9"), ErrorReason.SYNCHRONIZATION),
        (RuckigError("\n[ruckig] target position nan of DoF 0"), ErrorReason.INVALID_INPUT_VALUES),
        (ValueError("-101 is not a valid Result."), ErrorReason.EXECUTION_TIME_TOO_BIG),
        (ValueError("-7 is not a valid Result."), ErrorReason.ERROR),
    ],
)
def test_every_answer_has_its_reason(answer: object, reason: ErrorReason) -> None:
    planner = planner_of(Answering(answer))
    moving = SetPoint(STILL, (0.1,) + (0.0,) * 6)
    for fault in (planner.to_goal(AT_ZERO, GOAL), planner.along_line(AT_ZERO, GOAL), planner.to_rest(moving)):
        assert isinstance(fault, Fault)
        assert fault.reason == reason
        assert fault.detail.startswith("the planner answers")
        assert "\n" not in fault.detail


def test_axes_that_cannot_be_synchronised_go_each_for_itself() -> None:
    solver = Answering(Result.ErrorSynchronizationCalculation, Result.Working)
    planned(planner_of(solver).to_goal(AT_ZERO, GOAL, any_range=True))
    assert solver.asked == [Synchronization.Time, Synchronization.No]


def test_a_profile_that_ruckig_misses_is_asked_for_once_more() -> None:
    missed = RuckigError("\n[ruckig] error in step 1, dof: 0 input:")
    solver = Answering(missed, Result.Working)
    planned(planner_of(solver).to_goal(AT_ZERO, GOAL, any_range=True))
    assert solver.asked == [Synchronization.Time] * 2
    solver = Answering(missed, missed, Result.Working)
    assert isinstance(planner_of(solver).to_goal(AT_ZERO, GOAL, any_range=True), Fault)


@pytest.mark.parametrize("minimum_time_s", [0.0, 2.0])
def test_a_way_that_would_turn_round_behind_the_end_of_the_range_rests_first(minimum_time_s: float) -> None:
    end = BASIS.limits.position_max_rad[1]
    planner = planner_of(acceleration_override=20.0, joint_jerk_percent=500.0)
    # It can stop five milliradians before the end, and Ruckig's quickest way there is by 0.3 mrad behind it.
    start = SetPoint((0.0, end - 0.05783758232384839, *STILL[2:]), (0.0, 0.3724146893862162, *STILL[2:]),
                     (0.0, 12.762438827910257, *STILL[2:]))  # fmt: skip
    goal = (0.0, end - 2e-8, *STILL[2:])
    assert planned(planner.to_goal(start, goal, any_range=True)).duration_s < 0.2
    way = planned(planner.to_goal(start, goal, minimum_time_s=minimum_time_s))
    assert way.duration_s >= minimum_time_s
    times = np.linspace(0.0, way.duration_s, 2000)
    positions = np.array([way.at(time).position_rad[1] for time in times])
    velocities = np.array([way.at(time).velocity_rad_s[1] for time in times])
    assert np.max(positions) <= end + 1e-9
    assert np.max(np.abs(np.diff(positions) - 0.5 * (velocities[1:] + velocities[:-1]) * times[1])) < 1e-6
    assert way.end.position_rad == pytest.approx(goal, abs=1e-8)
    moving_away = SetPoint(start.position_rad, (0.0, 1.7, *STILL[2:]))
    assert isinstance(planner.to_goal(moving_away, goal), Fault)


def test_axes_that_must_arrive_with_a_velocity_are_not_tried_without_synchronisation() -> None:
    solver = Answering(Result.ErrorSynchronizationCalculation, Result.Working)
    fault = planner_of(solver).to_goal(AT_ZERO, GOAL, velocity_rad_s=(0.1,) * 7)
    assert isinstance(fault, Fault)
    assert solver.asked == [Synchronization.Time]


def test_limits_and_times_that_ruckig_cannot_plan_with() -> None:
    def reason(answer: Plan | Fault) -> str:
        assert isinstance(answer, Fault)
        return answer.reason

    for time_s in (-1.0, math.nan, math.inf, LONGEST_EXECUTION_TIME_S * 1.001, 1e9):
        assert reason(planner_of().to_goal(AT_ZERO, GOAL, minimum_time_s=time_s)) == ErrorReason.USER_TIME_OUT_OF_RANGE
    assert reason(planner_of(joint_velocity_rel=1e-6).to_goal(AT_ZERO, GOAL)) == ErrorReason.EXECUTION_TIME_TOO_BIG
    assert reason(planner_of(joint_jerk_percent=0.0).to_goal(AT_ZERO, GOAL)) == ErrorReason.INVALID_INPUT_VALUES
    assert reason(planner_of().to_goal(AT_ZERO, (math.nan,) * 7)) == ErrorReason.INVALID_INPUT_VALUES


@pytest.mark.parametrize("time_s", [0.0, 1e-9, 0.01, 7.0, 100.0, LONGEST_EXECUTION_TIME_S])
def test_the_minimum_time_is_kept(time_s: float) -> None:
    shortest = planned(planner_of().to_goal(AT_ZERO, GOAL)).duration_s
    plan = planned(planner_of().to_goal(AT_ZERO, GOAL, minimum_time_s=time_s))
    assert plan.duration_s == pytest.approx(max(time_s, shortest), abs=1e-9)
    assert plan.end.position_rad == pytest.approx(GOAL, abs=1e-8)


@given(seed=SEEDS)
def test_a_line_is_straight_and_within_the_limits_whatever_the_axes_have_to_do(seed: int) -> None:
    source = random.Random(seed)
    start = shares(source, BASIS.limits.position_max_rad, 0.99)
    goal: Seven = tuple(
        min(max(here + source.choice((-1, 0, 1)) * 10 ** source.uniform(-12, 0.5), -0.99 * high), 0.99 * high)
        for here, high in zip(start, BASIS.limits.position_max_rad, strict=True)
    )  # type: ignore[assignment]
    plan = planned(TrajectoryPlanner(BASIS.limits, cycle_s=1e-3).along_line(SetPoint(start, STILL), goal))
    way = np.array(goal) - np.array(start)
    longest = int(np.argmax(np.abs(way)))
    for share_of_time in (0.0, 0.1, 0.4, 0.7, 1.0):
        position, velocity, acceleration = plan.at(share_of_time * plan.duration_s)
        if way[longest]:
            share = (position[longest] - start[longest]) / way[longest]
            assert np.abs(np.array(start) + share * way - position).max() < 2e-8
        for axis in range(JOINT_COUNT):
            assert abs(velocity[axis]) <= BASIS.limits.velocity_rad_s[axis] * (1 + 1e-9)
            assert abs(acceleration[axis]) <= BASIS.limits.acceleration_rad_s2[axis] * (1 + 1e-9)


def test_a_line_takes_as_long_as_its_slowest_axis_alone() -> None:
    planner = TrajectoryPlanner(BASIS.limits, cycle_s=1e-3)
    alone = []
    for axis, way in enumerate(GOAL):
        single: Seven = tuple(way if other == axis else 0.0 for other in range(JOINT_COUNT))  # type: ignore[assignment]
        alone.append(planned(planner.along_line(AT_ZERO, single)).duration_s)
    together = planned(planner.along_line(AT_ZERO, GOAL)).duration_s
    assert max(alone) <= together <= 1.07 * max(alone)


def test_a_line_that_is_not_straight_is_refused() -> None:
    class Bent:
        def calculate(self, request: InputParameter, trajectory: Trajectory) -> Result:
            request.synchronization = Synchronization.No
            first, *others = request.max_acceleration
            request.max_acceleration = [first, *(value / 2 for value in others)]
            return Ruckig(JOINT_COUNT).calculate(request, trajectory)

    fault = planner_of(Bent()).along_line(AT_ZERO, GOAL)
    assert isinstance(fault, Fault)
    assert fault.reason == ErrorReason.NO_PHASE_SYNCHRONIZATION


def test_a_way_that_leaves_the_range_is_tried_without_synchronisation_and_then_refused_with_figures() -> None:
    high = BASIS.limits.position_max_rad[1]
    start = SetPoint((0.0, high - 0.1, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 1.2, 0.0, 0.0, 0.0, 0.0, 0.0))
    fault = planner_of().to_goal(start, STILL)
    assert isinstance(fault, Fault)
    assert fault.reason == ErrorReason.POSITIONAL_LIMITS
    assert fault.detail.startswith("A2 would go to 2.8")
    assert "its range is -2.094395..2.094395 rad" in fault.detail
    rest = planner_of().to_rest(start)
    assert isinstance(rest, Fault)
    assert rest.reason == ErrorReason.POSITIONAL_LIMITS
    planned(planner_of(acceleration_override=20.0, joint_jerk_percent=500.0).to_rest(start))


@given(seed=SEEDS)
def test_extremes_are_those_of_the_whole_way(seed: int) -> None:
    """Ruckig's own miss an axis that turns while its acceleration is constant."""
    source = random.Random(seed)
    request = InputParameter(JOINT_COUNT)
    request.current_position = list(shares(source, (1.0,) * 7))
    request.current_velocity = list(shares(source, (1.5,) * 7))
    request.current_acceleration = list(shares(source, (3.0,) * 7))
    request.target_position = list(shares(source, (1.0,) * 7))
    request.target_velocity = list(shares(source, (0.9,) * 7))
    request.max_velocity, request.max_acceleration, request.max_jerk = [1.0] * 7, [2.0] * 7, [30.0] * 7
    trajectory = Trajectory(JOINT_COUNT)
    Ruckig(JOINT_COUNT).calculate(request, trajectory)
    times = np.linspace(0.0, trajectory.duration, 400)
    path = np.array([trajectory.at_time(time)[0] for time in times])
    for axis, profile in enumerate(trajectory.profiles[0]):
        low, high = extremes(profile)
        assert low <= path[:, axis].min() + 1e-9
        assert high >= path[:, axis].max() - 1e-9
        coarse = 3.0 * (times[1] - times[0])  # at 3 rad/s at most
        assert low >= path[:, axis].min() - coarse
        assert high <= path[:, axis].max() + coarse


@given(seed=SEEDS)
def test_an_admissible_acceleration_keeps_the_velocity_and_is_as_large_as_it_may(seed: int) -> None:
    source = random.Random(seed)
    limits = BASIS.limits
    start = SetPoint(
        place(source, limits, STILL),
        shares(source, limits.velocity_rad_s, 1.2),
        shares(source, limits.acceleration_rad_s2, source.choice((0.1, 1.0, 20.0))),
    )
    carried = admissible(start, limits)
    assert carried[:2] == start[:2]
    for axis, (before, after) in enumerate(zip(start.acceleration_rad_s2, carried.acceleration_rad_s2, strict=True)):
        speed, fastest = start.velocity_rad_s[axis], limits.velocity_rad_s[axis]
        assert before * after >= 0.0
        assert abs(after) <= min(abs(before), limits.acceleration_rad_s2[axis])
        reached = speed + after * abs(after) / (2 * limits.jerk_rad_s3[axis])
        assert math.copysign(1.0, after) * reached <= max(fastest, abs(speed)) * (1 + 1e-12)
        if (
            abs(before) <= limits.acceleration_rad_s2[axis]
            and abs(speed) + before**2 / (2 * limits.jerk_rad_s3[axis]) <= fastest
        ):
            assert after == before
    assert admissible(carried, limits) == carried


@pytest.mark.parametrize(
    ("velocity", "acceleration", "jerk"), list(itertools.product((0.01, 0.5, 2.0), (1.0, 9.0), (20.0, 300.0)))
)
def test_stopping_distance_is_that_of_the_planner(velocity: float, acceleration: float, jerk: float) -> None:
    request = InputParameter(1)
    request.current_position, request.current_velocity, request.current_acceleration = [0.0], [0.0], [0.0]
    request.target_position, request.target_velocity = [10.0], [velocity]
    request.max_velocity, request.max_acceleration, request.max_jerk = [velocity], [acceleration], [jerk]
    trajectory = Trajectory(1)
    Ruckig(1).calculate(request, trajectory)
    distance = stopping_distance_rad(-velocity, acceleration, jerk)
    ramp_s = trajectory.duration - (10.0 - distance) / velocity
    assert trajectory.at_time(ramp_s)[0][0] == pytest.approx(distance, rel=1e-6)
    assert trajectory.at_time(ramp_s)[1][0] == pytest.approx(velocity, rel=1e-6)


@pytest.mark.parametrize(
    ("parameters", "reason", "detail"),
    [
        (MotionParameters(joint_velocity_rel=0.0), ErrorReason.INVALID_INPUT_VALUES, "joint velocity rel is 0"),
        (MotionParameters(acceleration_override=0.0), ErrorReason.INVALID_INPUT_VALUES, "override is 0"),
        (MotionParameters(joint_jerk_percent=0.0), ErrorReason.INVALID_INPUT_VALUES, "joint jerk is 0"),
        (MotionParameters(joint_acceleration_rel=0.0), ErrorReason.INVALID_INPUT_VALUES, "acceleration rel is 0"),
        (MotionParameters(joint_velocity_rel=1.01), ErrorReason.OVERRIDE_OUT_OF_RANGE, "1.01 is outside its range 0"),
        (MotionParameters(acceleration_override=20.5), ErrorReason.OVERRIDE_OUT_OF_RANGE, "0 ... 20"),
        (MotionParameters(joint_jerk_percent=1501.0), ErrorReason.OVERRIDE_OUT_OF_RANGE, "0 ... 1500 %"),
        (MotionParameters(joint_acceleration_rel=math.nan), ErrorReason.OVERRIDE_OUT_OF_RANGE, "nan"),
        (MotionParameters(minimum_execution_time_s=-0.1), ErrorReason.USER_TIME_OUT_OF_RANGE, ">= 0 s"),
        (MotionParameters(minimum_execution_time_s=2000.0), ErrorReason.USER_TIME_OUT_OF_RANGE, "0..1000 s"),
        (MotionParameters(speed_timeout_s=-1.0), ErrorReason.USER_TIME_OUT_OF_RANGE, "speed timeout"),
        (MotionParameters(timeout_after_goal_s=math.inf), ErrorReason.USER_TIME_OUT_OF_RANGE, "timeout after goal"),
    ],
)
def test_parameters_out_of_range_are_named_with_value_and_range(
    parameters: MotionParameters, reason: ErrorReason, detail: str
) -> None:
    fault = bad_parameter(parameters, SMART_SERVO_CHECKS)
    assert fault is not None
    assert fault.reason == reason
    assert detail in fault.detail
    assert bad_parameter(MotionParameters(), SMART_SERVO_CHECKS) is None


def test_a_way_keeps_the_margin_it_is_told_from_the_ends_of_the_range() -> None:
    high, back = BASIS.limits.position_max_rad[6], -2.0
    planner = planner_of(acceleration_override=20.0, joint_jerk_percent=500.0)
    axis = tuple(float(index == 6) for index in range(JOINT_COUNT))
    start = SetPoint(tuple((high - 0.2) * one for one in axis), STILL)  # type: ignore[arg-type]
    velocity: Seven = tuple(back * one for one in axis)  # type: ignore[assignment]
    plan = planned(planner.to_goal(start, start.position_rad, velocity_rad_s=velocity))
    turn = max(plan.at(share * plan.duration_s).position_rad[6] for share in np.linspace(0.0, 1.0, 2001))
    assert 0.0 < high - turn < 0.1
    for margin, keeps in ((high - turn + 1e-4, False), (high - turn - 1e-4, True)):
        margins: Seven = tuple(margin * one for one in axis)  # type: ignore[assignment]
        way = planner.to_goal(start, start.position_rad, velocity_rad_s=velocity, margin_rad=margins)
        assert isinstance(way, Plan) is keeps
