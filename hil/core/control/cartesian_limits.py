"""What the monitors ask of Cartesian impedance: control force, path deviation and velocity against their limits."""

from typing import NamedTuple

from hil.values.control import OFF, CartesianDof, CartesianImpedanceControlMode
from hil.values.robot import Six

_DOFS = tuple(CartesianDof)


class CartesianReading(NamedTuple):
    """Of one cycle, X Y Z A B C along and about the axes of the set point."""

    force: Six
    """What the controller pulls with, cut off at its maximum, N and Nm."""
    deviation: Six
    """Measured minus set point, mm and rad."""
    velocity: Six
    """Of the measured TCP, mm/s and rad/s."""


class LimitViolation(NamedTuple):
    """A limit that was reached (control force) or exceeded (the others)."""

    name: str
    dof: CartesianDof
    value: float
    limit: float

    def __str__(self) -> str:
        return f"{self.name} {self.dof}: {self.value:.4g}, limit {self.limit:g}"


class CartesianLimits:
    """The limits of one control mode; ``watching`` is False where all are off, so that nobody need look."""

    def __init__(self, settings: CartesianImpedanceControlMode) -> None:
        force = settings.max_control_force if settings.stop_on_max_control_force else (OFF,) * 6
        limits = (force, settings.max_path_deviation, settings.max_cartesian_velocity)
        self._limits = limits
        self.watching = any(value < OFF for row in limits for value in row)

    def first_violation(self, reading: CartesianReading) -> LimitViolation | None:
        """Return the first limit that does not hold, or None."""
        force, deviation, velocity = self._limits
        for axis, dof in enumerate(_DOFS):
            # The force itself never gets beyond its maximum.
            if abs(reading.force[axis]) >= force[axis] < OFF:
                return LimitViolation("max control force", dof, reading.force[axis], force[axis])
            if abs(reading.deviation[axis]) > deviation[axis]:
                return LimitViolation("max path deviation", dof, reading.deviation[axis], deviation[axis])
            if abs(reading.velocity[axis]) > velocity[axis]:
                return LimitViolation("max Cartesian velocity", dof, reading.velocity[axis], velocity[axis])
        return None
