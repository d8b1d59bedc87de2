"""A torque-driven arm in MuJoCo, stepped at 1 kHz under a control law, which can be pushed at the flange and the elbow.

No controller, no backend: the law is asked with the exact state, and what it says goes to the motors.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import mujoco
import numpy as np
import pinocchio

from backends.mujoco.load import hang
from backends.mujoco.torque_sensors import TorqueSensors
from backends.robots import load_mujoco, load_pinocchio
from hil.core.control.dynamics import Dynamics
from hil.core.control.friction import FrictionCompensation
from hil.core.control.law import ControlLaw
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.arm import ArmState, seven
from hil.values.load import NO_LOAD, Load
from hil.values.robot import Seven

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROBOTS = ("lbr-iiwa-7-r800", "lbr-iiwa-14-r820")
POSES_DEG: tuple[Seven, ...] = (
    (0.0, 30.0, 0.0, 40.0, 0.0, 90.0, 0.0),
    (20.0, 45.0, -15.0, -70.0, 25.0, 60.0, 40.0),
    (-40.0, 20.0, 30.0, -100.0, -20.0, -50.0, 10.0),
)
"""The start pose of the facts, and two regular ones with all axes turned."""
STEP_NS = 1_000_000
STEP_S = STEP_NS * 1e-9
_ELBOW = "link_4"
_LAST = "link_7"


class TorqueArm:
    """``load`` is the true one, ``told`` what the law reckons with; without ``friction`` the joints have none.

    With ``compensate`` the law makes up for the friction the robot's facts tell of.
    """

    def __init__(
        self,
        name: str,
        position_rad: Seven,
        *,
        load: Load = NO_LOAD,
        told: Load | None = None,
        friction: bool = True,
        compensate: bool = True,
    ) -> None:
        self.name = name
        self.model = load_mujoco(name, shells=False)
        self.model.opt.timestep = STEP_S
        if not friction:
            self.model.dof_frictionloss[:] = 0.0
            self.model.dof_damping[:] = 0.0
        hang(load, self.model)
        self.data = mujoco.MjData(self.model)
        self._flange = self.model.site("flange").id
        self._last = self.model.body(_LAST).id
        self._elbow = self.model.body(_ELBOW).id
        self.pinocchio_model = load_pinocchio(name)
        self.dynamics = Dynamics(
            self.pinocchio_model,
            load=load if told is None else told,
            friction=FrictionCompensation(self.pinocchio_model) if friction and compensate else None,
        )
        self.now_ns = 0
        self.wrench: Array = np.zeros(6)
        """What pushes the flange's origin: N and Nm, base axes."""
        self.elbow_wrench: Array = np.zeros(6)
        """What pushes link 4 at its origin, on the elbow: N and Nm, base axes."""
        self.torque: Array = np.zeros(7)
        self.data.qpos[:] = position_rad
        mujoco.mj_forward(self.model, self.data)

    @property
    def position(self) -> "Array":
        """Of the flange's origin in the base, m; a copy."""
        return np.array(self.data.site_xpos[self._flange])

    @property
    def rotation(self) -> "Array":
        """Of the flange in the base, 3x3; a copy."""
        return np.array(self.data.site_xmat[self._flange]).reshape(3, 3)

    @property
    def jacobian(self) -> "Array":
        """MuJoCo's own Jacobian of the flange, 6x7."""
        linear, angular = np.zeros((3, 7)), np.zeros((3, 7))
        mujoco.mj_jacSite(self.model, self.data, linear, angular, self._flange)
        return np.vstack([linear, angular])

    @property
    def twist(self) -> "Array":
        """Velocity of the flange, m/s and rad/s, base axes."""
        return np.array(self.jacobian @ self.data.qvel)

    @property
    def kinetic_energy_j(self) -> float:
        """Of links, load and motors."""
        return float(0.5 * self.data.qvel @ self.mass @ self.data.qvel)

    @property
    def mass(self) -> "Array":
        """MuJoCo's own mass matrix, 7x7."""
        mass = np.zeros((7, 7))
        mujoco.mj_fullM(self.model, self.data, mass)
        return mass

    def measured(self, sensors: TorqueSensors) -> ArmState:
        """What a robot side would report after the last step, with the sensors' noise."""
        data = self.data
        shown = sensors.sense(self.model.dof_armature * data.qacc - data.qfrc_actuator)
        return ArmState(
            seven(data.qpos.tolist()), seven(data.qvel.tolist()), seven(shown.tolist()), STILL, STILL, (), 0
        )

    def step(self, law: ControlLaw, set_point: SetPoint) -> None:
        """One cycle: the law, then a millisecond of physics. Pose, velocity and Jacobian are fresh afterwards."""
        model, data = self.model, self.data
        self.dynamics.update(seven(data.qpos.tolist()), seven(data.qvel.tolist()))
        self.torque = np.array(law.torque_nm(set_point, self.dynamics, now_ns=self.now_ns))
        data.ctrl[:] = self.torque
        self._push(self._last, data.site_xpos[self._flange], self.wrench)
        self._push(self._elbow, data.xpos[self._elbow], self.elbow_wrench)
        mujoco.mj_step2(model, data)
        mujoco.mj_step1(model, data)
        self.now_ns += STEP_NS

    def run(self, law: ControlLaw, set_point: SetPoint, seconds: float, each: Callable[[], None] | None = None) -> None:
        """Hold one set point for that long; call ``each`` after each cycle."""
        for _ in range(round(seconds / STEP_S)):
            self.step(law, set_point)
            if each is not None:
                each()

    def _push(self, body: int, at: "Array", wrench: "Array") -> None:
        applied = self.data.xfrc_applied[body]
        if not wrench.any():
            applied[:] = 0.0
            return
        # MuJoCo takes what is applied at the body's centre of mass.
        x, y, z = (at - self.data.xipos[body]).tolist()
        fx, fy, fz, mx, my, mz = wrench.tolist()
        applied[:] = (fx, fy, fz, mx + y * fz - z * fy, my + z * fx - x * fz, mz + x * fy - y * fx)


def radians(position_deg: Seven) -> Seven:
    """Return the pose in rad."""
    return seven(np.radians(position_deg).tolist())


def off(arm: TorqueArm, position: "Array", rotation: "Array") -> "Array":
    """Return how far the flange is off this pose, in the pose's axes: m and, as a rotation vector, rad."""
    turn = pinocchio.log3(rotation.T @ arm.rotation)
    return np.concatenate([rotation.T @ (arm.position - position), turn])


def hold(position_rad: Seven) -> SetPoint:
    """Return the set point of an arm that stays there."""
    return SetPoint(position_rad, STILL)
