"""Why an inverse has no answer: values, because they are made in the control cycle; each says itself as a sentence."""

from dataclasses import dataclass
from enum import Enum

from hil.core.kinematics.singularities import Singularity
from hil.values.robot import JOINT_NAMES


@dataclass(frozen=True, slots=True)
class NoPosition:
    """No axis positions for this pose; always one of the kinds below."""


class Reach(Enum):
    """Which bound a wrist centre is beyond."""

    FAR = "beyond the stretched arm"
    NEAR = "inside the folded arm"
    ASIDE = "too near to the axis of A1 for this E1"
    """The elbow of this E1 leads the wrist past the A1 axis at a larger distance; another E1 may do."""


@dataclass(frozen=True, slots=True)
class Unreachable(NoPosition):
    """The wrist centre is ``by_m`` metres beyond a bound of the arm, whatever its axis limits."""

    reach: Reach
    by_m: float

    def __str__(self) -> str:
        return f"unreachable: the wrist centre is {1e3 * self.by_m:.4g} mm {self.reach.value}"


@dataclass(frozen=True, slots=True)
class Singular(NoPosition):
    """Two axes turn about one line, so the pose does not say how they share it."""

    singularity: Singularity

    def __str__(self) -> str:
        return f"singular: {self.singularity}"


@dataclass(frozen=True, slots=True)
class OutsideLimits(NoPosition):
    """The first axis (0 for A1) whose position would be outside its range; rad."""

    axis: int
    value_rad: float
    min_rad: float
    max_rad: float

    def __str__(self) -> str:
        return (
            f"outside its limits: {JOINT_NAMES[self.axis]} at {self.value_rad:.6g} rad; "
            f"valid: {self.min_rad:.6g} to {self.max_rad:.6g} rad"
        )
