"""What all packets are made of: texts, vectors and enumerations, and their bounds."""

from collections.abc import Iterable, Mapping, Sequence
from enum import IntEnum
from math import isfinite
from typing import Any, Final, TypeVar

from hil.values.errors import ConfigurationError, HilError, MalformedDatagram
from hil.values.frames import FrameKind
from hil.values.fri import ControlMode, OperationMode, SafetyState
from hil.values.motion import FineInterpolatorState, MotionEnd, MotionKind, MotionPhase
from hil.values.operator import ProgramState
from hil.values.outcomes import Outcome
from hil.values.pose import Pose
from hil.values.servo import MAX_VECTOR_NUMBERS, RequestError, Role, Vector
from transport.servo import servo_pb2

_E = TypeVar("_E", bound=IntEnum)
_ELLIPSIS: Final = "…"


def _numbered(kind: type[_E]) -> Mapping[int, _E]:
    return {int(member): member for member in kind}


ROLES: Final = _numbered(Role)
KINDS: Final = _numbered(MotionKind)
PHASES: Final = _numbered(MotionPhase)
INTERPOLATORS: Final = _numbered(FineInterpolatorState)
ENDS: Final = _numbered(MotionEnd)
ERRORS: Final = _numbered(RequestError)
FRAME_KINDS: Final = _numbered(FrameKind)
MODES: Final = _numbered(OperationMode)
CONTROL_MODES: Final = _numbered(ControlMode)
PROGRAMS: Final = _numbered(ProgramState)
SAFETY_STATES: Final = _numbered(SafetyState)
MOST_OVERRIDE_PERCENT: Final = 100.0
POSE_NUMBERS: Final = 7
"""Of a pose: x, y, z in m, quaternion w, x, y, z."""
_ABOUT_1: Final = (0.5, 2.0)
"""Squared lengths of quaternions that are as good as normalised."""


def undecodable(detail: str) -> MalformedDatagram:
    """Return the error for a datagram that is no packet."""
    return MalformedDatagram(Outcome.UNDECODABLE, detail)


def refuse_many(count: int, most: int, what: str) -> None:
    """Raise :class:`MalformedDatagram` for more than ``most``."""
    if count > most:
        raise undecodable(f"{count} {what}, at most {most} are allowed")


def read_member(members: Mapping[int, _E], number: int, what: str) -> _E:
    """Return the member of an enumeration; raise :class:`MalformedDatagram` for a number it does not have."""
    member = members.get(number)
    if member is None:
        raise undecodable(f"there is no {what} {number}")
    return member


def read_text(text: str, most_bytes: int, what: str) -> str:
    """Return ``text``; raise :class:`MalformedDatagram` if it has more than ``most_bytes`` in UTF-8."""
    size = len(text) if text.isascii() else len(text.encode())
    if size > most_bytes:
        raise undecodable(f"a {what} of {size} bytes, at most {most_bytes} are allowed")
    return text


def read_vector(values: Sequence[float]) -> Vector:
    """Return a vector; raise :class:`MalformedDatagram` if it has more than 32 numbers."""
    refuse_many(len(values), MAX_VECTOR_NUMBERS, "numbers in a vector")
    # Sliced first, because that is twice as fast as protobuf's own iterator.
    return tuple(values[:])


def read_pose(wire: servo_pb2.Pose) -> Pose:
    """Return a pose; raise :class:`MalformedDatagram` if it has not seven finite numbers, or no rotation."""
    return pose_of(tuple(wire.value[:]))


