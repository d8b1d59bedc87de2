"""Forward and inverse kinematics of the S-R-S arm in closed form, with E1, Status and Turn (robot facts 1.1, 7, 9).

The flange is Tz(d1) Rz(A1)Ry(A2) Tz(d3) Rz(A3)Ry(-A4) Tz(d5) Rz(A5)Ry(A6) Tz(d7) Rz(A7). With A3 held at E1:

- w, from shoulder to wrist centre, is the flange's origin less d7 along its z axis, less d1. Its length gives A4 by the
  law of cosines, but for the sign (Status bit 1).
- In the frame turned by A1 and A2, w is v = (-d5 sin A4 cos E1, -d5 sin A4 sin E1, d3 + d5 cos A4).
- A2 turns about y and leaves v_y; A1 turns about z and leaves w_z. So in the frame turned by A1 alone, the wrist centre
  is (x, v_y, w_z) with x = +-sqrt(w_x^2 + w_y^2 - v_y^2), minus being Status bit 0. Then A1 is the angle from (x, v_y)
  to (w_x, w_y), and A2 the one from (v_z, v_x) to (w_z, x). No x is real where this E1 leads the wrist too far aside.
- A5, A6, A7 are the ZYZ angles of what is left of the rotation; (A5 + pi, -A6, A7 + pi) are too (Status bit 2).

Two by two by two is eight branches, and every position of the axes lies in the branch of its own Status. On a border
between two branches (A4 = 0, x = 0, A6 = 0) both hold it. A singularity that leaves the axes determined is answered;
where two axes turn about one line (A6 = 0, or the wrist centre on the axis of A1) the caller says where one of them is.
Beside two borders at once (closer than 1e-5) the pose is as exact as ever, but its rounding decides about A1 or A5.
"""

import math
from typing import Final, NamedTuple

import pinocchio

from hil.core.kinematics.answers import NoPosition, OutsideLimits, Reach, Singular, Unreachable
from hil.core.kinematics.geometry import srs_lengths
from hil.core.kinematics.singularities import Singularity
from hil.values.arm import seven
from hil.values.errors import ConfigurationError, OutOfRange
from hil.values.pose import Matrix, Pose, multiplied
from hil.values.robot import JOINT_NAMES, JointLimits, Seven

OVERHEAD: Final = 1
"""Status bit 0: the wrist centre has x < 0 in the frame turned by A1."""
ELBOW: Final = 2
"""Status bit 1: A4 < 0."""
WRIST: Final = 4
"""Status bit 2: A6 <= 0."""
STATUSES: Final = range(8)

_PI: Final = math.pi
_TURN: Final = 2.0 * math.pi

_ROUNDING_M: Final = 1e-12
"""What a wrist centre may be beyond a bound and still count as on it: poses on the bound come with rounding."""

_ON_BORDER_M: Final = 4e-15
"""Within this of a border, A4 or x is 0: their roots would make 1e-7 of the last digits, and A5 or A1 anything."""

_UNDETERMINED: Final = 1e-10
"""Sine of A6, and metres of the wrist centre from the axis of A1, below which rounding decides about an angle."""

_LIMIT_ROUNDING_RAD: Final = 1e-10
"""A position this far outside its limit is put on it: the pose of an arm at its limit comes back with rounding."""


class WristTarget(NamedTuple):
    """What of a flange pose no choice of branch or E1 changes. Metres and rad, from the shoulder, in base axes."""

    x: float
    y: float
    z: float
    aside: float
    """Distance of the wrist centre from the axis of A1."""
    a4: float
    """Without its sign."""
    sin_a4: float
    cos_a4: float
    rotation: Matrix


