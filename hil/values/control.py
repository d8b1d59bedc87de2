"""Control modes as values: what each may be set to, and what it is unless set.

Source: ranges and defaults of robot facts 5.1 and 5.2, names of servoing manual 7.10; where neither has a figure it is
ours and says so. Units are the vendor's: Cartesian limits in mm and rad, stiffness in N/m and Nm/rad. Tuples of six
run X, Y, Z, A, B, C: A turns about z, B about y, C about x.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Final, NamedTuple

from hil.values.errors import ConfigurationError, OutOfRange
from hil.values.fri import ControlMode
from hil.values.load import NO_LOAD, Load
from hil.values.motion import ParameterRange
from hil.values.pose import NOWHERE, Pose
from hil.values.robot import JOINT_NAMES, Seven, Six

NO_WRENCH: Final[Six] = (0.0,) * 6
OFF: Final = 1e6
"""A limit of this size limits nothing (facts 5.1)."""


class CartesianDof(StrEnum):
    """One Cartesian degree of freedom."""

    X = "X"
    Y = "Y"
    Z = "Z"
    A = "A"
    B = "B"
    C = "C"


class CartesianPlane(StrEnum):
    """The plane of a pattern of two axes: its first axis, then its second."""

    XY = "XY"
    XZ = "XZ"
    YZ = "YZ"


_DOFS: Final = tuple(dof.value for dof in CartesianDof)
_INDEX: Final = {dof: index for index, dof in enumerate(CartesianDof)}

TRANSLATIONAL_STIFFNESS: Final = ParameterRange("translational stiffness", 0.0, 5000.0, 2000.0, "N/m")
ROTATIONAL_STIFFNESS: Final = ParameterRange("rotational stiffness", 0.0, 300.0, 200.0, "Nm/rad")
CARTESIAN_DAMPING: Final = ParameterRange("damping", 0.1, 1.0, 0.7, "")
NULL_SPACE_STIFFNESS: Final = ParameterRange("null space stiffness", 0.0, math.inf, 100.0, "Nm/rad")
NULL_SPACE_DAMPING: Final = ParameterRange("null space damping", 0.3, 1.0, 0.7, "")
JOINT_STIFFNESS: Final = ParameterRange("joint stiffness", 0.0, math.inf, 1000.0, "Nm/rad")
"""No public default or upper end (facts 5.2): the default is ours. Above about 1e5 the loop at 1 kHz is unstable."""
JOINT_DAMPING: Final = ParameterRange("joint damping", 0.0, 1.0, 0.7, "")
FREQUENCY: Final = ParameterRange("frequency", 0.0, 15.0, 0.0, "Hz")
AMPLITUDE: Final = ParameterRange("amplitude", 0.0, math.inf, 0.0, "N or Nm")
RISE_TIME: Final = ParameterRange("rise time", 0.0, math.inf, 0.0, "s")
FALL_TIME: Final = ParameterRange("fall time", 0.0, math.inf, 0.0, "s")

LISSAJOUS_RATIO: Final = 0.4
"""Frequency of the second axis over that of the first. Ours, no public source: the figure closes after two of five."""


def six(value: float | Sequence[float]) -> Six:
    """Return six floats: the one number six times, or the six given; raise ConfigurationError for another count."""
    numbers = tuple(value) if isinstance(value, Sequence) else (value,) * 6
    if len(numbers) != 6:
        raise ConfigurationError(f"{len(numbers)} values given, X Y Z A B C are 6")
    return numbers


def by_translation(translational: float, rotational: float) -> Six:
    """Return six floats: one number for X, Y and Z, the other for A, B and C."""
    return (translational,) * 3 + (rotational,) * 3


def _each(values: Sequence[float], names: Sequence[str], check: ParameterRange) -> None:
    if len(values) != len(names):
        raise ConfigurationError(f"{check.name}: {len(values)} values given, {' '.join(names)} are {len(names)}")
    for name, value in zip(names, values, strict=True):
        check._replace(name=f"{check.name} {name}").check(value)


def _each_finite(values: Sequence[float], name: str) -> None:
    for dof, value in zip(_DOFS, six(values), strict=True):
        if not math.isfinite(value):
            raise OutOfRange(f"{name} {dof}", value, "finite")


def _each_positive(values: Sequence[float], name: str, unit: str) -> None:
    for dof, value in zip(_DOFS, six(values), strict=True):
        if not (math.isfinite(value) and value > 0.0):
            raise OutOfRange(f"{name} {dof}", value, f"> 0 {unit}")


@dataclass(frozen=True, slots=True)
class PositionControlMode:
    """Stiff, on the set point."""


@dataclass(frozen=True, slots=True)
class JointImpedanceControlMode:
    """Each axis a spring with damping; A1 to A7. Raises OutOfRange with axis, value and range."""

    stiffness_nm_rad: Seven = (JOINT_STIFFNESS.default,) * 7
    damping: Seven = (JOINT_DAMPING.default,) * 7
    """Lehr's damping ratio."""

    def __post_init__(self) -> None:
        _each(self.stiffness_nm_rad, JOINT_NAMES, JOINT_STIFFNESS)
        _each(self.damping, JOINT_NAMES, JOINT_DAMPING)


