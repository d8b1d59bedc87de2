"""DirectServo: velocity and range kept, no overshoot in a step from rest, exact arrival; its faults and states."""

import math
import random
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backends.mujoco import MujocoBackend
from backends.robots import load_description, robot_names
from hil.core.motion.application_motion import Accounting, MotionBasis
from hil.core.motion.direct_filter import POLE_RAD_S
from hil.core.motion.direct_servo import DirectServo
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.arm import JointCommand
from hil.values.motion import (
    DIRECT_SERVO_DELTA_RAD,
    ErrorReason,
    Fault,
    FineInterpolatorState,
    MotionParameters,
)
from hil.values.robot import JOINT_COUNT, Seven
from hil.values.servo import Vector
from tests.support.cases import cases
from tests.support.interpolation import (
    START,
    Run,
    assert_in_range,
    assert_no_jump,
    at,
    basis_of,
    began,
    moved,
    place,
    shares,
)

SEEDS = st.integers(0, 2**32)
S = FineInterpolatorState


def direct(
    parameters: MotionParameters | None = None, destination: Vector | None = None, **basis: float | str
) -> DirectServo:
    return DirectServo(parameters or MotionParameters(), basis=basis_of(**basis), destination=destination)  # type: ignore[arg-type]


def near(source: random.Random, motion: DirectServo, here: Seven) -> Seven:
    """Return a destination in the axis ranges, at most 5 degrees away."""
    goal = place(source, motion.basis.limits, here)
    return tuple(
        min(max(there, now - DIRECT_SERVO_DELTA_RAD), now + DIRECT_SERVO_DELTA_RAD)
        for there, now in zip(goal, here, strict=True)
    )  # type: ignore[return-value]


@settings(max_examples=cases(80))
@given(
    seed=SEEDS,
    robot=st.sampled_from(robot_names()),
    velocity_rel=st.sampled_from((1.0, 1.0, 0.3, 0.01)),
    cycle_ms=st.sampled_from((1, 1, 2, 4, 5)),
)
def test_velocity_and_range_are_kept_whatever_is_set_when(
    seed: int, robot: str, velocity_rel: float, cycle_ms: int
) -> None:
    source = random.Random(seed)
    motion = direct(MotionParameters(joint_velocity_rel=velocity_rel), robot=robot, cycle_ms=cycle_ms)
    limits = motion.basis.limits
    run = began(motion, at(place(source, limits, STILL)))
    longest = source.choice((1, 5, 100))
    for _ in range(40):
        motion.set_runtime_parameters(
            minimum_execution_time_s=source.choice((0.0, 0.01, 0.01, 0.3)), velocity_planning=None, wait_for_pause=None
        )
        assert run.go_to(near(source, motion, run.now.position_rad)) is None
        run.cycle(source.randint(1, longest))
    goal = near(source, motion, run.now.position_rad)
    assert run.go_to(goal) is None
    run.until(lambda: motion.interpolator is S.RESTING)
    assert run.now == SetPoint(goal, STILL, STILL)
    position, velocity, acceleration = run.arrays()
    cycle_s = cycle_ms * 1e-3
    fastest = np.array(limits.velocity_rad_s) * velocity_rel
    strongest = 20.0 * np.array(motion.basis.servo.acceleration_rad_s2)
    assert np.all(np.abs(velocity) <= fastest * (1 + 1e-9))
    assert np.all(np.abs(np.diff(position, axis=0)) <= fastest * cycle_s * (1 + 1e-9) + 1e-15)
    assert np.all(np.abs(acceleration) <= strongest * (1 + 1e-6))
    assert np.all(np.abs(np.diff(velocity, axis=0)) <= strongest * cycle_s * (1 + 1e-6))
    assert_no_jump(run)
    assert_in_range(run)


