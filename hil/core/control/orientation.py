"""Orientation error as a rotation vector, and the moment of a spring on it.

The error is ``theta``, the axis of the rotation from the set point's orientation to the measured one times its angle in
rad, in the set point's axes: so a rotational stiffness means Nm per radian at any angle. The spring's moment is the
exact gradient of its energy ``theta' K theta / 2``, also where its three stiffnesses differ, so it cannot pump energy.
Half a turn off, the axis is no longer unique; path deviation limits end a motion long before.
"""

import math
from typing import Final

from hil.values.robot import Three

_SMALL: Final = 1e-6


def rotation_vector(x: float, y: float, z: float, w: float) -> Three:
    """Return axis times angle, rad, of the rotation with this unit quaternion; the angle is in 0 ... pi."""
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 if sine < _SMALL else 2.0 * math.atan2(sine, w) / sine
    return (scale * x, scale * y, scale * z)


def spring_moment(theta: Three, stiffness: Three) -> Three:
    """Return the moment in Nm, in the set point's axes, of rotational springs in Nm/rad about these axes."""
    tx, ty, tz = theta
    mx, my, mz = stiffness[0] * tx, stiffness[1] * ty, stiffness[2] * tz
    if stiffness[0] == stiffness[1] == stiffness[2]:
        return (-mx, -my, -mz)
    # K theta times the transposed inverse of the left Jacobian of SO(3): I + [theta]/2 + c [theta]^2.
    ux, uy, uz = ty * mz - tz * my, tz * mx - tx * mz, tx * my - ty * mx
    vx, vy, vz = ty * uz - tz * uy, tz * ux - tx * uz, tx * uy - ty * ux
    square = tx * tx + ty * ty + tz * tz
    half = 0.5 * math.sqrt(square)
    c = 1.0 / 12.0 if half < 1e-3 else (1.0 - half / math.tan(half)) / square
    return (-mx - 0.5 * ux - c * vx, -my - 0.5 * uy - c * vy, -mz - 0.5 * uz - c * vz)