def pose_of(numbers: tuple[float, ...]) -> Pose:
    """Return the pose of seven numbers; raise :class:`MalformedDatagram` where they are none."""
    if len(numbers) != POSE_NUMBERS:
        raise undecodable(f"a pose of {len(numbers)} numbers, {POSE_NUMBERS} are needed")
    x_m, y_m, z_m, w, x, y, z = numbers
    square = w * w + x * x + y * y + z * z
    if not (_ABOUT_1[0] < square < _ABOUT_1[1] and isfinite(x_m) and isfinite(y_m) and isfinite(z_m)):
        return _unusual_pose(numbers)
    # What Pose.from_quaternion does, at a third of its price: this is read in every packet.
    s = 2.0 / square
    sx, sy, sz = s * x, s * y, s * z
    xx, xy, xz, yy, yz, zz = sx * x, sx * y, sx * z, sy * y, sy * z, sz * z
    wx, wy, wz = sx * w, sy * w, sz * w
    return Pose(
        x_m,
        y_m,
        z_m,
        (1.0 - yy - zz, xy - wz, xz + wy, xy + wz, 1.0 - xx - zz, yz - wx, xz - wy, yz + wx, 1.0 - xx - yy),
    )


def _unusual_pose(numbers: tuple[float, ...]) -> Pose:
    x_m, y_m, z_m, w, x, y, z = numbers
    try:
        return Pose.from_quaternion((x_m, y_m, z_m), (w, x, y, z))
    except HilError as error:
        raise undecodable(str(error)) from None


def read_counted(values: Sequence[float], count: int, what: str) -> Vector:
    """Return ``count`` numbers, finite or not; raise :class:`MalformedDatagram` for another count."""
    if len(values) != count:
        raise undecodable(f"{what} with {len(values)} numbers where {count} are needed")
    return tuple(values[:])


def read_finite(values: Sequence[float], count: int, what: str) -> Vector:
    """Return ``count`` finite numbers; raise :class:`MalformedDatagram` where they are others."""
    numbers = tuple(values[:])
    if len(numbers) != count or not all(map(isfinite, numbers)):
        raise undecodable(f"{what} of {numbers[:MAX_VECTOR_NUMBERS]}, {count} finite numbers are needed")
    return numbers


def wire_number(member: IntEnum) -> Any:
    """Return the number of a member, as protobuf's type hints, which know its own enumerations only, let it through."""
    return int(member)


def wire_text(text: str, most_bytes: int) -> str:
    """Return ``text``, cut between two characters if it has more than ``most_bytes`` in UTF-8."""
    if text.isascii() and len(text) <= most_bytes:
        return text
    content = text.encode(errors="replace")
    if len(content) > most_bytes:
        return content[: most_bytes - len(_ELLIPSIS.encode())].decode(errors="ignore") + _ELLIPSIS
    return content.decode()


def wire_vector(values: Vector | None) -> servo_pb2.Vector | None:
    """Return a vector that may be left out; raise :class:`ConfigurationError` if no packet can carry it."""
    if values is None:
        return None
    if len(values) > MAX_VECTOR_NUMBERS:
        raise ConfigurationError(f"a vector of {len(values)} numbers, at most {MAX_VECTOR_NUMBERS} can be sent")
    return servo_pb2.Vector(value=values)


def pose_numbers(pose: Pose) -> tuple[float, ...]:
    """Return the seven numbers of a pose."""
    return (*pose[:3], *pose.quaternion_wxyz())


def finite_pose_numbers(pose: Pose) -> tuple[float, ...]:
    """Return the seven numbers of a pose; raise :class:`ConfigurationError` if one is not finite."""
    numbers = pose_numbers(pose)
    if not isfinite(sum(numbers)):
        raise ConfigurationError(f"a pose with the numbers {numbers} cannot be sent; finite ones are needed")
    return numbers


def wire_pose(pose: Pose | None) -> servo_pb2.Pose | None:
    """Return a pose that may be left out; raise :class:`ConfigurationError` if no packet can carry it."""
    return None if pose is None else servo_pb2.Pose(value=finite_pose_numbers(pose))


def fitting(pieces: Iterable[bytes], room_bytes: int) -> bytes:
    """Return as many of ``pieces``, from the first on, as there is room for."""
    taken: list[bytes] = []
    for piece in pieces:
        room_bytes -= len(piece)
        if room_bytes < 0:
            break
        taken.append(piece)
    return b"".join(taken)
