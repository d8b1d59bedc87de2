"""Springs and masses as independent oscillators: the double diagonalisation of stiffness and inertia.

Source: Albu-Schaeffer, Ott, Frese, Hirzinger 2003, "Cartesian impedance control of redundant robots: recent results
with the DLR-light-weight-arms", ICRA, p. 3704 (double diagonalisation design). The generalised eigenvalue problem of
stiffness K and inertia L is solved as the ordinary one of S = sqrt(K) inv(L) sqrt(K) = V diag(w^2) V', which needs no
inverse of K or L: no stiffness is too low and no pose too singular for it. The damping matrix that gives each
oscillator its damping ratio z is then D = sqrt(K) V diag(2 z / w) V' sqrt(K).
"""

from typing import TYPE_CHECKING, Final

import eigenpy  # type: ignore[import-untyped]  # comes with Pinocchio, which is built on it
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SLOWEST_RAD2_S2: Final = 1e-3
"""Floor of w^2: a direction in which the arm cannot move, or nothing pulls, has none."""


class Modes:
    """The oscillators of ``size`` coordinates; buffers of its own, valid until the next :meth:`solve`."""

    def __init__(self, size: int, damping: "Array") -> None:
        self._solver = eigenpy.SelfAdjointEigenSolver(size)
        self.frequency_rad_s: Array = np.empty(size)
        """w of each oscillator, never below the square root of the floor."""
        self.vectors: Array = np.eye(size)
        """V: oscillators are its columns."""
        self._gain = np.empty(size)
        self._along = np.empty(size)
        self._squares = np.empty((size, size))
        self._ratio2 = 2.0 * damping
        self._uniform = bool(np.all(damping == damping[0]))
        self.set_damping(damping)

    def set_damping(self, damping: "Array") -> None:
        """Take one damping ratio a coordinate; an oscillator gets their mean, weighted by its spring energy in each."""
        self._ratio2 = 2.0 * damping
        self._uniform = bool(np.all(damping == damping[0]))

    def solve(self, scaled_mobility: "Array") -> None:
        """Solve for S = sqrt(K) inv(L) sqrt(K), symmetric."""
        self._solver.compute(scaled_mobility)
        vectors: Array = self._solver.eigenvectors()
        self.vectors = vectors
        frequency = self.frequency_rad_s
        np.maximum(self._solver.eigenvalues(), SLOWEST_RAD2_S2, out=frequency)
        np.sqrt(frequency, out=frequency)
        if self._uniform:
            np.divide(self._ratio2, frequency, out=self._gain)
        else:
            np.multiply(vectors, vectors, out=self._squares)
            self._ratio2.dot(self._squares, self._gain)
            self._gain /= frequency

    def damping_force(self, scaled_velocity: "Array", out: "Array") -> None:
        """Write V diag(2 z / w) V' times sqrt(K) velocity to ``out``; times sqrt(K) it is the damping force."""
        along = self._along
        scaled_velocity.dot(self.vectors, along)
        along *= self._gain
        self.vectors.dot(along, out)
