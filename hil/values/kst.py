"""How a KST server behaves: the third link of a robot, TCP, for programs of the KST toolbox and its siblings."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from hil.values.servo import Vector

KST_PORT: Final = 30001
DEFAULT_WATCHDOG_MS: Final = 1000
MOTION_GAP_NS: Final = 100_000_000
"""Least time between the two acknowledgements of a motion: a client that reads all that came must not get both."""


class UnprovenLoad(StrEnum):
    """What becomes of impedance with a tool whose load does not explain the measured torques."""

    REPLACE = "replace"
    """The load that does explain them is taken instead, and the log says so."""
    REFUSE = "refuse"
    """The mode ends at once, as on a Cabinet whose load validation fails."""


@dataclass(frozen=True, slots=True)
class KstSettings:
    """Behaviour of a server, and the robot's axis limits."""

    position_min_rad: Vector
    position_max_rad: Vector
    velocity_max_rad_s: Vector = (math.inf,) * 7
    strict: bool = False
    """Do as a published server does, its faults included."""
    nagle: bool = False
    """Leave Nagle's algorithm on."""
    watchdog_ms: int = DEFAULT_WATCHDOG_MS
    """Silence in velocity mode after which the arm stops."""
    unproven_load: UnprovenLoad = UnprovenLoad.REPLACE
    second_acknowledgement: bool = True
    """Whether the end of impedance is acknowledged once more, as published servers do."""

    @property
    def motion_gap_ns(self) -> int:
        """Return the least time between two acknowledgements that belong together."""
        # With Nagle's algorithm the kernel keeps the second one back until the first one was acknowledged.
        return 0 if self.strict or self.nagle else MOTION_GAP_NS