@settings(max_examples=cases(120))
@given(
    axis=st.integers(0, 6),
    step=st.one_of(st.floats(1e-15, 1.0), st.floats(0.0, 1e-6), st.sampled_from((1.0, 0.5, 0.02))),
    sign=st.sampled_from((1.0, -1.0)),
    parameters=st.builds(
        MotionParameters,
        joint_velocity_rel=st.sampled_from((1.0, 0.2, 0.003)),
        minimum_execution_time_s=st.sampled_from((0.0, 0.01, 0.1, 1.0)),
    ),
    basis=st.builds(basis_of, st.sampled_from(robot_names()), cycle_ms=st.sampled_from((1, 2, 4, 5))),
)
def test_a_step_from_rest_does_not_overshoot_and_is_reached_exactly(
    axis: int, step: float, sign: float, parameters: MotionParameters, basis: MotionBasis
) -> None:
    motion = DirectServo(parameters, basis=basis, destination=None)
    run = began(motion, at())
    goal = moved(**{f"A{axis + 1}": sign * step * DIRECT_SERVO_DELTA_RAD})  # names of axes
    assert run.go_to(goal) is None
    cycles = run.until(lambda: motion.interpolator is S.RESTING)
    assert run.now == SetPoint(goal, STILL, STILL)
    path = run.arrays()[0][:, axis] * sign
    assert np.all(np.diff(path) >= 0.0)
    assert path.max() == sign * goal[axis]
    others = [other for other in range(JOINT_COUNT) if other != axis]
    assert np.all(run.arrays()[0][:, others] == np.array(START)[others])
    if step > 0.01:
        fastest = parameters.joint_velocity_rel * basis.limits.velocity_rad_s[axis]
        took_s = cycles * basis.cycle_ns * 1e-9
        assert took_s >= max(parameters.minimum_execution_time_s, step * DIRECT_SERVO_DELTA_RAD / fastest) - 1e-9


def test_the_same_calls_give_the_same_set_points() -> None:
    def path() -> list[SetPoint]:
        source = random.Random(4)
        motion = direct()
        run = began(motion, at())
        for _ in range(60):
            run.go_to(near(source, motion, run.now.position_rad))
            run.cycle(7)
        return run.set_points

    assert path() == path()


def test_small_steps_are_filtered_by_two_equal_poles_and_nothing_else() -> None:
    motion = direct()
    run = began(motion, at())
    step = 1e-4
    assert run.go_to(moved(A1=step)) is None
    run.cycle(60)
    time_s = np.arange(61) * 1e-3
    exact = step * (1.0 - (1.0 + POLE_RAD_S * time_s) * np.exp(-POLE_RAD_S * time_s))
    path = run.arrays()[0][:, 0] - START[0]
    # The velocity of a cycle moves the position in the same cycle: half a cycle ahead of the continuous filter.
    assert np.abs(path - np.interp(time_s + 0.5e-3, time_s, exact)).max() < 0.01 * step