_STIFFNESS: Final = by_translation(TRANSLATIONAL_STIFFNESS.default, ROTATIONAL_STIFFNESS.default)


@dataclass(frozen=True, slots=True)
class CartesianImpedanceControlMode:
    """The TCP on six springs with damping, along and about the axes of its set point; the elbow on one of its own.

    Raises OutOfRange with parameter, axis, value and range.
    """

    stiffness: Six = _STIFFNESS
    """N/m and Nm/rad."""
    damping: Six = (CARTESIAN_DAMPING.default,) * 6
    """Lehr's damping ratio."""
    null_space_stiffness_nm_rad: float = NULL_SPACE_STIFFNESS.default
    null_space_damping: float = NULL_SPACE_DAMPING.default
    additional_control_force: Six = (0.0,) * 6
    """N and Nm, on top of the springs."""
    max_control_force: Six = (OFF,) * 6
    """N and Nm: the controller never pulls harder."""
    stop_on_max_control_force: bool = False
    """Whether a control force at its maximum is a reason to stop, too."""
    max_cartesian_velocity: Six = (OFF,) * 6
    """mm/s and rad/s: more is a reason to stop."""
    max_path_deviation: Six = (OFF,) * 6
    """mm and rad: more is a reason to stop."""

    def __post_init__(self) -> None:
        _each(self.stiffness[:3], _DOFS[:3], TRANSLATIONAL_STIFFNESS)
        _each(self.stiffness[3:], _DOFS[3:], ROTATIONAL_STIFFNESS)
        _each(self.damping, _DOFS, CARTESIAN_DAMPING)
        NULL_SPACE_STIFFNESS.check(self.null_space_stiffness_nm_rad)
        NULL_SPACE_DAMPING.check(self.null_space_damping)
        _each_finite(self.additional_control_force, "additional control force")
        _each_positive(self.max_control_force, "max control force", "N or Nm")
        _each_positive(self.max_cartesian_velocity, "max Cartesian velocity", "mm/s or rad/s")
        _each_positive(self.max_path_deviation, "max path deviation", "mm or rad")


@dataclass(frozen=True, slots=True)
class ForceOscillation:
    """A force over the springs: ``bias + amplitude sin(2 pi frequency t + phase)`` of each axis, in N and Nm.

    It fades in linearly within the rise time, stays for the hold time, and fades out linearly within the fall time; the
    bias with it, so that it begins and ends without a step where these times are not 0. Raises OutOfRange.
    """

    amplitude: Six = (AMPLITUDE.default,) * 6
    frequency_hz: Six = (FREQUENCY.default,) * 6
    phase_deg: Six = (0.0,) * 6
    bias: Six = (0.0,) * 6
    force_limit: Six = (OFF,) * 6
    """N and Nm: what the sum of bias and sine is cut off at."""
    position_limit: Six = (OFF,) * 6
    """mm and rad: an axis this far off its set point is not pushed farther; pushed back it is."""
    rise_time_s: float = RISE_TIME.default
    hold_time_s: float = math.inf
    """Infinite: for ever."""
    fall_time_s: float = FALL_TIME.default

    def __post_init__(self) -> None:
        _each(self.amplitude, _DOFS, AMPLITUDE)
        _each(self.frequency_hz, _DOFS, FREQUENCY)
        _each_finite(self.phase_deg, "phase")
        _each_finite(self.bias, "bias")
        _each_positive(self.force_limit, "force limit", "N or Nm")
        _each_positive(self.position_limit, "position limit", "mm or rad")
        RISE_TIME.check(self.rise_time_s)
        FALL_TIME.check(self.fall_time_s)
        if not self.hold_time_s >= 0.0:
            raise OutOfRange("hold time", self.hold_time_s, ">= 0 s")


