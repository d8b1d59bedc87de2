"""Laws of the overlay, of braking and of take-overs: limits kept, ends exact, no jump; seeded by hypothesis."""

import itertools
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backends.robots import load_description, robot_names
from hil.core.motion.application_motion import MotionBasis
from hil.core.motion.brake import Brake
from hil.core.motion.executive import PHASES, MotionExecutive, Phase
from hil.core.motion.joint_overlay import JointOverlay
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.errors import IllegalTransition
from hil.values.motion import (
    DIRECT_SERVO_DELTA_RAD,
    ErrorReason,
    Fault,
    FineInterpolatorState,
    MotionKind,
)
from hil.values.robot import JOINT_COUNT, JointLimits, Seven
from tests.support.cases import cases
from tests.support.interpolation import (
    Run,
    assert_in_range,
    assert_no_jump,
    basis_of,
    began,
    make,
    place,
    shares,
)
from tests.support.motion import proposed

CYCLE_S = 0.001
SHARES = st.tuples(*[st.floats(-1, 1) for _ in range(JOINT_COUNT)])


def limits_of(name: str) -> JointLimits:
    return load_description(name).limits


def scaled(shares: tuple[float, ...], limits: tuple[float, ...], factor: float = 1.0) -> Seven:
    return tuple(share * limit * factor for share, limit in zip(shares, limits, strict=True))  # type: ignore[return-value]


def assert_step_is_legal(before: Seven, after: Seven, limits: JointLimits) -> None:
    for axis in range(JOINT_COUNT):
        assert abs(after[axis] - before[axis]) <= limits.velocity_rad_s[axis] * CYCLE_S * (1 + 1e-9) + 1e-15


@given(name=st.sampled_from(robot_names()), start=SHARES, targets=st.lists(SHARES, min_size=1, max_size=5))
def test_overlay_keeps_the_axis_velocities_whatever_it_is_told(
    name: str, start: tuple[float, ...], targets: list[tuple[float, ...]]
) -> None:
    limits = limits_of(name)
    position = scaled(start, limits.position_max_rad)
    overlay = JointOverlay(SetPoint(position, STILL), limits=limits, cycle_s=CYCLE_S, cycles_per_target=5)
    for target in targets:
        overlay.retarget(scaled(target, limits.position_max_rad))
        for _ in range(5):
            after = overlay.interpolate()
            assert_step_is_legal(position, after.position_rad, limits)
            for axis in range(JOINT_COUNT):
                moved = (after.position_rad[axis] - position[axis]) / CYCLE_S
                assert after.velocity_rad_s[axis] == pytest.approx(moved, abs=1e-6)
            position = after.position_rad


@given(cycles=st.integers(1, 100), shares=SHARES)
def test_overlay_reaches_a_legal_target_exactly_when_the_next_is_due(cycles: int, shares: tuple[float, ...]) -> None:
    limits = limits_of("lbr-iiwa-14-r820")
    overlay = JointOverlay(SetPoint(STILL, STILL), limits=limits, cycle_s=CYCLE_S, cycles_per_target=cycles)
    target = scaled(shares, limits.velocity_rad_s, cycles * CYCLE_S * 0.999)
    overlay.retarget(target)
    for index in range(cycles):
        assert not overlay.at_rest, index
        set_point = overlay.interpolate()
    assert set_point.position_rad == target
    assert overlay.at_rest
    assert overlay.interpolate() == SetPoint(target, STILL)
    assert overlay.tracking_performance == 1.0


def test_overlay_reaches_a_far_target_later_and_says_so() -> None:
    limits = limits_of("lbr-iiwa-14-r820")
    overlay = JointOverlay(SetPoint(STILL, STILL), limits=limits, cycle_s=CYCLE_S, cycles_per_target=1)
    target: Seven = (0.01, 0.0, -0.005, 0.0, 0.0, 0.0, 0.0)
    overlay.retarget(target)
    first = overlay.interpolate()
    assert overlay.tracking_performance == pytest.approx(limits.velocity_rad_s[0] * CYCLE_S / 0.01)
    assert first.position_rad[2] == pytest.approx(-first.position_rad[0] / 2)
    cycles = 1
    while not overlay.at_rest:
        overlay.interpolate()
        cycles += 1
    assert overlay.interpolate().position_rad == target
    assert cycles == 7  # 0.01 rad at 1.4835 rad/s


@given(name=st.sampled_from(robot_names()), where=SHARES, velocity=SHARES)
def test_brake_ends_at_rest_in_range_without_a_jump(
    name: str, where: tuple[float, ...], velocity: tuple[float, ...]
) -> None:
    limits = limits_of(name)
    start = SetPoint(scaled(where, limits.position_max_rad), scaled(velocity, limits.velocity_rad_s))
    brake = Brake(start, limits=limits, cycle_s=CYCLE_S)
    assert brake.duration_s < 1.0
    before = start.position_rad
    while not brake.at_rest:
        set_point = brake.interpolate()
        assert_step_is_legal(before, set_point.position_rad, limits)
        for axis in range(JOINT_COUNT):
            low, high = limits.position_min_rad[axis], limits.position_max_rad[axis]
            assert low - 1e-9 <= set_point.position_rad[axis] <= high + 1e-9
        before = set_point.position_rad
    assert brake.interpolate() == SetPoint(before, STILL)


