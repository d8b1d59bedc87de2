"""Destinations of motions: what every one of them is checked for, and the line they wait in for their dead time."""

import math
from collections import deque
from typing import NamedTuple

from hil.core.motion.axis_range import MARGIN_RAD
from hil.core.motion.set_point import STILL
from hil.values.motion import ErrorReason, Fault
from hil.values.robot import JOINT_COUNT, JOINT_NAMES, JointLimits, Seven
from hil.values.servo import Vector

MAX_WAITING = 256
"""Destinations that wait for their dead time; with one more the oldest is superseded."""


class Destination(NamedTuple):
    """Where a motion is to go: position in rad, velocity there in rad/s; and when that arrived at the controller."""

    position_rad: Seven
    velocity_rad_s: Seven
    planned_rad: Seven
    """The position, but so far inside the axis ranges that a way planned to it does not leave them."""
    arrived_ns: int


class Due(NamedTuple):
    """The destination whose dead time is over, and how many before it nobody will go for."""

    destination: Destination
    superseded: int


class DestinationLine:
    """Destinations on their way to the interpolator: each is there ``dead_time_ns`` after it arrived."""

    def __init__(self, dead_time_ns: int) -> None:
        self._dead_time_ns = dead_time_ns
        self._waiting: deque[Destination] = deque()

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def newest(self) -> Destination:
        """The destination that arrived last; there must be one."""
        return self._waiting[-1]

    def wait_ns(self, *, now_ns: int) -> int:
        """Return how long the newest destination still has to wait."""
        return max(0, self._waiting[-1].arrived_ns + self._dead_time_ns - now_ns)

    def add(self, destination: Destination) -> bool:
        """Put ``destination`` at the end; return True when the oldest had to go for it."""
        full = len(self._waiting) >= MAX_WAITING
        if full:
            self._waiting.popleft()
        self._waiting.append(destination)
        return full

    def due(self, *, now_ns: int) -> Due | None:
        """Take the newest destination whose dead time is over, and forget those before it."""
        arrived_before_ns = now_ns - self._dead_time_ns
        taken, count = None, 0
        while self._waiting and self._waiting[0].arrived_ns <= arrived_before_ns:
            taken = self._waiting.popleft()
            count += 1
        return None if taken is None else Due(taken, count - 1)


def not_well_formed(position: Vector | None, velocity: Vector | None) -> Fault | None:
    """Return the first reason why this is no destination of seven finite numbers (and as many velocities), or None."""
    if position is None:
        return Fault(ErrorReason.NULL_POINTER, "no destination is given")
    return _not_seven_numbers("destination", position) or (
        None if velocity is None else _not_seven_numbers("target velocity", velocity)
    )


def destination(
    position: Vector, velocity: Vector | None, *, arrived_ns: int, limits: JointLimits, out_of_range: ErrorReason
) -> Destination | Fault:
    """Return the destination of well-formed vectors, or which axis is out of its range.

    Without ``velocity`` it is reached standing still.
    """
    near_end = False
    axes = zip(JOINT_NAMES, position, limits.position_min_rad, limits.position_max_rad, strict=True)
    for name, value, low, high in axes:
        if not low + MARGIN_RAD <= value <= high - MARGIN_RAD:
            if not low <= value <= high:
                return Fault(
                    out_of_range, f"destination of {name} {value:.9g} rad is outside {low:.9g}..{high:.9g} rad"
                )
            near_end = True
    exact: Seven = tuple(position)  # type: ignore[assignment]  # there are seven
    speed: Seven = STILL if velocity is None else tuple(velocity)  # type: ignore[assignment]
    return Destination(exact, speed, _inside(exact, limits) if near_end else exact, arrived_ns)


def _inside(position: Seven, limits: JointLimits) -> Seven:
    axes = zip(position, limits.position_min_rad, limits.position_max_rad, strict=True)
    return tuple(min(max(value, low + MARGIN_RAD), high - MARGIN_RAD) for value, low, high in axes)  # type: ignore[return-value]


def _not_seven_numbers(what: str, values: Vector) -> Fault | None:
    if len(values) != JOINT_COUNT:
        return Fault(ErrorReason.NUMBER_OF_DOFS, f"a {what} of {len(values)} joints, the arm has {JOINT_COUNT}")
    # A sum is finite only if all its parts are; it may overflow though they are.
    if math.isfinite(sum(values)):
        return None
    for axis, value in enumerate(values):
        if not math.isfinite(value):
            return Fault(ErrorReason.INVALID_INPUT_VALUES, f"{what} of {JOINT_NAMES[axis]} is {value}")
    return None
