"""Transformations the controller asks the client for: asked, checked, kept with their time.

What a message asks with is what the recorded ones hold: the name and the identity, without a time stamp.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from hil.core.fri.commands import Refusal
from hil.values.fri import MAX_TRANSFORMATIONS, TRAITS, Release
from hil.values.fri_messages import TimeStamp, Transformation
from hil.values.outcomes import Outcome
from hil.values.pose import Pose

ROTATION_TOLERANCE: Final = 1e-3
"""How far lengths and angles' cosines of a rotation may be off. Ours."""
MAX_AGE_NS: Final = 1_000_000_000
"""How far a time stamp may be from the controller's clock, either way. Ours, no public figure."""
_NS: Final = 1_000_000_000
_MM: Final = 1e-3
_IDENTITY: Final = {
    12: (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0),
    7: (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
}


class Provided(NamedTuple):
    """What a client gave last."""

    pose: Pose
    at: TimeStamp | None
    """The client's time stamp, where it gave one."""
    received_ns: int
    """When its answer came, in core time."""


class RequestedTransformations:
    """Those of one client. ``unix_epoch_ns`` is the Unix time of core time zero."""

    def __init__(self, names: Sequence[str], *, release: Release, unix_epoch_ns: int) -> None:
        self._count = TRAITS[release].transformation_values
        self._unix_epoch_ns = unix_epoch_ns
        self.on_wire = tuple(Transformation(name, _IDENTITY[self._count]) for name in names)
        """What a monitoring message asks with."""
        self.provided: dict[str, Provided | None] = dict.fromkeys(names)
        """What the client gave last, by name; None before it did."""
        self.updates = dict.fromkeys(names, 0)

    def refusal(self, values: tuple[Transformation, ...], *, now_ns: int) -> Refusal | None:
        """Return why these cannot be taken, or None."""
        if not self.on_wire:
            return Refusal(
                Outcome.NOT_ALLOWED,
                "the command carries transformations the controller did not ask for; it asks for none",
            )
        if len(values) > MAX_TRANSFORMATIONS:
            return Refusal(
                Outcome.SHAPE, f"the command carries {len(values)} transformations, {MAX_TRANSFORMATIONS} are allowed"
            )
        for value in values:
            if refusal := self._refused(value, now_ns):
                return refusal
        return None

    def take(self, values: tuple[Transformation, ...], *, now_ns: int) -> None:
        """Keep what :meth:`refusal` found nothing against."""
        for value in values:
            self.provided[value.name] = Provided(_pose(value.values), value.at, now_ns)
            self.updates[value.name] += 1

    def report(self) -> dict[str, object]:
        """Return what the client gave last, by name: position in m, quaternion w x y z, times in seconds."""
        return {name: self._report(name, given) for name, given in self.provided.items()}

    def _report(self, name: str, given: Provided | None) -> dict[str, object] | None:
        if given is None:
            return None
        return {
            "position_m": list(given.pose.position_m),
            "quaternion_wxyz": list(given.pose.quaternion_wxyz()),
            "time_stamp_unix_s": None if given.at is None else given.at.seconds + given.at.nanoseconds / _NS,
            "received_s": given.received_ns / _NS,
            "updates": self.updates[name],
        }

    def _refused(self, value: Transformation, now_ns: int) -> Refusal | None:
        name, numbers = value.name, value.values
        if name not in self.provided:
            return Refusal(
                Outcome.NOT_ALLOWED,
                f"the command carries the transformation {name[:80]!r}, which the controller did not ask for; "
                f"it asks for {', '.join(self.provided)}",
            )
        if len(numbers) != self._count:
            return Refusal(
                Outcome.SHAPE, f"the transformation {name} has {len(numbers)} numbers, {self._count} are needed"
            )
        if not all(map(math.isfinite, numbers)):
            wrong = next(number for number in numbers if not math.isfinite(number))
            return Refusal(Outcome.NOT_FINITE, f"the transformation {name} has the number {wrong}")
        off = _off_a_rotation(numbers)
        if not off <= ROTATION_TOLERANCE:
            return Refusal(
                Outcome.SHAPE,
                f"the transformation {name} is no rotation: it is {off:.3g} off one, {ROTATION_TOLERANCE:g} is allowed",
            )
        return self._stale(value, now_ns)

    def _stale(self, value: Transformation, now_ns: int) -> Refusal | None:
        if value.at is None:
            return None
        age_ns = self._unix_epoch_ns + now_ns - (value.at.seconds * _NS + value.at.nanoseconds)
        if abs(age_ns) <= MAX_AGE_NS:
            return None
        told = f"{age_ns / _NS:.3f} s old" if age_ns > 0 else f"{-age_ns / _NS:.3f} s in the future"
        return Refusal(
            Outcome.LATE,
            f"the transformation {value.name} is {told} by its time stamp, {MAX_AGE_NS / _NS:g} s are allowed: "
            f"is it the monitoring message's time stamp?",
        )


def _matrix(numbers: Sequence[float]) -> tuple[float, ...]:
    return (*numbers[0:3], *numbers[4:7], *numbers[8:11])


def _off_a_rotation(numbers: Sequence[float]) -> float:
    """Return how far the rotation in ``numbers`` is off one: of a quaternion its length, of a matrix its rows."""
    if len(numbers) != len(_IDENTITY[12]):
        return abs(math.hypot(*numbers[3:]) - 1.0)
    a, b, c, d, e, f, g, h, i = _matrix(numbers)
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    if determinant < 0.0:
        return abs(determinant - 1.0)
    return max(
        *(abs(math.hypot(*row) - 1.0) for row in ((a, b, c), (d, e, f), (g, h, i))),
        *map(abs, (a * d + b * e + c * f, a * g + b * h + c * i, d * g + e * h + f * i)),
    )


def _pose(numbers: Sequence[float]) -> Pose:
    if len(numbers) != len(_IDENTITY[12]):
        x, y, z, *quaternion = numbers
        w, i, j, k = quaternion
        return Pose.from_quaternion((x * _MM, y * _MM, z * _MM), (w, i, j, k))
    position_m = (numbers[3] * _MM, numbers[7] * _MM, numbers[11] * _MM)
    a, b, c, d, e, f, g, h, i = _matrix(numbers)
    # By way of the quaternion, so that what is kept is a rotation to the last digit.
    return Pose.from_quaternion(position_m, Pose(*position_m, (a, b, c, d, e, f, g, h, i)).quaternion_wxyz())
