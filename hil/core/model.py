"""Kinematics of one arm, by Pinocchio: flange pose and flange speed. Frames: flange in robot base, metres."""

import math
from operator import mul
from struct import Struct
from typing import Final

import numpy as np
import pinocchio

from hil.core.control.dynamics import Dynamics
from hil.core.control.friction import FrictionCompensation
from hil.core.kinematics.srs import SrsKinematics
from hil.core.motion.set_point import STILL
from hil.values.arm import seven
from hil.values.load import Load
from hil.values.robot import JOINT_COUNT, JointLimits, Seven

_STATE: Final = Struct(f"{2 * JOINT_COUNT}d")
"""Positions and velocities, in the machine's own order of bytes."""

_FROM_FLANGE: Final = range(JOINT_COUNT - 1, -1, -1)
_NEAR_MM: Final = 20.0
"""How far from a pose its levers are of use: some per cent of them."""
_ROUNDING: Final = 1.0 + 1e-9


class ArmModel:
    """Works on private buffers; what it returns is a copy. ``flange_frame`` is a frame name of ``model``."""

    def __init__(self, model: "pinocchio.Model", *, flange_frame: str = "flange") -> None:
        self._model = model
        self._data = model.createData()
        self._frame = model.getFrameId(flange_frame)
        self._at: Seven | None = None
        # Packing numbers into memory that is there costs a fifth of making an array of them.
        self._state = np.zeros((2, JOINT_COUNT))
        self._position, self._velocity = self._state
        self._memory = self._state.data.cast("B")
        self._reach_mm = _reach_mm(model, model.frames[self._frame])
        self._levers_data = model.createData()
        self._levers_mm: list[float] = []
        """Distance of the flange's origin from each axis at :attr:`_levers_at`."""
        self._levers_at = STILL
        self._take_levers(STILL)

    def kinematics(self, limits: JointLimits) -> SrsKinematics:
        """Return the closed-form kinematics of this arm within axis limits; raise :class:`ConfigurationError`."""
        return SrsKinematics(self._model, limits, flange_frame=self._model.frames[self._frame].name)

    def dynamics(self, load: Load) -> Dynamics:
        """Return the dynamics of this arm with a load in its flange; friction as the model has it is made up for."""
        return Dynamics(
            self._model,
            flange_frame=self._model.frames[self._frame].name,
            load=load,
            friction=FrictionCompensation(self._model),
        )

    def flange_speed_bound_mm_s(self, velocity_rad_s: Seven) -> float:
        """Return a speed in mm/s that the flange's origin exceeds in no pose, at a fraction of the exact one's cost."""
        return sum(map(mul, map(abs, velocity_rad_s), self._reach_mm), 0.0)

    def flange_keeps_below(self, limit_mm_s: float, position_rad: Seven, velocity_rad_s: Seven) -> bool:
        """Return whether the flange's origin is surely not above a speed in mm/s; if not, the exact one must tell."""
        if self.flange_speed_bound_mm_s(velocity_rad_s) <= limit_mm_s:
            return True
        # Each axis moves the flange on a lever of its own, known in a pose nearby. It changes with the axes behind it
        # alone, by no more than they have moved the flange since.
        bound_mm_s = moved_mm = 0.0
        for axis in _FROM_FLANGE:
            bound_mm_s += abs(velocity_rad_s[axis]) * (self._levers_mm[axis] + moved_mm)
            moved_mm += abs(position_rad[axis] - self._levers_at[axis]) * self._reach_mm[axis]
        if bound_mm_s * _ROUNDING <= limit_mm_s:
            return True
        if moved_mm > _NEAR_MM:
            self._take_levers(position_rad)
        return False

    def main_axis(self, position_rad: Seven, velocity_rad_s: Seven) -> int:
        """Return the axis (0 for A1) that moves the flange's origin most at these velocities."""
        alone: list[float] = []
        for axis, velocity in enumerate(velocity_rad_s):
            only: list[float] = [0.0] * len(velocity_rad_s)
            only[axis] = velocity
            alone.append(self.flange_speed_mm_s(position_rad, seven(only)))
        return max(range(len(alone)), key=alone.__getitem__)

    def _take_levers(self, position_rad: Seven) -> None:
        jacobian = pinocchio.computeFrameJacobian(
            self._model, self._levers_data, np.array(position_rad), self._frame, pinocchio.LOCAL
        )
        self._levers_mm = (1e3 * np.linalg.norm(jacobian[:3], axis=0)).tolist()
        self._levers_at = position_rad

    def flange_in_base_mm(self, position_rad: Seven) -> tuple[float, ...]:
        """Return translation in mm and unit quaternion w x y z, seven numbers, as FRI 2.x sends poses."""
        # Immutable tuples: the same object is the same position, so the speed of this cycle already placed the links.
        if position_rad is not self._at:
            _STATE.pack_into(self._memory, 0, *position_rad, *STILL)
            pinocchio.forwardKinematics(self._model, self._data, self._position)
            self._at = position_rad
        placement = pinocchio.updateFramePlacement(self._model, self._data, self._frame)
        x, y, z, qx, qy, qz, qw = pinocchio.SE3ToXYZQUATtuple(placement)
        return (x * 1e3, y * 1e3, z * 1e3, qw, qx, qy, qz)

    def flange_speed_mm_s(self, position_rad: Seven, velocity_rad_s: Seven) -> float:
        """Return the speed of the flange's origin in mm/s."""
        _STATE.pack_into(self._memory, 0, *position_rad, *velocity_rad_s)
        pinocchio.forwardKinematics(self._model, self._data, self._position, self._velocity)
        self._at = position_rad
        velocity = pinocchio.getFrameVelocity(self._model, self._data, self._frame, pinocchio.LOCAL)
        x, y, z = velocity.linear.tolist()
        return 1e3 * math.hypot(x, y, z)


def _reach_mm(model: "pinocchio.Model", flange: "pinocchio.Frame") -> list[float]:
    """Return for each joint the largest distance the flange can have from it: all lengths beyond it, added."""
    reach = float(np.linalg.norm(flange.placement.translation))
    reaches: list[float] = []
    for joint in range(model.njoints - 1, 0, -1):
        reaches.append(1e3 * reach)
        reach += float(np.linalg.norm(model.jointPlacements[joint].translation))
    return reaches[::-1]
