"""A transformation as the configured release has it: a matrix in 1.x, a quaternion in 2.x."""

from hil.client.fri.state import FriState
from hil.values.fri import TRAITS
from hil.values.fri_messages import TimeStamp, Transformation
from hil.values.pose import Four, Pose
from hil.values.robot import Three

_MATRIX_NUMBERS = 12


def make_transformation(
    state: FriState,
    name: str,
    translation_mm: Three,
    quaternion_wxyz: Four = (1.0, 0.0, 0.0, 0.0),
    *,
    at: TimeStamp | None = None,
) -> Transformation:
    """Return what :attr:`Command.transformations` takes.

    ``quaternion_wxyz`` may have any length but 0; ``at`` is when it was measured, default: the time stamp of ``state``.
    Raises :class:`hil.values.errors.ConfigurationError` for numbers that are not finite.
    """
    rotation = Pose.from_quaternion(translation_mm, quaternion_wxyz)
    stamp = state.time_stamp if at is None else at
    x, y, z = translation_mm
    if TRAITS[state.release].transformation_values != _MATRIX_NUMBERS:
        length = sum(number * number for number in quaternion_wxyz) ** 0.5
        return Transformation(name, (x, y, z, *(number / length for number in quaternion_wxyz)), stamp)
    r = rotation.rotation
    return Transformation(name, (*r[0:3], x, *r[3:6], y, *r[6:9], z), stamp)
