"""Pose of one frame in another: position in metres and a rotation matrix, with KUKA's A, B, C and quaternions.

A, B, C are Rz(A) Ry(B) Rx(C) (robot facts 1.1). Plain floats in a named tuple: at this size they are faster than
arrays, and nobody can change one that somebody else holds.
"""

import math
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from hil.values.errors import ConfigurationError, OutOfRange
from hil.values.robot import Three

Four = tuple[float, float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]
"""A rotation matrix, row by row."""

_GIMBAL_LOCK: Final = 1e-12
"""Below this cosine of B its rounding decides about A; the rest of the rotation goes into C whatever A is."""

_ORTHONORMAL: Final = 1e-6
"""How far from 1 a length, from 0 an angle's cosine, a matrix may be that is still meant as a rotation."""


class Pose(NamedTuple):
    """Where a frame stands in another: ``a_in_c = b_in_c @ a_in_b``. Two are equal when all numbers are."""

    x_m: float
    y_m: float
    z_m: float
    rotation: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

    @classmethod
    def from_abc_rad(cls, position_m: Three, a_rad: float, b_rad: float, c_rad: float) -> Self:
        """Return the pose with the rotation Rz(a) Ry(b) Rx(c); raise ConfigurationError for numbers not finite."""
        _require_finite("pose", (*position_m, a_rad, b_rad, c_rad))
        sa, ca = math.sin(a_rad), math.cos(a_rad)
        sb, cb = math.sin(b_rad), math.cos(b_rad)
        sc, cc = math.sin(c_rad), math.cos(c_rad)
        return cls(
            *position_m,
            (
                *(ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc),
                *(sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc),
                *(-sb, cb * sc, cb * cc),
            ),
        )

    @classmethod
    def from_abc_deg(cls, position_m: Three, a_deg: float, b_deg: float, c_deg: float) -> Self:
        """Return the pose with the rotation Rz(a) Ry(b) Rx(c); raise ConfigurationError for numbers not finite."""
        return cls.from_abc_rad(position_m, math.radians(a_deg), math.radians(b_deg), math.radians(c_deg))

    @classmethod
    def from_quaternion(cls, position_m: Three, quaternion_wxyz: Four) -> Self:
        """Return the pose with the rotation of a quaternion of any length but 0; raise OutOfRange for that."""
        _require_finite("pose", (*position_m, *quaternion_wxyz))
        length = math.hypot(*quaternion_wxyz)
        if not 0.0 < length < math.inf:
            raise OutOfRange("length of the quaternion", length, "above 0 and finite")
        w, x, y, z = (number / length for number in quaternion_wxyz)
        return cls(
            *position_m,
            (
                *(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
                *(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
                *(2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
            ),
        )

    @classmethod
    def from_homogeneous(cls, matrix: NDArray[np.float64]) -> Self:
        """Return the pose of a 4x4 matrix in metres; raise ConfigurationError when it is no rigid motion."""
        turn = matrix[:3, :3]
        closeness = np.abs(turn @ turn.T - np.eye(3)).max() if matrix.shape == (4, 4) else math.inf
        if not (closeness <= _ORTHONORMAL and np.linalg.det(turn) > 0.0 and np.isfinite(matrix).all()):
            raise ConfigurationError(f"{matrix.tolist()} is no pose; valid: a 4x4 matrix with a rotation and metres")
        x, y, z = matrix[:3, 3].tolist()
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = turn.ravel().tolist()
        return cls(x, y, z, (r00, r01, r02, r10, r11, r12, r20, r21, r22))

    @property
    def position_m(self) -> Three:
        """x, y, z in metres."""
        return self[:3]

    def abc_rad(self) -> Three:
        """Return A, B, C in rad: A and C in -pi..pi, B in -pi/2..pi/2; A is 0 where only A + C or A - C is defined."""
        r00, r01, r02, r10, r11, r12, r20, _, _ = self.rotation
        cos_b = math.hypot(r00, r10)
        a = math.atan2(r10, r00) if cos_b > _GIMBAL_LOCK else 0.0
        sa, ca = math.sin(a), math.cos(a)
        # C from the rotation that is left when A is undone: exact also where A was a guess.
        return a, math.atan2(-r20, cos_b), math.atan2(sa * r02 - ca * r12, ca * r11 - sa * r01)

    def abc_deg(self) -> Three:
        """Return A, B, C in degrees, as :meth:`abc_rad`."""
        a, b, c = self.abc_rad()
        return math.degrees(a), math.degrees(b), math.degrees(c)

    def quaternion_wxyz(self) -> Four:
        """Return the unit quaternion w x y z with w >= 0."""
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = self.rotation
        trace = r00 + r11 + r22
        # Of the four ways to take the root, the one whose number is largest: it never divides by a small one.
        largest = max(trace, r00, r11, r22)
        if largest == trace:
            w, x, y, z = 1.0 + trace, r21 - r12, r02 - r20, r10 - r01
        elif largest == r00:
            w, x, y, z = r21 - r12, 1.0 + r00 - r11 - r22, r01 + r10, r02 + r20
        elif largest == r11:
            w, x, y, z = r02 - r20, r01 + r10, 1.0 - r00 + r11 - r22, r12 + r21
        else:
            w, x, y, z = r10 - r01, r02 + r20, r12 + r21, 1.0 - r00 - r11 + r22
        length = math.copysign(math.hypot(w, x, y, z), w)
        return w / length, x / length, y / length, z / length

    def homogeneous(self) -> NDArray[np.float64]:
        """Return a fresh 4x4 matrix, metres."""
        x, y, z, rotation = self
        matrix = np.eye(4)
        matrix[:3, :3] = np.reshape(rotation, (3, 3))
        matrix[:3, 3] = x, y, z
        return matrix

    def inverse(self) -> "Pose":
        """Return where the other frame stands in this one."""
        x, y, z, (r00, r01, r02, r10, r11, r12, r20, r21, r22) = self
        return Pose(
            -(r00 * x + r10 * y + r20 * z),
            -(r01 * x + r11 * y + r21 * z),
            -(r02 * x + r12 * y + r22 * z),
            (r00, r10, r20, r01, r11, r21, r02, r12, r22),
        )

    def __matmul__(self, other: "Pose") -> "Pose":
        x, y, z, rotation = self
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation
        u, v, w, turn = other
        return Pose(
            x + r00 * u + r01 * v + r02 * w,
            y + r10 * u + r11 * v + r12 * w,
            z + r20 * u + r21 * v + r22 * w,
            multiplied(rotation, turn),
        )

    def distance_m(self, other: "Pose") -> float:
        """Return how far apart the two origins are."""
        return math.dist(self[:3], other[:3])

    def angle_rad(self, other: "Pose") -> float:
        """Return the angle of the rotation between the two, 0..pi; exact for small angles, to 1e-8 near pi."""
        return 2.0 * math.asin(min(1.0, math.dist(self.rotation, other.rotation) / math.sqrt(8.0)))


NOWHERE: Final = Pose(0.0, 0.0, 0.0)
"""No distance and no rotation."""


def multiplied(first: Matrix, second: Matrix) -> Matrix:
    """Return the product of two rotation matrices."""
    a, b, c, d, e, f, g, h, i = first
    r, s, t, u, v, w, x, y, z = second
    return (
        *(a * r + b * u + c * x, a * s + b * v + c * y, a * t + b * w + c * z),
        *(d * r + e * u + f * x, d * s + e * v + f * y, d * t + e * w + f * z),
        *(g * r + h * u + i * x, g * s + h * v + i * y, g * t + h * w + i * z),
    )


def _require_finite(what: str, numbers: tuple[float, ...]) -> None:
    if not all(map(math.isfinite, numbers)):
        raise ConfigurationError(f"{what} has the numbers {numbers}; valid: finite numbers")
