"""Dynamics against MuJoCo, which computes mass matrix, bias and Jacobian of the same arm on its own; with loads too."""

import math

import mujoco
import numpy as np
import pytest

from hil.core.control.orientation import rotation_vector, spring_moment
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.arm import seven
from hil.values.load import NO_LOAD, Load
from hil.values.pose import Pose
from tests.support.torque_arm import ROBOTS, TorqueArm

LOAD = Load(3.0, (0.02, -0.03, 0.08), (0.02, 0.03, 0.015), (0.002, -0.001, 0.003))


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("load", [NO_LOAD, LOAD], ids=["bare", "loaded"])
def test_mass_bias_and_jacobian_are_mujocos(name: str, load: Load) -> None:
    random = np.random.default_rng(7)
    arm = TorqueArm(name, STILL, load=load)
    for _ in range(20):
        position, velocity = random.uniform(-1.5, 1.5, 7), random.uniform(-1.0, 1.0, 7)
        arm.data.qpos[:], arm.data.qvel[:] = position, velocity
        mujoco.mj_forward(arm.model, arm.data)
        dynamics = arm.dynamics
        dynamics.update(seven(position.tolist()), seven(velocity.tolist()))
        assert dynamics.mass_kg_m2 == pytest.approx(arm.mass, abs=1e-9)
        assert dynamics.bias_nm == pytest.approx(arm.data.qfrc_bias, abs=1e-8)
        assert dynamics.jacobian() == pytest.approx(arm.jacobian, abs=1e-9)
        assert dynamics.flange_jacobian() == pytest.approx(arm.jacobian, abs=1e-9)
        assert dynamics.inverse_mass() @ arm.mass == pytest.approx(np.eye(7), abs=1e-9)


def test_a_load_can_be_changed_and_taken_off() -> None:
    arm = TorqueArm(ROBOTS[0], STILL)
    lean = (0.0, 1.0, 0.0, 0.5, 0.0, 0.5, 0.0)
    arm.dynamics.update(lean, STILL)
    bare = arm.dynamics.bias_nm.copy()
    arm.dynamics.set_load(LOAD)
    arm.dynamics.update(lean, STILL)
    assert arm.dynamics.load == LOAD
    assert abs(arm.dynamics.bias_nm[1] - bare[1]) > 5.0
    arm.dynamics.set_load(NO_LOAD)
    arm.dynamics.update(lean, STILL)
    assert arm.dynamics.bias_nm.tolist() == bare.tolist()


def test_the_tcp_moves_the_jacobian_and_the_goal() -> None:
    arm = TorqueArm(ROBOTS[0], STILL)
    dynamics = arm.dynamics
    pose = (0.1, 0.5, 0.2, -0.9, 0.3, 0.7, 0.4)
    dynamics.set_tcp(Pose.from_quaternion((0.0, 0.0, 0.1), (math.cos(0.2), math.sin(0.2), 0.0, 0.0)))
    dynamics.update(pose, STILL)
    flange = dynamics.flange_jacobian()
    rotation = dynamics.placement().rotation
    lever = 0.1 * (rotation @ np.array([0.0, np.sin(0.4), np.cos(0.4)]))  # the flange's z axis
    expected = flange[:3] - np.cross(lever, flange[3:].T).T
    assert dynamics.jacobian()[:3] == pytest.approx(expected, abs=1e-12)
    assert dynamics.jacobian()[3:] == pytest.approx(flange[3:], abs=1e-12)
    assert dynamics.goal(SetPoint(pose, STILL)).placement.isApprox(dynamics.placement())


def test_the_goals_velocity_is_the_rate_of_its_pose() -> None:
    dynamics = TorqueArm(ROBOTS[1], STILL).dynamics
    velocity = (0.3, -0.2, 0.5, 0.1, -0.4, 0.2, 0.6)
    pose = np.array((0.1, 0.5, 0.2, -0.9, 0.3, 0.7, 0.4))
    before, after = (
        dynamics.goal(SetPoint(seven((pose + sign * 1e-6 * np.array(velocity)).tolist()), STILL)).placement.copy()
        for sign in (-1.0, 1.0)
    )
    twist = dynamics.goal(SetPoint(seven(pose.tolist()), velocity)).twist
    assert twist is not None
    assert twist[:3] == pytest.approx((after.translation - before.translation) / 2e-6, abs=1e-6)


def test_the_rotational_spring_is_the_gradient_of_its_energy() -> None:
    random = np.random.default_rng(3)
    stiffness = (200.0, 100.0, 5.0)

    def energy(quaternion: np.ndarray) -> float:
        theta = np.array(rotation_vector(*quaternion.tolist()))
        return float(0.5 * theta @ (np.array(stiffness) * theta))

    def turned(quaternion: np.ndarray, axis: int, angle: float) -> np.ndarray:
        """The rotation, then one about a fixed axis: quaternions x y z w."""
        half = np.zeros(4)
        half[axis], half[3] = np.sin(angle / 2.0), np.cos(angle / 2.0)
        vector = half[3] * quaternion[:3] + quaternion[3] * half[:3] + np.cross(half[:3], quaternion[:3])
        return np.append(vector, half[3] * quaternion[3] - half[:3] @ quaternion[:3])

    for _ in range(50):
        quaternion = random.standard_normal(4)
        quaternion /= np.linalg.norm(quaternion)
        if abs(quaternion[3]) < 0.1:
            continue
        moment = spring_moment(rotation_vector(*quaternion.tolist()), stiffness)
        slope = [
            (energy(turned(quaternion, axis, 1e-6)) - energy(turned(quaternion, axis, -1e-6))) / 2e-6
            for axis in range(3)
        ]
        assert moment == pytest.approx([-value for value in slope], abs=1e-5), quaternion