@pytest.mark.parametrize("cycle_ms", [1, 2, 5])
def test_a_ramp_is_followed_two_time_constants_late(cycle_ms: int) -> None:
    motion = direct(cycle_ms=cycle_ms)
    run = began(motion, at())
    speed = 0.2
    for index in range(400 // cycle_ms):
        assert run.go_to(moved(A1=speed * index * cycle_ms * 1e-3)) is None
        run.cycle()
    behind_s = (index * cycle_ms * 1e-3) - (run.now.position_rad[0] - START[0]) / speed
    assert behind_s == pytest.approx(2.0 / POLE_RAD_S - cycle_ms * 1e-3, rel=0.03)
    assert run.now.velocity_rad_s[0] == pytest.approx(speed, rel=1e-6)


@pytest.mark.parametrize(("robot", "axis"), [("lbr-iiwa-7-r800", 1), ("lbr-iiwa-7-r800", 5), ("lbr-med-14", 1)])
def test_the_mujoco_arm_follows_a_step_without_running_past_it(robot: str, axis: int) -> None:
    description = load_description(robot)
    start = description.initial_position_rad
    goal = moved(start, **{f"A{axis + 1}": -math.radians(5.0)})
    motion = direct(robot=robot)
    run = began(motion, at(start), robot=robot)
    assert run.go_to(goal) is None
    arm = MujocoBackend(description)
    arm.open(period_ns=1_000_000)
    behind, past, near_since = 0.0, 0.0, 0
    for index in range(300):
        before = run.now.position_rad
        arm.write(JointCommand(*run.cycle()))
        arm.step()
        measured = arm.read().position_rad
        behind = max(behind, abs(measured[axis] - before[axis]))
        past = max(past, goal[axis] - measured[axis])
        if abs(measured[axis] - goal[axis]) > math.radians(0.05):
            near_since = index + 1
    assert behind < 4e-3
    assert past < 2e-5
    assert near_since < 150


def test_the_remaining_time_from_rest_is_about_what_it_takes() -> None:
    for cycle_ms, step in ((1, 0.087), (1, 0.01), (1, 1e-4), (4, 0.05)):
        motion = direct(dead_time_ms=8.0, cycle_ms=cycle_ms)
        run = began(motion, at())
        assert run.go_to(moved(A1=step, A2=-step)) is None
        told = [motion.remaining_s(now_ns=run.now_ns)]
        while motion.interpolator is not S.RESTING:
            run.cycle()
            told.append(motion.remaining_s(now_ns=run.now_ns))
        took = [1e-3 * cycle_ms * (len(told) - 1 - index) for index in range(len(told))]
        assert told == pytest.approx(took, abs=0.025)
        assert told[-1] == 0.0


def test_at_rest_the_same_set_point_comes_again() -> None:
    run = began(direct(), at())
    assert run.cycle() is run.cycle()


def test_it_rests_where_it_takes_over_without_a_destination() -> None:
    motion = direct()
    run = began(motion, at())
    assert (motion.interpolator, motion.destination, motion.goals_reached) == (S.RESTING, START, 0)
    assert run.cycle(5) == at()


def test_without_a_destination_a_moving_arm_stops_without_turning_round() -> None:
    motion = direct()
    run = began(motion, SetPoint(START, (1.2, -0.3, 0.0, 0.0, 0.01, 0.0, 0.0)))
    assert motion.interpolator is S.MOVING
    run.until(lambda: motion.interpolator is S.RESTING)
    assert run.now == SetPoint(motion.destination, STILL)  # type: ignore[arg-type]
    assert motion.goals_reached == 0
    path = run.arrays()[0]
    assert np.all(np.diff(path[:, 0]) >= 0.0)
    assert np.all(np.diff(path[:, 1]) <= 0.0)
    assert 1.2**2 / (2 * 70.0) < path[-1, 0] - START[0] < 0.025


@given(seed=SEEDS)
def test_no_axis_leaves_its_range_however_it_was_moving(seed: int) -> None:
    """What takes over may be too fast for its acceleration: the range comes first, as in every brake."""
    source = random.Random(seed)
    motion = direct()
    limits = motion.basis.limits
    velocity = shares(source, limits.velocity_rad_s)
    start: list[float] = []
    for axis, speed in enumerate(velocity):
        # Room to stop with 1 to 10 times the acceleration the filter has.
        room = speed * speed / (2.0 * source.uniform(1.0, 10.0) * 20.0 * motion.basis.servo.acceleration_rad_s2[axis])
        start.append(limits.position_max_rad[axis] - room if speed > 0 else limits.position_min_rad[axis] + room)
    run = began(motion, SetPoint(tuple(start), velocity))  # type: ignore[arg-type]
    for _ in range(source.randint(0, 3)):
        run.cycle(source.randint(0, 30))
        assert run.go_to(near(source, motion, run.now.position_rad)) is None
    run.until(lambda: motion.interpolator is S.RESTING)
    assert_in_range(run)
    assert_no_jump(run, hardest=10.0)
    assert np.all(np.abs(run.arrays()[1]) <= np.array(limits.velocity_rad_s) * (1 + 1e-9))


@pytest.mark.parametrize(("dead_time_ms", "cycles"), [(0.0, 1), (1.0, 1), (1.1, 2), (10.0, 10)])
def test_a_destination_is_there_in_the_first_cycle_after_its_dead_time(dead_time_ms: float, cycles: int) -> None:
    motion = direct(dead_time_ms=dead_time_ms)
    run = began(motion, at())
    run.cycle(10)
    assert run.go_to(moved(A1=0.05)) is None
    assert motion.interpolator is S.MOVING
    assert run.until(lambda: run.now.position_rad != START) == cycles
    assert motion.accounting == Accounting(1, 0, 1, run.now_ns)


def test_it_rests_and_ends_after_its_timeout_unless_a_new_destination_comes() -> None:
    motion = direct(MotionParameters(timeout_after_goal_s=0.2), moved(A1=0.01))
    run = began(motion, at())
    run.until(lambda: motion.interpolator is S.RESTING)
    run.cycle(150)
    assert run.go_to(moved(A1=0.02)) is None
    run.until(lambda: motion.interpolator is S.RESTING)
    assert run.until(lambda: motion.ended) == 200
    assert motion.goals_reached == 2


def test_velocity_planning_and_what_is_smart_servos_mean_nothing() -> None:
    odd = MotionParameters(
        velocity_planning=True,
        speed_timeout_s=-5.0,
        acceleration_override=99.0,
        joint_jerk_percent=0.0,
        joint_acceleration_rel=0.0,
    )
    motion, plain = direct(odd, moved(A1=0.05)), direct(None, moved(A1=0.05))
    run, other = began(motion, at()), began(plain, at())
    run.cycle(300)
    other.cycle(300)
    assert run.set_points == other.set_points
    assert motion.interpolator is S.RESTING


@pytest.mark.parametrize(
    ("position", "velocity", "reason"),
    [
        (None, None, ErrorReason.NULL_POINTER),
        ((0.0,) * 6, None, ErrorReason.NUMBER_OF_DOFS),
        ((math.nan,) * 7, None, ErrorReason.INVALID_INPUT_VALUES),
        (START, (0.0,) * 7, ErrorReason.INVALID_INPUT_VALUES),
        (START, (0.1,) * 3, ErrorReason.NUMBER_OF_DOFS),
        (moved(A7=math.radians(5.01)), None, ErrorReason.DIRECT_SERVO_DELTA),
        (moved(A2=math.radians(-6.0)), None, ErrorReason.DIRECT_SERVO_DELTA),
        ((*START[:6], 3.2), None, ErrorReason.DIRECT_SERVO_LIMIT),
    ],
)
def test_a_destination_that_cannot_be_is_refused_and_changes_nothing(
    position: Vector | None, velocity: Vector | None, reason: ErrorReason
) -> None:
    motion, untouched = direct(None, moved(A1=0.08)), direct(None, moved(A1=0.08))
    run, other = began(motion, at()), began(untouched, at())
    run.cycle(3)
    other.cycle(3)
    fault = run.go_to(position, velocity)
    assert fault is not None
    assert fault.reason == reason
    assert fault.detail
    assert motion.accounting == untouched.accounting
    run.cycle(200)
    other.cycle(200)
    assert run.set_points == other.set_points


def test_a_target_velocity_is_refused_with_who_takes_one() -> None:
    run = began(direct(), at())
    fault = run.go_to(START, (0.1,) * 7)
    assert fault == Fault(ErrorReason.INVALID_INPUT_VALUES, "only SmartServo takes a target velocity")


def test_the_five_degrees_are_from_the_measured_position_at_arrival() -> None:
    motion = direct(dead_time_ms=10.0)
    run = began(motion, at())
    goal = moved(A1=math.radians(5.0))
    assert run.go_to(goal) is None
    far = motion.set_destination(goal, None, measured_rad=moved(A1=math.radians(-0.1)), arrived_ns=run.now_ns)
    assert far is not None
    assert far.detail.startswith("destination of A1 0.087266 rad is +0.089012 rad from its measured position, 0.087266")
    run.cycle(200)
    assert run.go_to(moved(A1=math.radians(9.0))) is None


def test_the_destination_it_begins_with_is_judged_where_it_begins() -> None:
    motion = direct(None, moved(A1=0.05))
    assert motion.set_destination(moved(A1=0.5), None, measured_rad=START, arrived_ns=0) is None
    refused = Run(motion, at()).refused
    assert refused is not None
    assert refused.reason == ErrorReason.DIRECT_SERVO_DELTA
    motion = direct(None, moved(A1=0.5))
    assert Run(motion, at(moved(A1=0.45))).refused is None
    far = direct(None, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0))
    refused = Run(far, at()).refused
    assert refused is not None
    assert refused.reason == ErrorReason.DIRECT_SERVO_LIMIT


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        (MotionParameters(joint_velocity_rel=0.0), ErrorReason.INVALID_INPUT_VALUES),
        (MotionParameters(joint_velocity_rel=1.1), ErrorReason.OVERRIDE_OUT_OF_RANGE),
        (MotionParameters(minimum_execution_time_s=math.nan), ErrorReason.USER_TIME_OUT_OF_RANGE),
        (MotionParameters(timeout_after_goal_s=-1.0), ErrorReason.USER_TIME_OUT_OF_RANGE),
    ],
)
def test_a_motion_with_bad_parameters_does_not_begin(parameters: MotionParameters, reason: ErrorReason) -> None:
    refused = Run(direct(parameters), at()).refused
    assert refused is not None
    assert refused.reason == reason


def test_a_minimum_execution_time_slows_a_step_down_until_it_is_over() -> None:
    motion = direct(replace(MotionParameters(), minimum_execution_time_s=0.5))
    run = began(motion, at())
    assert run.go_to(moved(A1=0.05)) is None
    cycles = run.until(lambda: motion.interpolator is S.RESTING)
    assert 500 <= cycles < 600
    assert run.arrays()[1][:, 0].max() == pytest.approx(0.1, rel=0.01)
