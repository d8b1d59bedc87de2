"""Position and joint impedance on the MuJoCo arm, and what a torque does when one law takes over from another."""

import math

import mujoco
import numpy as np
import pytest

from backends.mujoco import MujocoBackend
from backends.mujoco.backend import LOOP_FREQUENCY_RAD_S
from backends.robots import load_description
from hil.core.control.cartesian_impedance import CartesianImpedanceLaw
from hil.core.control.joint_impedance import JointImpedanceLaw
from hil.core.control.law import ControlLaw
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.arm import JointCommand, seven
from hil.values.control import CartesianImpedanceControlMode, JointImpedanceControlMode
from hil.values.load import NO_LOAD, Load
from hil.values.robot import Seven
from tests.support.position_law import PositionLaw
from tests.support.torque_arm import POSES_DEG, ROBOTS, STEP_S, TorqueArm, hold, radians

SOFT = JointImpedanceControlMode((1000.0, 1000.0, 800.0, 600.0, 300.0, 200.0, 150.0), (0.5,) * 7)

each_robot = pytest.mark.parametrize("name", ROBOTS)
each_pose = pytest.mark.parametrize("pose_deg", POSES_DEG, ids=["start", "bent", "folded"])


def state_of(arm: TorqueArm) -> tuple[Seven, Seven]:
    return seven(arm.data.qpos.tolist()), seven(arm.data.qvel.tolist())


@each_robot
@each_pose
def test_a_push_hardly_moves_an_arm_in_position_control(name: str, pose_deg: Seven) -> None:
    position = radians(pose_deg)
    for axis in range(3):
        arm = TorqueArm(name, position)
        at, farthest = arm.position, 0.0
        arm.wrench[axis] = 20.0
        law = PositionLaw()
        for _ in range(500):
            arm.step(law, hold(position))
            farthest = max(farthest, float(np.linalg.norm(arm.position - at)))
        assert 0.0 < farthest < 0.2e-3


@each_robot
def test_the_position_law_is_the_one_of_the_mujoco_backend(name: str) -> None:
    description = load_description(name)
    backend = MujocoBackend(description)
    backend.open(period_ns=1_000_000)
    arm = TorqueArm(name, description.initial_position_rad)
    law, start = PositionLaw(loop_frequency_rad_s=LOOP_FREQUENCY_RAD_S), np.array(description.initial_position_rad)
    # The backend commands the set point of the cycle before at the first of its steps.
    previous = start
    for cycle in range(400):
        angle = 2.0 * math.pi * cycle * STEP_S
        place = start + 0.05 * (1.0 - math.cos(angle))
        rate = seven([0.1 * math.pi * math.sin(angle)] * 7)
        change = seven([0.2 * math.pi**2 * math.cos(angle)] * 7)
        backend.write(JointCommand(seven(place.tolist()), rate, change))
        backend.step()
        arm.step(law, SetPoint(seven(previous.tolist()), rate, change))
        previous = place
    assert backend.read().position_rad == pytest.approx(tuple(arm.data.qpos), abs=1e-9)
    assert np.abs(arm.data.qpos - start).max() > 0.05
    backend.close()


@each_robot
@each_pose
@pytest.mark.parametrize("friction", [False, True], ids=["smooth", "friction"])
def test_an_axis_gives_way_by_torque_over_stiffness(name: str, pose_deg: Seven, friction: bool) -> None:
    position = radians(pose_deg)
    arm = TorqueArm(name, position, friction=friction)
    law = JointImpedanceLaw(SOFT)
    push = np.array([30.0, -30.0, 25.0, 20.0, -15.0, 12.0, 8.0])
    for cycle in range(3000):
        arm.data.qfrc_applied[:] = push * min(1.0, cycle / 2000.0)
        arm.step(law, hold(position))
    expected = push / np.array(SOFT.stiffness_nm_rad)
    assert arm.data.qpos - position == pytest.approx(expected, rel=0.02)


@each_robot
@each_pose
def test_each_oscillator_of_the_axes_is_damped_as_set(name: str, pose_deg: Seven) -> None:
    position = radians(pose_deg)
    stiffness = np.diag(SOFT.stiffness_nm_rad)
    squares, shapes = np.linalg.eig(np.linalg.solve(TorqueArm(name, position).mass, stiffness))
    for square, shape in zip(squares.real, shapes.real.T, strict=True):
        arm = TorqueArm(name, position)
        law = JointImpedanceLaw(SOFT)
        arm.data.qpos[:] = position + 0.05 * shape / np.abs(shape).max()
        mujoco.mj_forward(arm.model, arm.data)
        places, rates = [], []
        for _ in range(round(8.0 / math.sqrt(square) / STEP_S)):
            arm.step(law, hold(position))
            places.append(shape @ stiffness @ (arm.data.qpos - position))
            rates.append(shape @ stiffness @ arm.data.qvel)
        change = np.gradient(np.array(rates), STEP_S)
        (damping, spring), *_ = np.linalg.lstsq(-np.array([rates, places]).T, change, rcond=None)
        assert damping / (2.0 * math.sqrt(spring)) == pytest.approx(0.5, rel=0.1), (square, shape)


