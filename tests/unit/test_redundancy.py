"""The singularities of facts 8 against the Jacobian, and the answer nearest to the present axis positions."""

import math
from collections.abc import Callable

import numpy as np
import pinocchio
import pytest

from backends.robots import FLANGE, load_description, load_pinocchio
from hil.core.kinematics.answers import NoPosition, OutsideLimits, Unreachable
from hil.core.kinematics.redundancy import largest_change_rad, nearest
from hil.core.kinematics.singularities import Singularity
from hil.core.kinematics.srs import SrsKinematics, WristTarget
from hil.values.arm import seven
from hil.values.pose import Pose
from hil.values.robot import Seven
from tests.unit.robots_support import NAMES, Array

EXACT = 1e-9
QUARTER = math.pi / 2.0
kinematics = pytest.mark.parametrize("name", NAMES)


class Arm:
    """A robot with its closed form and Pinocchio's Jacobian; random axes keep 0.2 rad from 0 and from their limits."""

    def __init__(self, name: str) -> None:
        self.model = load_pinocchio(name)
        self.limits = load_description(name).limits
        self.closed = SrsKinematics(self.model, self.limits)
        self._data = self.model.createData()
        self._flange = self.model.getFrameId(FLANGE)
        self._random = np.random.default_rng(5)
        self._high = np.array(self.limits.position_max_rad)

    def jacobian(self, position_rad: Seven) -> Array:
        axes = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        q = np.array(position_rad)
        return np.array(pinocchio.computeFrameJacobian(self.model, self._data, q, self._flange, axes))

    def smallest_singular_values(self, position_rad: Seven) -> tuple[float, float]:
        """Of the 6x7 Jacobian, and of the 6x6 one with A3 held."""
        jacobian = self.jacobian(position_rad)
        held = np.delete(jacobian, 2, axis=1)
        return (
            float(np.linalg.svd(jacobian, compute_uv=False)[-1]),
            float(np.linalg.svd(held, compute_uv=False)[-1]),
        )

    def random(self, **fixed_rad: float) -> Seven:
        signs = self._random.choice((-1.0, 1.0), 7)
        q = (self._random.uniform(0.2, self._high - 0.2) * signs).tolist()
        for axis, value in fixed_rad.items():
            q[int(axis[1]) - 1] = value
        return seven(q)

    def overhead_rad(self, position_rad: Seven) -> float:
        """The A2 that puts the wrist centre on x = 0."""
        _, d3, d5, _ = self.closed.lengths
        a3, a4 = position_rad[2:4]
        return math.atan2(d5 * math.sin(a4) * math.cos(a3), d3 + d5 * math.cos(a4))

    def beside(self, position_rad: Seven, distance_rad: float) -> Seven:
        step = self._random.normal(size=7)
        moved = np.array(position_rad) + step * distance_rad / np.linalg.norm(step)
        return seven(np.clip(moved, -self._high, self._high).tolist())

    def reaches(self, answer: Seven, pose: Pose) -> bool:
        flange = self.closed.forward(answer)
        low, high = self.limits.position_min_rad, self.limits.position_max_rad
        inside = all(a <= value <= b for a, value, b in zip(low, answer, high, strict=True))
        return inside and flange.distance_m(pose) < EXACT and flange.angle_rad(pose) < EXACT


CONDITIONS = {
    Singularity.ELBOW_STRETCHED: {"A4": 0.0},
    Singularity.WRIST_STRETCHED: {"A6": 0.0},
    Singularity.SHOULDER_WITH_ELBOW_SIDEWAYS: {"A2": 0.0, "A3": -QUARTER},
    Singularity.WRIST_WITH_ELBOW_SIDEWAYS: {"A6": 0.0, "A5": QUARTER},
    Singularity.SHOULDER_AND_WRIST: {"A2": 0.0, "A6": 0.0},
    Singularity.ELBOW_RIGHT_ANGLE_AND_WRIST: {"A4": QUARTER, "A6": 0.0},
}


