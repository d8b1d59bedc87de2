"""Friction compensation: what the joints' own friction takes, the law gives back, by the measured velocity.

That the vendor's controller compensates friction is known, how is not; it is said to be off while the commanded
position is the measured one (facts 4.4). Ours goes by the measured velocity and is smooth through zero, so that it
gives nothing at rest: at rest a joint may still stick, as the manual warns (7.10.3).
"""

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    import pinocchio
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

KNEE_RAD_S: Final = 0.005
"""Velocity at which dry friction is given back to three quarters. Ours: slow against motion, fast against creep."""


class FrictionCompensation:
    """Viscous and dry friction of ``model``'s joints, times ``share`` (1: all of it)."""

    def __init__(self, model: "pinocchio.Model", *, share: float = 1.0) -> None:
        self._viscous: Array = share * np.array(model.damping)
        self._dry: Array = share * np.array(model.upperDryFrictionLimit)
        self._scaled = np.empty_like(self._dry)
        self._torque = np.empty_like(self._dry)

    def torque_nm(self, velocity_rad_s: "Array") -> "Array":
        """Return the torque that makes up for the friction at this velocity, seven; a buffer of this object."""
        torque, scaled = self._torque, self._scaled
        np.multiply(velocity_rad_s, 1.0 / KNEE_RAD_S, out=scaled)
        np.tanh(scaled, out=torque)
        torque *= self._dry
        np.multiply(velocity_rad_s, self._viscous, out=scaled)
        torque += scaled
        return torque
