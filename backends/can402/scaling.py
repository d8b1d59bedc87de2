"""Counts of a drive and radians of its axis."""

import math

from backends.can402.options import AxisOptions

_MOST_COUNTS = (1 << 31) - 1


class AxisScale:
    """One axis. ``counts_per_rad`` has the sign of the axis."""

    def __init__(self, axis: AxisOptions) -> None:
        self.counts_per_rad = axis.sign * axis.counts_per_turn * axis.gear / (2.0 * math.pi)
        self._rad_per_count = 1.0 / self.counts_per_rad
        self._offset_rad = axis.offset_rad
        self._nm_per_permille = axis.sign * axis.rated_torque_nm * 1e-3

    def counts(self, position_rad: float) -> int:
        """Return the position in whole counts, at most what 32 bits hold."""
        counts = round((position_rad - self._offset_rad) * self.counts_per_rad)
        return max(-_MOST_COUNTS, min(_MOST_COUNTS, counts))

    def position_rad(self, counts: int) -> float:
        """Return the position of the axis."""
        return self._offset_rad + counts * self._rad_per_count

    def velocity_rad_s(self, counts_per_s: int) -> float:
        """Return the velocity of the axis."""
        return counts_per_s * self._rad_per_count

    def motor_torque_nm(self, permille: int) -> float:
        """Return the torque of the motor at the axis, positive towards plus."""
        return permille * self._nm_per_permille

    def reaches(self, position_rad: float) -> bool:
        """Whether 32 bits hold that position."""
        return abs((position_rad - self._offset_rad) * self.counts_per_rad) <= _MOST_COUNTS
