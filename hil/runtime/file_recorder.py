"""A recorder for virtual time: it writes at once, because nobody waits for it."""

from pathlib import Path
from types import TracebackType
from typing import Self

from hil.runtime.capture_header import CaptureHeader
from hil.values.link import Address
from transport.capture.journal import EndEntry, encode_entry
from transport.capture.records import CapturedDatagram
from transport.capture.writing import PcapngWriter


class FileRecorder:
    """Writes the recording of the run of ``header`` to ``file``; a context manager that completes it.

    Raises ``CaptureError`` for what the system refuses.
    """

    def __init__(self, file: Path, header: CaptureHeader) -> None:
        self._writer = PcapngWriter(file, comment=header.to_comment())

    def put(self, at_unix_ns: int, source: Address, destination: Address, payload: bytes) -> None:
        """Record one datagram."""
        self._writer.write(CapturedDatagram(at_unix_ns, source, destination, payload))

    def note(self, entry: bytes) -> None:
        """Record one entry of the journal."""
        self._writer.note(entry)

    def close(self) -> None:
        """Complete the file."""
        self._writer.note(encode_entry(EndEntry()))
        self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self._writer.close()
