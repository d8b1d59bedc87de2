"""Runs of protobuf fields that always have the same size, written and read without protobuf objects.

The packets of nearly every cycle are such runs: their numbers are fixed64, doubles, or enumerations of one byte, and
their vectors have seven numbers. Known bytes (tags and lengths of fields) stand between the numbers. A run says every
field, also one that is zero, which protobuf itself would leave out: any reader takes both.
"""

from struct import Struct
from typing import Any, Final

from hil.values.servo import MAX_SERVO_DATAGRAM_BYTES
from transport.fri.vectors import varint

TAG_AND_LENGTH_BYTES: Final = 3
"""Of a field of up to 16 383 bytes, at most."""
_LENGTHS: Final = tuple(varint(length) for length in range(MAX_SERVO_DATAGRAM_BYTES))


class Layout:
    """``parts`` in their order: known bytes, or the struct format of numbers (``"Q"``, ``"7d"``), little-endian."""

    def __init__(self, *parts: bytes | str) -> None:
        self._numbers = Struct("<" + "".join(part if isinstance(part, str) else f"{len(part)}x" for part in parts))
        self.size = self._numbers.size
        known = b"".join(part if isinstance(part, bytes) else bytes(_size(part)) for part in parts)
        mask = b"".join(b"\xff" * len(part) if isinstance(part, bytes) else bytes(_size(part)) for part in parts)
        self._known = int.from_bytes(known, "little")
        self._mask = int.from_bytes(mask, "little")
        self.pack = Struct("<" + "".join(part if isinstance(part, str) else f"{len(part)}s" for part in parts)).pack
        """Return the bytes of all parts. The caller says the known ones too: putting them in costs as much again."""

    def unpack(self, packet: bytes, at: int = 0) -> tuple[Any, ...] | None:
        """Return the numbers of the run that begins at ``at``; None where the known bytes are others."""
        run = packet[at : at + self.size]
        if len(run) != self.size or int.from_bytes(run, "little") & self._mask != self._known:
            return None
        return self._numbers.unpack(run)


def field(tag: bytes, body: bytes) -> bytes:
    """Return the field ``tag`` that holds ``body``: a message, a text, or packed numbers."""
    length = len(body)
    return b"".join((tag, _LENGTHS[length] if length < len(_LENGTHS) else varint(length), body))


def _size(part: str) -> int:
    return Struct("<" + part).size
