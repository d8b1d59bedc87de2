"""The process that writes a capture: ``python -m transport.capture.writer_main SOCKET_FD FILE_FD``.

Reads batches from the socket until its other end is closed, by the parent or by the parent's death, and then prints
one line of JSON: ``{"written": packets, "lost": packets, "error": text or null}``. The parent starts it with the
signals of a terminal blocked, so it outlives the Ctrl-C that ends the run and writes what was sent before.
"""

import io
import json
import os
import socket
import sys
from collections.abc import Sequence
from contextlib import suppress

from transport.capture.batches import MAX_MESSAGE_BYTES, unpack_batch, unpack_opening
from transport.capture.pcapng import PcapngWriter

_NICENESS = 10


class Recording:
    """Writes whole batches to a file; after the first refusal it only counts, so the file has no gaps."""

    def __init__(self, file_fd: int, comment: str) -> None:
        self.written = 0
        """Packets in the file."""
        self.lost = 0
        """Packets that came after, or in, the batch the system refused."""
        self.error: str | None = None
        """Why it was refused."""
        self._file_fd = file_fd
        self._size = 0
        self._block_buffer = io.BytesIO()
        self._writer = PcapngWriter(self._block_buffer, comment=comment)
        self._commit(0)

    def add(self, batch: memoryview) -> None:
        """Write the records of ``batch``."""
        packets = 0
        for datagram in unpack_batch(batch):
            packets += 1
            if self.error is None:
                self._writer.write(datagram)
        self._commit(packets)

    def close(self) -> None:
        """Close the file; some file systems only now say that they have no room."""
        try:
            os.close(self._file_fd)
        except OSError as error:
            self._fail(error)

    def _commit(self, packets: int) -> None:
        """Bring what was encoded, ``packets`` of them, to the file."""
        if self.error is None:
            try:
                self._write_all(self._block_buffer.getvalue())
                self.written += packets
            except OSError as error:
                self._fail(error)
                self.lost += packets
            self._block_buffer.seek(0)
            self._block_buffer.truncate()
        else:
            self.lost += packets

    def _write_all(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(self._file_fd, rest) :]
        self._size += len(data)

    def _fail(self, error: OSError) -> None:
        self.error = error.strerror or str(error)
        with suppress(OSError):  # half a block would spoil the file; a device cannot be cut, and need not be
            os.ftruncate(self._file_fd, self._size)


def record(messages: socket.socket, file_fd: int) -> Recording:
    """Write everything that comes through ``messages`` to ``file_fd`` and close it."""
    buffer = memoryview(bytearray(MAX_MESSAGE_BYTES))
    size = messages.recv_into(buffer)
    recording = Recording(file_fd, unpack_opening(bytes(buffer[:size])))
    while size := messages.recv_into(buffer):
        recording.add(buffer[:size])
    recording.close()
    return recording


def _give_way() -> None:
    """The control loop comes first, also where it runs under a real-time policy, which a child inherits."""
    with suppress(OSError):  # a sandbox may forbid either; the capture is still right
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    with suppress(OSError):
        os.nice(_NICENESS)


def main(arguments: Sequence[str]) -> None:
    """Record until the parent is done, then report."""
    socket_fd, file_fd = map(int, arguments)
    _give_way()
    with socket.socket(fileno=socket_fd) as messages:
        recording = record(messages, file_fd)
    report = {"written": recording.written, "lost": recording.lost, "error": recording.error}
    with suppress(BrokenPipeError):  # the parent died; the file is complete all the same
        sys.stdout.write(json.dumps(report))
        sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
