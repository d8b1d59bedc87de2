"""What a capture's sections and interfaces say of its packets, and the frames that were recorded.

Whatever is looked for in frames, datagrams or TCP segments, begins here.
"""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from hil.values.tuples import new_tuple
from transport.capture import blocks, options
from transport.capture.blocks import (
    CLASSIC_NANOSECONDS,
    CLASSIC_PACKET,
    CLASSIC_PACKET_BYTES,
    INTERFACE,
    OLD_PACKET,
    PACKET,
    SECTION_HEADER,
    SIMPLE_PACKET,
    STATISTICS,
    Block,
)
from transport.capture.errors import CaptureError
from transport.capture.frames import LINK_ETHERNET

PACKET_KINDS: Final = frozenset({PACKET, OLD_PACKET, SIMPLE_PACKET, CLASSIC_PACKET})
"""Blocks that Wireshark counts as packets."""
_NS_PER_S: Final = 1_000_000_000
_DEFAULT_TICKS_PER_S: Final = 1_000_000
"""What an interface without ``if_tsresol`` counts."""
_PACKET_START: Final = 28
"""Where the frame begins in an enhanced or obsolete packet block."""
_BLOCK_END_BYTES: Final = 4
_TIME_OFFSET_BYTES: Final = 8
_MAX_UNIX_NS: Final = (1 << 64) - 1
"""July 2554: what our own files can hold; a later time stamp is a damaged one, or of a damaged interface."""
_VERSION_MAJOR: Final = 1
_OPTIONS_AT: Final = {SECTION_HEADER: 24, INTERFACE: 16, STATISTICS: 20}


class RecordedFrame(NamedTuple):
    """One frame as it was recorded, and where it is in the file."""

    number: int
    """Of the packet in the file, from 1, as Wireshark counts."""
    offset: int
    """Where its block begins in the file [bytes]."""
    at_unix_ns: int
    recorded_crc32: int | None
    """CRC-32 of the frame as the recorder noted it; None where it noted none."""
    link_type: int
    data: bytes
    """What was recorded of it."""
    full_bytes: int
    """How long it was; the recorder may have cut it."""
    notes: bytes
    """What our recorder noted before it."""


class _Interface(NamedTuple):
    """How the packets of one interface are to be read."""

    link_type: int
    ticks_per_s: int
    offset_s: int
    in_unix_ns: bool
    """Whether its ticks are nanoseconds since 1970."""

    def unix_ns(self, ticks: int) -> int:
        return self.offset_s * _NS_PER_S + ticks * _NS_PER_S // self.ticks_per_s


def open_capture(path: Path) -> BinaryIO:
    """Open the file; raises ``CaptureError`` where the system refuses."""
    try:
        return path.open("rb")
    except OSError as error:
        raise CaptureError(path, f"cannot be read: {error.strerror or error}") from error


def check_version(block: Block, path: Path) -> None:
    """Raise ``CaptureError`` where a section header is of a version that cannot be read."""
    try:
        major, minor = struct.unpack_from(f"{block.byte_order}HH", block.data, 12)
    except struct.error as error:
        reason = "the block is damaged: a section header without version"
        raise CaptureError(path, reason, offset=block.offset) from error
    if major != _VERSION_MAJOR:
        raise CaptureError(path, f"pcapng version {major}.{minor}; valid: 1.x", offset=block.offset)


def block_options(block: Block, path: Path, at: int | None = None) -> Iterator[tuple[int, bytes]]:
    """Code and content of each option of a block; raises ``CaptureError`` where they do not hold together."""
    start = _OPTIONS_AT[block.kind] if at is None else at
    try:
        yield from options.read_options(block.data[start:-_BLOCK_END_BYTES], block.byte_order)
    except ValueError as error:
        raise CaptureError(path, f"the block is damaged: {error}", offset=block.offset) from error


def _interface(block: Block, path: Path) -> _Interface:
    if len(block.data) < _OPTIONS_AT[INTERFACE] + _BLOCK_END_BYTES:
        raise CaptureError(path, "the block is damaged: it is too short for an interface", offset=block.offset)
    (link_type,) = struct.unpack_from(f"{block.byte_order}H", block.data, 8)
    ticks_per_s = _DEFAULT_TICKS_PER_S
    offset_s = 0
    for code, content in block_options(block, path):
        if code == options.TIME_RESOLUTION and content:
            base = 2 if content[0] & 0x80 else 10
            ticks_per_s = base ** (content[0] & 0x7F)
        elif code == options.TIME_OFFSET:
            if len(content) != _TIME_OFFSET_BYTES:
                reason = f"the block is damaged: an offset of time of {len(content)} bytes, not {_TIME_OFFSET_BYTES}"
                raise CaptureError(path, reason, offset=block.offset)
            offset_s = int.from_bytes(content, "little" if block.byte_order == "<" else "big", signed=True)
    return _Interface(link_type, ticks_per_s, offset_s, ticks_per_s == _NS_PER_S and not offset_s)