def found(answer: Seven | NoPosition) -> Seven:
    assert not isinstance(answer, NoPosition), str(answer)
    return answer


def in_singularity(arm: Arm, singularity: Singularity) -> Seven:
    """Random axis positions in one singularity and in no other of its own making."""
    if singularity is Singularity.WRIST_CENTRE_OVERHEAD:
        q = arm.random()
        return seven([q[0], arm.overhead_rad(q), *q[2:]])
    return arm.random(**CONDITIONS[singularity])


@kinematics
@pytest.mark.parametrize("singularity", Singularity)
def test_each_singularity_takes_a_rank_where_its_row_says(name: str, singularity: Singularity) -> None:
    arm = Arm(name)
    whole: list[float] = []
    for _ in range(200):
        q = in_singularity(arm, singularity)
        assert singularity in arm.closed.singularities_of(q, tolerance_rad=1e-9)
        whole_arm, e1_held = arm.smallest_singular_values(q)
        whole.append(whole_arm)
        assert e1_held < 1e-12
    if singularity.whole_arm:
        assert max(whole) < 1e-12
    else:
        assert np.median(whole) > 0.02


@kinematics
def test_with_e1_held_the_determinant_is_the_product_of_three_factors(name: str) -> None:
    """So no singularity is missing from the table: it has a row for each factor."""
    arm = Arm(name)
    _, d3, d5, _ = arm.closed.lengths
    random = np.random.default_rng(9)
    for _ in range(500):
        q = seven(random.uniform(arm.limits.position_min_rad, arm.limits.position_max_rad).tolist())
        _, a2, a3, a4, _, a6, _ = q
        x = -d5 * math.sin(a4) * math.cos(a3) * math.cos(a2) + (d3 + d5 * math.cos(a4)) * math.sin(a2)
        held = float(np.linalg.det(np.delete(arm.jacobian(q), 2, axis=1)))
        assert abs(held) == pytest.approx(abs(d3 * d5 * math.sin(a4) * x * math.sin(a6)), abs=1e-14)


@kinematics
def test_away_from_all_rows_the_arm_is_regular(name: str) -> None:
    """And beside a singularity of the whole arm a row of that kind is named: none of these is missing either."""
    arm = Arm(name)
    random = np.random.default_rng(10)
    named = 0
    for _ in range(4000):
        q = seven(random.uniform(arm.limits.position_min_rad, arm.limits.position_max_rad).tolist())
        whole_arm, e1_held = arm.smallest_singular_values(q)
        rows = arm.closed.singularities_of(q, tolerance_rad=0.2)
        assert rows or e1_held > 1e-3
        if whole_arm < 2e-3:
            named += 1
            assert any(row.whole_arm for row in rows), (q, whole_arm)
    assert named > 10


def test_the_tolerance_is_an_angle() -> None:
    arm = Arm(NAMES[1])
    for singularity in Singularity:
        q = in_singularity(arm, singularity)
        axis = {"A2": 1, "wr": 1, "A4": 3, "A6": 5}[singularity.condition[:2]]
        away = seven([value + (0.02 if index == axis else 0.0) for index, value in enumerate(q)])
        assert singularity in arm.closed.singularities_of(away, tolerance_rad=0.0201)
        assert singularity not in arm.closed.singularities_of(away, tolerance_rad=0.0199)


def test_candle_is_in_three_of_them() -> None:
    rows = Arm(NAMES[0]).closed.singularities_of((0.0,) * 7, tolerance_rad=0.0)
    assert rows == (
        Singularity.ELBOW_STRETCHED,
        Singularity.WRIST_CENTRE_OVERHEAD,
        Singularity.WRIST_STRETCHED,
        Singularity.SHOULDER_AND_WRIST,
    )


@kinematics
def test_standing_still_is_the_nearest_answer_even_in_a_singularity(name: str) -> None:
    arm = Arm(name)
    for q in ((0.0,) * 7, *(in_singularity(arm, singularity) for singularity in Singularity)):
        assert nearest(arm.closed, arm.closed.forward(q), q) == q


