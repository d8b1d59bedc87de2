"""Flange pose and Jacobian: MuJoCo, Pinocchio and the product form of facts 1.1 agree."""

import numpy as np
import pytest

from backends.robots import load_description, load_pinocchio, robot_names
from hil.core.model import ArmModel
from hil.values.arm import seven
from tests.unit.robots_support import NAMES, Array, InMujoco, InPinocchio, facts_of, product_form, random_states

EXACT = 1e-9
FLANGE_HEIGHT_M = {
    "lbr-iiwa-7-r800": 1.266,
    "lbr-iiwa-14-r820": 1.306,
    "lbr-med-7": 1.266,
    "lbr-med-14": 1.306,
}
"""Facts 1.1."""


def numerical_jacobian(lengths_m: tuple[float, float, float, float], q: Array) -> Array:
    """6×7 by central differences of the product form; the angular rows from the skew part of dR·Rᵀ."""
    step = 1e-5
    jacobian = np.zeros((6, 7))
    turned = product_form(lengths_m, q)[:3, :3]
    for index, unit in enumerate(np.eye(7)):
        ahead, behind = product_form(lengths_m, q + step * unit), product_form(lengths_m, q - step * unit)
        change = (ahead - behind) / (2.0 * step)
        spin = change[:3, :3] @ turned.T
        jacobian[:, index] = [*change[:3, 3], spin[2, 1], spin[0, 2], spin[1, 0]]
    return jacobian


@pytest.mark.parametrize("name", NAMES)
def test_flange_height_at_zero(name: str) -> None:
    zero = np.zeros(7)
    upright = np.eye(4)
    upright[2, 3] = FLANGE_HEIGHT_M[name]
    assert facts_of(name).flange_height_m == pytest.approx(FLANGE_HEIGHT_M[name], abs=1e-12)
    np.testing.assert_allclose(InMujoco(name).at(zero, zero).flange, upright, rtol=0, atol=1e-12)
    np.testing.assert_allclose(InPinocchio(name).at(zero, zero).flange, upright, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_flange_pose_is_the_product_form_in_both(name: str) -> None:
    in_mujoco, in_pinocchio, lengths = InMujoco(name), InPinocchio(name), facts_of(name).lengths_m
    for q, v in random_states(name):
        expected = product_form(lengths, q)
        np.testing.assert_allclose(in_mujoco.at(q, v).flange, expected, rtol=0, atol=EXACT)
        np.testing.assert_allclose(in_pinocchio.at(q, v).flange, expected, rtol=0, atol=EXACT)


@pytest.mark.parametrize("name", NAMES)
def test_flange_jacobian_agrees(name: str) -> None:
    in_mujoco, in_pinocchio = InMujoco(name), InPinocchio(name)
    for q, v in random_states(name):
        expected = in_mujoco.at(q, v).jacobian
        np.testing.assert_allclose(in_pinocchio.at(q, v).jacobian, expected, rtol=0, atol=EXACT)


@pytest.mark.parametrize("name", NAMES)
def test_flange_jacobian_is_the_slope_of_the_pose(name: str) -> None:
    """Central differences with a step of 1e-5 leave 1e-10 of curvature and about as much of rounding."""
    in_mujoco, lengths = InMujoco(name), facts_of(name).lengths_m
    for q, v in random_states(name, count=50):
        expected = numerical_jacobian(lengths, q)
        np.testing.assert_allclose(in_mujoco.at(q, v).jacobian, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_even_joints_stand_at_shoulder_elbow_and_wrist(name: str) -> None:
    facts = facts_of(name)
    d1, d3, d5, d7 = facts.lengths_m
    heights = facts.joint_heights_m
    assert heights[1::2] == pytest.approx((d1, d1 + d3, d1 + d3 + d5), abs=1e-12)
    assert list(heights) == sorted(heights)
    assert heights[-1] < facts.flange_height_m == pytest.approx(heights[5] + d7, abs=1e-12)


@pytest.mark.parametrize("name", robot_names())
def test_the_flange_is_never_faster_than_its_bound(name: str) -> None:
    random = np.random.default_rng(7)
    model = ArmModel(load_pinocchio(name))
    limits = load_description(name).limits
    closest = 0.0
    for _ in range(2000):
        position = seven(random.uniform(limits.position_min_rad, limits.position_max_rad).tolist())
        velocity = seven((random.uniform(-1, 1, 7) * random.integers(0, 2, 7)).tolist())
        exact = model.flange_speed_mm_s(position, velocity)
        bound = model.flange_speed_bound_mm_s(velocity)
        assert exact <= bound * (1 + 1e-12)
        closest = max(closest, exact / bound if bound else 0.0)
    assert closest > 0.8


@pytest.mark.parametrize("name", robot_names())
def test_a_flange_that_keeps_below_a_speed_is_not_above_it(name: str) -> None:
    """Along ways of small and large steps; one axis that moves alone is judged as the exact speed judges it."""
    random = np.random.default_rng(8)
    model = ArmModel(load_pinocchio(name))
    limits = load_description(name).limits
    low, high = np.array(limits.position_min_rad), np.array(limits.position_max_rad)
    here, kept, alone = random.uniform(low, high), 0, 0
    for step in range(3000):
        moved = here + random.uniform(-1, 1, 7) * random.integers(0, 2, 7) * (0.5 if step % 100 == 0 else 3e-3)
        here = np.clip(moved, low, high)
        velocity = random.uniform(-1, 1, 7) * random.integers(0, 2, 7)
        if step % 3 == 0:
            velocity *= np.arange(7) == step % 7
        position, rate = seven(here.tolist()), seven(velocity.tolist())
        exact = model.flange_speed_mm_s(position, rate)
        limit = exact * random.choice((0.5, 1.0 - 1e-12, 1.0, 1.01, 1.3, 2.0))
        if model.flange_keeps_below(limit, position, rate):
            assert exact <= limit
            kept += model.flange_speed_bound_mm_s(rate) > limit
            alone += step % 3 == 0 and limit <= 1.01 * exact and exact > 0.0
    assert kept > 300
    assert alone > 50
