"""A push as arguments of a call: checked before it becomes a request, which no packet might be able to carry."""

from collections.abc import Iterable
from operator import index

from hil.client.servo.errors import IllegalArgumentException
from hil.values.arm import Push
from hil.values.robot import JOINT_COUNT, Three


def checked_push(link: int, force_n: Iterable[float], moment_nm: Iterable[float], duration_s: float) -> Push:
    """Return the push; raise OutOfRange, or :class:`IllegalArgumentException` for what is no number."""
    force, moment = _three("force", force_n, "N"), _three("moment", moment_nm, "Nm")
    try:
        seconds = float(duration_s)
    except (TypeError, ValueError):
        raise IllegalArgumentException(f"duration of a push is {duration_s!r}; a number of seconds is needed") from None
    try:
        place = index(link)
    except TypeError:
        raise IllegalArgumentException(f"link is {link!r}; a whole number, 1 ... {JOINT_COUNT}, is needed") from None
    push = Push(place, force, moment, seconds)
    push.check()
    return push


def _three(name: str, values: Iterable[float], unit: str) -> Three:
    try:
        x, y, z = map(float, values)
    except (TypeError, ValueError):
        raise IllegalArgumentException(f"{name} is {values!r}; three numbers x, y, z in {unit} are needed") from None
    return x, y, z
