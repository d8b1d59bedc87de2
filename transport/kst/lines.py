"""Requests as lines, cut out of what a TCP connection delivers, in bounded memory."""

import re
from typing import Final

LINE_MOST_BYTES: Final = 1024
_END: Final = re.compile(rb"\n|\r|\xc2\x85|\xe2\x80[\xa8\xa9]")
"""What a Java scanner ends a line at; CR LF is two, of which the second ends an empty line, and that is ignored."""
_LONGEST_END: Final = 3


class LineCutter:
    """Feeds on bytes, however they were cut; a line longer than the bound is told once, as None, and dropped."""

    def __init__(self, most_bytes: int = LINE_MOST_BYTES) -> None:
        self._most = most_bytes
        self._rest = b""
        self._dropping = False

    @property
    def open_line(self) -> bytes:
        """What came of a line that has no end yet; empty between lines, and while one is dropped."""
        return b"" if self._dropping else self._rest

    def feed(self, data: bytes) -> list[bytes | None]:
        """Return the lines that ``data`` completes, without their ends, empty ones included; None: one too long."""
        parts = _END.split(self._rest + data)
        self._rest = parts.pop()
        lines: list[bytes | None] = []
        for part in parts:
            if self._dropping:
                self._dropping = False
            else:
                lines.append(part if len(part) <= self._most else None)
        if self._dropping:
            # An end of several bytes may be cut in two.
            self._rest = self._rest[-_LONGEST_END:]
        elif len(self._rest) > self._most + _LONGEST_END:
            self._rest, self._dropping = self._rest[-_LONGEST_END:], True
            lines.append(None)
        return lines