def test_an_axis_without_stiffness_floats_and_keeps_its_place() -> None:
    position = radians(POSES_DEG[0])
    arm = TorqueArm(ROBOTS[0], position, compensate=False)
    law = JointImpedanceLaw(JointImpedanceControlMode((0.0,) * 7, (0.7,) * 7))
    arm.run(law, hold(STILL), 2.0)  # far from its set point, which does not pull
    assert arm.data.qpos == pytest.approx(position, abs=1e-3)  # gravity is compensated, its own friction stays
    arm.data.qfrc_applied[3] = 3.0
    arm.run(law, hold(STILL), 1.0)
    assert arm.data.qpos[3] - position[3] > 0.2


@each_robot
def test_a_wrong_load_makes_axes_drift_and_a_right_one_does_not(name: str) -> None:
    load = Load(4.0, (0.0, 0.0, 0.1), (0.01, 0.01, 0.01))
    position = radians(POSES_DEG[0])
    drift = []
    for told in (load, NO_LOAD):
        arm = TorqueArm(name, position, load=load, told=told)
        arm.run(JointImpedanceLaw(SOFT), hold(position), 2.0)
        drift.append(float(np.abs(arm.data.qpos - position).max()))
    assert drift[0] < 1e-4
    assert drift[1] > 0.01


def test_an_overlay_torque_is_added_on_top_of_gravity_compensation() -> None:
    position = radians(POSES_DEG[1])
    arm = TorqueArm(ROBOTS[0], position)
    law = JointImpedanceLaw(SOFT)
    arm.dynamics.update(position, STILL)
    plain = np.array(law.torque_nm(hold(position), arm.dynamics, now_ns=0))
    law.overlay_nm = (1.0, -2.0, 3.0, 0.0, 0.0, 0.5, 0.0)
    assert law.torque_nm(hold(position), arm.dynamics, now_ns=0) == pytest.approx(plain + law.overlay_nm)


@pytest.mark.parametrize("seed", range(5))
def test_laws_have_no_memory_of_each_other(seed: int) -> None:
    random = np.random.default_rng(seed)
    position = radians(POSES_DEG[1])
    arm = TorqueArm(ROBOTS[0], position)

    def laws() -> list[ControlLaw]:
        return [
            PositionLaw(),
            JointImpedanceLaw(SOFT),
            CartesianImpedanceLaw(CartesianImpedanceControlMode()),
        ]

    used = laws()
    arm.wrench = random.uniform(-20.0, 20.0, 6)
    for cycle in range(300):
        arm.step(used[cycle // 50 % 3], hold(position))
    arm.dynamics.update(*state_of(arm))
    for before, fresh in zip(used, laws(), strict=True):
        now = before.torque_nm(hold(position), arm.dynamics, now_ns=arm.now_ns)
        assert now == pytest.approx(fresh.torque_nm(hold(position), arm.dynamics, now_ns=arm.now_ns), abs=1e-9)


@each_robot
@each_pose
def test_at_rest_on_the_set_point_all_laws_agree(name: str, pose_deg: Seven) -> None:
    position = radians(pose_deg)
    arm = TorqueArm(name, position)
    laws: list[ControlLaw] = [
        PositionLaw(),
        JointImpedanceLaw(SOFT),
        CartesianImpedanceLaw(CartesianImpedanceControlMode()),
    ]
    arm.dynamics.update(position, STILL)
    for law in laws:
        torque = law.torque_nm(hold(position), arm.dynamics, now_ns=0)
        assert torque == pytest.approx(tuple(arm.data.qfrc_bias), abs=1e-6)


def test_other_stiffness_steps_the_torque_by_the_difference() -> None:
    position = radians(POSES_DEG[1])
    arm = TorqueArm(ROBOTS[0], position)
    law = JointImpedanceLaw(SOFT)
    target = hold(seven((np.array(position) + 0.02).tolist()))
    arm.dynamics.update(position, STILL)
    before = np.array(law.torque_nm(target, arm.dynamics, now_ns=0))
    law.change(JointImpedanceControlMode((1100.0, *SOFT.stiffness_nm_rad[1:]), SOFT.damping))
    after = np.array(law.torque_nm(target, arm.dynamics, now_ns=0))
    assert after - before == pytest.approx([2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], abs=1e-9)