@kinematics
@pytest.mark.parametrize("distance_rad", [1e-6, 1e-4, 1e-2, 0.3])
def test_e1_and_branch_are_kept_where_the_arm_is_well_conditioned(name: str, distance_rad: float) -> None:
    arm = Arm(name)
    kept = 0
    for _ in range(200):
        present = arm.random()
        pose = arm.closed.forward(arm.beside(present, distance_rad))
        answer = found(nearest(arm.closed, pose, present))
        assert arm.reaches(answer, pose)
        kept += answer == arm.closed.inverse(pose, present[2], arm.closed.status_of(present))
    assert kept > 170


def beside_nothing(arm: Arm) -> Seven:
    return arm.random()


def beside_stretched_wrist(arm: Arm) -> Seven:
    return arm.random(A6=0.0)


def beside_overhead(arm: Arm) -> Seven:
    return in_singularity(arm, Singularity.WRIST_CENTRE_OVERHEAD)


STARTS = (beside_nothing, beside_stretched_wrist, beside_overhead)


def beside_both(arm: Arm) -> Seven:
    q = beside_overhead(arm)
    return seven([*q[:5], 0.0, q[6]])


@kinematics
@pytest.mark.parametrize(
    ("start", "distance_rad"),
    [
        *((start, distance) for start in STARTS for distance in (1e-6, 1e-4, 1e-3, 1e-2)),
        # Closer than that, rounding decides about A5: see srs.py.
        *((beside_both, distance) for distance in (1e-4, 1e-3, 1e-2)),
    ],
)
def test_a_pose_close_by_is_reached_close_by(name: str, start: Callable[[Arm], Seven], distance_rad: float) -> None:
    """Continuity: where the whole arm is regular the axes go about as far as the pose does, E1 held or not."""
    arm = Arm(name)
    judged = 0
    for _ in range(100):
        present = start(arm)
        if arm.smallest_singular_values(present)[0] < 0.05:
            continue
        judged += 1
        pose = arm.closed.forward(arm.beside(present, distance_rad))
        answer = found(nearest(arm.closed, pose, present))
        assert arm.reaches(answer, pose)
        assert largest_change_rad(answer, present) < 40.0 * distance_rad
    assert judged > 10


@kinematics
@pytest.mark.parametrize("aside_deg", [0.0, 0.02, 0.2, 1.0])
def test_a_path_past_the_stretched_wrist_has_no_jump(name: str, aside_deg: float) -> None:
    """Steps of 0.1 deg that turn A6 from 10 to -10 deg, the flange a little aside; with E1 held A5 swings."""
    arm = Arm(name)
    start = seven([math.radians(value) for value in (10, 40, 20, 70, 60, 10, 30)])
    a7 = start[6]
    lean = Pose.from_abc_deg((0.0, 0.0, 0.0), 0.0, aside_deg * math.cos(a7), aside_deg * math.sin(a7))
    present, held, swing = start, start, 0.0
    for step in range(201):
        pose = arm.closed.forward(seven([*start[:5], math.radians(10.0 - 0.1 * step), a7])) @ lean
        answer = found(nearest(arm.closed, pose, present))
        assert arm.reaches(answer, pose)
        assert step == 0 or largest_change_rad(answer, present) < math.radians(1.0)
        present = answer
        with_e1_held = arm.closed.inverse(pose, start[2], 0, near_rad=held)
        if not isinstance(with_e1_held, NoPosition):
            swing = max(swing, largest_change_rad(with_e1_held, held))
            held = with_e1_held
    assert present[5] < 0.0
    assert swing > 1.0


