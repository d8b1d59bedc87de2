"""What the robot tests share: random states, the forward kinematics of facts 1.1, and both libraries' quantities.

Poses and velocities are arrays of seven, rad and rad/s; torques Nm; lengths m.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio
from numpy.typing import NDArray

from backends.robots import FLANGE, load_description, load_mujoco, load_pinocchio
from backends.robots.facts import ROBOTS, RobotFacts

Array = NDArray[np.float64]

NAMES = ("lbr-iiwa-7-r800", "lbr-iiwa-14-r820", "lbr-med-7", "lbr-med-14")
POSES = 200


def facts_of(name: str) -> RobotFacts:
    """The facts table entry of a robot."""
    return next(facts for facts in ROBOTS if facts.description.name == name)


def random_states(name: str, count: int = POSES) -> list[tuple[Array, Array]]:
    """Seeded pairs of position and velocity, both within the robot's limits."""
    random = np.random.default_rng(20240)
    limits = load_description(name).limits
    low, high = np.array(limits.position_min_rad), np.array(limits.position_max_rad)
    fastest = np.array(limits.velocity_rad_s)
    return [(random.uniform(low, high), random.uniform(-fastest, fastest)) for _ in range(count)]


def product_form(lengths_m: tuple[float, float, float, float], q: Array) -> Array:
    """Flange pose, 4×4: Tz(d1) Rz(q1)Ry(q2) Tz(d3) Rz(q3)Ry(−q4) Tz(d5) Rz(q5)Ry(q6) Tz(d7) Rz(q7)."""
    d1, d3, d5, d7 = lengths_m
    shoulder = _lift(d1) @ _turn_z(q[0]) @ _turn_y(q[1])
    elbow = _lift(d3) @ _turn_z(q[2]) @ _turn_y(-q[3])
    wrist = _lift(d5) @ _turn_z(q[4]) @ _turn_y(q[5])
    return shoulder @ elbow @ wrist @ _lift(d7) @ _turn_z(q[6])


def _lift(height_m: float) -> Array:
    pose = np.eye(4)
    pose[2, 3] = height_m
    return pose


def _turn_z(angle_rad: float) -> Array:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    pose = np.eye(4)
    pose[:2, :2] = [[c, -s], [s, c]]
    return pose


def _turn_y(angle_rad: float) -> Array:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    pose = np.eye(4)
    pose[0, 0], pose[0, 2], pose[2, 0], pose[2, 2] = c, s, -s, c
    return pose


@dataclass(frozen=True, slots=True)
class Quantities:
    """One library's view of one state."""

    flange: Array
    """Pose of the flange in the base frame, 4×4."""
    jacobian: Array
    """6×7 at the flange in base axes: rows x, y, z, then rotations."""
    mass: Array
    """7×7, kg·m², with armature on its diagonal."""
    bias: Array
    """Coriolis, centrifugal and gravity torques at the state's velocity, as torques the motors must give."""
    gravity: Array
    """The same at rest."""


class InMujoco:
    """MuJoCo's quantities of a robot."""

    def __init__(self, name: str) -> None:
        self._model = load_mujoco(name)
        self._data = mujoco.MjData(self._model)
        self._site = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_SITE, FLANGE)

    def at(self, q: Array, v: Array) -> Quantities:
        model, data = self._model, self._data
        data.qpos[:], data.qvel[:] = q, 0.0
        mujoco.mj_forward(model, data)
        gravity = data.qfrc_bias.copy()
        data.qvel[:] = v
        mujoco.mj_forward(model, data)
        flange = np.eye(4)
        flange[:3, :3] = data.site_xmat[self._site].reshape(3, 3)
        flange[:3, 3] = data.site_xpos[self._site]
        jacobian = np.zeros((6, 7))
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], self._site)
        return Quantities(flange, jacobian, self._mass(), data.qfrc_bias.copy(), gravity)

    def _mass(self) -> Array:
        """Column by column with ``mj_mulM``: ``mj_fullM`` changed its arguments in MuJoCo 4."""
        mass, column = np.zeros((7, 7)), np.zeros(7)
        for index, unit in enumerate(np.eye(7)):
            mujoco.mj_mulM(self._model, self._data, column, unit)
            mass[:, index] = column
        return mass


class InPinocchio:
    """Pinocchio's quantities of a robot."""

    def __init__(self, name: str) -> None:
        self._model = load_pinocchio(name)
        self._data = self._model.createData()
        self._frame = self._model.getFrameId(FLANGE)

    def at(self, q: Array, v: Array) -> Quantities:
        model, data = self._model, self._data
        axes = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = pinocchio.computeFrameJacobian(model, data, q, self._frame, axes).copy()
        pinocchio.framesForwardKinematics(model, data, q)
        flange = data.oMf[self._frame].homogeneous.copy()
        upper = np.triu(pinocchio.crba(model, data, q))
        mass = upper + np.triu(upper, 1).T
        bias = pinocchio.nonLinearEffects(model, data, q, v).copy()
        gravity = pinocchio.computeGeneralizedGravity(model, data, q).copy()
        return Quantities(flange, jacobian, mass, bias, gravity)
