"""What the joint torque sensors show of a torque: their step and their noise, seeded.

Source: robot facts 4.4 (log of a Med 7): torque quantum and short-term standard deviation at rest, taken for all four
robots. Not modelled: offset, drift, hysteresis, temperature.
"""

from typing import TYPE_CHECKING

import numpy as np

from hil.values.robot import Seven

if TYPE_CHECKING:
    from numpy.typing import NDArray

_QUANTUM_NM = np.array([1.344e-3] * 2 + [8.80e-4] * 3 + [3.34e-4] * 2)
_PER_QUANTUM = 1.0 / _QUANTUM_NM
SIGMA_NM: Seven = (0.0041, 0.026, 0.0028, 0.0085, 0.0028, 0.0013, 0.0014)
_EXACT: Seven = (0.0,) * 7
_BLOCK = 1024


class TorqueSensors:
    """Seven sensors; without ``noise`` they show the truth.

    Noise is drawn in blocks, because one draw a cycle costs more than its share of the cycle.
    """

    def __init__(self, *, seed: int, noise: bool = True) -> None:
        self._random = np.random.default_rng(seed)
        self._noise = noise
        self._row = _BLOCK
        self._drawn = np.empty((_BLOCK, 7))
        self.sigma_nm: Seven = SIGMA_NM if noise else _EXACT
        """Standard deviation of what they show."""

    def sense(self, torque_nm: "NDArray[np.float64]") -> "NDArray[np.float64]":
        """Return what the sensors show of ``torque_nm``."""
        if not self._noise:
            return torque_nm
        if self._row == _BLOCK:
            self._row = 0
            self._drawn = self._random.standard_normal((_BLOCK, 7)) * SIGMA_NM
        row = self._row
        self._row += 1
        shown: NDArray[np.float64] = np.rint((torque_nm + self._drawn[row]) * _PER_QUANTUM) * _QUANTUM_NM
        return shown
