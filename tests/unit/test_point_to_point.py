"""PTP: a straight line from rest, limits kept, the point reached exactly, blending; its faults."""

import math
import random
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from backends.robots import robot_names
from hil.core.motion.motion_limits import point_to_point_limits
from hil.core.motion.point_to_point import TAKES_NO_DESTINATION, PointToPoint
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.motion import ErrorReason, FineInterpolatorState, MotionKind, MotionParameters
from hil.values.servo import Vector
from tests.support.interpolation import (
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
)

SEEDS = st.integers(0, 2**32)
S = FineInterpolatorState


def ptp(point: Vector | None, parameters: MotionParameters | None = None) -> PointToPoint:
    return PointToPoint(parameters or MotionParameters(), basis=basis_of(), destination=point)


@given(
    seed=SEEDS,
    robot=st.sampled_from(robot_names()),
    velocity_rel=st.sampled_from((1.0, 0.3)),
    acceleration_rel=st.sampled_from((1.0, 0.2)),
    cycle_ms=st.sampled_from((1, 5)),
)
def test_from_rest_it_goes_straight_within_its_limits_and_stops_exactly_at_its_point(
    seed: int, robot: str, velocity_rel: float, acceleration_rel: float, cycle_ms: int
) -> None:
    source = random.Random(seed)
    basis = basis_of(robot, cycle_ms=cycle_ms)
    start = place(source, basis.limits, STILL)
    point = place(source, basis.limits, start)
    parameters = MotionParameters(joint_velocity_rel=velocity_rel, joint_acceleration_rel=acceleration_rel)
    motion = PointToPoint(parameters, basis=basis, destination=point)
    run = began(motion, at(start))
    remaining_s = motion.remaining_s(now_ns=0)
    cycles = run.until(lambda: motion.ended)
    assert run.now == SetPoint(point, STILL, STILL)
    assert cycles * cycle_ms * 1e-3 == pytest.approx(remaining_s, abs=cycle_ms * 1.001e-3)
    assert (motion.interpolator, motion.goals_reached) == (S.ENDED, 1)
    assert_within(run, point_to_point_limits(basis, parameters))
    assert_in_range(run)
    path = run.arrays()[0]
    way = np.array(point) - np.array(start)
    longest = int(np.argmax(np.abs(way)))
    if abs(way[longest]) > 1e-6:
        share = (path[:, longest] - start[longest]) / way[longest]
        assert np.abs(start + share[:, None] * way - path).max() < 3e-8


@given(seed=SEEDS)
def test_every_point_of_a_blended_sequence_is_reached_or_passed_near_by_without_a_jump(seed: int) -> None:
    source = random.Random(seed)
    limits = basis_of().limits
    blended = MotionParameters(blending_rel=source.uniform(0.01, 1.0))
    set_points = [at(place(source, limits, STILL))]
    for _ in range(4):
        motion = ptp(place(source, limits, set_points[-1].position_rad), blended)
        run = Run(motion, set_points[-1])
        if run.refused is not None:
            # From a moving arm the way may not fit in the range; the arm then brakes.
            assert run.refused.reason == ErrorReason.POSITIONAL_LIMITS
            assert set_points[-1].velocity_rad_s != STILL
            break
        run.until(lambda: motion.ended or motion.blend_begins(now_ns=0))  # noqa: B023  # called at once
        assert_no_jump(run)
        assert_within(run, limits)
        assert_in_range(run)
        set_points.append(run.now)


def test_a_point_where_it_stands_is_reached_in_the_first_cycle() -> None:
    motion = ptp(START)
    run = began(motion, at())
    assert run.cycle() == at()
    assert motion.ended
    assert run.cycle() == at()
    assert motion.remaining_s(now_ns=0) == 0.0


def test_blending_begins_with_the_blended_share_of_the_longest_way_left() -> None:
    motion = ptp(moved(A1=0.5, A2=0.1), MotionParameters(blending_rel=0.25))
    run = began(motion, at())
    assert not motion.blend_begins(now_ns=0)
    run.until(lambda: motion.blend_begins(now_ns=0))
    assert run.set_points[-2].position_rad[0] - START[0] <= 0.375 < run.now.position_rad[0] - START[0]
    assert run.now.position_rad[1] - START[1] == pytest.approx(0.075, abs=1e-3)


def test_nothing_is_blended_without_a_share_or_a_way() -> None:
    for motion in (ptp(moved(A1=0.1)), ptp(START, MotionParameters(blending_rel=1.0))):
        run = began(motion, at())
        while not motion.ended:
            run.cycle()
            assert not motion.blend_begins(now_ns=0)


def test_what_is_smart_servos_means_nothing() -> None:
    odd = MotionParameters(acceleration_override=99.0, joint_jerk_percent=0.0, minimum_execution_time_s=50.0)
    run, plain = began(ptp(moved(A1=0.1), odd), at()), began(ptp(moved(A1=0.1)), at())
    run.until(lambda: run.motion.ended)
    plain.until(lambda: plain.motion.ended)
    assert run.set_points == plain.set_points


def test_it_takes_no_new_destination() -> None:
    motion = ptp(moved(A1=0.1))
    run = began(motion, at())
    run.cycle(20)
    assert run.go_to(START) == TAKES_NO_DESTINATION
    run.until(lambda: motion.ended)
    assert run.now.position_rad == moved(A1=0.1)


@pytest.mark.parametrize(
    ("point", "parameters", "reason"),
    [
        (None, MotionParameters(), ErrorReason.NULL_POINTER),
        ((0.0,) * 5, MotionParameters(), ErrorReason.NUMBER_OF_DOFS),
        ((math.nan,) * 7, MotionParameters(), ErrorReason.INVALID_INPUT_VALUES),
        ((0.0, 0.0, 0.0, 2.2, 0.0, 0.0, 0.0), MotionParameters(), ErrorReason.POSITIONAL_LIMITS),
        (START, MotionParameters(joint_velocity_rel=0.0), ErrorReason.INVALID_INPUT_VALUES),
        (START, MotionParameters(joint_acceleration_rel=1.5), ErrorReason.OVERRIDE_OUT_OF_RANGE),
        (START, MotionParameters(blending_rel=1.5), ErrorReason.INVALID_INPUT_VALUES),
        (moved(A1=0.5), MotionParameters(joint_velocity_rel=1e-6), ErrorReason.EXECUTION_TIME_TOO_BIG),
    ],
)
def test_a_ptp_that_cannot_be_does_not_begin(
    point: Vector | None, parameters: MotionParameters, reason: ErrorReason
) -> None:
    refused = Run(ptp(point, parameters), at()).refused
    assert refused is not None
    assert refused.reason == reason
    assert refused.detail


def test_a_point_too_near_the_end_for_a_moving_arm_is_refused_with_figures() -> None:
    high = basis_of().limits.position_max_rad[1]
    start = SetPoint((0.0, high - 0.02, *(0.0,) * 5), (0.0, 1.0, *(0.0,) * 5))
    refused = Run(ptp((0.0,) * 7), start).refused
    assert refused is not None
    assert refused.reason == ErrorReason.POSITIONAL_LIMITS
    assert refused.detail.startswith("A2 would go to")
    assert (
        Run(make(MotionKind.PTP, replace(basis_of()), (0.0,) * 7), start._replace(velocity_rad_s=STILL)).refused is None
    )