@settings(max_examples=cases(120))
@given(seed=st.integers(0, 2**32), name=st.sampled_from(robot_names()))
def test_brake_from_any_state_keeps_the_range_and_does_not_jump(seed: int, name: str) -> None:
    """Planned motions hand over accelerations that the rated brake may or may not carry."""
    source = random.Random(seed)
    basis = basis_of(name)
    limits = basis.limits
    start = SetPoint(
        shares(source, limits.position_max_rad),
        shares(source, limits.velocity_rad_s),
        shares(source, basis.servo.acceleration_rad_s2, source.choice((0.0, 1.0, 20.0))),
    )
    brake = Brake(start, limits=limits, cycle_s=CYCLE_S)
    path = [start]
    while not brake.at_rest:
        path.append(brake.interpolate())
    assert brake.interpolate() == SetPoint(path[-1].position_rad, STILL)
    hardest_s = min(brake.duration_s, CYCLE_S)
    for before, after in itertools.pairwise(path):
        assert_step_is_legal(before.position_rad, after.position_rad, limits)
        for axis in range(JOINT_COUNT):
            low, high = limits.position_min_rad[axis], limits.position_max_rad[axis]
            assert low - 1e-9 <= after.position_rad[axis] <= high + 1e-9
            assert abs(after.velocity_rad_s[axis]) <= limits.velocity_rad_s[axis] * (1 + 1e-9)
            moved = after.position_rad[axis] - before.position_rad[axis]
            slower, faster = sorted((before.velocity_rad_s[axis], after.velocity_rad_s[axis]))
            assert (slower - 0.05) * hardest_s <= moved <= (faster + 0.05) * CYCLE_S or moved == 0.0


def test_brake_keeps_an_acceleration_it_can_carry() -> None:
    limits = limits_of("lbr-iiwa-7-r800")
    start = SetPoint(STILL, (0.5, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0), (3.0, 0.0, -2.0, 0.0, 0.0, 0.0, 0.0))
    brake = Brake(start, limits=limits, cycle_s=CYCLE_S)
    before = start
    while not brake.at_rest:
        after = brake.interpolate()
        for axis in range(JOINT_COUNT):
            change = after.acceleration_rad_s2[axis] - before.acceleration_rad_s2[axis]
            assert abs(change) <= limits.jerk_rad_s3[axis] * CYCLE_S * (1 + 1e-6) + 1e-6
        before = after


def test_a_slow_axis_does_not_make_the_brake_at_the_end_of_the_range_harder() -> None:
    limits = limits_of("lbr-iiwa-7-r800")
    end = limits.position_max_rad[0]
    start = SetPoint((end - 0.05, 0, 0, 0, 0, 0, 0), (1.0, 0, 0, 0, 0, 0, 1e-9))
    brake = Brake(start, limits=limits, cycle_s=CYCLE_S)
    assert brake.duration_s == pytest.approx(2 * 0.05 / 1.0)
    assert Brake(start, limits=limits, cycle_s=CYCLE_S, longest_s=0.04).duration_s == pytest.approx(0.04)
    assert Brake(start, limits=limits, cycle_s=CYCLE_S, longest_s=0.0).at_rest


def driven(source: random.Random, kind: MotionKind, basis: MotionBasis, start: SetPoint) -> Run:
    """Return a motion of ``kind`` somewhere on its way, after some destinations."""
    parameters = {
        "joint_velocity_rel": source.choice((1.0, 1.0, 0.3)),
        "acceleration_override": source.choice((1.0, 20.0)),
        "joint_jerk_percent": source.choice((100.0, 500.0, 1500.0)),
    }
    first = place(source, basis.limits, start.position_rad) if kind is MotionKind.PTP else None
    run = began(make(kind, basis, first, **parameters), start)
    for _ in range(source.randint(1, 4)):
        if kind is not MotionKind.PTP:
            assert run.go_to(near_or_anywhere(source, kind, basis, run.now.position_rad)) is None
        run.cycle(source.randint(1, 200))
    return run


def near_or_anywhere(source: random.Random, kind: MotionKind, basis: MotionBasis, here: Seven) -> Seven:
    goal = place(source, basis.limits, here)
    if kind is not MotionKind.DIRECT_SERVO:
        return goal
    return tuple(
        min(max(there, now - DIRECT_SERVO_DELTA_RAD), now + DIRECT_SERVO_DELTA_RAD)
        for there, now in zip(goal, here, strict=True)
    )  # type: ignore[return-value]


