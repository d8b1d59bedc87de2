"""Kinematics of one arm, by Pinocchio: flange pose and flange speed. Frames: flange in robot base, metres."""

import math
from typing import TYPE_CHECKING

import numpy as np
import pinocchio

from hil.values.robot import Seven

if TYPE_CHECKING:
    from numpy.typing import NDArray


class ArmModel:
    """Works on private buffers; what it returns is a copy. ``flange_frame`` is a frame name of ``model``."""

    def __init__(self, model: "pinocchio.Model", *, flange_frame: str = "flange") -> None:
        self._model = model
        self._data = model.createData()
        self._frame = model.getFrameId(flange_frame)
        self._jacobian = np.zeros((6, model.nv))

    def flange_in_base_mm(self, position_rad: Seven) -> tuple[float, ...]:
        """Return translation in mm and unit quaternion w x y z, seven numbers, as FRI 2.x sends poses."""
        pinocchio.framesForwardKinematics(self._model, self._data, np.array(position_rad))
        placement = self._data.oMf[self._frame]
        x, y, z = placement.translation
        return (x * 1e3, y * 1e3, z * 1e3, *_quaternion_wxyz(placement.rotation))

    def flange_speed_mm_s(self, position_rad: Seven, velocity_rad_s: Seven) -> float:
        """Return the speed of the flange's origin in mm/s."""
        jacobian = pinocchio.computeFrameJacobian(
            self._model, self._data, np.array(position_rad), self._frame, pinocchio.LOCAL_WORLD_ALIGNED
        )
        velocity: NDArray[np.float64] = jacobian[:3] @ np.array(velocity_rad_s)
        return 1e3 * math.sqrt(float(velocity @ velocity))


def _quaternion_wxyz(rotation: "NDArray[np.float64]") -> tuple[float, float, float, float]:
    quaternion = pinocchio.Quaternion(rotation)
    quaternion.normalize()
    return (float(quaternion.w), float(quaternion.x), float(quaternion.y), float(quaternion.z))
