"""What a decoded command must satisfy before the interpolator sees it: finite, right shape, allowed, within limits."""

import math
from typing import NamedTuple

from hil.values.fri_messages import CommandData
from hil.values.outcomes import Outcome
from hil.values.robot import JOINT_COUNT, JOINT_NAMES, JointLimits, Seven

VELOCITY_TOLERANCE = 1e-6
"""Relative; a client that clamps its steps to the axis velocity must not fail on rounding."""


class Refusal(NamedTuple):
    """Why a command is not taken: the counter, words with axis, value and limit, whether the motion ends with it."""

    outcome: Outcome
    detail: str
    ends_motion: bool = False


def joint_position(data: CommandData | None) -> tuple[Seven, None] | tuple[None, Refusal]:
    """Return the commanded joint position of a command for a joint position overlay, or why there is none."""
    if data is not None and (not_taken := _not_taken(data)):
        return None, Refusal(
            Outcome.NOT_ALLOWED, f"the command carries {not_taken}; the running overlay takes joint positions"
        )
    if data is None or data.position is None:
        return None, Refusal(Outcome.SHAPE, "the command has no joint position")
    position = data.position
    if len(position) != JOINT_COUNT:
        return None, Refusal(Outcome.SHAPE, f"{len(position)} joint positions, {JOINT_COUNT} are needed")
    if not all(map(math.isfinite, position)):
        axis = next(index for index, value in enumerate(position) if not math.isfinite(value))
        return None, Refusal(Outcome.NOT_FINITE, f"{JOINT_NAMES[axis]} is {position[axis]}")
    return position, None  # type: ignore[return-value]  # seven values, checked above


def _not_taken(data: CommandData) -> str | None:
    if data.torque is not None:
        return "torques"
    if data.wrench is not None:
        return "a wrench"
    if data.pose is not None or data.redundancy is not None:
        return "a Cartesian pose"
    if data.inputs_outputs:
        return "outputs the controller does not list"
    if data.transformations:
        return "transformations the controller did not ask for"
    return None


def within_limits(
    target: Seven, previous: Seven, *, elapsed_s: float, approach_s: float, limits: JointLimits
) -> Refusal | None:
    """Return why ``target`` is out of bounds, or None.

    ``previous`` is the last accepted position, ``elapsed_s`` the time the client had for the step, and ``approach_s``
    the time in which the interpolator will make it, if the axis can. A target is out of bounds outside the axis range,
    when the step is faster than the axis may move, and when the axis, arriving as fast as the interpolator will let it,
    could not stop before the end of its range with its rated deceleration.
    """
    rows = zip(
        target,
        previous,
        limits.position_min_rad,
        limits.position_max_rad,
        limits.velocity_rad_s,
        limits.acceleration_rad_s2,
        strict=True,
    )
    for axis, (value, before, low, high, fastest, deceleration) in enumerate(rows):
        if not low <= value <= high:
            return Refusal(
                Outcome.AXIS_LIMIT, f"{JOINT_NAMES[axis]} to {value:.4f} rad, its range is {low:.4f}..{high:.4f} rad"
            )
        if value == before:
            continue
        step = value - before
        speed = step / elapsed_s
        if abs(speed) > fastest * (1 + VELOCITY_TOLERANCE):
            return Refusal(
                Outcome.AXIS_VELOCITY,
                f"{JOINT_NAMES[axis]} steps {step:+.4f} rad in {elapsed_s * 1e3:g} ms, "
                f"{abs(speed):.3f} rad/s; its limit is {fastest:.3f} rad/s",
            )
        arrival = min(abs(step) / approach_s, fastest)
        if arrival * arrival > 2 * deceleration * (high - value if step > 0 else value - low):
            return Refusal(
                Outcome.AXIS_LIMIT,
                f"{JOINT_NAMES[axis]} at {value:.4f} rad arrives with {arrival:.3f} rad/s and could not stop "
                f"before {high if step > 0 else low:.4f} rad",
            )
    return None
