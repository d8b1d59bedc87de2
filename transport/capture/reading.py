"""Reading captures: datagrams with their place in the file, and what the recorder noted between them.

pcapng (https://www.ietf.org/archive/id/draft-ietf-opsawg-pcapng-03.html) of any byte order, any number of sections and
interfaces and any resolution of time stamps; classic pcap of microseconds and nanoseconds.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from transport.capture import options
from transport.capture.blocks import CLASSIC_FILE, STATISTICS, Block, read_blocks
from transport.capture.frames import FrameDecoder
from transport.capture.records import CapturedDatagram, CaptureRecord, Notes, Packet
from transport.capture.sections import (
    PACKET_KINDS,
    RecordedFrame,
    Section,
    block_options,
    check_version,
    open_capture,
)
from transport.capture.usual import UsualPackets


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
    with open_capture(path) as file:
        block = next(read_blocks(file, path))
        if block.kind == CLASSIC_FILE:
            return None
        check_version(block, path)
        for code, content in block_options(block, path):
            if code == options.COMMENT:
                return content.decode(errors="replace")
    return None


def _records(path: Path, tally: _Tally) -> Iterator[CaptureRecord]:
    section = Section(path)
    usual = UsualPackets()
    decoder = FrameDecoder()
    number = 0
    with open_capture(path) as file:
        for block in read_blocks(file, path):
            offset, kind, _, data = block
            if kind in PACKET_KINDS:
                number += 1
                if section.is_usual and (read := usual.read(data, offset, number)):
                    packet, notes = read
                    if notes:
                        yield Notes(offset, notes)
                    yield packet
                    continue
                frame = section.frame(block, number)
                if frame is not None and frame.notes:
                    yield Notes(offset, frame.notes)
                found = _datagram(frame, decoder)
                if found is None:
                    tally.skipped += 1
                else:
                    yield found
            elif kind == STATISTICS:
                for notes in _notes(block, path):
                    yield Notes(offset, notes)
            else:
                section.describe(block)


def _notes(block: Block, path: Path) -> Iterator[bytes]:
    for code, content in block_options(block, path):
        if code == options.CUSTOM_NOT_COPIED and (notes := options.notes_of(content)):
            yield notes


def _datagram(recorded: RecordedFrame | None, decoder: FrameDecoder) -> Packet | None:
    if recorded is None:
        return None
    number, offset, at_unix_ns, crc32, link_type, frame, full_bytes, _ = recorded
    if len(frame) < full_bytes:
        return None
    found = decoder.locate(link_type, frame)
    if found is None:
        return None
    payload = frame[found.start : found.end]
    return Packet(number, offset, at_unix_ns, crc32, found.source, found.destination, payload, frame, found.start)
