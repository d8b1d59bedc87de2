"""Reading captures: datagrams with their place in the file, and what the recorder noted between them.

pcapng (https://www.ietf.org/archive/id/draft-ietf-opsawg-pcapng-03.html) of any byte order, any number of sections and
interfaces and any resolution of time stamps; classic pcap of microseconds and nanoseconds.
"""

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from transport.capture import blocks, options
from transport.capture.blocks import (
    CLASSIC_FILE,
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
    read_blocks,
)
from transport.capture.errors import CaptureError
from transport.capture.frames import LINK_ETHERNET, FrameDecoder
from transport.capture.records import CapturedDatagram, CaptureRecord, Notes, Packet
from transport.capture.usual import UsualPackets

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
_PACKET_KINDS: Final = frozenset({PACKET, OLD_PACKET, SIMPLE_PACKET, CLASSIC_PACKET})
_OPTIONS_AT: Final = {SECTION_HEADER: 24, INTERFACE: 16, STATISTICS: 20}


class _Interface(NamedTuple):
    """How the packets of one interface are to be read."""

    link_type: int
    ticks_per_s: int
    offset_s: int
    in_unix_ns: bool
    """Whether its ticks are nanoseconds since 1970."""

    def unix_ns(self, ticks: int) -> int:
        return self.offset_s * _NS_PER_S + ticks * _NS_PER_S // self.ticks_per_s


@dataclass(slots=True)
class _Tally:
    """What the reading has met; apart from the reader, so that an abandoned reader closes its file at once."""

    skipped: int = 0


