"""Whether an arm of a scene is one of ours: its axes and lengths at zero, whatever frames the simulator has there.

Axes are compared as lines, so it does not matter where along its axis a joint is drawn. Robot facts 1.1.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from backends.robots.facts import JOINT_AXES, ROBOTS, RobotFacts
from hil.values.errors import ConfigurationError, UnknownName
from hil.values.pose import Pose
from hil.values.robot import JOINT_COUNT, JOINT_NAMES

_TOLERANCE_M = 0.002
_TOLERANCE_RAD = math.radians(1.0)
_MOST_DIFFERENCES = 3
_Vector = NDArray[np.float64]


class Fit(NamedTuple):
    """How the scene's arm goes with ours."""

    base_in_world: Pose
    """Where it has our robot base."""
    signs: tuple[int, ...]
    """-1 for an axis that turns the other way there."""
    flange_in_last_joint: Pose


def fit_arm(joints_at_zero: Sequence[Pose], *, model: str, device: str, robot: str) -> Fit:
    """Return how the arm fits ``model``; raise :class:`ConfigurationError` that says what differs.

    ``joints_at_zero`` are the seven joints in the world, each one turning about its z axis.
    """
    facts = _facts(model)
    arm = _measure(joints_at_zero)
    differences = _differences(arm, facts)
    if not differences:
        return _fit(arm, facts)
    like = [other.description.name for other in ROBOTS if not _differences(arm, other)]
    more = len(differences) - _MOST_DIFFERENCES
    told = "; ".join(differences[:_MOST_DIFFERENCES]) + (f"; and {more} more" if more > 0 else "")
    raise ConfigurationError(
        f"{device!r} of the scene is no {model}, which the robot {robot!r} is: {told}"
        + (f"; it is like {' and '.join(like)}" if like else "")
    )


class _Arm(NamedTuple):
    joints: Sequence[Pose]
    axes: list[_Vector]
    centres: tuple[_Vector, _Vector, _Vector]
    """Shoulder, elbow and wrist, where A1 and A2, A3 and A4, A5 and A6 meet."""
    gaps_m: tuple[float, float, float]
    """How far these pass each other."""


def _facts(model: str) -> RobotFacts:
    for facts in ROBOTS:
        if facts.description.name == model:
            return facts
    raise UnknownName("robot", model, [facts.description.name for facts in ROBOTS])


def _measure(joints: Sequence[Pose]) -> _Arm:
    axes = [np.array(pose.rotation[2::3]) for pose in joints]
    points = [np.array(pose.position_m) for pose in joints]
    met = [_meeting(points[i], axes[i], points[i + 1], axes[i + 1]) for i in (0, 2, 4)]
    (shoulder, at_shoulder), (elbow, at_elbow), (wrist, at_wrist) = met
    return _Arm(joints, axes, (shoulder, elbow, wrist), (at_shoulder, at_elbow, at_wrist))


def _meeting(point: _Vector, axis: _Vector, other: _Vector, other_axis: _Vector) -> tuple[_Vector, float]:
    """Return the middle between two lines where they are nearest, and their distance there."""
    across = np.cross(axis, other_axis)
    square = float(across @ across)
    if square < math.sin(_TOLERANCE_RAD) ** 2:
        return point, math.inf
    between = other - point
    on_first = point + axis * float(np.cross(between, other_axis) @ across) / square
    on_second = other + other_axis * float(np.cross(between, axis) @ across) / square
    return (on_first + on_second) / 2.0, math.dist(on_first, on_second)


def _differences(arm: _Arm, facts: RobotFacts) -> list[str]:
    shoulder, elbow, wrist = arm.centres
    found = [
        f"the axes of A{2 * i + 1} and A{2 * i + 2} are parallel"
        if math.isinf(gap_m)
        else f"the axes of A{2 * i + 1} and A{2 * i + 2} pass each other at {gap_m * 1000.0:.0f} mm"
        for i, gap_m in enumerate(arm.gaps_m)
        if gap_m > _TOLERANCE_M
    ]
    if found:
        return found
    for ends, there_m, here_m in (
        ("shoulder to elbow", math.dist(shoulder, elbow), facts.lengths_m[1]),
        ("elbow to wrist", math.dist(elbow, wrist), facts.lengths_m[2]),
    ):
        if abs(there_m - here_m) > _TOLERANCE_M:
            found.append(f"{ends} is {there_m * 1000.0:.0f} mm instead of {here_m * 1000.0:.0f} mm")
    if min(math.dist(shoulder, elbow), math.dist(elbow, wrist)) < _TOLERANCE_M:
        return found
    x, y, z = _base_axes(arm)
    for name, axis, ours in zip(JOINT_NAMES, arm.axes, JOINT_AXES, strict=True):
        away_rad = _between_lines(axis, ours[0] * x + ours[1] * y + ours[2] * z)
        if away_rad > _TOLERANCE_RAD:
            found.append(f"at 0 the axis of {name} is {math.degrees(away_rad):.0f} degrees away from ours")
    bend_rad = _between_lines(wrist - elbow, z)
    if bend_rad > _TOLERANCE_RAD or float((wrist - elbow) @ z) < 0.0:
        found.append("at 0 its forearm is not in line with its upper arm")
    return found + _beside(arm)


def _beside(arm: _Arm) -> list[str]:
    """Return the axes along the arm that pass beside the centre before or behind them."""
    shoulder, elbow, wrist = arm.centres
    found = []
    for joint, centre, name in ((2, shoulder, "shoulder"), (4, elbow, "elbow"), (6, wrist, "wrist")):
        away_m = float(np.linalg.norm(np.cross(centre - np.array(arm.joints[joint].position_m), arm.axes[joint])))
        if away_m > _TOLERANCE_M:
            found.append(f"the axis of {JOINT_NAMES[joint]} passes the {name} at {away_m * 1000.0:.0f} mm")
    return found


def _base_axes(arm: _Arm) -> tuple[_Vector, _Vector, _Vector]:
    """Return x, y, z of our robot base: z to the elbow, y along A2.

    With A2 the other way round it would be the same arm, turned by half a turn: A2 has our sense by definition.
    """
    shoulder, elbow, _ = arm.centres
    z = (elbow - shoulder) / np.linalg.norm(elbow - shoulder)
    y = arm.axes[1] - z * float(arm.axes[1] @ z)
    y /= max(float(np.linalg.norm(y)), 1e-9)
    return np.cross(y, z), y, z


def _between_lines(first: _Vector, second: _Vector) -> float:
    return math.atan2(float(np.linalg.norm(np.cross(first, second))), abs(float(first @ second)))


def _fit(arm: _Arm, facts: RobotFacts) -> Fit:
    x, y, z = _base_axes(arm)
    foot = arm.centres[0] - z * facts.lengths_m[0]
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack((x, y, z), axis=1)
    matrix[:3, 3] = foot
    base = Pose.from_homogeneous(matrix)
    ours = [axis[0] * x + axis[1] * y + axis[2] * z for axis in JOINT_AXES]
    signs = tuple(1 if float(arm.axes[i] @ ours[i]) > 0.0 else -1 for i in range(JOINT_COUNT))
    flange = base @ Pose(0.0, 0.0, facts.flange_height_m)
    return Fit(base, signs, arm.joints[-1].inverse() @ flange)
