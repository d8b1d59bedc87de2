"""What the joint torque sensors show of a torque: their step and their noise, seeded.

Source: robot facts 4.4 (log of a Med 7): torque quantum and short-term standard deviation at rest, taken for all four
robots. Not modelled: offset, drift, hysteresis, temperature.
"""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_QUANTUM_NM = np.array([1.344e-3] * 2 + [8.80e-4] * 3 + [3.34e-4] * 2)
_PER_QUANTUM = 1.0 / _QUANTUM_NM
_MEASURED_SIGMA_NM = np.array([0.0041, 0.026, 0.0028, 0.0085, 0.0028, 0.0013, 0.0014])
_EXTERNAL_SIGMA_NM = np.array([0.0006, 0.014, 0.0004, 0.004, 0.0003, 0.0003, 0.0001])
_BLOCK = 1024


class TorqueSensors:
    """Seven sensors; noise is drawn in blocks, because one draw a cycle costs more than its share of the cycle."""

    def __init__(self, *, seed: int) -> None:
        self._random = np.random.default_rng(seed)
        self._row = _BLOCK
        self._measured_noise = np.empty((_BLOCK, 7))
        self._external_noise = np.empty((_BLOCK, 7))

    def sense(
        self, torque_nm: "NDArray[np.float64]", external_nm: "NDArray[np.float64]"
    ) -> tuple["NDArray[np.float64]", "NDArray[np.float64]"]:
        """Return what the sensors show of ``torque_nm`` and what the controller makes of ``external_nm``."""
        if self._row == _BLOCK:
            self._row = 0
            self._measured_noise = self._random.standard_normal((_BLOCK, 7)) * _MEASURED_SIGMA_NM
            self._external_noise = self._random.standard_normal((_BLOCK, 7)) * _EXTERNAL_SIGMA_NM
        row = self._row
        self._row += 1
        shown = np.rint((torque_nm + self._measured_noise[row]) * _PER_QUANTUM) * _QUANTUM_NM
        return shown, external_nm + self._external_noise[row]
