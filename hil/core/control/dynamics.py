"""Dynamics of one arm with its load, by Pinocchio: mass matrix, bias, Jacobian, pose of the TCP. SI units.

One computation a cycle: :meth:`Dynamics.update`. What is then read are views of buffers that the next update changes;
they are for the laws and estimators of the same cycle only.
"""

from struct import Struct
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import pinocchio

from hil.core.control.friction import FrictionCompensation
from hil.core.motion.set_point import STILL, SetPoint
from hil.values.load import NO_LOAD, Load
from hil.values.pose import Pose
from hil.values.robot import JOINT_COUNT, Seven

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_STATE: Final = Struct(f"{2 * JOINT_COUNT}d")
_POSITION: Final = Struct(f"{JOINT_COUNT}d")
_GOAL: Final = Struct(f"{3 * JOINT_COUNT}d")


class Goal(NamedTuple):
    """A set point as arrays, and where it has the TCP, in the robot base; views of buffers, like all here."""

    placement: "pinocchio.SE3"
    rotation: "Array"
    """3x3."""
    twist: "Array | None"
    """Velocity of the TCP's origin in m/s and angular velocity in rad/s, base axes; None at rest."""
    position_rad: "Array"
    velocity_rad_s: "Array"
    acceleration_rad_s2: "Array"


