"""Poses, and the S-R-S arm forward and inverse. Oracle: Pinocchio. HIL_SOAK_POSES sets the poses a robot."""

import math
import os
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio
import pytest
from hypothesis import given
from hypothesis import strategies as st

from backends.robots import FLANGE, load_description, load_pinocchio
from hil.core.kinematics.answers import NoPosition, OutsideLimits, Reach, Singular, Unreachable
from hil.core.kinematics.geometry import srs_lengths
from hil.core.kinematics.singularities import Singularity
from hil.core.kinematics.srs import ELBOW, OVERHEAD, STATUSES, WRIST, SrsKinematics, turn_of
from hil.values.arm import seven
from hil.values.errors import ConfigurationError, OutOfRange
from hil.values.pose import Pose
from hil.values.robot import Seven
from tests.unit.robots_support import NAMES, Array, facts_of

EXACT = 1e-9
POSES = int(os.environ.get("HIL_SOAK_POSES", "100000"))
RIGHT_ANGLE_DEG = 90.0

angles_deg = st.floats(-180.0, 180.0)
pitches_deg = st.floats(-89.9, 89.9)
kinematics = pytest.mark.parametrize("name", NAMES)


class Arm:
    """A robot with its closed form, and Pinocchio's flange to judge it by."""

    def __init__(self, name: str) -> None:
        self.model = load_pinocchio(name)
        self.limits = load_description(name).limits
        self.closed = SrsKinematics(self.model, self.limits)
        self._data = self.model.createData()
        self._flange = self.model.getFrameId(FLANGE)
        self._wrist = self.model.getJointId("A6")

    def flange(self, position_rad: Seven) -> Array:
        pinocchio.framesForwardKinematics(self.model, self._data, np.array(position_rad))
        return np.array(self._data.oMf[self._flange].homogeneous)

    def wrist_centre(self, position_rad: Seven) -> Array:
        pinocchio.framesForwardKinematics(self.model, self._data, np.array(position_rad))
        return np.array(self._data.oMi[self._wrist].translation)

    def pose(self, position_rad: Seven) -> Pose:
        return Pose.from_homogeneous(self.flange(position_rad))

    def random(self, count: int, *, seed: int = 7) -> Iterator[Seven]:
        random = np.random.default_rng(seed)
        low, high = self.limits.position_min_rad, self.limits.position_max_rad
        return (seven(random.uniform(low, high).tolist()) for _ in range(count))

    def inside(self, position_rad: Seven) -> bool:
        low, high = self.limits.position_min_rad, self.limits.position_max_rad
        return all(a <= value <= b for a, value, b in zip(low, position_rad, high, strict=True))


@pytest.fixture(scope="module")
def arm() -> Arm:
    return Arm("lbr-iiwa-14-r820")


def found(answer: Seven | NoPosition) -> Seven:
    assert not isinstance(answer, NoPosition), str(answer)
    return answer


def degrees(*values: float) -> Seven:
    return seven([math.radians(value) for value in values])


def test_abc_turn_about_z_then_y_then_x() -> None:
    random = np.random.default_rng(1)
    for a, b, c in random.uniform(-math.pi, math.pi, (500, 3)).tolist():
        pose = Pose.from_abc_rad((0.1, 0.2, 0.3), a, b, c)
        expected = pinocchio.SE3(pinocchio.rpy.rpyToMatrix(c, b, a), np.array((0.1, 0.2, 0.3))).homogeneous
        np.testing.assert_allclose(pose.homogeneous(), expected, rtol=0, atol=1e-14)
        assert Pose.from_homogeneous(expected).angle_rad(pose) < 1e-14


@given(angles_deg, pitches_deg, angles_deg)
def test_abc_come_back(a_deg: float, b_deg: float, c_deg: float) -> None:
    back = Pose.from_abc_deg((0.0, 0.0, 0.0), a_deg, b_deg, c_deg).abc_deg()
    for given_deg, came_back_deg in zip((a_deg, b_deg, c_deg), back, strict=True):
        assert math.remainder(given_deg - came_back_deg, 360.0) == pytest.approx(0.0, abs=1e-9)


