"""Vectors of doubles as protobuf writes them unpacked, a tag before each value; without an object for each vector.

A monitoring message has up to seven of them, and making and filling protobuf objects for them was most of the cost of
encoding (``hil bench cycle``, 1.15: 11 us before, 8 us since).
"""

from functools import cache
from struct import Struct

from hil.values.fri_messages import Vector

_VALUE = b"\x09"
"""Tag of field 1 as a double: JointValues.value and CartesianVector.value."""
_SEVEN = Struct("<cc" + "cd" * 7).pack
_SEVEN_BYTES = b"\x3f"
_SIX = Struct("<cc" + "cd" * 6).pack
_SIX_BYTES = b"\x36"
_POSE_VALUE = b"\x11"
"""Tag of field 2 as a double: Transformation.value."""
_SEVEN_OF_POSE = Struct("<" + "cd" * 7).pack
LAST_ONE_BYTE = 0x7F
ONE_BYTE = [bytes((number,)) for number in range(LAST_ONE_BYTE + 1)]
"""The varints of one byte."""
_TWO_BYTES = 0x3FFF
_THREE_BYTES = 0x1FFFFF
_FOUR_BYTES = 0xFFFFFFF
_FIVE_BYTES = 0x7FFFFFFFF


def vector_field(tag: bytes, values: Vector | None) -> bytes:
    """Return the field ``tag`` that holds ``values`` in a submessage; nothing for None."""
    if values is None:
        return b""
    if len(values) == 7:
        a, b, c, d, e, f, g = values
        return _SEVEN(tag, _SEVEN_BYTES, _VALUE, a, _VALUE, b, _VALUE, c, _VALUE, d, _VALUE, e, _VALUE, f, _VALUE, g)
    if len(values) == 6:
        a, b, c, d, e, f = values
        return _SIX(tag, _SIX_BYTES, _VALUE, a, _VALUE, b, _VALUE, c, _VALUE, d, _VALUE, e, _VALUE, f)
    body = _packing(len(values)).pack(*(part for value in values for part in (_VALUE, value)))
    return tag + varint(len(body)) + body


def pose_field(tag: bytes, name: str, values: Vector) -> bytes | None:
    """Return the field ``tag`` that holds an unstamped Transformation of seven numbers; None for another count."""
    if len(values) != 7:
        return None
    a, b, c, d, e, f, g = values
    t = _POSE_VALUE
    text = name.encode()
    body = b"".join((b"\x0a", varint(len(text)), text, _SEVEN_OF_POSE(t, a, t, b, t, c, t, d, t, e, t, f, t, g)))
    return b"".join((tag, varint(len(body)), body))


def varint(number: int) -> bytes:
    """Return a non-negative number as a base-128 varint."""
    if number <= LAST_ONE_BYTE:
        return ONE_BYTE[number]
    if number <= _TWO_BYTES:
        return bytes((number & 0x7F | 0x80, number >> 7))
    low, middle = number & 0x7F | 0x80, number >> 7 & 0x7F | 0x80
    if number <= _THREE_BYTES:
        return bytes((low, middle, number >> 14))
    high = number >> 14 & 0x7F | 0x80
    if number <= _FOUR_BYTES:
        return bytes((low, middle, high, number >> 21))
    higher = number >> 21 & 0x7F | 0x80
    if number <= _FIVE_BYTES:
        return bytes((low, middle, high, higher, number >> 28))
    return bytes((low, middle, high, higher)) + varint(number >> 28)


@cache
def _packing(count: int) -> Struct:
    return Struct("<" + "cd" * count)