class Dynamics:
    """The arm's model with a load at its flange, armature of the motors included; ``model`` is copied.

    The load is the one *told*: if it is not the true one, whatever compensates gravity with it drifts. Without
    ``friction`` nothing reckons with the joints' own.
    """

    def __init__(
        self,
        model: "pinocchio.Model",
        *,
        flange_frame: str = "flange",
        load: Load = NO_LOAD,
        friction: FrictionCompensation | None = None,
    ) -> None:
        self._model = model.copy()
        self._flange = self._model.getFrameId(flange_frame)
        frame = self._model.frames[self._flange]
        self._joint = frame.parentJoint
        self._flange_in_joint = pinocchio.SE3(frame.placement)
        self._bare = pinocchio.Inertia(self._model.inertias[self._joint])
        self._tcp = self._model.addFrame(
            pinocchio.Frame(
                "control_tcp", self._joint, self._flange, self._flange_in_joint, pinocchio.FrameType.OP_FRAME
            )
        )
        self._data = self._model.createData()
        self._goal_data = self._model.createData()
        self._ahead_data = self._model.createData()
        self._elsewhere_data = self._model.createData()
        self._elsewhere = np.zeros(JOINT_COUNT)
        self._elsewhere_memory = self._elsewhere.data.cast("B")
        memory = np.zeros((2, JOINT_COUNT))
        self.position_rad: Array = memory[0]
        """Measured position, seven."""
        self.velocity_rad_s: Array = memory[1]
        """Measured velocity, seven."""
        self._memory = memory.data.cast("B")
        goal = np.zeros((3, JOINT_COUNT))
        self._goal_position, self._goal_velocity, self._goal_acceleration = goal
        self._goal_memory = goal.data.cast("B")
        self._goal_of: SetPoint | None = None
        self._goal: Goal | None = None
        self._friction = friction
        self._friction_torque: Array | None = None
        self._load = NO_LOAD
        self.armature_kg_m2: Array = np.array(self._model.armature)
        """Inertia of the motors as the joints see it, seven."""
        # Views of Pinocchio's own memory, which stays where it is; taking one anew each cycle costs a microsecond.
        self.mass_kg_m2: Array = self._data.M
        """Mass matrix, 7x7, symmetric, armature on its diagonal."""
        self.bias_nm: Array = self._data.nle
        """Torque that gravity, Coriolis and centrifugal forces ask for, seven."""
        self.gravity_nm: Array = self._data.g
        """Torque that gravity alone asks for, seven."""
        self._jacobian: Array | None = None
        self._inverse: Array | None = None
        self.set_load(load)
        self.update(STILL, STILL)

    @property
    def load(self) -> Load:
        """The load that is reckoned with."""
        return self._load

    def set_load(self, load: Load) -> None:
        """Reckon with another load from the next update on."""
        carried = pinocchio.Inertia(load.mass_kg, np.array(load.centre_m), load.tensor_kg_m2())
        self._model.inertias[self._joint] = (
            self._bare + self._flange_in_joint.act(carried) if load.mass_kg > 0.0 else self._bare
        )
        self._load = load

    def set_tcp(self, tcp_in_flange: Pose) -> None:
        """Put the TCP there from the next update on; it starts at the flange."""
        rotation = np.reshape(tcp_in_flange.rotation, (3, 3))
        self._model.frames[self._tcp].placement = self._flange_in_joint * pinocchio.SE3(
            rotation, np.array(tcp_in_flange.position_m)
        )
        self._goal_of = None

    def update(self, position_rad: Seven, velocity_rad_s: Seven) -> None:
        """Compute everything for this measured state, in rad and rad/s."""
        _STATE.pack_into(self._memory, 0, *position_rad, *velocity_rad_s)
        pinocchio.computeAllTerms(self._model, self._data, self.position_rad, self.velocity_rad_s)
        self._jacobian = self._inverse = self._friction_torque = None

    def inverse_mass(self) -> "Array":
        """Return the inverse of the mass matrix, 7x7; computed when first asked for in a cycle."""
        if self._inverse is None:
            pinocchio.cholesky.decompose(self._model, self._data)
            self._inverse = pinocchio.cholesky.computeMinv(self._model, self._data)
        return self._inverse

    def jacobian(self) -> "Array":
        """Return the Jacobian of the TCP, 6x7: velocity of its origin, then angular velocity, base axes."""
        if self._jacobian is None:
            self._jacobian = pinocchio.getFrameJacobian(
                self._model, self._data, self._tcp, pinocchio.LOCAL_WORLD_ALIGNED
            )
        return self._jacobian

    def flange_jacobian(self) -> "Array":
        """Return the same for the flange's origin."""
        jacobian: Array = pinocchio.getFrameJacobian(
            self._model, self._data, self._flange, pinocchio.LOCAL_WORLD_ALIGNED
        )
        return jacobian

    def flange_jacobian_at(self, position_rad: Seven) -> "Array":
        """Return the same at another position, in rad, without an update: a tenth of its cost."""
        _POSITION.pack_into(self._elsewhere_memory, 0, *position_rad)
        pinocchio.computeJointJacobians(self._model, self._elsewhere_data, self._elsewhere)
        jacobian: Array = pinocchio.getFrameJacobian(
            self._model, self._elsewhere_data, self._flange, pinocchio.LOCAL_WORLD_ALIGNED
        )
        return jacobian

    def placement(self) -> "pinocchio.SE3":
        """Return the pose of the TCP in the robot base."""
        placement: pinocchio.SE3 = pinocchio.updateFramePlacement(self._model, self._data, self._tcp)
        return placement

    def feed_forward(self, velocity_rad_s: "Array", acceleration_rad_s2: "Array") -> "Array":
        """Return the torque that moves the arm as planned, at its measured position, seven; at rest it is gravity.

        Coriolis and centrifugal forces are those of the planned velocity. Those of the measured one do no work, and
        making up for them would: it is what can make an arm that yields gain energy.
        """
        torque: Array = pinocchio.rnea(
            self._model, self._ahead_data, self.position_rad, velocity_rad_s, acceleration_rad_s2
        )
        return torque

    def friction_nm(self) -> "Array | None":
        """Return the torque that makes up for the joints' friction, seven; None if it is not reckoned with."""
        if self._friction is None:
            return None
        if self._friction_torque is None:
            self._friction_torque = self._friction.torque_nm(self.velocity_rad_s)
        return self._friction_torque

    def goal(self, set_point: SetPoint) -> Goal:
        """Return where the set point has the TCP; the same tuples again cost nothing."""
        position, velocity, acceleration = set_point
        known = self._goal_of
        if (
            self._goal is not None
            and known is not None
            and known[0] is position
            and known[1] is velocity
            and known[2] is acceleration
        ):
            return self._goal
        _GOAL.pack_into(self._goal_memory, 0, *position, *velocity, *acceleration)
        model, data = self._model, self._goal_data
        twist: Array | None = None
        if any(velocity):
            pinocchio.forwardKinematics(model, data, self._goal_position, self._goal_velocity)
            twist = pinocchio.getFrameVelocity(model, data, self._tcp, pinocchio.LOCAL_WORLD_ALIGNED).vector
        else:
            pinocchio.forwardKinematics(model, data, self._goal_position)
        placement = pinocchio.updateFramePlacement(model, data, self._tcp)
        self._goal = Goal(
            placement,
            placement.rotation,
            twist,
            self._goal_position,
            self._goal_velocity,
            self._goal_acceleration,
        )
        self._goal_of = set_point
        return self._goal
