"""What was changed in a datagram that is not what the recorder wrote."""

import zlib
from collections.abc import Callable
from typing import Final

from hil.replay.fields import differences
from hil.values.errors import MalformedDatagram
from transport.capture.records import Packet

_MOST_BYTES: Final = 2000
"""Longer frames are not searched for the bit."""


def alteration(packet: Packet, decode: Callable[[bytes], object]) -> str:
    """Return in words what was changed in a datagram: which bit and which field, where one bit explains it."""
    recorded = packet.recorded_crc32
    bit = None if recorded is None else _flipped_bit(packet.frame, recorded)
    if bit is None:
        return "more than one bit of it was changed after it was recorded"
    at = bit // 8 - packet.payload_at
    if not 0 <= at < len(packet.payload):
        return f"bit {bit % 8} of byte {bit // 8} of its headers was changed after it was recorded"
    before = bytearray(packet.payload)
    before[at] ^= 1 << (bit % 8)
    where = f"bit {bit % 8} of byte {at} of its payload was changed after it was recorded"
    return where + _fields(bytes(before), packet.payload, decode)


def _fields(before: bytes, now: bytes, decode: Callable[[bytes], object]) -> str:
    try:
        was = decode(before)
    except MalformedDatagram:
        return ""
    try:
        found = list(differences(was, decode(now)))
    except MalformedDatagram as error:
        return f", so that it is no message any more: {error}"
    if not found:
        return ""
    change = found[0].change
    told = f"{found[0].name} was {found[0].recorded!r} and is {found[0].emulated!r}"
    return f": {told}" + (f" ({change:+g} {found[0].unit})".replace(" )", ")") if change is not None else "")


def _flipped_bit(frame: bytes, recorded: int) -> int | None:
    """Return the one bit that makes ``frame`` have the recorded CRC-32; None where there is none."""
    if len(frame) > _MOST_BYTES:
        return None
    changed = bytearray(frame)
    for at in range(len(frame)):
        for bit in range(8):
            changed[at] ^= 1 << bit
            found = zlib.crc32(changed) == recorded
            changed[at] ^= 1 << bit
            if found:
                return at * 8 + bit
    return None