@kinematics
def test_what_a_kept_e1_cannot_reach_another_does_about_as_near_as_a_fine_search_finds(name: str) -> None:
    """The fine search takes 1200 E1 in all branches; the answer may miss valleys that are narrower than its steps."""
    arm = Arm(name)
    low, high = arm.limits.position_min_rad[2], arm.limits.position_max_rad[2]
    excess_rad: list[float] = []
    while len(excess_rad) < 25:
        present, goal = arm.random(), arm.random()
        pose = arm.closed.forward(goal)
        if not isinstance(arm.closed.inverse(pose, present[2], arm.closed.status_of(present)), NoPosition):
            continue
        answer = found(nearest(arm.closed, pose, present))
        assert arm.reaches(answer, pose)
        branches = (arm.closed.branches(pose, e1) for e1 in np.linspace(low, high, 1200).tolist())
        fine = (branch for eight in branches for branch in eight if not isinstance(branch, NoPosition))
        best = min(largest_change_rad(branch, present) for branch in fine)
        excess_rad.append(largest_change_rad(answer, present) - best)
    assert np.median(excess_rad) < 0.001
    assert np.quantile(excess_rad, 0.85) < 0.05


def test_without_an_answer_the_reason_of_the_present_branch_is_given() -> None:
    arm = Arm(NAMES[0])
    present = arm.random()
    answer = nearest(arm.closed, Pose(2.0, 0.0, 0.5), present)
    assert isinstance(answer, Unreachable)
    # A4 is the same for every E1.
    folded = arm.closed.forward((0.1, 0.2, 0.3, 2.2, 0.5, 0.6, 0.7))
    answer = nearest(arm.closed, folded, (0.1, 0.2, 0.3, 2.0, 0.5, 0.6, 0.7))
    assert isinstance(answer, OutsideLimits)
    assert answer.axis == 3
    assert answer.value_rad == pytest.approx(2.2)


def test_an_elbow_at_its_limit_is_no_obstacle_to_the_search() -> None:
    """A4 comes back from a pose with rounding, and it is the same for every E1."""
    arm = Arm(NAMES[0])
    limit = arm.limits.position_max_rad[3]
    searched = 0
    for _ in range(100):
        present, goal = arm.random(A4=limit - 0.1), arm.random(A4=limit)
        pose = arm.closed.forward(goal)
        kept = arm.closed.inverse(pose, present[2], arm.closed.status_of(present))
        searched += isinstance(kept, NoPosition)
        assert arm.reaches(found(nearest(arm.closed, pose, present)), pose)
    assert searched > 10


def test_the_search_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Worst where nothing is found, and E1 is searched from limit to limit with both elbows."""
    arm = Arm(NAMES[0])
    calls = 0
    wrist_up = SrsKinematics.wrist_up

    def counted(
        closed: SrsKinematics, target: WristTarget, e1_rad: float, *, overhead: bool, elbow: bool, near: Seven | None
    ) -> object:
        nonlocal calls
        calls += 1
        return wrist_up(closed, target, e1_rad, overhead=overhead, elbow=elbow, near=near)

    monkeypatch.setattr(SrsKinematics, "wrist_up", counted)
    random = np.random.default_rng(3)
    most = 0
    for _ in range(500):
        calls = 0
        x, y, z, *turn = random.uniform(-1.0, 1.0, 7).tolist()
        pose = Pose.from_quaternion((x, y, z + 0.3), (turn[0], turn[1], turn[2], turn[3]))
        nearest(arm.closed, pose, arm.random())
        most = max(most, calls)
    assert 50 < most < 400
    calls = 0
    q = arm.random(A6=0.0)
    nearest(arm.closed, arm.closed.forward(arm.beside(q, 1e-9)), q)
    assert calls < 400


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_a_pose_that_is_no_pose_has_no_answer(number: float) -> None:
    arm = Arm(NAMES[0])
    present = arm.random()
    pose = arm.closed.forward(present)
    holes = [pose._replace(x_m=number), pose._replace(z_m=number)]
    holes += [
        pose._replace(rotation=(*pose.rotation[:index], number, *pose.rotation[index + 1 :]))  # type: ignore[arg-type]
        for index in range(9)
    ]
    for hole in holes:
        answer = nearest(arm.closed, hole, present)
        assert isinstance(answer, NoPosition) or all(map(math.isfinite, answer))