@given(angles_deg, st.sampled_from((-1.0, 1.0)), angles_deg, st.sampled_from((0.0, 1e-15, 1e-13, 1e-11, 1e-8, 1e-4)))
def test_in_gimbal_lock_abc_still_give_the_same_rotation(a: float, sign: float, c: float, beside: float) -> None:
    pose = Pose.from_abc_deg((0.0, 0.0, 0.0), a, sign * (RIGHT_ANGLE_DEG - beside), c)
    assert pose.angle_rad(Pose.from_abc_deg((0.0, 0.0, 0.0), *pose.abc_deg())) < 1e-12


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_in_gimbal_lock_a_is_zero_and_c_has_the_rest(sign: float) -> None:
    """Up and down in turn, A + C or C - A is all there is."""
    a, b, c = Pose.from_abc_deg((0.0, 0.0, 0.0), 30.0, sign * RIGHT_ANGLE_DEG, 50.0).abc_deg()
    assert (a, b, c) == pytest.approx((0.0, sign * RIGHT_ANGLE_DEG, 50.0 - sign * 30.0), abs=1e-9)


def test_quaternions_are_those_of_pinocchio() -> None:
    random = np.random.default_rng(2)
    half_turns = [(0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0), (0.0, 0.6, 0.0, 0.8)]
    for w, x, y, z in (*random.normal(size=(500, 4)).tolist(), *half_turns):
        pose = Pose.from_quaternion((1.0, 2.0, 3.0), (w, x, y, z))
        turn = pinocchio.Quaternion(w, x, y, z).normalized().toRotationMatrix()
        np.testing.assert_allclose(pose.homogeneous()[:3, :3], turn, rtol=0, atol=1e-14)
        back = pose.quaternion_wxyz()
        assert back[0] >= 0.0
        assert math.hypot(*back) == pytest.approx(1.0, abs=1e-15)
        assert Pose.from_quaternion((1.0, 2.0, 3.0), back).angle_rad(pose) < 1e-14


def test_composition_and_inverse_are_those_of_matrices() -> None:
    random = np.random.default_rng(3)
    poses = [Pose.from_quaternion((*row[:3],), (*row[3:],)) for row in random.normal(size=(101, 7)).tolist()]
    for first, second in pairwise(poses):
        product = first.homogeneous() @ second.homogeneous()
        np.testing.assert_allclose((first @ second).homogeneous(), product, rtol=0, atol=1e-14)
        np.testing.assert_allclose((first @ first.inverse()).homogeneous(), np.eye(4), rtol=0, atol=1e-14)
        np.testing.assert_allclose((first.inverse() @ first).homogeneous(), np.eye(4), rtol=0, atol=1e-14)


def test_distance_and_angle_between_poses() -> None:
    pose = Pose.from_abc_deg((1.0, 2.0, 3.0), 10.0, 20.0, 30.0)
    for angle_deg in (1e-9, 1.0, 120.0, 179.0):
        other = pose @ Pose.from_abc_deg((0.0, 0.3, 0.4), angle_deg, 0.0, 0.0)
        assert pose.distance_m(other) == pytest.approx(0.5, abs=1e-14)
        assert math.degrees(pose.angle_rad(other)) == pytest.approx(angle_deg, abs=1e-11)


def test_what_is_no_pose_is_refused() -> None:
    with pytest.raises(OutOfRange, match="length of the quaternion"):
        Pose.from_quaternion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    with pytest.raises(ConfigurationError, match="finite numbers"):
        Pose.from_abc_deg((0.0, 0.0, math.inf), 0.0, 0.0, 0.0)
    with pytest.raises(ConfigurationError, match="finite numbers"):
        Pose.from_quaternion((0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0))
    mirror, far, plain = np.diag((1.0, 1.0, -1.0, 1.0)), np.eye(4), np.eye(3)
    far[0, 3] = math.nan
    for matrix in (mirror, far, plain, 2.0 * np.eye(4)):
        with pytest.raises(ConfigurationError, match="no pose"):
            Pose.from_homogeneous(matrix)


@kinematics
def test_lengths_are_read_from_the_model(name: str) -> None:
    assert srs_lengths(load_pinocchio(name)) == pytest.approx(facts_of(name).lengths_m, abs=1e-12)