class SrsKinematics:
    """One arm: lengths read from ``model``, axis limits as given. Keeps no state; frames: flange in robot base, metres.

    Raise ConfigurationError for a model that is no S-R-S arm, and for limits that allow an axis more than half a turn
    to either side, because then a pose and a branch would have more than one answer.
    """

    def __init__(self, model: "pinocchio.Model", limits: JointLimits, *, flange_frame: str = "flange") -> None:
        self.lengths = srs_lengths(model, flange_frame)
        for name, low, high in zip(JOINT_NAMES, limits.position_min_rad, limits.position_max_rad, strict=True):
            if not -_PI <= low < high <= _PI:
                raise ConfigurationError(
                    f"limits of {name} are {low:g} to {high:g} rad; valid: growing, and within half a turn of 0"
                )
        self.limits = limits
        self._low, self._high = limits.position_min_rad, limits.position_max_rad
        self.largest_a4_rad = max(-self._low[3], self._high[3])
        self._d1, self._d3, self._d5, self._d7 = self.lengths

    def forward(self, position_rad: Seven) -> Pose:
        """Return the flange in the base."""
        q1, q2, q3, q4, q5, q6, q7 = position_rad
        upper = _turned(q1, q2)
        fore = multiplied(upper, _turned(q3, -q4))
        wrist = multiplied(fore, _turned(q5, q6))
        sin, cos = math.sin(q7), math.cos(q7)
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = wrist
        d3, d5, d7 = self._d3, self._d5, self._d7
        return Pose(
            d3 * upper[2] + d5 * fore[2] + d7 * r02,
            d3 * upper[5] + d5 * fore[5] + d7 * r12,
            d3 * upper[8] + d5 * fore[8] + d7 * r22 + self._d1,
            (
                *(r00 * cos + r01 * sin, r01 * cos - r00 * sin, r02),
                *(r10 * cos + r11 * sin, r11 * cos - r10 * sin, r12),
                *(r20 * cos + r21 * sin, r21 * cos - r20 * sin, r22),
            ),
        )

    def inverse(
        self, flange_in_base: Pose, e1_rad: float, status: int, *, near_rad: Seven | None = None
    ) -> Seven | NoPosition:
        """Return the axis positions of a pose with A3 at ``e1_rad`` in the branch ``status`` (0 to 7), or why none.

        Where two axes turn about one line, the first of them stands where ``near_rad`` has it; without it the answer
        is ``Singular``. Raise OutOfRange for a status that does not exist.
        """
        if status not in STATUSES:
            raise OutOfRange("status", status, "0 to 7")
        if not self._low[2] <= e1_rad <= self._high[2]:
            return OutsideLimits(2, e1_rad, self._low[2], self._high[2])
        target = self.wrist_target(flange_in_base)
        if isinstance(target, NoPosition):
            return target
        if near_rad is not None and status & WRIST:
            near_rad = other_wrist(near_rad)
        found = self.wrist_up(target, e1_rad, overhead=status & OVERHEAD != 0, elbow=status & ELBOW != 0, near=near_rad)
        if isinstance(found, NoPosition):
            return found
        return self.within_limits(other_wrist(found) if status & WRIST else found)

    def branches(
        self, flange_in_base: Pose, e1_rad: float, *, near_rad: Seven | None = None
    ) -> tuple[Seven | NoPosition, ...]:
        """Return the answers of :meth:`inverse` for all eight branches, in the order of Status."""
        if not self._low[2] <= e1_rad <= self._high[2]:
            return (OutsideLimits(2, e1_rad, self._low[2], self._high[2]),) * 8
        target = self.wrist_target(flange_in_base)
        if isinstance(target, NoPosition):
            return (target,) * 8
        up: list[Seven | NoPosition] = []
        down: list[Seven | NoPosition] = []
        turned = None if near_rad is None else other_wrist(near_rad)
        for overhead, elbow in ((False, False), (True, False), (False, True), (True, True)):
            arm = self.wrist_up(target, e1_rad, overhead=overhead, elbow=elbow, near=near_rad)
            up.append(arm if isinstance(arm, NoPosition) else self.within_limits(arm))
            if turned is not None:
                arm = self.wrist_up(target, e1_rad, overhead=overhead, elbow=elbow, near=turned)
            down.append(arm if isinstance(arm, NoPosition) else self.within_limits(other_wrist(arm)))
        return (*up, *down)

    def status_of(self, position_rad: Seven) -> int:
        """Return Status, 0 to 7: the branch these axis positions are in."""
        _, _, _, a4, _, a6, _ = position_rad
        x, _ = self._wrist_centre(position_rad)
        return (OVERHEAD if x < 0.0 else 0) | (ELBOW if a4 < 0.0 else 0) | (WRIST if a6 <= 0.0 else 0)

    def singularities_of(self, position_rad: Seven, *, tolerance_rad: float) -> tuple[Singularity, ...]:
        """Return all singularities whose condition holds within ``tolerance_rad``, in the order of their table.

        For the wrist centre overhead, that is the angle by which A2 is away from it.
        """
        _, a2, a3, a4, a5, a6, _ = map(abs, position_rad)
        x, distance = self._wrist_centre(position_rad)
        quarter = _PI / 2.0
        shoulder, wrist = a2 <= tolerance_rad, a6 <= tolerance_rad
        holds = {
            Singularity.ELBOW_STRETCHED: a4 <= tolerance_rad,
            Singularity.WRIST_CENTRE_OVERHEAD: abs(x) <= distance * math.sin(min(tolerance_rad, quarter)),
            Singularity.WRIST_STRETCHED: wrist,
            Singularity.SHOULDER_WITH_ELBOW_SIDEWAYS: shoulder and abs(a3 - quarter) <= tolerance_rad,
            Singularity.WRIST_WITH_ELBOW_SIDEWAYS: wrist and abs(a5 - quarter) <= tolerance_rad,
            Singularity.SHOULDER_AND_WRIST: shoulder and wrist,
            Singularity.ELBOW_RIGHT_ANGLE_AND_WRIST: wrist and abs(a4 - quarter) <= tolerance_rad,
        }
        return tuple(singularity for singularity in Singularity if holds[singularity])

    def wrist_target(self, flange_in_base: Pose) -> WristTarget | Unreachable:
        """Return what all branches and all E1 share."""
        x, y, z, rotation = flange_in_base
        d3, d5, d7 = self._d3, self._d5, self._d7
        x -= d7 * rotation[2]
        y -= d7 * rotation[5]
        z -= d7 * rotation[8] + self._d1
        aside = math.hypot(x, y)
        distance = math.hypot(aside, z)
        if distance > d3 + d5 + _ROUNDING_M:
            return Unreachable(Reach.FAR, distance - d3 - d5)
        if distance < abs(d3 - d5) - _ROUNDING_M:
            return Unreachable(Reach.NEAR, abs(d3 - d5) - distance)
        cosine = (distance * distance - d3 * d3 - d5 * d5) / (2.0 * d3 * d5)
        a4 = math.acos(max(-1.0, cosine)) if distance < d3 + d5 - _ON_BORDER_M else 0.0
        if a4 > self.largest_a4_rad >= a4 - _LIMIT_ROUNDING_RAD:
            a4 = self.largest_a4_rad
        return WristTarget(x, y, z, aside, a4, math.sin(a4), math.cos(a4), rotation)

    def wrist_up(
        self, target: WristTarget, e1_rad: float, *, overhead: bool, elbow: bool, near: Seven | None
    ) -> Seven | Unreachable | Singular:
        """Return the axis positions of two branches' common arm, with A6 >= 0, whatever the axis limits."""
        wx, wy, wz, aside, a4, s4, c4, (r00, r01, r02, r10, r11, r12, r20, r21, r22) = target
        if elbow:
            a4, s4 = -a4, -s4
        s3, c3 = math.sin(e1_rad), math.cos(e1_rad)
        d5 = self._d5
        vx, vy, vz = -d5 * s4 * c3, -d5 * s4 * s3, self._d3 + d5 * c4
        beyond = abs(vy) - aside
        if beyond > _ROUNDING_M:
            s4 = math.copysign(aside / (d5 * abs(s3)), a4)
            shorter = math.copysign(math.sqrt(1.0 - s4 * s4), c4) - c4
            if not abs(shorter) * d5 <= _ROUNDING_M:
                return Unreachable(Reach.ASIDE, beyond)
            # Next to the stretched arm the last digit of a length is many of A4's; the most that reaches is as good.
            c4 += shorter
            a4 = math.atan2(s4, c4)
            vx, vy, vz, beyond = -d5 * s4 * c3, -d5 * s4 * s3, self._d3 + d5 * c4, 0.0
        # As a product it keeps its digits where the two are nearly equal.
        x = math.sqrt(-beyond * (abs(vy) + aside)) if beyond < -_ON_BORDER_M else 0.0
        if overhead:
            x = -x
        if aside > _UNDETERMINED:
            q1 = _wrapped(math.atan2(wy, wx) - math.atan2(vy, x))
        elif near is not None:
            q1 = near[0]
        else:
            return Singular(Singularity.WRIST_CENTRE_OVERHEAD)
        q2 = _wrapped(math.atan2(x, wz) - math.atan2(vx, vz))
        s1, c1, s2, c2 = math.sin(q1), math.cos(q1), math.sin(q2), math.cos(q2)
        # The flange's z axis, turned back by A1, A2, A3 and A4 one after the other.
        x, y = c1 * r02 + s1 * r12, c1 * r12 - s1 * r02
        x, z = c2 * x - s2 * r22, s2 * x + c2 * r22
        x, y = c3 * x + s3 * y, c3 * y - s3 * x
        x, z = c4 * x + s4 * z, c4 * z - s4 * x
        s6, c6 = math.hypot(x, y), z
        if s6 > _UNDETERMINED:
            q5 = math.atan2(y, x)
            s5, c5 = y / s6, x / s6
        elif near is not None:
            q5 = near[4]
            s5, c5 = math.sin(q5), math.cos(q5)
        else:
            return Singular(Singularity.WRIST_STRETCHED)
        # The axis of A6, turned forward to the base: A7 is measured from it, so it makes up for any rounding in A5.
        x, y, z = -s5 * c4, c5, -s5 * s4
        x, y = c3 * x - s3 * y, s3 * x + c3 * y
        x, z = c2 * x + s2 * z, c2 * z - s2 * x
        x, y = c1 * x - s1 * y, s1 * x + c1 * y
        q7 = math.atan2(x * r00 + y * r10 + z * r20, x * r01 + y * r11 + z * r21)
        return q1, q2, e1_rad, a4, q5, math.atan2(s6, c6), q7

    def within_limits(self, position_rad: Seven) -> Seven | OutsideLimits:
        """Return the position, put on a limit it is beyond by no more than rounding, or the first axis outside."""
        if not self.inside(position_rad):
            for axis, (low, value, high) in enumerate(zip(self._low, position_rad, self._high, strict=True)):
                if not low - _LIMIT_ROUNDING_RAD <= value <= high + _LIMIT_ROUNDING_RAD:
                    return OutsideLimits(axis, value, low, high)
            clamped = zip(self._low, position_rad, self._high, strict=True)
            return seven([min(max(value, low), high) for low, value, high in clamped])
        return position_rad

    def inside(self, position_rad: Seven) -> bool:
        """Return whether no axis is outside its limits."""
        q1, q2, q3, q4, q5, q6, q7 = position_rad
        l1, l2, l3, l4, l5, l6, l7 = self._low
        h1, h2, h3, h4, h5, h6, h7 = self._high
        # The axes that fail most often come first: most candidates of a search do.
        return (
            (l6 <= q6 <= h6 and l1 <= q1 <= h1 and l2 <= q2 <= h2 and l5 <= q5 <= h5)
            and (l7 <= q7 <= h7 and l4 <= q4 <= h4 and l3 <= q3 <= h3)
        )  # fmt: skip

    def _wrist_centre(self, position_rad: Seven) -> tuple[float, float]:
        """Return the wrist centre's x in the frame turned by A1, and its distance from that frame's y axis; metres."""
        _, a2, a3, a4, _, _, _ = position_rad
        vx, vz = -self._d5 * math.sin(a4) * math.cos(a3), self._d3 + self._d5 * math.cos(a4)
        return math.cos(a2) * vx + math.sin(a2) * vz, math.hypot(vx, vz)


