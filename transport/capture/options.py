"""Options of pcapng blocks, and the two of ours: a packet's CRC-32, and what the recorder noted before it.

The notes are custom options, which programs that copy packets are told not to copy. Their enterprise number is the one
for documentation (RFC 5612), because this project has none; eight bytes behind it say whose they are.
"""

import struct
from collections.abc import Iterator
from typing import Final

END: Final = 0
COMMENT: Final = 1
APPLICATION: Final = 4
TIME_RESOLUTION: Final = 9
TIME_OFFSET: Final = 14
HASH: Final = 3
CUSTOM_NOT_COPIED: Final = 19373
_DOCUMENTATION_ENTERPRISE: Final = 32473
_NOTES_MARK: Final = struct.pack("<I8s", _DOCUMENTATION_ENTERPRISE, b"fri-hil\x01")
_CRC32: Final = b"\x02"
_HEAD: Final = struct.Struct("<HH")
_HEADS: Final = {order: struct.Struct(f"{order}HH") for order in "<>"}
OWN_HASH: Final = _HEAD.pack(HASH, 5) + _CRC32
"""How the option with a packet's CRC-32 begins."""
MAX_NOTES_BYTES: Final = 65_535 - len(_NOTES_MARK)


def option(code: int, data: bytes) -> bytes:
    """Return a little-endian option, filled up to four bytes."""
    return _HEAD.pack(code, len(data)) + data + bytes(-len(data) % 4)


def packet_options(crc32: int, notes: bytes) -> bytes:
    """Return the options of a packet: CRC-32 of its frame, and the recorder's notes where there are some."""
    hashed = option(HASH, _CRC32 + crc32.to_bytes(4, "big"))
    return hashed + (notes_option(notes) if notes else b"") + option(END, b"")


def notes_option(notes: bytes) -> bytes:
    """Return the option of the recorder's notes, at most :data:`MAX_NOTES_BYTES`."""
    return option(CUSTOM_NOT_COPIED, _NOTES_MARK + notes)


def own_notes(block: bytes, at: int, *, end: int) -> bytes | None:
    """Return the notes in a block's option, as :func:`notes_option` lays it out from ``at`` to ``end``, or None."""
    start = at + _HEAD.size
    if not block.startswith(_NOTES_MARK, start):
        return None
    code, size = _HEAD.unpack_from(block, at)
    if code != CUSTOM_NOT_COPIED or start + size + -size % 4 != end:
        return None
    return block[start + len(_NOTES_MARK) : start + size]


def read_options(data: bytes, byte_order: str) -> Iterator[tuple[int, bytes]]:
    """Yield code and content of each option; raise ``ValueError`` where they do not hold together."""
    head = _HEADS[byte_order]
    at = 0
    while at + head.size <= len(data):
        code, size = head.unpack_from(data, at)
        at += head.size
        if code == END:
            return
        if at + size > len(data):
            raise ValueError(f"option {code} of {size} bytes goes beyond its block")
        yield code, data[at : at + size]
        at += size + -size % 4


def notes_of(content: bytes) -> bytes | None:
    """Return the recorder's notes in a custom option; None for somebody else's."""
    return content[len(_NOTES_MARK) :] if content.startswith(_NOTES_MARK) else None


def crc32_of(content: bytes) -> int | None:
    """Return the CRC-32 in a hash option; None for another algorithm."""
    return int.from_bytes(content[1:5], "big") if content[:1] == _CRC32 and len(content) == 5 else None