def _classic_interface(block: Block) -> _Interface:
    (link_type,) = struct.unpack_from(f"{block.byte_order}I", block.data, 20)
    nanoseconds = block.data[:4] in CLASSIC_NANOSECONDS
    # The upper bits tell of a check sequence at the end of frames, which no datagram contains.
    return _Interface(link_type & 0xFFFF, _NS_PER_S if nanoseconds else _DEFAULT_TICKS_PER_S, 0, nanoseconds)


_PACKET_HEADS: Final = {
    (PACKET, "<"): struct.Struct("<8xIIIII"),
    (PACKET, ">"): struct.Struct(">8xIIIII"),
    (OLD_PACKET, "<"): struct.Struct("<8xHxxIIII"),
    (OLD_PACKET, ">"): struct.Struct(">8xHxxIIII"),
}


class Section:
    """What was described so far of where packets come from."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._interfaces: list[_Interface] = []
        self.is_usual = False
        """Whether its packets may be such as our writer lays out."""

    def describe(self, block: Block) -> None:
        """Take a block that holds no packet."""
        match block.kind:
            case blocks.SECTION_HEADER:
                check_version(block, self._path)
                self._interfaces = []  # a section counts its interfaces anew
            case blocks.INTERFACE:
                self._interfaces.append(_interface(block, self._path))
            case blocks.CLASSIC_FILE:
                self._interfaces.append(_classic_interface(block))
        if self._interfaces and block.kind == INTERFACE:
            first = self._interfaces[0]
            self.is_usual = block.byte_order == "<" and first.link_type == LINK_ETHERNET and first.in_unix_ns
        else:
            self.is_usual = False

    def frame(self, block: Block, number: int) -> RecordedFrame | None:
        """Return the frame in the block of packet ``number``; None where there is no time stamp."""
        kind = block.kind
        if kind in {PACKET, OLD_PACKET}:
            return self._enhanced(block, number)
        if kind == CLASSIC_PACKET:
            return self._classic(block, number)
        return None

    def _classic(self, block: Block, number: int) -> RecordedFrame:
        seconds, fraction, _, full = struct.unpack_from(f"{block.byte_order}IIII", block.data)
        interface = self._interfaces[0]
        at_unix_ns = interface.unix_ns(seconds * interface.ticks_per_s + fraction)
        frame = block.data[CLASSIC_PACKET_BYTES:]
        return RecordedFrame(number, block.offset, at_unix_ns, None, interface.link_type, frame, full, b"")

    def _enhanced(self, block: Block, number: int) -> RecordedFrame:
        data = block.data
        room = len(data) - _PACKET_START - _BLOCK_END_BYTES
        if room < 0:
            raise self._damaged(block, number, "the block is damaged: it is too short for a packet")
        head = _PACKET_HEADS[block.kind, block.byte_order]
        interface_id, high, low, captured, full = head.unpack_from(data)
        if interface_id >= len(self._interfaces):
            raise self._damaged(block, number, f"interface {interface_id} is not described before it")
        if captured > room:
            raise self._damaged(block, number, f"the block is damaged: {captured} bytes of packet do not fit into it")
        crc32: int | None = None
        notes = b""
        options_at = _PACKET_START + captured + -captured % 4
        if options_at + _BLOCK_END_BYTES < len(data) and block.kind == PACKET:
            for code, content in block_options(block, self._path, options_at):
                if code == options.HASH:
                    crc32 = options.crc32_of(content)
                elif code == options.CUSTOM_NOT_COPIED:
                    notes += options.notes_of(content) or b""
        interface = self._interfaces[interface_id]
        at_unix_ns = interface.unix_ns(high << 32 | low)
        if not 0 <= at_unix_ns <= _MAX_UNIX_NS:
            reason = f"its time stamp is {at_unix_ns} ns; valid: 0 to {_MAX_UNIX_NS} since 1970"
            raise self._damaged(block, number, reason)
        frame = data[_PACKET_START : _PACKET_START + captured]
        found: RecordedFrame = new_tuple(
            RecordedFrame, (number, block.offset, at_unix_ns, crc32, interface.link_type, frame, full, notes)
        )
        return found

    def _damaged(self, block: Block, number: int, reason: str) -> CaptureError:
        return CaptureError(self._path, reason, offset=block.offset, packet=number)
