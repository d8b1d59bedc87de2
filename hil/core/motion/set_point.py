"""Set points, and what every motion offers."""

from typing import NamedTuple, Protocol

from hil.values.robot import Seven

STILL: Seven = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class SetPoint(NamedTuple):
    """Position in rad and velocity in rad/s of the seven axes."""

    position_rad: Seven
    velocity_rad_s: Seven


class Motion(Protocol):
    """One motion; it is asked once a control cycle."""

    def interpolate(self) -> SetPoint:
        """Return the set point of the next cycle."""

    @property
    def at_rest(self) -> bool:
        """True when the set point no longer moves by itself."""
