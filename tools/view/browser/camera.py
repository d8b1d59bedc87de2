"""From where the page is looked at before anybody turns it: so that all robots are seen."""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from hil.values.frames import BASE
from hil.values.robot import Three
from tools.view.drawing import DrawnRobot

FIELD_OF_VIEW_RAD: Final = math.radians(45.0)
_FROM_M: Final = (1.75, -1.55, 0.8)
"""For one robot, from the point that is looked at."""
_LOOKS_AT_HEIGHT_M: Final = 0.5
_SPREAD_M: Final = 1.1
"""Robots that are so far from their middle need twice the distance."""


class Camera(NamedTuple):
    """Where it is, and what it looks at, m, in the world."""

    position_m: Three
    looks_at_m: Three


def camera_for(robots: Sequence[DrawnRobot]) -> Camera:
    """Return a camera that sees the robots."""
    bases = [robot.frames[BASE].in_parent.position_m for robot in robots]
    x, y, z = (sum(part) / len(bases) for part in zip(*bases, strict=True))
    spread_m = max(math.dist((x, y, z), base) for base in bases)
    away = 1.0 + spread_m / _SPREAD_M
    target = (x, y, z + _LOOKS_AT_HEIGHT_M)
    px, py, pz = (at + away * part for at, part in zip(target, _FROM_M, strict=True))
    return Camera((px, py, pz), target)
