"""Arithmetic of sequence numbers: where they wrap, and which of them were not captured."""

from typing import Final

_WRAP: Final = 1 << 32
_MOST_RANGES: Final = 16


def nearest(wrapped: int, near: int) -> int:
    """Return the number that 32 bits of ``wrapped`` mean, the one nearest to ``near``."""
    distance = (wrapped - near) % _WRAP
    return near + (distance if distance < _WRAP // 2 else distance - _WRAP)


class MissingRanges:
    """Bytes that were jumped over; the last few such places."""

    def __init__(self) -> None:
        self._ranges: dict[tuple[int, int], int] = {}

    def add(self, start: int, end: int, at_ns: int) -> None:
        """Note that the bytes from ``start`` to ``end`` were not there at ``at_ns``."""
        if len(self._ranges) >= _MOST_RANGES:
            del self._ranges[next(iter(self._ranges))]
        self._ranges[start, end] = at_ns

    def fill(self, start: int, end: int, at_ns: int) -> int | None:
        """Take bytes that came later; return how much later [ns], None where none of them was missing."""
        for (first, behind), since_ns in self._ranges.items():
            if first <= start and end <= behind:
                del self._ranges[first, behind]
                if first < start:
                    self._ranges[first, start] = since_ns
                if end < behind:
                    self._ranges[end, behind] = since_ns
                return max(at_ns - since_ns, 0)
        return None
