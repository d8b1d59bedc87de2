"""What a decoded command must satisfy before the interpolator sees it: finite, right shape, allowed, within limits."""

import math
from itertools import compress
from operator import ne
from typing import Final, NamedTuple

from hil.values.fri import OverlayKind
from hil.values.fri_messages import CommandData
from hil.values.outcomes import Outcome
from hil.values.robot import JOINT_COUNT, JOINT_NAMES, JointLimits, Seven

VELOCITY_TOLERANCE = 1e-6
"""Relative; a client that clamps its steps to the axis velocity must not fail on rounding."""


_AXES: Final = range(JOINT_COUNT)
_Axis = tuple[float, float, float, float, float]
"""Range (low, high) in rad, velocity limit in rad/s, the same with its tolerance, twice the rated deceleration in
rad/s2."""


class Refusal(NamedTuple):
    """Why a command is not taken: the counter, words with axis, value and limit, whether the motion ends with it."""

    outcome: Outcome
    detail: str
    ends_motion: bool = False
    missing: bool = False
    """Whether the command says nothing at all of what the overlay needs; such an answer does not end it at once."""


_TAKES: Final = {
    OverlayKind.JOINT_POSITION: "joint positions",
    OverlayKind.TORQUE: "joint positions and torques",
    OverlayKind.WRENCH: "joint positions and a wrench",
    OverlayKind.CARTESIAN_POSE: "a Cartesian pose",
}


_NOTHING_ELSE: Final = CommandData()[1:]
_CARTESIAN_POSE: Final = OverlayKind.CARTESIAN_POSE


def not_allowed(data: CommandData | None, overlay: OverlayKind) -> Refusal | None:
    """Return which part of a command is none that the running overlay takes, or None."""
    if data is None:
        return None
    # Most overlays are of joint positions, and most commands carry nothing else.
    if data[1:] == _NOTHING_ELSE and overlay is not _CARTESIAN_POSE:
        return None
    not_taken = _of_another_overlay(data, overlay)
    if not_taken is None:
        return None
    return Refusal(Outcome.NOT_ALLOWED, f"the command carries {not_taken}; the running overlay takes {_TAKES[overlay]}")


def joint_position(data: CommandData | None) -> Seven | Refusal:
    """Return the commanded joint position of a command, or why there is none."""
    if data is None or data.position is None:
        return Refusal(Outcome.SHAPE, "the command has no joint position", missing=True)
    position = data.position
    if len(position) != JOINT_COUNT:
        return Refusal(Outcome.SHAPE, f"{len(position)} joint positions, {JOINT_COUNT} are needed")
    # A sum is finite only if all of it is; one that is not may just be too large.
    if not (math.isfinite(sum(position)) or all(map(math.isfinite, position))):
        axis = next(index for index, value in enumerate(position) if not math.isfinite(value))
        return Refusal(Outcome.NOT_FINITE, f"{JOINT_NAMES[axis]} is {position[axis]}")
    return position  # type: ignore[return-value]  # seven values, checked above


def _of_another_overlay(data: CommandData, overlay: OverlayKind) -> str | None:
    if data.torque is not None and overlay is not OverlayKind.TORQUE:
        return "torques"
    if data.wrench is not None and overlay is not OverlayKind.WRENCH:
        return "a wrench"
    if (data.pose is not None or data.redundancy is not None) and overlay is not OverlayKind.CARTESIAN_POSE:
        return "a Cartesian pose"
    if data.position is not None and overlay is OverlayKind.CARTESIAN_POSE:
        return "joint positions"
    return None


class CommandBounds:
    """What the axes of one robot allow a commander. Sources of the limits: robot facts 2.1."""

    def __init__(self, limits: JointLimits) -> None:
        self._axes = tuple(
            (low, high, fastest, fastest * (1 + VELOCITY_TOLERANCE), 2 * deceleration)
            for low, high, fastest, deceleration in zip(
                limits.position_min_rad,
                limits.position_max_rad,
                limits.velocity_rad_s,
                limits.acceleration_rad_s2,
                strict=True,
            )
        )

    def position(self, target: Seven) -> Refusal | None:
        """Return why ``target`` is outside an axis range, or None."""
        for axis, (value, (low, high, _, _, _)) in enumerate(zip(target, self._axes, strict=True)):
            if not low <= value <= high:
                return _out_of_range(axis, value, low, high)
        return None

    def step(self, target: Seven, previous: Seven, *, elapsed_s: float, approach_s: float) -> Refusal | None:
        """Return why the step to ``target`` is out of bounds, or None.

        ``previous`` is the last accepted position, ``elapsed_s`` the time the client had for the step, ``approach_s``
        the time in which the interpolator will make it, if the axis can. A step is out of bounds when it leaves the
        axis range, when it is faster than the axis may move, and when the axis, arriving as fast as the interpolator
        will let it, could not stop before the end of its range with its rated deceleration.
        """
        # What was accepted before is in range, and most axes stand still most of the time.
        for axis in compress(_AXES, map(ne, target, previous)):
            refusal = _refused_step(axis, target[axis], previous[axis], self._axes[axis], elapsed_s, approach_s)
            if refusal is not None:
                return refusal
        return None


def _refused_step(  # noqa: PLR0917  # runs for each moving axis in each cycle; keywords cost
    axis: int, value: float, before: float, bounds: _Axis, elapsed_s: float, approach_s: float
) -> Refusal | None:
    low, high, fastest, too_fast_above, twice_deceleration = bounds
    if not low <= value <= high:
        return _out_of_range(axis, value, low, high)
    step = value - before
    length = abs(step)
    speed = length / elapsed_s
    if speed > too_fast_above:
        return Refusal(
            Outcome.AXIS_VELOCITY,
            f"{JOINT_NAMES[axis]} steps {step:+.4f} rad in {elapsed_s * 1e3:g} ms, "
            f"{speed:.3f} rad/s; its limit is {fastest:.3f} rad/s",
        )
    # A comparison, not min(): this runs for each moving axis in each cycle, and a call costs more than it does.
    arrival = length / approach_s
    if arrival > fastest:  # noqa: PLR1730
        arrival = fastest
    if arrival * arrival > twice_deceleration * (high - value if step > 0 else value - low):
        return Refusal(
            Outcome.AXIS_LIMIT,
            f"{JOINT_NAMES[axis]} at {value:.4f} rad arrives with {arrival:.3f} rad/s and could not stop "
            f"before {high if step > 0 else low:.4f} rad",
        )
    return None


def _out_of_range(axis: int, value: float, low: float, high: float) -> Refusal:
    return Refusal(
        Outcome.AXIS_LIMIT, f"{JOINT_NAMES[axis]} to {value:.4f} rad, its range is {low:.4f}..{high:.4f} rad"
    )
