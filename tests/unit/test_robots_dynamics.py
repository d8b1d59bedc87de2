"""Mass matrix, gravity and bias: MuJoCo and Pinocchio agree, and both give the reference figures of the facts."""

import mujoco
import numpy as np
import pinocchio
import pytest

from backends.robots import load_mujoco, load_pinocchio
from tests.unit.robots_support import NAMES, InMujoco, InPinocchio, facts_of, random_states

EXACT = 1e-9
AT_REST = np.zeros(7)

GRAVITY_NM = {
    "lbr-iiwa-7-r800": (0, -20.589, -0.220, -2.773, 0.076, -0.378, 0),
    "lbr-iiwa-14-r820": (0, -25.346, -0.426, -2.819, 0.124, -1.181, 0),
    "lbr-med-7": (0, -19.846, -0.212, -2.673, 0.074, -0.364, 0),
    "lbr-med-14": (0, -23.876, -0.237, -2.998, 0.083, -0.408, 0),
}
"""Facts 3.4, first table, at [0, 30, 0, 40, 0, 90, 0]°: the torque the motor must give."""

GRAVITY_TOLERANCE_NM = 2e-3
"""The reference was computed before centres of mass were rounded to 0.1 mm for the table we start from.

That rounding may move A2 by up to 0.012 Nm, A4 by 0.006 and A6 by 0.0017; the errors partly cancel, and what is
left stays below 0.0018 Nm, of which 0.0005 is the rounding of the printed torque.
"""

FURTHER_GRAVITY_NM = [
    ("lbr-iiwa-7-r800", (0, 30, 0, -60, 0, 90, 0), 2, -41.51),
    ("lbr-iiwa-7-r800", (0, 30, 0, -60, 0, 90, 0), 4, 18.15),
    ("lbr-iiwa-7-r800", (0, 90, 0, 0, 0, 0, 0), 2, -65.26),
    ("lbr-iiwa-14-r820", (0, 30, 0, -60, 0, 90, 0), 2, -51.18),
    ("lbr-iiwa-14-r820", (0, 30, 0, -60, 0, 90, 0), 4, 23.02),
    ("lbr-iiwa-14-r820", (0, 90, 0, 0, 0, 0, 0), 2, -80.58),
]
"""Facts 3.4, second table: robot, pose in degrees, axis, torque."""

FURTHER_TOLERANCE_NM = 8e-3
"""Half the last printed digit is 0.005 Nm; the rounded centres of mass add up to 0.003 Nm."""

INERTIA_KG_M2 = {
    "lbr-iiwa-7-r800": (0.403, 3.549, 0.273, 0.627, 0.015, 0.010, 0),
    "lbr-iiwa-14-r820": (0.523, 4.583, 0.302, 0.775, 0.024, 0.017, 0.001),
}
"""Facts 3.5, diagonal of M at [0, 30, 0, 40, 0, 90, 0]°, without rotors."""


@pytest.mark.parametrize("name", NAMES)
def test_mass_matrix_agrees(name: str) -> None:
    """Like with like: both read the armature from the file and add it to the diagonal."""
    in_mujoco, in_pinocchio = InMujoco(name), InPinocchio(name)
    for q, v in random_states(name):
        expected = in_mujoco.at(q, v).mass
        np.testing.assert_allclose(in_pinocchio.at(q, v).mass, expected, rtol=0, atol=EXACT)


@pytest.mark.parametrize("name", NAMES)
def test_armature_is_all_that_separates_the_mass_matrix_from_the_bodies(name: str) -> None:
    armature = np.array(facts_of(name).armature_kg_m2)
    model = load_pinocchio(name)
    bodies = load_pinocchio(name)
    bodies.armature = np.zeros(7)
    for q, _ in random_states(name, count=10):
        with_rotors = np.triu(pinocchio.crba(model, model.createData(), q))
        without = np.triu(pinocchio.crba(bodies, bodies.createData(), q))
        np.testing.assert_allclose(with_rotors - without, np.diag(armature), rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_gravity_and_bias_agree(name: str) -> None:
    in_mujoco, in_pinocchio = InMujoco(name), InPinocchio(name)
    for q, v in random_states(name):
        one, other = in_mujoco.at(q, v), in_pinocchio.at(q, v)
        np.testing.assert_allclose(one.gravity, other.gravity, rtol=0, atol=EXACT)
        np.testing.assert_allclose(one.bias, other.bias, rtol=0, atol=EXACT)


@pytest.mark.parametrize("name", NAMES)
def test_gravity_is_the_reference_of_the_facts(name: str) -> None:
    q = np.array(facts_of(name).description.initial_position_rad)
    gravity = InPinocchio(name).at(q, AT_REST).gravity
    np.testing.assert_allclose(gravity, GRAVITY_NM[name], rtol=0, atol=GRAVITY_TOLERANCE_NM)


@pytest.mark.parametrize(("name", "pose_deg", "axis", "torque_nm"), FURTHER_GRAVITY_NM)
def test_gravity_in_further_poses(name: str, pose_deg: tuple[float, ...], axis: int, torque_nm: float) -> None:
    gravity = InPinocchio(name).at(np.radians(pose_deg), AT_REST).gravity
    assert gravity[axis - 1] == pytest.approx(torque_nm, abs=FURTHER_TOLERANCE_NM)


@pytest.mark.parametrize("name", INERTIA_KG_M2)
def test_inertia_without_rotors_is_the_reference_of_the_facts(name: str) -> None:
    """Held to half the last printed digit."""
    facts = facts_of(name)
    q = np.array(facts.description.initial_position_rad)
    diagonal = np.diag(InMujoco(name).at(q, AT_REST).mass) - facts.armature_kg_m2
    np.testing.assert_allclose(diagonal, INERTIA_KG_M2[name], rtol=0, atol=5e-4)


@pytest.mark.parametrize("name", NAMES)
def test_gravity_is_the_torque_the_motor_must_give(name: str) -> None:
    """Leaning forward by +A2 wants to fall further, so the motor pulls back, and with that torque the arm rests."""
    model = load_mujoco(name)
    data = mujoco.MjData(model)
    model.dof_frictionloss[:] = 0.0
    data.qpos[:] = facts_of(name).description.initial_position_rad
    mujoco.mj_forward(model, data)
    data.ctrl[:] = data.qfrc_bias
    mujoco.mj_forward(model, data)
    assert data.qfrc_bias[1] < 0.0
    np.testing.assert_allclose(data.qacc, 0.0, atol=EXACT)


@pytest.mark.parametrize("name", NAMES)
def test_an_unpowered_arm_falls_and_stays_finite(name: str) -> None:
    model = load_mujoco(name)
    data = mujoco.MjData(model)
    data.qpos[:] = facts_of(name).description.initial_position_rad
    started_at = data.qpos[1]
    for _ in range(1000):
        mujoco.mj_step(model, data)
    assert data.qpos[1] > started_at + 0.1
    assert np.all(np.isfinite(data.qpos))
    assert not any(warning.number for warning in data.warning)


@pytest.mark.parametrize("name", NAMES)
def test_motors_stop_at_the_torque_limit(name: str) -> None:
    model = load_mujoco(name)
    data = mujoco.MjData(model)
    data.ctrl[:] = 1000.0
    mujoco.mj_forward(model, data)
    np.testing.assert_array_equal(data.qfrc_actuator, facts_of(name).description.limits.torque_nm)
