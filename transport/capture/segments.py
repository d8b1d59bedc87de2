"""Reading the TCP segments of a capture, beside :mod:`transport.capture.reading`, which reads its datagrams."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from transport.capture.blocks import PACKET, STATISTICS, read_blocks
from transport.capture.reading import read_section_comment
from transport.capture.sections import PACKET_KINDS, Section, open_capture
from transport.capture.tcp import Segment, SegmentDecoder

_STEP: Final = 4096
"""Packets between two reports of progress."""
_INTERFACE_0: Final = bytes(4)
_INTERFACE: Final = slice(8, 12)
_VERSION: Final = slice(40, 43)
"""Of an enhanced packet's block with Ethernet and IPv4: type of Ethernet, version and length of the IP header."""
_PLAIN_IPV4: Final = b"\x08\x00\x45"
_PROTOCOL: Final = slice(51, 52)
_UDP: Final = b"\x11"


@dataclass(slots=True)
class _Tally:
    """What the reading has met; apart from the reader, so that an abandoned reader closes its file at once."""

    packets: int = 0
    decoder: SegmentDecoder = field(default_factory=SegmentDecoder)


class SegmentReader(Iterable[Segment]):
    """The TCP segments over IPv4 of a capture, in file order, once; the file is closed at the end or with the reader.

    ``progress`` is told how many bytes of the file are behind it.
    """

    def __init__(self, path: Path, *, progress: Callable[[int], None] | None = None) -> None:
        self.path = path
        self._tally = _Tally()
        self._segments = _segments(path, self._tally, progress)

    def __iter__(self) -> Iterator[Segment]:
        return self._segments

    @property
    def packets(self) -> int:
        """Packets of the file so far, of whatever protocol."""
        return self._tally.packets

    @property
    def skipped(self) -> int:
        """TCP segments so far that cannot be read: fragments, and frames cut within the headers."""
        return self._tally.decoder.skipped


def read_segments(path: Path, *, progress: Callable[[int], None] | None = None) -> SegmentReader:
    """Read ``path``; a file that is no capture raises ``CaptureError`` here, a damaged one where the damage is met."""
    read_section_comment(path)
    return SegmentReader(path, progress=progress)


def _segments(path: Path, tally: _Tally, progress: Callable[[int], None] | None) -> Iterator[Segment]:
    section = Section(path)
    decode = tally.decoder.decode
    with open_capture(path) as file:
        for block in read_blocks(file, path):
            kind, data = block.kind, block.data
            if kind in PACKET_KINDS:
                tally.packets += 1
                if progress is not None and tally.packets % _STEP == 0:
                    progress(block.offset)
                # Captures of ours hold nothing but such datagrams; a tenth of the time of looking closer.
                if (
                    section.is_usual
                    and data[_PROTOCOL] == _UDP
                    and data[_VERSION] == _PLAIN_IPV4
                    and data[_INTERFACE] == _INTERFACE_0
                    and kind == PACKET
                ):
                    continue
                recorded = section.frame(block, tally.packets)
                if recorded is None:
                    continue
                number, _, at_unix_ns, _, link_type, frame, full_bytes, _ = recorded
                segment = decode(number, at_unix_ns, link_type, frame, full_bytes)
                if segment is not None:
                    yield segment
            elif kind != STATISTICS:
                section.describe(block)