@settings(max_examples=cases(120))
@given(
    seed=st.integers(0, 2**32),
    kinds=st.tuples(st.sampled_from(MotionKind), st.sampled_from(MotionKind)),
    name=st.sampled_from(robot_names()),
)
def test_a_motion_takes_over_from_any_other_without_a_jump(
    seed: int, kinds: tuple[MotionKind, MotionKind], name: str
) -> None:
    source = random.Random(seed)
    basis = basis_of(name)
    before = driven(source, kinds[0], basis, SetPoint(place(source, basis.limits, STILL), STILL)).now
    goal = near_or_anywhere(source, kinds[1], basis, before.position_rad)
    chosen = goal if kinds[1] is MotionKind.PTP or source.random() < 0.7 else None
    override, jerk = source.choice(((1.0, 100.0), (20.0, 500.0)))
    motion = make(kinds[1], basis, chosen, acceleration_override=override, joint_jerk_percent=jerk)
    run = Run(motion, before)
    if run.refused is not None:
        # The new motion's limits cannot keep the moving arm in its range: then the arm brakes, harder if it must.
        assert run.refused.reason == ErrorReason.POSITIONAL_LIMITS
        assert kinds[1] is not MotionKind.DIRECT_SERVO
        brake = Brake(before, limits=basis.limits, cycle_s=CYCLE_S)
        while not brake.at_rest:
            run.set_points.append(brake.interpolate())
        assert_in_range(run)
        return
    run.until(lambda: motion.interpolator in {FineInterpolatorState.RESTING, FineInterpolatorState.ENDED})
    assert run.now == SetPoint(motion.destination, STILL, STILL)  # type: ignore[arg-type]
    assert chosen is None or motion.destination == chosen
    assert_no_jump(run, hardest=1.05)
    assert_in_range(run)
    for set_point in run.set_points:
        for axis, velocity in enumerate(set_point.velocity_rad_s):
            assert abs(velocity) <= basis.limits.velocity_rad_s[axis] * (1 + 1e-9)


@given(velocity=SHARES)
def test_brake_in_free_space_keeps_rated_deceleration_and_jerk_and_the_path(velocity: tuple[float, ...]) -> None:
    limits = limits_of("lbr-iiwa-7-r800")
    start = SetPoint(STILL, scaled(velocity, limits.velocity_rad_s))
    brake = Brake(start, limits=limits, cycle_s=CYCLE_S)
    positions = [start.position_rad]
    while not brake.at_rest:
        positions.append(brake.interpolate().position_rad)
    fastest = max(range(JOINT_COUNT), key=lambda axis: abs(start.velocity_rad_s[axis]))
    reference = start.velocity_rad_s[fastest]
    for axis in range(JOINT_COUNT):
        path = [position[axis] for position in positions]
        speeds = [(there - here) / CYCLE_S for here, there in itertools.pairwise(path)]
        accelerations = [(there - here) / CYCLE_S for here, there in itertools.pairwise(speeds)]
        assert all(abs(value) <= limits.acceleration_rad_s2[axis] * (1 + 1e-6) + 1e-6 for value in accelerations)
        if abs(reference) > 1e-3:
            ratio = start.velocity_rad_s[axis] / reference
            for position in positions:
                assert position[axis] == pytest.approx(position[fastest] * ratio, abs=1e-6)


def test_brake_at_the_end_of_the_range_stops_there() -> None:
    limits = limits_of("lbr-iiwa-14-r820")
    end = limits.position_max_rad[3]
    start = SetPoint((0, 0, 0, end - 0.001, 0, 0, 0), (0.5, 0, 0, 1.0, 0, 0, 0))
    brake = Brake(start, limits=limits, cycle_s=CYCLE_S)
    while not brake.at_rest:
        last = brake.interpolate()
    assert last.position_rad[3] == pytest.approx(end, abs=1e-12)
    assert last.position_rad[0] == pytest.approx(0.0005, abs=1e-12)


def test_executive_goes_through_its_phases_and_no_others() -> None:
    executive = MotionExecutive(STILL, limits=limits_of("lbr-med-7"), cycle_s=CYCLE_S)
    assert executive.phase is Phase.HOLDING
    assert not executive.brake(Fault("a test"), now_ns=0)
    with pytest.raises(IllegalTransition):
        executive.retarget(STILL)
    executive.start_overlay(cycles_per_target=1)
    with pytest.raises(IllegalTransition):
        executive.start_overlay(cycles_per_target=1)
    executive.retarget((0.001, 0, 0, 0, 0, 0, 0))
    assert not executive.commit(proposed(executive), now_ns=0)
    assert executive.brake(Fault("a test"), now_ns=0)
    ended = False
    while not ended:
        ended = executive.commit(proposed(executive), now_ns=0)
    assert executive.phase is Phase.HOLDING
    assert executive.hold_position_rad == executive.set_point.position_rad
    assert executive.hold_position_rad[0] > 0.001
    assert set(PHASES) == set(Phase)
