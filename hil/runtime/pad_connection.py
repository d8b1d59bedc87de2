"""One connection of a pad: lines in, lines out, in bounded memory."""

import asyncio
import json
import socket
from collections.abc import Callable
from typing import Final, Protocol, cast

from hil.runtime.pad_requests import MAX_LINE_BYTES, RequestId

BURST_REQUESTS: Final = 20
REQUEST_INTERVAL_NS: Final = 50_000_000
"""Between two requests of a connection, when it has used up its burst."""
UNREAD_BYTES: Final = 1 << 16
"""What is kept for a pad that does not read; lines that would come then are lost, and counted."""
_VOLATILE: Final = frozenset({"time_s", "cycles", "closest", "margins", "latency"})
"""Parts of a robot's state that change all the time, and are no change to be told."""

Message = dict[str, object]


class Channel(Protocol):
    """What a connection belongs to."""

    lost_lines: int
    """Lines that were not sent, because nobody read those before."""

    def joined(self, connection: "Connection", link: socket.socket) -> str:
        """Take a connection, or return why not."""

    def left(self, connection: "Connection") -> None:
        """Forget a connection."""

    def queue(self, connection: "Connection", line: bytes) -> None:
        """Do a request, and then call :meth:`Connection.answer`."""


class Connection(asyncio.BufferedProtocol):
    """One pad: a buffer of one line, one request at a time, and no more unread lines than ``UNREAD_BYTES``."""

    def __init__(self, channel: Channel, *, now_ns: Callable[[], int]) -> None:
        self._channel = channel
        self._now_ns = now_ns
        self._buffer = bytearray(MAX_LINE_BYTES + 1)
        self._filled = 0
        self._transport: asyncio.Transport | None = None
        self._busy = False
        self._half_closed = False
        self._unread = False
        self._free_at_ns = 0
        self._lost = 0
        self._watch_id: RequestId = None
        self._shown: object = None
        self.watched: list[str] = []
        """Robots it watches."""
        self.used_ns = now_ns()
        """When it last asked for something."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Check who it is."""
        self._transport = cast("asyncio.Transport", transport)
        self._transport.set_write_buffer_limits(high=UNREAD_BYTES)
        refusal = self._channel.joined(self, transport.get_extra_info("socket"))
        if refusal:
            self.end(refusal)

    def connection_lost(self, _error: Exception | None) -> None:
        """Let go what it held."""
        self._transport = None
        self._channel.left(self)

    def pause_writing(self) -> None:
        """It does not read."""
        self._unread = True

    def resume_writing(self) -> None:
        """It reads again."""
        self._unread = False

    def get_buffer(self, _sizehint: int) -> memoryview:
        """Return room for at most the rest of a line."""
        return memoryview(self._buffer)[self._filled :]

    def buffer_updated(self, count: int) -> None:
        """Take what arrived."""
        self._filled += count
        self._take_line()

    def eof_received(self) -> bool:
        """Stay open for what it asked before it ended its side."""
        self._half_closed = True
        self._take_line()
        return self._transport is not None

    def watch(self, names: list[str], request_id: RequestId) -> None:
        """Show it these robots from now on."""
        self.watched, self._watch_id, self._shown = names, request_id, None

    def show(self, states: dict[str, Message], *, always: bool) -> None:
        """Send the state of what it watches, if that changed."""
        steady = {
            name: {key: value for key, value in state.items() if key not in _VOLATILE} for name, state in states.items()
        }
        if always or steady != self._shown:
            told = {"ok": True, "watch": True, "lost": self._lost, "robots": states}
            # What was lost is still to be shown.
            self._shown = steady if self._send(told, self._watch_id) else None

    def answer(self, told: Message, request_id: RequestId) -> None:
        """Send the answer to its request, and take the next one."""
        self._send(told, request_id)
        self._busy = False
        self._take_line()

    def end(self, reason: str) -> None:
        """Say why, and close."""
        if self._transport is not None:
            self._send({"ok": False, "error": reason}, None)
            self._close(self._transport)

    def _take_line(self) -> None:
        if self._transport is None or self._busy:
            return
        end = self._buffer.find(b"\n", 0, self._filled)
        if end < 0 and self._half_closed and self._filled:
            end = self._filled
        if end >= 0:
            line = bytes(self._buffer[:end])
            rest = bytes(self._buffer[end + 1 : self._filled])
            self._buffer[: len(rest)] = rest
            self._filled = len(rest)
            self._busy = True
            self._transport.pause_reading()
            self._queue(line)
        elif self._filled > MAX_LINE_BYTES:
            self.end(f"a line is longer than {MAX_LINE_BYTES} bytes; the connection is closed")
        elif self._half_closed:
            self._close(self._transport)
        else:
            self._transport.resume_reading()

    def _close(self, transport: asyncio.Transport) -> None:
        self._transport = None
        # Whoever does not read must not keep the connection, nor what it holds.
        if transport.get_write_buffer_size():
            transport.abort()
        else:
            transport.close()

    def _queue(self, line: bytes) -> None:
        now_ns = self.used_ns = self._now_ns()
        self._free_at_ns = max(self._free_at_ns, now_ns) + REQUEST_INTERVAL_NS
        early_ns = self._free_at_ns - now_ns - BURST_REQUESTS * REQUEST_INTERVAL_NS
        if early_ns > 0:
            asyncio.get_running_loop().call_later(early_ns / 1e9, self._channel.queue, self, line)
        else:
            self._channel.queue(self, line)

    def _send(self, told: Message, request_id: RequestId) -> bool:
        if self._transport is None or self._unread:
            self._lost += 1
            self._channel.lost_lines += 1
            return False
        if request_id is not None:
            told["id"] = request_id
        self._transport.write(json.dumps(told).encode() + b"\n")
        return True