class RecordReader(Iterable[CaptureRecord]):
    """Everything of a capture in file order, once; the file is closed at the end or with the reader."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._tally = _Tally()
        self._records = _records(path, self._tally)

    def __iter__(self) -> Iterator[CaptureRecord]:
        return self._records

    @property
    def skipped(self) -> int:
        """Packets passed over so far: not UDP over IPv4, a fragment, cut by the recorder, or without time stamp."""
        return self._tally.skipped


class CaptureReader(Iterator[CapturedDatagram]):
    """The UDP datagrams over IPv4 of a capture, in file order; the file is closed at the end or with the reader."""

    def __init__(self, path: Path) -> None:
        self._records = RecordReader(path)

    def __next__(self) -> CapturedDatagram:
        for record in self._records:
            if isinstance(record, Packet):
                return record.datagram
        raise StopIteration

    @property
    def skipped(self) -> int:
        """Packets passed over so far: not UDP over IPv4, a fragment, cut by the recorder, or without time stamp."""
        return self._records.skipped


def read_capture(path: Path) -> CaptureReader:
    """Read ``path``; a file that is no capture raises ``CaptureError`` here, a damaged one where the damage is met."""
    read_section_comment(path)
    return CaptureReader(path)


def read_records(path: Path) -> RecordReader:
    """Read datagrams and notes of ``path``; errors come as those of :func:`read_capture`."""
    read_section_comment(path)
    return RecordReader(path)


def read_section_comment(path: Path) -> str | None:
    """The first comment of the first section header, ``None`` if there is none."""
    with _open(path) as file:
        block = next(read_blocks(file, path))
        if block.kind == CLASSIC_FILE:
            return None
        _check_version(block, path)
        for code, content in _options(block, path):
            if code == options.COMMENT:
                return content.decode(errors="replace")
    return None


def _records(path: Path, tally: _Tally) -> Iterator[CaptureRecord]:
    section = _Section(path)
    usual = UsualPackets()
    number = 0
    with _open(path) as file:
        for block in read_blocks(file, path):
            offset, kind, _, data = block
            if kind in _PACKET_KINDS:
                number += 1
                packet, notes = (section.is_usual and usual.read(data, offset, number)) or section.packet(block, number)
                if notes:
                    yield Notes(offset, notes)
                if packet is None:
                    tally.skipped += 1
                else:
                    yield packet
            elif kind == STATISTICS:
                for notes in _notes(block, path):
                    yield Notes(offset, notes)
            else:
                section.describe(block)


def _open(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise CaptureError(path, f"cannot be read: {error.strerror or error}") from error


def _check_version(block: Block, path: Path) -> None:
    try:
        major, minor = struct.unpack_from(f"{block.byte_order}HH", block.data, 12)
    except struct.error as error:
        reason = "the block is damaged: a section header without version"
        raise CaptureError(path, reason, offset=block.offset) from error
    if major != _VERSION_MAJOR:
        raise CaptureError(path, f"pcapng version {major}.{minor}; valid: 1.x", offset=block.offset)


def _options(block: Block, path: Path, at: int | None = None) -> Iterator[tuple[int, bytes]]:
    start = _OPTIONS_AT[block.kind] if at is None else at
    try:
        yield from options.read_options(block.data[start:-_BLOCK_END_BYTES], block.byte_order)
    except ValueError as error:
        raise CaptureError(path, f"the block is damaged: {error}", offset=block.offset) from error


def _notes(block: Block, path: Path) -> Iterator[bytes]:
    for code, content in _options(block, path):
        if code == options.CUSTOM_NOT_COPIED and (notes := options.notes_of(content)):
            yield notes


def _interface(block: Block, path: Path) -> _Interface:
    if len(block.data) < _OPTIONS_AT[INTERFACE] + _BLOCK_END_BYTES:
        raise CaptureError(path, "the block is damaged: it is too short for an interface", offset=block.offset)
    (link_type,) = struct.unpack_from(f"{block.byte_order}H", block.data, 8)
    ticks_per_s = _DEFAULT_TICKS_PER_S
    offset_s = 0
    for code, content in _options(block, path):
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


class _Section:
    """What was described so far of where packets come from."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._interfaces: list[_Interface] = []
        self._decoder = FrameDecoder()
        self.is_usual = False
        """Whether its packets may be such as our writer lays out."""

    def describe(self, block: Block) -> None:
        """Take a block that holds no packet."""
        match block.kind:
            case blocks.SECTION_HEADER:
                _check_version(block, self._path)
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

    def packet(self, block: Block, number: int) -> tuple[Packet | None, bytes]:
        """Return the datagram of a packet's block, None where it holds none, and the notes before it."""
        kind = block.kind
        if kind == PACKET:
            return self._enhanced(block, number)
        if kind == OLD_PACKET:
            return self._enhanced(block, number)
        if kind == CLASSIC_PACKET:
            return self._classic(block, number), b""
        return None, b""  # a simple packet has no time stamp

    def _classic(self, block: Block, number: int) -> Packet | None:
        seconds, fraction, captured, full = struct.unpack_from(f"{block.byte_order}IIII", block.data)
        if captured < full:
            return None
        interface = self._interfaces[0]
        at_unix_ns = interface.unix_ns(seconds * interface.ticks_per_s + fraction)
        frame = block.data[CLASSIC_PACKET_BYTES:]
        return self._located((number, block.offset, at_unix_ns, None), frame, interface.link_type)

    def _enhanced(self, block: Block, number: int) -> tuple[Packet | None, bytes]:
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
            for code, content in _options(block, self._path, options_at):
                if code == options.HASH:
                    crc32 = options.crc32_of(content)
                elif code == options.CUSTOM_NOT_COPIED:
                    notes += options.notes_of(content) or b""
        if captured < full:
            return None, notes
        interface = self._interfaces[interface_id]
        frame = data[_PACKET_START : _PACKET_START + captured]
        at_unix_ns = interface.unix_ns(high << 32 | low)
        if not 0 <= at_unix_ns <= _MAX_UNIX_NS:
            reason = f"its time stamp is {at_unix_ns} ns; valid: 0 to {_MAX_UNIX_NS} since 1970"
            raise self._damaged(block, number, reason)
        place = number, block.offset, at_unix_ns, crc32
        return self._located(place, frame, interface.link_type), notes

    def _damaged(self, block: Block, number: int, reason: str) -> CaptureError:
        return CaptureError(self._path, reason, offset=block.offset, packet=number)

    def _located(self, place: tuple[int, int, int, int | None], frame: bytes, link_type: int) -> Packet | None:
        found = self._decoder.locate(link_type, frame)
        if found is None:
            return None
        return Packet(*place, found.source, found.destination, frame[found.start : found.end], frame, found.start)
