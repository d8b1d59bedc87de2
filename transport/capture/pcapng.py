"""The file format of captures: pcapng, readable by Wireshark, with time stamps to the nanosecond.

https://www.ietf.org/archive/id/draft-ietf-opsawg-pcapng-03.html
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

from dpkt import pcapng

from hil.values.errors import UsageError
from transport.capture.blocks import INTERFACE, OLD_PACKET, PACKET, SECTION_HEADER, SIMPLE_PACKET, Block, read_blocks
from transport.capture.comment import encode_comment
from transport.capture.errors import CaptureError, cannot_create
from transport.capture.frames import LINK_ETHERNET, FrameEncoder, decode_frame
from transport.capture.records import CapturedDatagram

_APPLICATION = b"fri-hil"
_NS_PER_S = 1_000_000_000
_NANOSECONDS = b"\x09"
"""``if_tsresol``: ticks of 10^-9 s."""
_DEFAULT_TICKS_PER_S = 1_000_000
"""What an interface without ``if_tsresol`` counts."""
_SNAP_BYTES = 262_144
"""Wireshark's default: longer than any frame, so nothing is cut."""
_PACKET_HEAD_BYTES = 32
"""An enhanced or obsolete packet block without packet and options."""


class PcapngWriter:
    """Writes datagrams to ``target``: a path, which is created, or a binary file, which stays open.

    ``comment`` goes into the section header, at most 65535 bytes of UTF-8. Whatever the system refuses (no folder,
    disk full) is raised as ``CaptureError``.
    """

    def __init__(self, target: Path | BinaryIO, *, comment: str | None = None) -> None:
        self._name = target if isinstance(target, Path) else str(getattr(target, "name", "in memory"))
        head = _section_header(None if comment is None else encode_comment(self._name, comment)) + _interface()
        self._frames = FrameEncoder()
        self._owns_file = isinstance(target, Path)
        self._file = _create(target) if isinstance(target, Path) else target
        try:
            self._put(head)
        except CaptureError:
            self._discard()
            raise

    def write(self, datagram: CapturedDatagram) -> None:
        """Append ``datagram``; raises ``UsageError`` for one that UDP over IPv4 or the format cannot hold."""
        if not 0 <= datagram.at_unix_ns < 1 << 64:
            raise UsageError(f"time stamp {datagram.at_unix_ns} ns cannot be captured; valid: 0 to 2^64 - 1")
        block = pcapng.EnhancedPacketBlockLE(
            ts_high=datagram.at_unix_ns >> 32,
            ts_low=datagram.at_unix_ns & 0xFFFF_FFFF,
            pkt_data=self._frames.encode(datagram),
        )
        self._put(bytes(block))

    def close(self) -> None:
        """Complete the file; a second call does nothing."""
        try:
            if self._owns_file:
                self._file.close()
            elif not self._file.closed:
                self._file.flush()
        except OSError as error:
            raise CaptureError(self._name, f"cannot be written: {error.strerror or error}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self._discard()  # what went wrong first is what the caller must hear

    def _put(self, data: bytes) -> None:
        try:
            self._file.write(data)
        except OSError as error:
            raise CaptureError(self._name, f"cannot be written: {error.strerror or error}") from error

    def _discard(self) -> None:
        with suppress(CaptureError):
            self.close()


def _create(path: Path) -> BinaryIO:
    try:
        return path.open("wb")
    except OSError as error:
        raise cannot_create(path, error) from error


def _section_header(comment: bytes | None) -> bytes:
    options = [
        pcapng.PcapngOptionLE(code=pcapng.PCAPNG_OPT_SHB_USERAPPL, data=_APPLICATION),
        pcapng.PcapngOptionLE(code=pcapng.PCAPNG_OPT_ENDOFOPT),
    ]
    if comment is not None:
        options.insert(0, pcapng.PcapngOptionLE(code=pcapng.PCAPNG_OPT_COMMENT, data=comment))
    return bytes(pcapng.SectionHeaderBlockLE(opts=options))


def _interface() -> bytes:
    options = [
        pcapng.PcapngOptionLE(code=pcapng.PCAPNG_OPT_IF_TSRESOL, data=_NANOSECONDS),
        pcapng.PcapngOptionLE(code=pcapng.PCAPNG_OPT_ENDOFOPT),
    ]
    return bytes(pcapng.InterfaceDescriptionBlockLE(linktype=LINK_ETHERNET, snaplen=_SNAP_BYTES, opts=options))


@dataclass(slots=True)
class _Tally:
    """What the reading has met; apart from the reader, so that an abandoned reader closes its file at once."""

    packets: int = 0
    skipped: int = 0


class CaptureReader(Iterator[CapturedDatagram]):
    """The UDP datagrams over IPv4 of a capture, in file order; the file is closed at the end or with the reader."""

    def __init__(self, path: Path) -> None:
        self._tally = _Tally()
        self._datagrams = _datagrams(path, self._tally)

    def __next__(self) -> CapturedDatagram:
        return next(self._datagrams)

    @property
    def skipped(self) -> int:
        """Packets passed over so far: not UDP over IPv4, a fragment, cut by the recorder, or without time stamp."""
        return self._tally.skipped


def read_capture(path: Path) -> CaptureReader:
    """Read ``path``; a file that is no capture raises ``CaptureError`` here, a damaged one where the damage is met."""
    read_section_comment(path)
    return CaptureReader(path)


def read_section_comment(path: Path) -> str | None:
    """The first comment of the first section header, ``None`` if there is none."""
    with _open(path) as file:
        header = _section(next(read_blocks(file, path)), path)
    return next((option.text for option in header.opts if option.code == pcapng.PCAPNG_OPT_COMMENT), None)


@dataclass(frozen=True, slots=True)
class _Interface:
    """How the packets of one interface are to be read."""

    link_type: int
    ticks_per_s: int
    offset_s: int

    def unix_ns(self, ticks: int) -> int:
        return self.offset_s * _NS_PER_S + ticks * _NS_PER_S // self.ticks_per_s


def _datagrams(path: Path, tally: _Tally) -> Iterator[CapturedDatagram]:
    interfaces: list[_Interface] = []
    with _open(path) as file:
        for block in read_blocks(file, path):
            if block.kind == SECTION_HEADER:
                _section(block, path)
                interfaces = []  # a section counts its interfaces anew
            elif block.kind == INTERFACE:
                interfaces.append(_parsed_interface(block, path))
            elif block.kind in {PACKET, OLD_PACKET, SIMPLE_PACKET}:
                tally.packets += 1
                datagram = _datagram(block, interfaces, path, tally.packets)
                if datagram is None:
                    tally.skipped += 1
                else:
                    yield datagram


def _open(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise CaptureError(path, f"cannot be read: {error.strerror or error}") from error


def _section(block: Block, path: Path) -> Any:
    header = block.parsed(path)
    if header.v_major != pcapng.PCAPNG_VERSION_MAJOR:
        version = f"{header.v_major}.{header.v_minor}"
        raise CaptureError(path, f"pcapng version {version}; valid: 1.x", offset=block.offset)
    return header


def _parsed_interface(block: Block, path: Path) -> _Interface:
    description = block.parsed(path)
    options = {option.code: option.data for option in description.opts}
    ticks_per_s = _DEFAULT_TICKS_PER_S
    offset_s = 0
    if resolution := options.get(pcapng.PCAPNG_OPT_IF_TSRESOL):
        base = 2 if resolution[0] & 0x80 else 10
        ticks_per_s = base ** (resolution[0] & 0x7F)
    if offset := options.get(pcapng.PCAPNG_OPT_IF_TSOFFSET):
        offset_s = int.from_bytes(offset, "little" if block.byte_order == "<" else "big", signed=True)
    return _Interface(description.linktype, ticks_per_s, offset_s)


def _datagram(block: Block, interfaces: list[_Interface], path: Path, number: int) -> CapturedDatagram | None:
    """The datagram of a packet block, ``None`` if it holds none; ``number`` counts packets from 1."""
    if block.kind == SIMPLE_PACKET:  # has no time stamp
        return None
    packet = block.parsed(path)
    if packet.iface_id >= len(interfaces):
        reason = f"interface {packet.iface_id} is not described before it"
        raise CaptureError(path, reason, offset=block.offset, packet=number)
    if packet.caplen > len(block.data) - _PACKET_HEAD_BYTES:
        reason = f"the block is damaged: {packet.caplen} bytes of packet do not fit into it"
        raise CaptureError(path, reason, offset=block.offset, packet=number)
    if packet.caplen < packet.pkt_len:
        return None
    interface = interfaces[packet.iface_id]
    content = decode_frame(interface.link_type, packet.pkt_data)
    if content is None:
        return None
    return CapturedDatagram(interface.unix_ns(packet.ts_high << 32 | packet.ts_low), *content)
