"""What moves every arm of the comparison: a sine over axis 4. It needs nothing but Python."""

import math
from typing import Final

AMPLITUDE_RAD: Final = 0.04
FREQUENCY_HZ: Final = 0.25
AXIS: Final = 3
MOVED_RAD: Final = 0.5 * AMPLITUDE_RAD
"""An arm that follows has moved farther than this within a period of the sine."""


def with_sine(start_rad: tuple[float, ...], cycle: int) -> tuple[float, ...]:
    """Return the position to command in a cycle of 1 ms counted from the start of the motion."""
    offset_rad = AMPLITUDE_RAD * math.sin(2.0 * math.pi * FREQUENCY_HZ * cycle * 1e-3)
    return (*start_rad[:AXIS], start_rad[AXIS] + offset_rad, *start_rad[AXIS + 1 :])
