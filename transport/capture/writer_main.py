"""The process that writes a capture: ``python -m transport.capture.writer_main SOCKET_FD FILE_FD PATH HOW``.

``HOW`` says what the socket is: ``connected``, or one to ``listen`` at. It reads batches from there until the other end
is closed, by the recorder or by the recorder's death, and then answers with one message of JSON: ``{"written": packets,
"removed": packets, "error": text or null}``. It is started with the signals of a terminal blocked, so it outlives the
Ctrl-C that ends the run and writes what was sent before.
"""

import errno
import io
import json
import os
import socket
import sys
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from transport.capture.batches import MAX_MESSAGE_BYTES, Opening, unpack_batch, unpack_opening
from transport.capture.parts import part_path
from transport.capture.writing import PcapngWriter
from transport.claims import claim_file

_NICENESS: Final = 10
_CONNECT_WITHIN_S: Final = 10.0


class Recording:
    """Writes whole batches to a file; after the first refusal it only counts, so the file has no gaps.

    With a ring the next file is begun where a batch would make the present one too long, and the oldest one removed.
    """

    def __init__(self, file_fd: int, path: Path, opening: Opening) -> None:
        self.written = 0
        """Packets in the files."""
        self.lost = 0
        """Packets that came after, or in, the batch the system refused."""
        self.removed = 0
        """Packets of files that newer ones replaced."""
        self.error: str | None = None
        """Why it was refused."""
        self._path = path
        self._ring = opening.ring
        self._comment = opening.comment.decode()
        self._part = 1
        self._kept: deque[tuple[Path, int]] = deque([(path, 0)])
        """Files of the ring that are there, and how many packets each has."""
        self._file_fd = file_fd
        self._size = 0
        self._block_buffer = io.BytesIO()
        self._writer = PcapngWriter(self._block_buffer, comment=self._comment)
        self._commit(0)

    def add(self, batch: memoryview) -> None:
        """Write the records of ``batch``."""
        packets = 0
        writer = self._writer
        for record in unpack_batch(batch):
            if isinstance(record, bytes):
                if self.error is None:
                    writer.note(record)
                continue
            packets += 1
            if self.error is None:
                writer.write(record)
        if self.error is None:
            writer.settle()
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
                data = self._block_buffer.getvalue()
                self._make_room(len(data))
                self._write_all(data)
                self.written += packets
                path, before = self._kept[-1]
                self._kept[-1] = (path, before + packets)
            except OSError as error:
                self._fail(error)
                self.lost += packets
            self._block_buffer.seek(0)
            self._block_buffer.truncate()
        else:
            self.lost += packets

    def _make_room(self, size: int) -> None:
        ring = self._ring
        if ring is None or not self._size or self._size + size <= ring.file_bytes:
            return
        self._part += 1
        path = part_path(self._path, self._part)
        next_fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o666)
        if holder := claim_file(next_fd):
            os.close(next_fd)
            raise OSError(errno.EBUSY, f"{holder} records to {path.name}")
        os.ftruncate(next_fd, 0)
        os.close(self._file_fd)
        self._file_fd, self._size = next_fd, 0
        self._kept.append((path, 0))
        head = io.BytesIO()
        PcapngWriter(head, comment=self._comment)
        self._write_all(head.getvalue())
        while len(self._kept) > ring.files:
            oldest, packets = self._kept.popleft()
            with suppress(OSError):
                oldest.unlink()
            self.written -= packets
            self.removed += packets

    def _write_all(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(self._file_fd, rest) :]
        self._size += len(data)

    def _fail(self, error: OSError) -> None:
        self.error = error.strerror or str(error)
        with suppress(OSError):  # half a block would spoil the file; a device cannot be cut, and need not be
            os.ftruncate(self._file_fd, self._size)


def record(messages: socket.socket, file_fd: int, path: Path) -> Recording:
    """Write everything that comes through ``messages`` to ``file_fd``, which is that of ``path``, and close it."""
    buffer = memoryview(bytearray(MAX_MESSAGE_BYTES))
    size = messages.recv_into(buffer)
    recording = Recording(file_fd, path, unpack_opening(bytes(buffer[:size])) if size else Opening(b""))
    while size and (size := messages.recv_into(buffer)):
        recording.add(buffer[:size])
    recording.close()
    return recording


def _give_way() -> None:
    """The control loop comes first, also where it runs under a real-time policy, which a child inherits."""
    with suppress(OSError):  # a sandbox may forbid either; the capture is still right
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    with suppress(OSError):
        os.nice(_NICENESS)


def _accepted(listener: socket.socket) -> socket.socket:
    with listener:
        listener.settimeout(_CONNECT_WITHIN_S)
        link, _ = listener.accept()
    link.setblocking(True)
    return link


def main(arguments: Sequence[str]) -> None:
    """Record until the recorder is done, then report."""
    socket_text, file_text, path, how = arguments
    _give_way()
    link = socket.socket(fileno=int(socket_text))
    listens = how == "listen"
    with _accepted(link) if listens else link as messages:
        if listens:
            # Not before: where the controller refuses the recording, the file keeps what it holds.
            with suppress(OSError):  # a device cannot be cut, and need not be
                os.ftruncate(int(file_text), 0)
        recording = record(messages, int(file_text), Path(path))
        report = {"written": recording.written, "removed": recording.removed, "error": recording.error}
        with suppress(OSError):  # the recorder died; the file is complete all the same
            messages.send(json.dumps(report).encode())


if __name__ == "__main__":
    main(sys.argv[1:])
