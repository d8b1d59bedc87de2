"""Set points, and what every motion offers."""

from typing import NamedTuple, Protocol

from hil.values.robot import Seven

STILL: Seven = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""No velocity, or no acceleration."""


class SetPoint(NamedTuple):
    """Position in rad, velocity in rad/s and acceleration in rad/s2 of the seven axes.

    The acceleration is what a motion that takes over may go on from; 0 where it is not planned.
    """

    position_rad: Seven
    velocity_rad_s: Seven
    acceleration_rad_s2: Seven = STILL

    @property
    def stands(self) -> bool:
        """Whether nothing moves, and nothing is about to."""
        return self.velocity_rad_s == STILL and self.acceleration_rad_s2 == STILL


class Motion(Protocol):
    """One motion; it is asked once a control cycle."""

    def interpolate(self) -> SetPoint:
        """Return the set point of the next cycle."""

    @property
    def at_rest(self) -> bool:
        """True when the set point no longer moves by itself."""
