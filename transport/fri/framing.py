"""Framing of an FRI message in a datagram: bare, or (2.7) length prefix and CRC-32 around it. Source: fri-wire page."""

import struct
import zlib

_WORD = struct.Struct("<I")
FRAME_BYTES = 2 * _WORD.size


def frame(body: bytes) -> bytes:
    """Return ``body`` between its little-endian length and its little-endian CRC-32."""
    return b"".join((_WORD.pack(len(body)), body, _WORD.pack(zlib.crc32(body))))


def unframe(datagram: bytes) -> tuple[bytes, None] | tuple[None, str]:
    """Return ``(body, None)``, or ``(None, reason)`` for a datagram that is no intact frame."""
    if len(datagram) < FRAME_BYTES:
        return None, f"{len(datagram)} bytes cannot hold the {FRAME_BYTES} bytes of length and CRC"
    (length,) = _WORD.unpack_from(datagram)
    if length + FRAME_BYTES != len(datagram):
        return None, f"the length prefix says {length} bytes, the datagram has {len(datagram) - FRAME_BYTES}"
    body = datagram[_WORD.size : _WORD.size + length]
    (crc,) = _WORD.unpack_from(datagram, _WORD.size + length)
    if zlib.crc32(body) != crc:
        return None, f"the CRC is 0x{crc:08x}, the message has 0x{zlib.crc32(body):08x}"
    return body, None
