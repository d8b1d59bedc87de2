"""What a decoded command must satisfy beside its joint positions: torques, wrenches and Cartesian poses."""

import math
from typing import Final, NamedTuple

from hil.core.fri.commands import Refusal
from hil.core.kinematics.answers import NoPosition
from hil.core.kinematics.redundancy import largest_change_rad
from hil.core.kinematics.srs import SrsKinematics
from hil.core.motion.set_point import STILL
from hil.values.control import NO_WRENCH, six
from hil.values.fri import RedundancyStrategy
from hil.values.fri_messages import CommandData, Vector
from hil.values.outcomes import Outcome
from hil.values.pose import Pose
from hil.values.robot import JOINT_NAMES, Seven, Six

MAX_WRENCH: Final[Six] = (200.0, 200.0, 200.0, 40.0, 40.0, 40.0)
"""What a wrench overlay may add, N and Nm. Ours, no public figure (facts 6.3): half as much again as the heaviest
payload weighs, and what the last axis has."""
UNIT_LENGTH: Final = 1e-3
"""How far from 1 the length of a pose's quaternion may be."""

_WRENCH_NAMES: Final = ("Fx", "Fy", "Fz", "the moment about A", "the moment about B", "the moment about C")
_WRENCH_UNITS: Final = ("N", "N", "N", "Nm", "Nm", "Nm")
_POSE_NAMES: Final = ("tx", "ty", "tz", "w", "x", "y", "z")
_SAME_BRANCH_RAD: Final = 0.1
"""Change of an axis up to which the present branch is the nearest without a look at the others."""
_NEAR_SINGULAR_RAD: Final = 0.1


class PoseTarget(NamedTuple):
    """A commanded pose of the flange in the base; without an E1 the present one stays."""

    flange_in_base: Pose
    e1_rad: float | None


def axis_torque(data: CommandData | None, most_nm: Seven) -> Seven | Refusal:
    """Return the torques a command adds, Nm, or why it cannot; none given are none."""
    values = None if data is None else data.torque
    if values is None:
        return STILL
    if refusal := _not_numbers(values, "torques", JOINT_NAMES):
        return refusal
    for name, value, most in zip(JOINT_NAMES, values, most_nm, strict=True):
        if abs(value) > most:
            return Refusal(Outcome.TORQUE_LIMIT, f"{name} is to get {value:+.1f} Nm more, its limit is {most:g} Nm")
    return values  # type: ignore[return-value]  # seven values, checked above


def wrench(data: CommandData | None) -> Six | Refusal:
    """Return the wrench a command adds, N and Nm, X Y Z A B C, or why it cannot; none given is none."""
    values = None if data is None else data.wrench
    if values is None:
        return NO_WRENCH
    if refusal := _not_numbers(values, "numbers of a wrench", _WRENCH_NAMES):
        return refusal
    for name, value, most, unit in zip(_WRENCH_NAMES, values, MAX_WRENCH, _WRENCH_UNITS, strict=True):
        if abs(value) > most:
            return Refusal(Outcome.TORQUE_LIMIT, f"{name} is {value:+.1f} {unit}, {most:g} {unit} are allowed")
    return six(values)


def cartesian_pose(data: CommandData | None) -> PoseTarget | Refusal:
    """Return the commanded pose of a command, or why there is none."""
    if data is None or data.pose is None:
        return Refusal(Outcome.SHAPE, "the command has no Cartesian pose", missing=True)
    values = data.pose.values
    if refusal := _not_numbers(values, "numbers of a pose", _POSE_NAMES):
        return refusal
    tx, ty, tz, w, x, y, z = values
    length = math.hypot(w, x, y, z)
    if abs(length - 1.0) > UNIT_LENGTH:
        return Refusal(
            Outcome.SHAPE, f"the quaternion of the pose has the length {length:.4f}, 1 to {UNIT_LENGTH:g} is needed"
        )
    e1_rad = None
    if data.redundancy is not None and data.redundancy.strategy != RedundancyStrategy.NONE:
        if data.redundancy.strategy != RedundancyStrategy.E1:
            return Refusal(
                Outcome.NOT_ALLOWED,
                f"redundancy strategy {data.redundancy.strategy}; "
                f"{RedundancyStrategy.E1:d} (E1) or {RedundancyStrategy.NONE:d} (none) are taken",
            )
        e1_rad = data.redundancy.value
        if not math.isfinite(e1_rad):
            return Refusal(Outcome.NOT_FINITE, f"E1 is {e1_rad}")
    return PoseTarget(Pose.from_quaternion((tx * 1e-3, ty * 1e-3, tz * 1e-3), (w, x, y, z)), e1_rad)


def axes_of(target: PoseTarget, kinematics: SrsKinematics, present_rad: Seven) -> Seven | Refusal:
    """Return the axis positions of a pose on the branch nearest to ``present_rad``, or why there are none."""
    pose = target.flange_in_base
    e1_rad = present_rad[2] if target.e1_rad is None else target.e1_rad
    kept = kinematics.inverse(pose, e1_rad, kinematics.status_of(present_rad), near_rad=present_rad)
    if not isinstance(kept, NoPosition) and largest_change_rad(kept, present_rad) <= _SAME_BRANCH_RAD:
        return kept
    # Two branches meet where A4, A6 or the wrist centre's x is 0: there the way may go on in the other one.
    answers = kinematics.branches(pose, e1_rad, near_rad=present_rad)
    found = [answer for answer in answers if not isinstance(answer, NoPosition)]
    if found:
        return min(found, key=lambda position: largest_change_rad(position, present_rad))
    x, y, z = (1e3 * value for value in pose.position_m)
    return Refusal(
        Outcome.UNREACHABLE, f"the pose at {x:.1f}, {y:.1f}, {z:.1f} mm with E1 at {e1_rad:.4f} rad is {kept}"
    )


def with_singularity(refusal: Refusal, kinematics: SrsKinematics, position_rad: Seven) -> Refusal:
    """Return the refusal of a step, which says so if the step is as long as it is because of a singularity."""
    near = kinematics.singularities_of(position_rad, tolerance_rad=_NEAR_SINGULAR_RAD)
    if refusal.outcome is not Outcome.AXIS_VELOCITY or not near:
        return refusal
    return refusal._replace(detail=f"{refusal.detail}; the pose is next to a singularity ({near[0]})")


def _not_numbers(values: Vector, what: str, names: tuple[str, ...]) -> Refusal | None:
    if len(values) != len(names):
        return Refusal(Outcome.SHAPE, f"{len(values)} {what}, {len(names)} are needed")
    for name, value in zip(names, values, strict=True):
        if not math.isfinite(value):
            return Refusal(Outcome.NOT_FINITE, f"{name} is {value} ({what})")
    return None
