"""Force and moment at the flange from external joint torques: the damped pseudo-inverse of the transposed Jacobian.

All that pushes is taken to push at the flange. What does not show at the joints is not observable:

- a push that acts on the null space alone (on the elbow along its circle) is no wrench at the flange; it is left over
  as ``unexplained_nm``, and so is part of any push on a link;
- in a singularity the wrench has a direction that loads no joint. Along directions whose singular value is below
  ``REGULAR`` the estimate is damped towards zero instead of blown up; ``smallest_singular_value`` tells.

Seven torques and six unknowns leave one check, so two pushes at once cannot be told apart.
"""

from typing import TYPE_CHECKING, Final, NamedTuple

import eigenpy  # type: ignore[import-untyped]  # comes with Pinocchio, which is built on it
import numpy as np

from hil.core.control.dynamics import Dynamics
from hil.values.arm import seven
from hil.values.control import six
from hil.values.robot import Seven, Six

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

REGULAR: Final = 0.05
"""Singular value of the Jacobian (m and 1 taken as alike) from which on nothing is damped. Ours."""
_LEAST_SQUARES: Final = np.full(6, REGULAR * REGULAR)


class FlangeForce(NamedTuple):
    """At the flange's origin, axes of the robot base: Fx, Fy, Fz in N, Mx, My, Mz in Nm."""

    wrench: Six
    variance: Six
    """In N2 and Nm2, from the variance of the joint torques."""
    unexplained_nm: Seven
    """External joint torque that no wrench at the flange makes."""
    smallest_singular_value: float

    @property
    def regular(self) -> bool:
        """Whether all six numbers are observable in this pose."""
        return self.smallest_singular_value >= REGULAR


class FlangeForceEstimator:
    """Computes when asked, which need not be in each cycle."""

    def __init__(self) -> None:
        self._solver = eigenpy.SelfAdjointEigenSolver(6)

    def estimate(self, external_nm: Seven, variance_nm2: Seven, dynamics: Dynamics) -> FlangeForce:
        """Return what at the flange explains these joint torques best, in the pose ``dynamics`` was updated with."""
        torque = np.array(external_nm)
        jacobian = dynamics.flange_jacobian()
        inverse = self._inverse(jacobian)
        wrench = inverse.dot(torque)
        variance = np.square(inverse).dot(np.array(variance_nm2))
        rest = torque - wrench.dot(jacobian)
        smallest = max(float(self._solver.eigenvalues()[0]), 0.0) ** 0.5
        return FlangeForce(six(wrench.tolist()), six(variance.tolist()), seven(rest.tolist()), smallest)

    def wrench(self, external_nm: Seven, jacobian: "Array") -> Six:
        """Return the wrench of such an estimate alone, where ``jacobian`` is that of the flange."""
        return six(self._inverse(jacobian).dot(np.array(external_nm)).tolist())

    def wrench_and_variance(self, external_nm: Seven, variance_nm2: Seven, jacobian: "Array") -> tuple[Six, Six]:
        """Return the wrench and its variance alone."""
        inverse = self._inverse(jacobian)
        wrench, variance = inverse.dot(np.array(external_nm)), np.square(inverse).dot(np.array(variance_nm2))
        return six(wrench.tolist()), six(variance.tolist())

    def _inverse(self, jacobian: "Array") -> "Array":
        """Return the damped pseudo-inverse of the transposed Jacobian, 6x7."""
        self._solver.compute(jacobian.dot(jacobian.T))
        vectors: Array = self._solver.eigenvectors()
        # Damped one direction at a time, growing from nothing at the edge: regular directions stay exact.
        damped = np.maximum(self._solver.eigenvalues(), _LEAST_SQUARES)
        inverse: Array = (vectors / damped).dot(vectors.T).dot(jacobian)
        return inverse