def turn_of(position_rad: Seven) -> int:
    """Return Turn, 0 to 127: bit 0 is set when A1 is negative, bit 6 when A7 is."""
    return sum(1 << axis for axis, value in enumerate(position_rad) if value < 0.0)


def other_wrist(position_rad: Seven) -> Seven:
    """Return the same arm with its wrist turned over: A6 with the other sign, A5 and A7 by half a turn; same flange."""
    q1, q2, q3, q4, q5, q6, q7 = position_rad
    return q1, q2, q3, q4, _half_turned(q5), -q6, _half_turned(q7)


def _half_turned(angle_rad: float) -> float:
    return angle_rad - _PI if angle_rad > 0.0 else angle_rad + _PI


def _wrapped(angle_rad: float) -> float:
    """Return a difference of two results of atan2 as an angle in -pi..pi."""
    if angle_rad > _PI:
        return angle_rad - _TURN
    return angle_rad + _TURN if angle_rad < -_PI else angle_rad


def _turned(about_z_rad: float, about_y_rad: float) -> Matrix:
    """Return Rz Ry."""
    sz, cz, sy, cy = math.sin(about_z_rad), math.cos(about_z_rad), math.sin(about_y_rad), math.cos(about_y_rad)
    return (cz * cy, -sz, cz * sy, sz * cy, cz, sz * sy, -sy, 0.0, cy)