@dataclass(frozen=True, slots=True)
class CartesianSineImpedanceControlMode:
    """Cartesian impedance with a superposed force oscillation."""

    impedance: CartesianImpedanceControlMode = field(default_factory=CartesianImpedanceControlMode)
    oscillation: ForceOscillation = field(default_factory=ForceOscillation)


ControlModeSettings = (
    PositionControlMode | JointImpedanceControlMode | CartesianImpedanceControlMode | CartesianSineImpedanceControlMode
)


POSITION_CONTROL: Final = PositionControlMode()


class ControlSetup(NamedTuple):
    """What a motion is controlled with: the mode, the load the law reckons with, and where its TCP is."""

    mode: ControlModeSettings = POSITION_CONTROL
    load: Load = NO_LOAD
    """In the flange, as told; the true one may be another."""
    tcp_in_flange: Pose = NOWHERE

    @property
    def kind(self) -> ControlMode:
        """What FRI calls it."""
        return _KINDS[type(self.mode)]

    @property
    def yields(self) -> bool:
        """Whether the arm gives way to forces, so that it need not be where its set point is."""
        return type(self.mode) is not PositionControlMode


_KINDS: Final[dict[type[ControlModeSettings], ControlMode]] = {
    PositionControlMode: ControlMode.POSITION,
    JointImpedanceControlMode: ControlMode.JOINT_IMPEDANCE,
    CartesianImpedanceControlMode: ControlMode.CARTESIAN_IMPEDANCE,
    CartesianSineImpedanceControlMode: ControlMode.CARTESIAN_IMPEDANCE,
}


def create_desired_force(dof: CartesianDof, force: float, stiffness: float) -> CartesianSineImpedanceControlMode:
    """Return the mode with a constant force of N or Nm along one axis, which has that stiffness."""
    return _pattern({dof: stiffness}, ForceOscillation(bias=_put({dof: force}, 0.0)))


def create_sine_pattern(
    dof: CartesianDof, frequency_hz: float, amplitude: float, stiffness: float
) -> CartesianSineImpedanceControlMode:
    """Return the mode with a sine of N or Nm along one axis, which has that stiffness."""
    return _pattern(
        {dof: stiffness},
        ForceOscillation(amplitude=_put({dof: amplitude}, 0.0), frequency_hz=_put({dof: frequency_hz}, 0.0)),
    )


def create_lissajous_pattern(
    plane: CartesianPlane, frequency_hz: float, amplitude_n: float, stiffness_n_m: float
) -> CartesianSineImpedanceControlMode:
    """Return the mode with a Lissajous figure: the second axis of the plane at 0.4 times the first one's frequency."""
    first, second = map(CartesianDof, plane.value)
    return _pattern(
        dict.fromkeys((first, second), stiffness_n_m),
        ForceOscillation(
            amplitude=_put(dict.fromkeys((first, second), amplitude_n), 0.0),
            frequency_hz=_put({first: frequency_hz, second: LISSAJOUS_RATIO * frequency_hz}, 0.0),
        ),
    )


def create_spiral_pattern(
    plane: CartesianPlane, frequency_hz: float, amplitude_n: float, stiffness_n_m: float, total_time_s: float
) -> CartesianSineImpedanceControlMode:
    """Return the mode with a spiral: circles of force that grow for half the total time and shrink for the other.

    How the vendor shares out the total time is not public; halves are ours.
    """
    first, second = map(CartesianDof, plane.value)
    ParameterRange("total time", 0.0, math.inf, 0.0, "s").check(total_time_s)
    return _pattern(
        dict.fromkeys((first, second), stiffness_n_m),
        ForceOscillation(
            amplitude=_put(dict.fromkeys((first, second), amplitude_n), 0.0),
            frequency_hz=_put(dict.fromkeys((first, second), frequency_hz), 0.0),
            phase_deg=_put({second: 90.0}, 0.0),
            rise_time_s=total_time_s / 2.0,
            hold_time_s=0.0,
            fall_time_s=total_time_s / 2.0,
        ),
    )


def _put(values: dict[CartesianDof, float], rest: float | Six) -> Six:
    numbers = list(six(rest))
    for dof, value in values.items():
        numbers[_INDEX[dof]] = value
    return six(numbers)


def _pattern(stiffness: dict[CartesianDof, float], oscillation: ForceOscillation) -> CartesianSineImpedanceControlMode:
    plain = CartesianImpedanceControlMode()
    return CartesianSineImpedanceControlMode(replace(plain, stiffness=_put(stiffness, plain.stiffness)), oscillation)
