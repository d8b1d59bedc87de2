"""A pcapng file cut into its blocks; dpkt reads what is inside one.

dpkt's own ``Reader`` is not used: it makes floats of the time stamps, takes a truncated file for a complete one, and
knows one section with one interface.
"""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from dpkt import pcapng
from dpkt.dpkt import Error as DpktError

from transport.capture.errors import CaptureError

SECTION_HEADER: int = pcapng.PCAPNG_BT_SHB
INTERFACE: int = pcapng.PCAPNG_BT_IDB
PACKET: int = pcapng.PCAPNG_BT_EPB
OLD_PACKET: int = pcapng.PCAPNG_BT_PB
SIMPLE_PACKET: int = pcapng.PCAPNG_BT_SPB

_HEAD_BYTES = 12
"""Type, length and, in a section header, the mark of the byte order; no block is shorter."""
_MAX_BLOCK_BYTES = 1 << 24
"""What Wireshark accepts; a longer one is a damaged length."""
_BYTE_ORDERS = {b"\x4d\x3c\x2b\x1a": "<", b"\x1a\x2b\x3c\x4d": ">"}
_CLASSIC_PCAP = {b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\xa1\xb2\x3c\x4d"}

_PARSERS: dict[tuple[int, str], Callable[[bytes], Any]] = {
    (SECTION_HEADER, "<"): pcapng.SectionHeaderBlockLE,
    (SECTION_HEADER, ">"): pcapng.SectionHeaderBlock,
    (INTERFACE, "<"): pcapng.InterfaceDescriptionBlockLE,
    (INTERFACE, ">"): pcapng.InterfaceDescriptionBlock,
    (PACKET, "<"): pcapng.EnhancedPacketBlockLE,
    (PACKET, ">"): pcapng.EnhancedPacketBlock,
    (OLD_PACKET, "<"): pcapng.PacketBlockLE,
    (OLD_PACKET, ">"): pcapng.PacketBlock,
}


@dataclass(frozen=True, slots=True)
class Block:
    """One block, not yet looked into."""

    offset: int
    """Where it begins in the file [bytes]."""
    kind: int
    """Block type, e.g. ``PACKET``."""
    byte_order: str
    """That of its section, as ``struct`` names it."""
    data: bytes
    """The whole block, head and closing length included."""

    def parsed(self, path: Path) -> Any:
        """dpkt's object for this block; raises ``CaptureError`` where the inside does not hold together."""
        try:
            return _PARSERS[self.kind, self.byte_order](self.data)
        except (DpktError, UnicodeDecodeError, struct.error) as error:
            raise CaptureError(path, f"the block is damaged: {error}", offset=self.offset) from error


def read_blocks(file: BinaryIO, path: Path) -> Iterator[Block]:
    """The blocks of ``file`` in order; raises ``CaptureError`` where it is no pcapng file or ends inside a block."""
    offset = 0
    byte_order = ""
    while head := file.read(_HEAD_BYTES):
        if offset == 0:
            _check_magic(head, path)
        if len(head) < _HEAD_BYTES:
            raise CaptureError(path, f"truncated: {len(head)} bytes of a block's head are there", offset=offset)
        if head[:4] == SECTION_HEADER.to_bytes(4, "big"):  # reads the same in either byte order
            byte_order = _byte_order(head[8:], path, offset)
        kind, size = struct.unpack_from(f"{byte_order}II", head)
        if not _HEAD_BYTES <= size <= _MAX_BLOCK_BYTES or size % 4:
            raise CaptureError(path, f"the block is damaged: its length cannot be {size} bytes", offset=offset)
        data = head + file.read(size - _HEAD_BYTES)
        if len(data) < size:
            raise CaptureError(path, f"truncated: {len(data)} of a block's {size} bytes are there", offset=offset)
        yield Block(offset, kind, byte_order, data)
        offset += size
    if offset == 0:
        raise CaptureError(path, "the file is empty", offset=0)


def _check_magic(head: bytes, path: Path) -> None:
    magic = head[:4]
    if magic in _CLASSIC_PCAP:
        raise CaptureError(path, "a classic pcap file, not pcapng; convert it: editcap -F pcapng OLD NEW", offset=0)
    if magic != SECTION_HEADER.to_bytes(4, "big"):
        raise CaptureError(path, f"not a pcapng file: it begins with {magic.hex(' ')}, not with 0a 0d 0d 0a", offset=0)


def _byte_order(mark: bytes, path: Path, offset: int) -> str:
    try:
        return _BYTE_ORDERS[mark]
    except KeyError:
        raise CaptureError(path, f"{mark.hex(' ')} is no pcapng byte order mark", offset=offset) from None