def test_a_model_that_is_no_srs_arm_is_refused() -> None:
    def moved(joint: str, *, by: tuple[float, float, float]) -> "pinocchio.Model":
        model = load_pinocchio(NAMES[0])
        model.jointPlacements[model.getJointId(joint)].translation += np.array(by)
        return model

    for joint in ("A1", "A2", "A3", "A5", "A7"):
        with pytest.raises(ConfigurationError, match="not an S-R-S arm: it has A"):
            srs_lengths(moved(joint, by=(0.001, 0.0, 0.0)))
    assert srs_lengths(moved("A3", by=(0.0, 0.0, 0.01))).d3_m == pytest.approx(0.41), "along its axis is no offset"
    turned = load_pinocchio(NAMES[0])
    turned.jointPlacements[turned.getJointId("A4")].rotation = pinocchio.rpy.rpyToMatrix(0.0, 0.0, math.pi)
    with pytest.raises(ConfigurationError, match="A4 with the direction"):
        srs_lengths(turned)
    with pytest.raises(ConfigurationError, match="no frame 'tool'"):
        srs_lengths(load_pinocchio(NAMES[0]), "tool")
    with pytest.raises(ConfigurationError, match="has its flange at"):
        srs_lengths(moved_flange())
    with pytest.raises(ConfigurationError, match="valid: 7 revolute joints"):
        srs_lengths(pinocchio.buildSampleModelManipulator())


def moved_flange() -> "pinocchio.Model":
    model = load_pinocchio(NAMES[0])
    model.frames[model.getFrameId(FLANGE)].placement.translation += np.array((0.0, 0.01, 0.0))
    return model


def test_limits_beyond_half_a_turn_are_refused(arm: Arm) -> None:
    wide = replace(arm.limits, position_max_rad=degrees(170, 120, 170, 120, 170, 120, 181))
    with pytest.raises(ConfigurationError, match="limits of A7"):
        SrsKinematics(arm.model, wide)


@kinematics
def test_forward_is_pinocchio_s(name: str) -> None:
    arm = Arm(name)
    for q in arm.random(500):
        np.testing.assert_allclose(arm.closed.forward(q).homogeneous(), arm.flange(q), rtol=0, atol=1e-12)


@kinematics
def test_inverse_comes_back_to_the_pose_in_the_right_branch(name: str) -> None:
    """The pose to 1e-9, the status asked for, and the very axis positions it came from."""
    arm = Arm(name)
    for q in arm.random(POSES):
        flange, status = arm.flange(q), arm.closed.status_of(q)
        answer = found(arm.closed.inverse(Pose.from_homogeneous(flange), q[2], status))
        assert np.abs(arm.flange(answer) - flange).max() < EXACT
        assert answer[2] == q[2]
        assert arm.closed.status_of(answer) == status
        assert math.dist(answer, q) < 1e-6


