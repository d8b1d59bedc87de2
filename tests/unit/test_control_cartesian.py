"""Cartesian impedance on the MuJoCo arm: stiffness, damping, null space and passivity are what was set."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from hil.core.control.cartesian_impedance import CartesianImpedanceLaw
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.arm import seven
from hil.values.control import (
    CartesianDof,
    CartesianImpedanceControlMode,
    CartesianPlane,
    by_translation,
    create_lissajous_pattern,
    six,
)
from hil.values.pose import Pose
from hil.values.robot import Seven
from tests.support.torque_arm import POSES_DEG, ROBOTS, STEP_S, TorqueArm, hold, off, radians

PLAIN = CartesianImpedanceControlMode()
UNEQUAL = CartesianImpedanceControlMode(stiffness=(2000.0, 1000.0, 500.0, 200.0, 100.0, 50.0))
IN_AXES = [0, 1, 2, 5, 4, 3]
"""Where X Y Z A B C are in x, y, z and turns about x, y, z."""

each_robot = pytest.mark.parametrize("name", ROBOTS)
each_pose = pytest.mark.parametrize("pose_deg", POSES_DEG, ids=["start", "bent", "folded"])
with_and_without_friction = pytest.mark.parametrize("friction", [False, True], ids=["smooth", "friction"])


def push(
    arm: TorqueArm,
    law: CartesianImpedanceLaw,
    set_point: SetPoint,
    wrench: np.ndarray,
    *,
    rise_s: float,
    stay_s: float,
) -> None:
    """Let a wrench in base axes grow, and stay."""
    cycles = round(rise_s / STEP_S)
    for cycle in range(cycles):
        arm.wrench = wrench * ((cycle + 1) / cycles)
        arm.step(law, set_point)
    arm.run(law, set_point, stay_s)


@each_robot
@each_pose
@with_and_without_friction
def test_a_force_deflects_the_flange_by_force_over_stiffness(name: str, pose_deg: Seven, friction: bool) -> None:
    # With friction the push grows slowly and on springs of the default stiffness: at rest the joints stick, within
    # about a newton, and the law gives their dry friction back only while they move.
    position, settings = radians(pose_deg), PLAIN if friction else UNEQUAL
    stiffness = np.array(settings.stiffness)[IN_AXES]
    for axis in range(6):
        arm = TorqueArm(name, position, friction=friction)
        law = CartesianImpedanceLaw(settings)
        at, rotation = arm.position, arm.rotation
        along = np.zeros(6)
        along[axis] = 40.0 if axis < 3 else 8.0
        wrench = np.concatenate([rotation @ along[:3], rotation @ along[3:]])
        push(arm, law, hold(position), wrench, rise_s=2.0 if friction else 0.5, stay_s=1.0 if friction else 2.5)
        assert off(arm, at, rotation)[axis] == pytest.approx(along[axis] / stiffness[axis], rel=0.02), axis


@each_robot
@each_pose
@pytest.mark.parametrize(("ratio", "friction"), [(0.3, False), (0.7, True)], ids=["smooth-0.3", "friction-0.7"])
def test_each_oscillator_is_damped_as_set(name: str, pose_deg: Seven, ratio: float, friction: bool) -> None:
    position = radians(pose_deg)
    settings = replace(PLAIN, damping=six(ratio))
    arm = TorqueArm(name, position, friction=friction)
    rotation = arm.rotation
    turn = np.kron(np.eye(2), rotation.T)
    jacobian = turn @ arm.jacobian
    inertia = np.linalg.inv(jacobian @ np.linalg.inv(arm.mass) @ jacobian.T)
    stiffness = np.diag(np.array(settings.stiffness)[IN_AXES])
    squares, shapes = np.linalg.eig(np.linalg.solve(inertia, stiffness))
    for square, unit in zip(squares.real, shapes.real.T, strict=True):
        shape = unit * min(0.01 / np.abs(unit[:3]).max(), 0.05 / np.abs(unit[3:]).max())
        arm = TorqueArm(name, position, friction=friction)
        law = CartesianImpedanceLaw(settings)
        at = arm.position
        pull = stiffness @ shape
        wrench = np.concatenate([rotation @ pull[:3], rotation @ pull[3:]])
        push(arm, law, hold(position), wrench, rise_s=0.5, stay_s=1.0)
        arm.wrench = np.zeros(6)
        places, rates = [], []
        for _ in range(round(min(2.0, 8.0 / math.sqrt(square)) / STEP_S)):
            arm.step(law, hold(position))
            places.append(shape @ stiffness @ off(arm, at, rotation))
            rates.append(shape @ stiffness @ turn @ arm.twist)
        change = np.gradient(np.array(rates), STEP_S)
        (damping, spring), *_ = np.linalg.lstsq(-np.array([rates, places]).T, change, rcond=None)
        assert damping / (2.0 * math.sqrt(spring)) == pytest.approx(ratio, rel=0.1), (square, shape)


def self_motion(arm: TorqueArm, cycles: int, amplitude_rad: float) -> np.ndarray:
    """Return axis positions, one a cycle, that turn the elbow and leave the flange where it is."""
    import pinocchio

    model = arm.pinocchio_model
    data = model.createData()
    flange = model.getFrameId("flange")

    def place(at: np.ndarray) -> "pinocchio.SE3":
        pinocchio.forwardKinematics(model, data, at)
        return pinocchio.updateFramePlacement(model, data, flange).copy()

    def jacobian(at: np.ndarray) -> np.ndarray:
        return np.asarray(pinocchio.computeFrameJacobian(model, data, at, flange, pinocchio.LOCAL))

    at = np.array(arm.data.qpos)
    goal, before, done = place(at), np.linalg.svd(jacobian(at))[2][6], 0.0
    positions = [at]
    for cycle in range(1, cycles + 1):
        way = amplitude_rad * 0.5 * (1.0 - math.cos(math.pi * cycle / cycles))
        circle = np.linalg.svd(jacobian(at))[2][6]
        before = circle if circle @ before > 0.0 else -circle
        at = at + before * (way - done)
        done = way
        for _ in range(2):
            at = at + np.linalg.pinv(jacobian(at)) @ pinocchio.log6(place(at).actInv(goal)).vector
        positions.append(at)
    return np.array(positions)


@each_robot
@each_pose
@with_and_without_friction
def test_null_space_motion_leaves_the_flange_where_it_is(name: str, pose_deg: Seven, friction: bool) -> None:
    arm = TorqueArm(name, radians(pose_deg), friction=friction)
    law = CartesianImpedanceLaw(PLAIN)
    positions = self_motion(arm, 2000, 0.4)
    velocities = np.gradient(positions, STEP_S, axis=0)
    at, farthest = arm.position, 0.0
    for position, velocity in zip(positions[1:], velocities[1:], strict=True):
        arm.step(law, SetPoint(seven(position.tolist()), seven(velocity.tolist())))
        farthest = max(farthest, float(np.linalg.norm(arm.position - at)))
    assert farthest < 0.5e-3
    assert np.abs(positions[-1] - positions[0]).max() > 0.2
    arm.run(law, hold(seven(positions[-1].tolist())), 2.0)
    assert arm.data.qpos == pytest.approx(positions[-1], abs=0.005)  # it really went there


@each_robot
@each_pose
def test_a_kicked_elbow_swings_back_and_leaves_the_flange_where_it_is(name: str, pose_deg: Seven) -> None:
    position = radians(pose_deg)
    arm = TorqueArm(name, position)
    law = CartesianImpedanceLaw(PLAIN)
    arm.data.qvel[:] = np.linalg.svd(arm.jacobian)[2][6] * 0.5
    mujoco.mj_forward(arm.model, arm.data)
    at, farthest, swing = arm.position, 0.0, 0.0
    for _ in range(2000):
        arm.step(law, hold(position))
        farthest = max(farthest, float(np.linalg.norm(arm.position - at)))
        swing = max(swing, float(np.abs(arm.data.qpos - position).max()))
    assert farthest < 0.5e-3
    assert swing > 0.01
    assert arm.data.qpos == pytest.approx(position, abs=0.003)


def test_the_null_space_spring_has_the_stiffness_and_damping_that_were_set() -> None:
    position = radians(POSES_DEG[1])
    arm = TorqueArm(ROBOTS[0], position, friction=False)
    settings = replace(PLAIN, null_space_stiffness_nm_rad=50.0, null_space_damping=0.4)
    law = CartesianImpedanceLaw(settings)
    circle = np.linalg.svd(arm.jacobian)[2][6]
    mass = circle @ arm.mass @ circle
    arm.data.qvel[:] = circle * 0.1
    mujoco.mj_forward(arm.model, arm.data)
    swings, rates = [], []
    for _ in range(2000):
        arm.step(law, hold(position))
        swings.append(circle @ (arm.data.qpos - position))
        rates.append(circle @ arm.data.qvel)
    change = np.gradient(np.array(rates), STEP_S)
    (damping, spring), *_ = np.linalg.lstsq(-np.array([rates, swings]).T, change, rcond=None)
    assert spring * mass == pytest.approx(50.0, rel=0.02)
    assert damping / (2.0 * math.sqrt(spring)) == pytest.approx(0.4, rel=0.05)


@each_robot
@each_pose
@pytest.mark.parametrize(
    ("elbow", "friction"), [(0.0, False), (0.0, True), (100.0, True)], ids=["smooth", "friction", "elbow-held"]
)
def test_energy_never_grows_in_contact_with_a_wall(name: str, pose_deg: Seven, elbow: float, friction: bool) -> None:
    position = radians(pose_deg)
    arm = TorqueArm(name, position, friction=friction)
    law = CartesianImpedanceLaw(replace(UNEQUAL, null_space_stiffness_nm_rad=elbow))
    at, rotation = arm.position, arm.rotation
    springs = np.array(UNEQUAL.stiffness)[IN_AXES]
    normal, wall = rotation[:, 0], 2e4

    def depth() -> float:
        return max(0.0, float((arm.position - at) @ normal) - 0.01)

    def energy() -> float:
        deflection = off(arm, at, rotation)
        return arm.kinetic_energy_j + float(0.5 * springs @ deflection**2) + 0.5 * wall * depth() ** 2

    throw = np.concatenate([rotation @ (0.6, 0.2, 0.4), rotation @ (0.3, -0.2, 0.5)])
    arm.data.qvel[:] = np.linalg.pinv(arm.jacobian) @ throw
    mujoco.mj_forward(arm.model, arm.data)
    begun = least = energy()
    touched, grown = False, 0.0
    for _ in range(3000):
        arm.wrench = np.concatenate([-wall * depth() * normal, np.zeros(3)])
        touched = touched or depth() > 0.0
        arm.step(law, hold(position))
        now = energy()
        grown, least = max(grown, now - least), min(least, now)
    assert touched
    assert grown < 1e-6 * begun
    assert least < (0.001 if elbow else 0.1) * begun  # an elbow without a spring has no damper either, and swings on


def test_the_controller_never_pulls_harder_than_its_maximum() -> None:
    position = radians(POSES_DEG[1])
    arm = TorqueArm(ROBOTS[0], position)
    law = CartesianImpedanceLaw(replace(PLAIN, max_control_force=(15.0, 1e6, 1e6, 1e6, 1e6, 1e6)))
    at, rotation = arm.position, arm.rotation
    arm.wrench = np.concatenate([rotation @ (25.0, 0.0, 0.0), np.zeros(3)])
    arm.run(law, hold(position), 0.4)
    assert off(arm, at, rotation)[0] > 25.0 / 2000.0  # farther than the spring alone would let it
    reading = law.reading(hold(position), arm.dynamics)
    assert reading.force[0] == pytest.approx(-15.0, abs=1e-9)
    assert law.violation(hold(position), arm.dynamics) is None
    law.change(replace(PLAIN, max_control_force=(15.0, 1e6, 1e6, 1e6, 1e6, 1e6), stop_on_max_control_force=True))
    arm.step(law, hold(position))
    violation = law.violation(hold(position), arm.dynamics)
    assert violation is not None
    assert (violation.name, violation.dof, violation.limit) == ("max control force", CartesianDof.X, 15.0)


def test_deviation_and_velocity_are_reported_against_their_limits() -> None:
    position = radians(POSES_DEG[0])
    arm = TorqueArm(ROBOTS[0], position)
    law = CartesianImpedanceLaw(replace(PLAIN, max_path_deviation=(50.0, 5.0, 50.0, 1.0, 1.0, 1.0)))
    rotation = arm.rotation
    arm.wrench = np.concatenate([rotation @ (0.0, 40.0, 0.0), np.zeros(3)])
    reasons = []
    for _ in range(1000):
        arm.step(law, hold(position))
        reasons.append(law.violation(hold(position), arm.dynamics))
    assert reasons[0] is None
    first = next(reason for reason in reasons if reason is not None)
    assert str(first).startswith("max path deviation Y: 5.0")
    law.change(replace(PLAIN, max_cartesian_velocity=(1e6, 1e6, 1e6, 0.2, 1e6, 1e6)))
    arm.data.qvel[6] = 0.5  # the last axis turns the flange about its own z: A
    arm.step(law, hold(position))
    violation = law.violation(hold(position), arm.dynamics)
    assert violation is not None
    assert (violation.name, violation.dof) == ("max Cartesian velocity", CartesianDof.A)
    assert abs(violation.value) == pytest.approx(0.5, abs=0.05)


def test_an_additional_force_pulls_without_a_deflection_and_a_wall_feels_it() -> None:
    position = radians(POSES_DEG[1])
    arm = TorqueArm(ROBOTS[0], position, friction=False)
    law = CartesianImpedanceLaw(replace(PLAIN, additional_control_force=(0.0, 0.0, 12.0, 0.0, 0.0, 1.0)))
    rotation = arm.rotation
    at = arm.position
    arm.wrench = -np.concatenate([rotation @ (0.0, 0.0, 12.0), rotation @ (1.0, 0.0, 0.0)])
    arm.run(law, hold(position), 0.5)
    assert off(arm, at, rotation) == pytest.approx(np.zeros(6), abs=1e-6)


def test_a_wrench_overlay_is_a_force_on_top() -> None:
    position = radians(POSES_DEG[1])
    arm = TorqueArm(ROBOTS[0], position)
    law = CartesianImpedanceLaw(PLAIN)
    arm.dynamics.update(position, STILL)
    plain = np.array(law.torque_nm(hold(position), arm.dynamics, now_ns=0))
    law.overlay_force = (1.0, 2.0, 3.0, 0.6, 0.5, 0.4)
    more = np.array(law.torque_nm(hold(position), arm.dynamics, now_ns=0)) - plain
    rotation = arm.rotation
    wrench = np.concatenate([rotation @ (1.0, 2.0, 3.0), rotation @ (0.4, 0.5, 0.6)])
    assert more == pytest.approx(arm.jacobian.T @ wrench, abs=1e-9)


@each_robot
def test_the_springs_are_at_the_tcp(name: str) -> None:
    position, length = radians(POSES_DEG[2]), 0.2
    arm = TorqueArm(name, position, friction=False)
    arm.dynamics.set_tcp(Pose(0.0, 0.0, length))
    law = CartesianImpedanceLaw(PLAIN)

    def tip() -> np.ndarray:
        return arm.position + length * arm.rotation[:, 2]

    begin, force = tip(), arm.rotation @ (20.0, 0.0, 0.0)
    for _ in range(2500):
        arm.wrench = np.concatenate([force, length * np.cross(arm.rotation[:, 2], force)])
        arm.step(law, hold(position))
    assert tip() - begin == pytest.approx(force / 2000.0, abs=2e-4)


def test_other_parameters_step_the_torque_by_what_they_differ_in() -> None:
    position = radians(POSES_DEG[1])
    arm = TorqueArm(ROBOTS[0], position)
    arm.wrench = np.array([10.0, -20.0, 15.0, 1.0, 0.5, -1.0])
    soft = replace(PLAIN, stiffness=by_translation(1000.0, 100.0))
    law = CartesianImpedanceLaw(PLAIN)
    arm.run(law, hold(position), 0.15)
    arm.dynamics.update(seven(arm.data.qpos.tolist()), seven(arm.data.qvel.tolist()))
    other = CartesianImpedanceLaw(soft)
    expected = other.torque_nm(hold(position), arm.dynamics, now_ns=arm.now_ns)
    law.change(soft)
    assert law.torque_nm(hold(position), arm.dynamics, now_ns=arm.now_ns) == pytest.approx(expected, abs=1e-9)
    law.change(soft)
    assert law.torque_nm(hold(position), arm.dynamics, now_ns=arm.now_ns) == pytest.approx(expected, abs=1e-9)


def test_a_soft_axis_lets_go_and_the_others_hold() -> None:
    position = radians(POSES_DEG[1])
    arm = TorqueArm(ROBOTS[0], position)
    law = CartesianImpedanceLaw(replace(PLAIN, stiffness=(2000.0, 2000.0, 0.0, 200.0, 200.0, 200.0)))
    at, rotation = arm.position, arm.rotation
    arm.wrench = np.concatenate([rotation @ (0.0, 0.0, 5.0), np.zeros(3)])
    arm.run(law, hold(position), 0.6)
    deflection = off(arm, at, rotation)
    assert deflection[2] > 0.03
    assert np.abs(deflection[:2]).max() < 0.002


@each_robot
def test_a_stretched_arm_stays_finite(name: str) -> None:
    position: Seven = (0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0)
    arm = TorqueArm(name, position)
    law = CartesianImpedanceLaw(PLAIN)
    at = arm.position
    arm.wrench = np.array([20.0, 10.0, -20.0, 1.0, 1.0, 1.0])
    arm.run(law, hold(position), 1.0)
    assert np.abs(arm.torque).max() < 100.0
    assert np.linalg.norm(arm.position - at) < 0.05


def test_a_wrong_load_makes_the_arm_drift_and_a_right_one_does_not() -> None:
    from hil.values.load import NO_LOAD, Load

    load = Load(3.0, (0.0, 0.0, 0.08), (0.01, 0.01, 0.01))
    position = radians(POSES_DEG[0])
    settings = replace(PLAIN, stiffness=by_translation(500.0, 50.0))
    sagged = []
    for told in (load, NO_LOAD):
        arm = TorqueArm(ROBOTS[0], position, load=load, told=told)
        at = arm.position
        arm.run(CartesianImpedanceLaw(settings), hold(position), 3.0)
        sagged.append(float(at[2] - arm.position[2]))
    assert abs(sagged[0]) < 1e-4
    assert sagged[1] == pytest.approx(3.0 * 9.81 / 500.0, rel=0.1)  # the weight the law does not know of


def test_a_lissajous_figure_moves_the_flange_in_its_plane() -> None:
    position = radians(POSES_DEG[1])
    arm = TorqueArm(ROBOTS[0], position)
    law = CartesianImpedanceLaw(create_lissajous_pattern(CartesianPlane.XY, 1.0, 15.0, 1000.0))
    at, rotation = arm.position, arm.rotation
    places = []
    for _ in range(5000):
        arm.step(law, hold(position))
        places.append(off(arm, at, rotation))
    reach = np.ptp(np.array(places)[1000:], axis=0)
    # Twice 15 N over 1000 N/m, and less where the arm is too heavy to follow.
    assert 0.010 < reach[0] < 0.036
    assert 0.020 < reach[1] < 0.036
    assert reach[2] < 0.005  # the inertia couples the axes


def test_a_moving_set_point_is_followed() -> None:
    position = np.array(radians(POSES_DEG[0]))
    arm = TorqueArm(ROBOTS[1], seven(position.tolist()))
    law = CartesianImpedanceLaw(PLAIN)
    way = np.array([0.4, 0.2, -0.2, 0.3, 0.3, -0.2, 0.5])
    farthest = 0.0
    for cycle in range(1, 2001):
        angle = math.pi * cycle / 2000.0
        share, rate = 0.5 * (1.0 - math.cos(angle)), 0.25 * math.pi * math.sin(angle)
        change = 0.125 * math.pi**2 * math.cos(angle)
        arm.step(
            law,
            SetPoint(
                seven((position + share * way).tolist()),
                seven((rate * way).tolist()),
                seven((change * way).tolist()),
            ),
        )
        farthest = max(farthest, float(np.abs(arm.data.qpos - position - share * way).max()))
    assert farthest < 0.01
    assert law.reading(hold(seven(arm.data.qpos.tolist())), arm.dynamics).deviation[:3] != STILL[:3]
