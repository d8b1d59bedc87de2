"""A capture file cut into its blocks: pcapng, and the classic pcap that tcpdump writes.

dpkt's own readers are not used: they make floats of the time stamps, take a truncated file for a complete one, and
know one section with one interface.
"""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from transport.capture.errors import CaptureError

SECTION_HEADER: Final = 0x0A0D0D0A
INTERFACE: Final = 1
OLD_PACKET: Final = 2
SIMPLE_PACKET: Final = 3
STATISTICS: Final = 5
PACKET: Final = 6
CLASSIC_FILE: Final = -1
CLASSIC_PACKET: Final = -2
"""Ours: what classic pcap has instead of blocks."""

_HEAD_BYTES = 12
"""Type, length and, in a section header, the mark of the byte order; no block is shorter."""
_MAX_BLOCK_BYTES = 1 << 24
"""What Wireshark accepts; a longer one is a damaged length."""
_PIECE_BYTES = 1 << 18
_HEADS = {order: struct.Struct(f"{order}II") for order in "<>"}
_TAILS = {order: struct.Struct(f"{order}I") for order in "<>"}
_SECTION_MAGIC = SECTION_HEADER.to_bytes(4, "big")  # reads the same in either byte order
_BYTE_ORDERS = {b"\x4d\x3c\x2b\x1a": "<", b"\x1a\x2b\x3c\x4d": ">"}
_CLASSIC_PCAP = {b"\xd4\xc3\xb2\xa1": "<", b"\xa1\xb2\xc3\xd4": ">", b"\x4d\x3c\xb2\xa1": "<", b"\xa1\xb2\x3c\x4d": ">"}
CLASSIC_NANOSECONDS: Final = (b"\x4d\x3c\xb2\xa1", b"\xa1\xb2\x3c\x4d")
CLASSIC_FILE_BYTES: Final = 24
CLASSIC_PACKET_BYTES: Final = 16


class Block(NamedTuple):
    """One block, not yet looked into."""

    offset: int
    """Where it begins in the file [bytes]."""
    kind: int
    """Block type, e.g. ``PACKET``."""
    byte_order: str
    """That of its section, as ``struct`` names it."""
    data: bytes
    """The whole block, head and closing length included."""


def read_blocks(file: BinaryIO, path: Path) -> Iterator[Block]:
    """The blocks of ``file`` in order; raises ``CaptureError`` where it is no capture or ends inside a block."""
    start = file.read(_HEAD_BYTES)
    if not start:
        raise CaptureError(path, "the file is empty", offset=0)
    if start[:4] in _CLASSIC_PCAP:
        yield from _classic_blocks(file, path, start)
        return
    if start[:4] != _SECTION_MAGIC:
        raise CaptureError(
            path,
            f"not a pcapng file: it begins with {start[:4].hex(' ')}, not with 0a 0d 0d 0a, nor with the number of a "
            f"classic pcap file",
            offset=0,
        )
    yield from _pcapng_blocks(file, path, start)


def _pcapng_blocks(file: BinaryIO, path: Path, buffer: bytes) -> Iterator[Block]:
    """Cut pieces of the file, each read at once, into blocks; ``buffer`` holds what was read already."""
    at = before = 0
    """Where the next block begins in the buffer, and the buffer in the file."""
    byte_order = "<"
    heads, tail = _HEADS[byte_order], _TAILS[byte_order]
    while True:
        if at + _HEAD_BYTES > len(buffer):
            before, buffer, at = before + at, buffer[at:] + file.read(_PIECE_BYTES), 0
            if not buffer:
                return
            if len(buffer) < _HEAD_BYTES:
                raise CaptureError(path, f"truncated: {len(buffer)} bytes of a block's head are there", offset=before)
        if buffer.startswith(_SECTION_MAGIC, at):
            byte_order = _byte_order(buffer[at + 8 : at + 12], path, before + at)
            heads, tail = _HEADS[byte_order], _TAILS[byte_order]
        kind, size = heads.unpack_from(buffer, at)
        if not _HEAD_BYTES <= size <= _MAX_BLOCK_BYTES or size % 4:
            reason = f"the block is damaged: its length cannot be {size} bytes"
            raise CaptureError(path, reason, offset=before + at)
        end = at + size
        if end > len(buffer):
            before, buffer, at, end = before + at, buffer[at:] + file.read(_PIECE_BYTES + size), 0, size
            if len(buffer) < size:
                reason = f"truncated: {len(buffer)} of a block's {size} bytes are there"
                raise CaptureError(path, reason, offset=before)
        if tail.unpack_from(buffer, end - 4)[0] != size:
            raise CaptureError(path, "the block is damaged: length fields do not match", offset=before + at)
        yield Block(before + at, kind, byte_order, buffer[at:end])
        at = end


def _classic_blocks(file: BinaryIO, path: Path, start: bytes) -> Iterator[Block]:
    byte_order = _CLASSIC_PCAP[start[:4]]
    header = start + file.read(CLASSIC_FILE_BYTES - len(start))
    if len(header) < CLASSIC_FILE_BYTES:
        raise CaptureError(path, f"truncated: {len(header)} of the header's {CLASSIC_FILE_BYTES} bytes", offset=0)
    yield Block(0, CLASSIC_FILE, byte_order, header)
    offset = CLASSIC_FILE_BYTES
    sizes = struct.Struct(f"{byte_order}8xI")
    while head := file.read(CLASSIC_PACKET_BYTES):
        if len(head) < CLASSIC_PACKET_BYTES:
            raise CaptureError(path, f"truncated: {len(head)} bytes of a packet's head are there", offset=offset)
        (size,) = sizes.unpack_from(head)
        if size > _MAX_BLOCK_BYTES:
            raise CaptureError(path, f"the packet is damaged: its length cannot be {size} bytes", offset=offset)
        data = head + file.read(size)
        if len(data) < CLASSIC_PACKET_BYTES + size:
            there = len(data) - CLASSIC_PACKET_BYTES
            raise CaptureError(path, f"truncated: {there} of a packet's {size} bytes are there", offset=offset)
        yield Block(offset, CLASSIC_PACKET, byte_order, data)
        offset += len(data)


def _byte_order(mark: bytes, path: Path, offset: int) -> str:
    try:
        return _BYTE_ORDERS[mark]
    except KeyError:
        raise CaptureError(path, f"{mark.hex(' ')} is no pcapng byte order mark", offset=offset) from None