@kinematics
def test_all_eight_branches_are_answered_or_named(name: str) -> None:
    """At the E1 of a position all branches exist; which of them are left out is a matter of axis limits only."""
    arm = Arm(name)
    answered = dict.fromkeys(STATUSES, 0)
    for q in arm.random(max(1, POSES // 30)):
        flange = arm.flange(q)
        pose = Pose.from_homogeneous(flange)
        answers = arm.closed.branches(pose, q[2])
        assert any(not isinstance(answer, NoPosition) and math.dist(answer, q) < 1e-6 for answer in answers)
        for status, answer in zip(STATUSES, answers, strict=True):
            assert answer == arm.closed.inverse(pose, q[2], status)
            if isinstance(answer, NoPosition):
                assert isinstance(answer, OutsideLimits)
                assert not answer.min_rad <= answer.value_rad <= answer.max_rad
                continue
            answered[status] += 1
            assert arm.closed.status_of(answer) == status
            assert arm.inside(answer)
            assert np.abs(arm.flange(answer) - flange).max() < EXACT
    assert min(answered.values()) > 0.1 * POSES // 30, answered


@kinematics
def test_status_is_that_of_the_facts(name: str) -> None:
    """Facts 7; the wrist centre from Pinocchio, turned back by A1."""
    arm = Arm(name)
    for q in arm.random(500):
        x, y, _ = arm.wrist_centre(q)
        status = arm.closed.status_of(q)
        assert bool(status & OVERHEAD) == (math.cos(q[0]) * x + math.sin(q[0]) * y < 0.0)
        assert bool(status & ELBOW) == (q[3] < 0.0)
        assert bool(status & WRIST) == (q[5] <= 0.0)


def test_a_stretched_wrist_and_a_stretched_elbow_have_the_status_of_the_facts(arm: Arm) -> None:
    assert arm.closed.status_of(degrees(0, 30, 0, 40, 0, 0, 0)) == WRIST
    assert arm.closed.status_of(degrees(0, 30, 0, 0, 0, 90, 0)) == 0


@pytest.mark.parametrize("a4_rad", [1e-3, 1e-4, 1e-5, 1e-6])
def test_next_to_the_stretched_arm_rounding_makes_no_pose_unreachable(arm: Arm, a4_rad: float) -> None:
    """The wrist centre overhead too, so that the elbow leads it as far aside as it can."""
    random = np.random.default_rng(12)
    for a1, a5, a6 in random.uniform(0.2, 1.5, (100, 3)).tolist():
        q = (a1, 0.0, math.pi / 2.0, a4_rad, a5, a6, 0.5)
        flange = arm.flange(q)
        answer = arm.closed.inverse(Pose.from_homogeneous(flange), q[2], 0)
        assert np.abs(arm.flange(found(answer)) - flange).max() < EXACT


def test_turn_has_a_bit_for_each_negative_axis() -> None:
    assert turn_of(degrees(0, 0, 0, 0, 0, 0, 0)) == 0
    assert turn_of(degrees(-1, 0, 0, 0, 0, 0, 0)) == 1
    assert turn_of(degrees(1, -1, 1, 1, -1, 1, -1)) == 0b1010010
    assert turn_of(degrees(-1, -1, -1, -1, -1, -1, -1)) == 127


def test_a_status_that_does_not_exist_is_refused(arm: Arm) -> None:
    pose = arm.pose(degrees(0, 30, 0, 40, 0, 90, 0))
    for status in (-1, 8):
        with pytest.raises(OutOfRange, match="status"):
            arm.closed.inverse(pose, 0.0, status)


def test_out_of_reach_says_by_how_much(arm: Arm) -> None:
    """Along the line from the shoulder to the wrist centre of a stretched arm."""
    d1, d3, d5, _ = arm.closed.lengths
    straight = arm.pose(degrees(20, 30, 0, 0, 0, 50, 0))
    x, y, z = arm.wrist_centre(degrees(20, 30, 0, 0, 0, 50, 0)) - (0.0, 0.0, d1)
    for by_m in (1e-6, 0.1, 5.0):
        part = by_m / (d3 + d5)
        away = straight._replace(x_m=straight.x_m + part * x, y_m=straight.y_m + part * y, z_m=straight.z_m + part * z)
        answer = arm.closed.inverse(away, 0.0, 0)
        assert isinstance(answer, Unreachable)
        assert answer.reach is Reach.FAR
        assert answer.by_m == pytest.approx(by_m, rel=1e-6)
    assert str(answer) == "unreachable: the wrist centre is 5000 mm beyond the stretched arm"


def test_inside_the_folded_arm_says_by_how_much(arm: Arm) -> None:
    d1, d3, d5, d7 = arm.closed.lengths
    answer = arm.closed.inverse(Pose(0.005, 0.0, d1 + d7), 0.0, 0)
    assert isinstance(answer, Unreachable)
    assert answer.reach is Reach.NEAR
    assert answer.by_m == pytest.approx(d3 - d5 - 0.005)


def test_an_e1_that_leads_the_wrist_past_the_axis_of_a1(arm: Arm) -> None:
    """A wrist centre 0.1 m from that axis, and an elbow that is led aside by 0.4 m times the sine of A4."""
    at_zero = arm.closed.lengths.d1_m + 0.5
    pose = Pose.from_abc_deg((0.1 + arm.closed.lengths.d7_m, 0.0, at_zero), 0.0, 90.0, 0.0)
    found(arm.closed.inverse(pose, 0.1, ELBOW))
    target = arm.closed.wrist_target(pose)
    assert not isinstance(target, NoPosition)
    answer = arm.closed.inverse(pose, math.radians(90.0), ELBOW)
    assert isinstance(answer, Unreachable)
    assert answer.reach is Reach.ASIDE
    assert answer.by_m == pytest.approx(0.4 * math.sin(target.a4) - 0.1)


def test_outside_the_limits_names_the_axis_its_value_and_its_range(arm: Arm) -> None:
    inside = degrees(10, 20, 30, 40, 50, 60, 70)
    for axis in range(7):
        high = arm.limits.position_max_rad[axis]
        q = seven([high + 0.01 if index == axis else value for index, value in enumerate(inside)])
        answer = arm.closed.inverse(arm.pose(q), q[2], arm.closed.status_of(q))
        assert isinstance(answer, OutsideLimits)
        assert answer == OutsideLimits(axis, answer.value_rad, -high, high)
        assert answer.value_rad == pytest.approx(high + 0.01)
        back = seven([high if index == axis else value for index, value in enumerate(inside)])
        assert arm.inside(found(arm.closed.inverse(arm.pose(back), back[2], arm.closed.status_of(back))))
    answer = arm.closed.inverse(arm.pose(inside), 3.0, 0)
    assert str(answer) == "outside its limits: A3 at 3 rad; valid: -2.96706 to 2.96706 rad"
    assert arm.closed.branches(arm.pose(inside), 3.0) == (answer,) * 8


@kinematics
@pytest.mark.parametrize("beside", [1e-3, 1e-6, 1e-8, 1e-9, 1e-11, 1e-13, 0.0])
def test_beside_singularities_the_pose_is_as_exact(name: str, beside: float) -> None:
    """A4, A6 and the wrist centre's x next to 0, alone and together.

    Beside two of them at once, rounding may turn A1 or A5 out of its limits, but not the flange off its pose.
    """
    arm = Arm(name)
    _, d3, d5, _ = arm.closed.lengths
    random = np.random.default_rng(11)
    for case in range(1, 8):
        for _ in range(40):
            q1, q2, q3, q4, q5, q6, q7 = (random.uniform(0.2, 1.5, 7) * random.choice((-1.0, 1.0), 7)).tolist()
            signs = random.choice((-1.0, 1.0), 3).tolist()
            q4 = signs[0] * beside if case & 1 else q4
            q6 = signs[1] * beside if case & 2 else q6
            overhead = math.atan2(d5 * math.sin(q4) * math.cos(q3), d3 + d5 * math.cos(q4))
            q2 = overhead + signs[2] * beside if case & 4 else q2
            q = (q1, q2, q3, q4, q5, q6, q7)
            flange = arm.flange(q)
            status = arm.closed.status_of(q)
            answer = arm.closed.inverse(Pose.from_homogeneous(flange), q3, status, near_rad=q)
            if case in {1, 2, 4} or beside in {1e-3, 0.0}:
                assert math.dist(found(answer), q) < 1e-4
            if isinstance(answer, NoPosition):
                assert isinstance(answer, OutsideLimits)
                assert answer.axis in {0, 4, 6}
            else:
                assert np.abs(arm.flange(answer) - flange).max() < EXACT


def test_two_axes_on_one_line_are_singular_until_one_is_given(arm: Arm) -> None:
    stretched_wrist = degrees(10, 20, 30, 40, 50, 0, 60)
    pose = arm.pose(stretched_wrist)
    assert arm.closed.inverse(pose, stretched_wrist[2], 0) == Singular(Singularity.WRIST_STRETCHED)
    answer = found(arm.closed.inverse(pose, stretched_wrist[2], 0, near_rad=stretched_wrist))
    assert math.dist(answer, stretched_wrist) < 1e-6
    for status, branch in enumerate(arm.closed.branches(pose, stretched_wrist[2], near_rad=stretched_wrist)):
        assert branch == arm.closed.inverse(pose, stretched_wrist[2], status, near_rad=stretched_wrist)
    on_axis = degrees(10, 0, 0, 0, 50, 30, 60)
    pose = arm.pose(on_axis)
    refused = arm.closed.inverse(pose, 0.0, 0)
    assert refused == Singular(Singularity.WRIST_CENTRE_OVERHEAD)
    assert str(refused) == "singular: wrist centre at x = 0 in the frame turned by A1"
    answer = found(arm.closed.inverse(pose, 0.0, 0, near_rad=on_axis))
    assert math.dist(answer, on_axis) < 1e-6


@given(
    st.lists(st.floats(), min_size=12, max_size=12),
    st.floats(),
    st.integers(0, 7),
    st.one_of(st.none(), st.just((0.0,) * 7)),
)
def test_no_numbers_make_it_raise(numbers: list[float], e1_rad: float, status: int, near: Seven | None) -> None:
    """An answer for any number, and never a position with a hole in it."""
    closed = ARM.closed
    x, y, z, r00, r01, r02, r10, r11, r12, r20, r21, r22 = numbers
    pose = Pose(x, y, z, (r00, r01, r02, r10, r11, r12, r20, r21, r22))
    answer = closed.inverse(pose, e1_rad, status, near_rad=near)
    assert str(answer)
    assert isinstance(answer, NoPosition) or ARM.inside(answer)


ARM = Arm(NAMES[0])
