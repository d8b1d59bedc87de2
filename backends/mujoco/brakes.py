"""The arm's mechanical brakes: dry friction on the motor side of each gear, as MuJoCo's friction loss of the joints.

The friction loss of the loaded model changes while the brakes grip; the file and its other readers know of none.
Not modelled: the time a brake takes to close, wear, temperature.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    import mujoco
    from numpy.typing import NDArray

BRAKE_PER_MOTOR_TORQUE: Final = 1.0
"""Torque of a brake over the largest of its motor. Ours, no public figure: what the drive can lift, the brake holds."""

_STIFF_IMPEDANCE: Final = (0.9999, 0.9999, 0.001, 0.5, 2.0)
_STIFF_REFERENCE: Final = (0.002, 1.0)
"""The stiffest that MuJoCo allows at steps of 1 ms. With its defaults a stretched arm creeps on closed brakes."""


class Brakes:
    """Seven brakes, applied and released together."""

    def __init__(self, model: "mujoco.MjModel", motor_torque_nm: Sequence[float], *, first_dof: int = 0) -> None:
        self._dofs = dofs = slice(first_dof, first_dof + len(motor_torque_nm))
        self._model = model
        self._friction = model.dof_frictionloss[dofs].copy()
        self._impedance = model.dof_solimp[dofs].copy()
        self._reference = model.dof_solref[dofs].copy()
        self._row = int(np.count_nonzero(model.dof_frictionloss[:first_dof]))
        """Of its first joint among MuJoCo's rows of friction."""
        self._torque = BRAKE_PER_MOTOR_TORQUE * np.array(motor_torque_nm)
        self._share = self._torque / (self._torque + self._friction)

    def apply(self) -> None:
        """Let them grip from the next step on."""
        self._model.dof_frictionloss[self._dofs] = self._friction + self._torque
        self._model.dof_solimp[self._dofs] = _STIFF_IMPEDANCE
        self._model.dof_solref[self._dofs] = _STIFF_REFERENCE

    def release(self) -> None:
        """Give the joints back their own friction."""
        self._model.dof_frictionloss[self._dofs] = self._friction
        self._model.dof_solimp[self._dofs] = self._impedance
        self._model.dof_solref[self._dofs] = self._reference

    def torque_nm(self, data: "mujoco.MjData") -> "NDArray[np.float64]":
        """Return what they gave in the last step they were applied in, positive towards plus; the rest is friction."""
        # Among MuJoCo's constraints the equalities come first, then the friction of the joints, joint by joint.
        first = int(data.ne) + self._row
        torque: NDArray[np.float64] = data.efc_force[first : first + len(self._share)] * self._share
        return torque
