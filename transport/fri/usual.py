"""The command of nearly every cycle, read without protobuf objects: a header alone, or a header and seven positions.

Anything else is None and goes the ordinary way. ``hil bench cycle``: 5.4 us to decode before, 4.2 us since. A test
holds both ways equal on recorded and on broken bytes.
"""

from struct import Struct

from hil.values.fri_messages import CommandData, CommandMessage

_SEVEN = Struct("<" + "cd" * 7).unpack_from
_TAGS = (b"\x09",) * 7
_POSITION_ALONE = b"\x12\x41\x0a\x3f"
"""CommandData of 65 bytes that holds JointValues of 63 bytes and nothing else."""
_POSITION_BYTES = 67
_ONE_BYTE = 0x7F


def usual_command(body: bytes) -> CommandMessage | None:
    """Return the command in ``body``, or None when its shape is not one of the two usual ones."""
    size = len(body)
    if size < 2 or body[0] != 0x0A or body[1] > _ONE_BYTE:
        return None
    end = 2 + body[1]
    numbers = _header(body, end) if end <= size else None
    if numbers is None:
        return None
    if size == end:
        return CommandMessage(numbers[1], numbers[2], None, None, numbers[0])
    if size != end + _POSITION_BYTES or body[end : end + 4] != _POSITION_ALONE:
        return None
    values = _SEVEN(body, end + 4)
    if values[::2] != _TAGS:
        return None
    return CommandMessage(numbers[1], numbers[2], CommandData(values[1::2]), None, numbers[0])


def _header(body: bytes, end: int) -> list[int] | None:
    """Return identifier and both counters when the header holds them in order and nothing else."""
    at = 2
    numbers: list[int] = []
    for tag in b"\x08\x10\x18":
        if at >= end or body[at] != tag:
            return None
        number = shift = 0
        while True:
            at += 1
            if at >= end or shift > 28:
                return None
            byte = body[at]
            number |= (byte & 0x7F) << shift
            if byte < 0x80:
                break
            shift += 7
        numbers.append(number)
        at += 1
    return numbers if at == end and max(numbers) <= 0xFFFFFFFF else None
