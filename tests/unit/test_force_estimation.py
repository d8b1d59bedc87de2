"""External torques and the flange force estimated from noisy joint torque sensors of the MuJoCo arm."""

import numpy as np
import pytest

from backends.mujoco.torque_sensors import TorqueSensors
from backends.robots.facts import ROBOTS as FACTS
from hil.core.control.cartesian_impedance import CartesianImpedanceLaw
from hil.core.control.law import ControlLaw
from hil.core.estimation.flange_force import FlangeForce, FlangeForceEstimator
from hil.core.estimation.momentum_observer import MomentumObserver
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.arm import seven
from hil.values.control import CartesianImpedanceControlMode
from hil.values.load import NO_LOAD, Load
from hil.values.robot import Seven
from tests.support.position_law import PositionLaw
from tests.support.torque_arm import POSES_DEG, ROBOTS, STEP_S, TorqueArm, hold, radians

SIGMA_NM: Seven = (0.0041, 0.026, 0.0028, 0.0085, 0.0028, 0.0013, 0.0014)
"""Of the sensors, robot facts 4.4."""

each_robot = pytest.mark.parametrize("name", ROBOTS)
each_pose = pytest.mark.parametrize("pose_deg", POSES_DEG, ids=["start", "bent", "folded"])


class Watched:
    """An arm with its sensors and both estimators."""

    def __init__(self, arm: TorqueArm, *, seed: int = 0) -> None:
        self.arm = arm
        self.sensors = TorqueSensors(seed=seed)
        self.observer = MomentumObserver(sensor_sigma_nm=SIGMA_NM)
        self.history: list[Seven] = []

    def run(self, law: ControlLaw, set_point: SetPoint, seconds: float) -> None:
        arm = self.arm
        for _ in range(round(seconds / STEP_S)):
            arm.step(law, set_point)
            state = arm.measured(self.sensors)
            arm.dynamics.update(state.position_rad, state.velocity_rad_s)
            self.history.append(self.observer.update(state, arm.dynamics, now_ns=arm.now_ns))

    def flange(self) -> FlangeForce:
        return FlangeForceEstimator().estimate(self.observer.external_nm, self.observer.variance_nm2, self.arm.dynamics)


def dry_nm(name: str) -> np.ndarray:
    return np.array(next(facts.coulomb_nm for facts in FACTS if facts.description.name == name))


@each_robot
@each_pose
def test_a_push_at_the_flange_shows_with_its_sign_and_size(name: str, pose_deg: Seven) -> None:
    position = radians(pose_deg)
    wrench = np.array([15.0, -20.0, 10.0, 1.5, -1.0, 0.8])
    for friction in (False, True):
        arm = TorqueArm(name, position, friction=friction)
        watched = Watched(arm)
        law = CartesianImpedanceLaw(CartesianImpedanceControlMode())
        watched.run(law, hold(position), 0.3)
        arm.wrench = wrench
        watched.run(law, hold(position), 2.0)
        found = watched.flange()
        assert found.regular
        # Five standard deviations; a joint at rest hides what its dry friction holds.
        allowed = 5.0 * np.sqrt(found.variance) + 0.02
        if friction:
            allowed += np.abs(np.linalg.pinv(arm.jacobian.T)) @ dry_nm(name)
        assert np.all(np.abs(np.array(found.wrench) - wrench) < allowed), (found, allowed)
        assert np.all(np.sign(found.wrench[:3]) == np.sign(wrench[:3]))


@each_robot
def test_without_friction_the_estimate_is_exact_to_its_noise(name: str) -> None:
    position = radians(POSES_DEG[1])
    arm = TorqueArm(name, position, friction=False)
    watched = Watched(arm)
    law = CartesianImpedanceLaw(CartesianImpedanceControlMode())
    arm.wrench = np.array([5.0, 3.0, -4.0, 0.2, 0.1, -0.3])
    watched.run(law, hold(position), 4.0)
    expected = arm.jacobian.T @ arm.wrench
    history = np.array(watched.history[2000:])
    spread, told = history.std(axis=0), np.sqrt(watched.observer.variance_nm2)
    assert history.mean(axis=0) == pytest.approx(expected, abs=0.01)
    assert spread == pytest.approx(told, rel=0.35)


def test_a_moving_arm_that_nobody_touches_feels_next_to_nothing() -> None:
    position = np.array(radians(POSES_DEG[0]))
    arm = TorqueArm(ROBOTS[0], seven(position.tolist()))
    watched = Watched(arm)
    law, way, largest = PositionLaw(), np.array([0.5, 0.3, -0.2, 0.4, 0.3, -0.3, 0.6]), np.zeros(7)
    for cycle in range(1, 2001):
        angle = np.pi * cycle / 2000.0
        share, rate, change = 0.5 * (1 - np.cos(angle)), 0.25 * np.pi * np.sin(angle), np.pi**2 / 8 * np.cos(angle)
        target = SetPoint(*(seven(row.tolist()) for row in (position + share * way, rate * way, change * way)))
        watched.run(law, target, STEP_S)
        largest = np.maximum(largest, np.abs(watched.history[-1]))
    assert np.all(largest < dry_nm(ROBOTS[0]) + 0.1), largest


def test_a_push_on_the_elbow_shows_at_the_joints_below_it_and_is_not_all_a_flange_force() -> None:
    position = radians(POSES_DEG[0])
    arm = TorqueArm(ROBOTS[0], position, friction=False)
    watched = Watched(arm)
    arm.elbow_wrench[1] = 25.0
    watched.run(PositionLaw(), hold(position), 1.0)
    external = np.array(watched.observer.external_nm)
    lever = float(arm.data.xpos[arm.model.body("link_4").id][0])
    assert external[0] == pytest.approx(25.0 * lever, abs=0.05)  # about A1, which is upright
    assert np.abs(external[4:]).max() < 0.05
    assert np.abs(watched.flange().unexplained_nm).max() > 1.0


def test_a_singular_arm_says_so_and_stays_finite() -> None:
    arm = TorqueArm(ROBOTS[0], STILL, friction=False)
    watched = Watched(arm)
    arm.wrench[2] = 30.0
    watched.run(PositionLaw(), hold(STILL), 0.5)
    found = watched.flange()
    assert not found.regular
    assert np.abs(found.wrench).max() < 5.0  # along the stretched arm no joint feels a thing


def test_load_that_was_not_told_looks_like_a_push() -> None:
    load = Load(2.0, (0.0, 0.0, 0.05))
    position = radians(POSES_DEG[0])
    weights = []
    for told in (load, NO_LOAD):
        arm = TorqueArm(ROBOTS[1], position, load=load, told=told, friction=False)
        watched = Watched(arm)
        watched.run(PositionLaw(), hold(position), 1.0)
        weights.append(watched.flange().wrench[2])
    assert weights[0] == pytest.approx(0.0, abs=0.2)
    assert weights[1] == pytest.approx(-2.0 * 9.81, abs=0.2)


def test_reset_begins_again_at_zero() -> None:
    position = radians(POSES_DEG[1])
    arm = TorqueArm(ROBOTS[0], position)
    watched = Watched(arm)
    arm.wrench[0] = 20.0
    watched.run(PositionLaw(), hold(position), 0.5)
    assert np.abs(watched.observer.external_nm).max() > 1.0
    watched.observer.reset()
    assert watched.observer.external_nm == STILL
