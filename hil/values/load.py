"""What hangs on the flange, or on a tool: mass, centre of mass, inertia; and a tool of a program's own. SI units."""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.values.errors import ConfigurationError
from hil.values.motion import ParameterRange
from hil.values.pose import NOWHERE, Pose
from hil.values.robot import Three


@dataclass(frozen=True, slots=True)
class Load:
    """A load in the frame it is mounted at. Its inertia is about the centre of mass, axes parallel to the frame's.

    Raises OutOfRange for a negative mass and ConfigurationError for an inertia no rigid body has.
    """

    mass_kg: float = 0.0
    centre_m: Three = (0.0, 0.0, 0.0)
    """Centre of mass in the frame."""
    moments_kg_m2: Three = (0.0, 0.0, 0.0)
    """Ixx, Iyy, Izz."""
    products_kg_m2: Three = (0.0, 0.0, 0.0)
    """Ixy, Ixz, Iyz, as entries of the tensor."""

    def __post_init__(self) -> None:
        ParameterRange("load mass", 0.0, math.inf, 0.0, "kg").check(self.mass_kg)
        for name, numbers in (("centre", self.centre_m), ("moments", self.moments_kg_m2)):
            if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
                raise ConfigurationError(f"load {name} {numbers}: three finite numbers are needed")
        if len(self.products_kg_m2) != 3 or not all(map(math.isfinite, self.products_kg_m2)):
            raise ConfigurationError(f"load products {self.products_kg_m2}: three finite numbers are needed")
        xx, yy, zz = self.moments_kg_m2
        if min(xx, yy, zz) < 0.0 or 2.0 * max(xx, yy, zz) > (xx + yy + zz) * (1.0 + 1e-9):
            raise ConfigurationError(
                f"load moments {self.moments_kg_m2} kg m2: none may be negative or larger than the sum of the others"
            )

    def mounted(self, frame_in_flange: Pose) -> "Load":
        """Return the same load in the flange, for one told in a frame that stands there."""
        x, y, z = (frame_in_flange @ Pose(*self.centre_m)).position_m
        turn = np.reshape(frame_in_flange.rotation, (3, 3))
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = (turn @ self.tensor_kg_m2() @ turn.T).tolist()
        return Load(self.mass_kg, (x, y, z), (xx, yy, zz), (xy, xz, yz))

    def tensor_kg_m2(self) -> NDArray[np.float64]:
        """Return the inertia about the centre of mass, 3x3."""
        xx, yy, zz = self.moments_kg_m2
        xy, xz, yz = self.products_kg_m2
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


NO_LOAD: Final = Load()


class AttachedTool(NamedTuple):
    """A tool that a program attaches to the flange by itself, with no need of a place in the robot's frames."""

    load: Load = NO_LOAD
    """In the flange; what is reckoned with while the tool is moved."""
    tcp_in_flange: Pose = NOWHERE
    """What Cartesian destinations are for, and where Cartesian impedance acts."""
