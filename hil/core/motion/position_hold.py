"""Position hold: the arm stays where it is."""

from hil.core.motion.set_point import STILL, SetPoint
from hil.values.robot import Seven


class PositionHold:
    """Holds ``position_rad`` for ever."""

    def __init__(self, position_rad: Seven) -> None:
        self._set_point = SetPoint(position_rad, STILL)

    def interpolate(self) -> SetPoint:
        """Return the held position."""
        return self._set_point

    @property
    def at_rest(self) -> bool:
        """Always."""
        return True
