"""What all packets are made of: texts, vectors and enumerations, and their bounds."""

from collections.abc import Iterable, Mapping, Sequence
from enum import IntEnum
from typing import Any, Final, TypeVar

from hil.values.errors import ConfigurationError, MalformedDatagram
from hil.values.fri import OperationMode, SafetyState
from hil.values.motion import FineInterpolatorState, MotionEnd, MotionKind, MotionPhase
from hil.values.operator import ProgramState
from hil.values.outcomes import Outcome
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
MODES: Final = _numbered(OperationMode)
PROGRAMS: Final = _numbered(ProgramState)
SAFETY_STATES: Final = _numbered(SafetyState)
MOST_OVERRIDE_PERCENT: Final = 100.0


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


def fitting(pieces: Iterable[bytes], room_bytes: int) -> bytes:
    """Return as many of ``pieces``, from the first on, as there is room for."""
    taken: list[bytes] = []
    for piece in pieces:
        room_bytes -= len(piece)
        if room_bytes < 0:
            break
        taken.append(piece)
    return b"".join(taken)
