"""The whole core: both links, an operator and strangers, led by bytes; what reaches the arm stays inside its limits."""

import random
from typing import Any

from hil.values.fri import OperationMode
from tests.fuzz.target import Target
from tests.support.hostile import Hostile

CYCLES = 120
_ROBOTS = ("lbr-iiwa-7-r800", "lbr-iiwa-14-r820")


class Led(random.Random):
    """Random numbers out of bytes; 0 when there are none left, so that a story is as long as its bytes."""

    def __new__(cls, _data: bytes) -> Any:  # as its parent's, which takes a seed
        return super().__new__(cls)

    def __init__(self, data: bytes) -> None:
        super().__init__(0)
        self._data = data
        self._at = 0

    def random(self) -> float:
        """Return a number of 0..1, of two bytes."""
        return self.getrandbits(16) / 65536.0

    def getrandbits(self, k: int, /) -> int:
        """Return so many bits."""
        size = (k + 7) // 8
        piece = self._data[self._at : self._at + size]
        self._at += size
        return int.from_bytes(piece.ljust(size, b"\0"), "little") & ((1 << k) - 1)


def _story(data: bytes) -> None:
    how = data[0] if data else 0
    mode = list(OperationMode)[how % len(OperationMode)]
    story = Hostile(0, mode=mode, robot=_ROBOTS[how >> 2 & 1], fri=bool(how >> 3 & 1))
    story.random = Led(data[1:])
    story.run(CYCLES)


TARGETS = (
    Target(
        "controller",
        "Whatever comes on both links and whoever presses what, set points are finite, in range, in velocity, in T1.",
        _story,
        lambda: [bytes([how]) + random.Random(how).randbytes(1500) for how in range(16)],
        longest_bytes=3000,
    ),
)
