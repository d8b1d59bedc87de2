"""Writing captures: pcapng, readable by Wireshark, with time stamps to the nanosecond.

https://www.ietf.org/archive/id/draft-ietf-opsawg-pcapng-03.html
"""

import struct
import zlib
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, Self

from hil.values.errors import UsageError
from transport.capture import options
from transport.capture.blocks import INTERFACE, PACKET, SECTION_HEADER, STATISTICS
from transport.capture.comment import encode_comment
from transport.capture.errors import CaptureError, cannot_create
from transport.capture.frames import LINK_ETHERNET, FrameEncoder
from transport.capture.records import CapturedDatagram

_APPLICATION: Final = b"fri-hil"
_BYTE_ORDER_MARK: Final = 0x1A2B3C4D
_UNKNOWN_LENGTH: Final = -1
_NANOSECONDS: Final = b"\x09"
"""``if_tsresol``: ticks of 10^-9 s."""
_SNAP_BYTES: Final = 262_144
"""Wireshark's default: longer than any frame, so nothing is cut."""
_MAX_UNIX_NS: Final = 1 << 64


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
        self._notes = bytearray()
        self._last_unix_ns = 0
        self._file = _create(target) if isinstance(target, Path) else target
        try:
            self._put(head)
        except CaptureError:
            self._discard()
            raise

    def write(self, datagram: CapturedDatagram) -> None:
        """Append ``datagram``; raises ``UsageError`` for one that UDP over IPv4 or the format cannot hold."""
        at_unix_ns = datagram.at_unix_ns
        if not 0 <= at_unix_ns < _MAX_UNIX_NS:
            raise UsageError(f"time stamp {at_unix_ns} ns cannot be captured; valid: 0 to 2^64 - 1")
        frame = self._frames.encode(datagram)
        size = len(frame)
        head = struct.pack("<IIIII", 0, at_unix_ns >> 32, at_unix_ns & 0xFFFF_FFFF, size, size)
        notes = bytes(self._notes)
        self._notes.clear()
        self._last_unix_ns = at_unix_ns
        self._put(_block(PACKET, head + frame + bytes(-size % 4) + options.packet_options(zlib.crc32(frame), notes)))

    def note(self, entries: bytes) -> None:
        """Append entries of a journal; they go with the next datagram, or into a block of their own."""
        if len(self._notes) + len(entries) > options.MAX_NOTES_BYTES:
            self.settle()
        self._notes += entries

    def settle(self) -> None:
        """Write the entries that wait for a datagram."""
        if self._notes:
            at = self._last_unix_ns
            head = struct.pack("<III", 0, at >> 32, at & 0xFFFF_FFFF)
            notes = options.notes_option(bytes(self._notes)) + options.option(options.END, b"")
            self._notes.clear()
            self._put(_block(STATISTICS, head + notes))

    def close(self) -> None:
        """Complete the file; a second call does nothing."""
        try:
            if not self._file.closed:
                self.settle()
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


def _block(kind: int, body: bytes) -> bytes:
    size = len(body) + 12
    return struct.pack("<II", kind, size) + body + struct.pack("<I", size)


def _section_header(comment: bytes | None) -> bytes:
    told = b"" if comment is None else options.option(options.COMMENT, comment)
    told += options.option(options.APPLICATION, _APPLICATION) + options.option(options.END, b"")
    return _block(SECTION_HEADER, struct.pack("<IHHq", _BYTE_ORDER_MARK, 1, 0, _UNKNOWN_LENGTH) + told)


def _interface() -> bytes:
    told = options.option(options.TIME_RESOLUTION, _NANOSECONDS) + options.option(options.END, b"")
    return _block(INTERFACE, struct.pack("<HHI", LINK_ETHERNET, 0, _SNAP_BYTES) + told)
