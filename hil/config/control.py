"""``[robot.fri.control]``: what the arm is controlled with while an FRI client commands it."""

from enum import StrEnum
from typing import Annotated, Any, Final

from pydantic import BaseModel, ConfigDict, Field

from hil.core.settings import NEEDED_CONTROL
from hil.values.control import (
    POSITION_CONTROL,
    CartesianImpedanceControlMode,
    ControlModeSettings,
    JointImpedanceControlMode,
)
from hil.values.errors import ConfigurationError
from hil.values.fri import ControlMode, OverlayKind


class ControlName(StrEnum):
    """What the arm is controlled with."""

    POSITION = "position"
    JOINT_IMPEDANCE = "joint-impedance"
    CARTESIAN_IMPEDANCE = "cartesian-impedance"


_FITTING: Final = {
    ControlMode.JOINT_IMPEDANCE: ControlName.JOINT_IMPEDANCE,
    ControlMode.CARTESIAN_IMPEDANCE: ControlName.CARTESIAN_IMPEDANCE,
}
_JOINT: Final = {"stiffness": "stiffness_nm_rad", "damping": "damping"}
"""Keys of joint impedance, and what the value class calls them."""
_CARTESIAN_ONLY: Final = (
    "null_space_stiffness_nm_rad",
    "null_space_damping",
    "additional_control_force",
    "max_control_force",
    "stop_on_max_control_force",
    "max_cartesian_velocity",
    "max_path_deviation",
)
_KEYS: Final[dict[ControlName, dict[str, str]]] = {
    ControlName.POSITION: {},
    ControlName.JOINT_IMPEDANCE: _JOINT,
    ControlName.CARTESIAN_IMPEDANCE: {key: key for key in ("stiffness", "damping", *_CARTESIAN_ONLY)},
}

Numbers = Annotated[tuple[float, ...], Field(min_length=6, max_length=7)]


class ControlConfig(BaseModel):
    """Parameters and their ranges are those of the value classes of :mod:`hil.values.control`; unset: their default."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    mode: Annotated[
        ControlName | None,
        Field(description="position, joint-impedance, cartesian-impedance; default: what the overlay needs"),
    ] = None
    stiffness: Annotated[
        Numbers | None, Field(description="A1..A7 in Nm/rad, or X Y Z A B C in N/m and Nm/rad, by the mode")
    ] = None
    damping: Annotated[Numbers | None, Field(description="damping ratios, A1..A7 or X Y Z A B C")] = None
    null_space_stiffness_nm_rad: Annotated[float | None, Field(description="Cartesian impedance: of the elbow")] = None
    null_space_damping: Annotated[float | None, Field(description="Cartesian impedance: of the elbow")] = None
    additional_control_force: Annotated[Numbers | None, Field(description="X Y Z A B C, N and Nm")] = None
    max_control_force: Annotated[Numbers | None, Field(description="X Y Z A B C, N and Nm")] = None
    stop_on_max_control_force: Annotated[
        bool | None, Field(strict=True, description="whether a control force at its maximum stops the arm")
    ] = None
    max_cartesian_velocity: Annotated[Numbers | None, Field(description="X Y Z A B C, mm/s and rad/s")] = None
    max_path_deviation: Annotated[Numbers | None, Field(description="X Y Z A B C, mm and rad")] = None

    def name_for(self, overlay: OverlayKind) -> ControlName:
        """Return the mode that is meant: the one that was given, else the one the overlay needs."""
        if self.mode is not None:
            return self.mode
        needed = NEEDED_CONTROL.get(overlay)
        return ControlName.POSITION if needed is None else _FITTING[needed]

    def settings(self, overlay: OverlayKind) -> ControlModeSettings:
        """Return the mode with its parameters; raise :class:`ConfigurationError` for one that is not its own."""
        name = self.name_for(overlay)
        given: dict[str, Any] = self.model_dump(exclude={"mode"}, exclude_none=True)
        known = _KEYS[name]
        for key in given:
            if key not in known:
                own = f"its parameters are {', '.join(known)}" if known else "it has no parameters"
                raise ConfigurationError(f"{key} is no parameter of the control mode {name}; {own}")
        parameters = {known[key]: value for key, value in given.items()}
        match name:
            case ControlName.POSITION:
                return POSITION_CONTROL
            case ControlName.JOINT_IMPEDANCE:
                return JointImpedanceControlMode(**parameters)
            case ControlName.CARTESIAN_IMPEDANCE:
                return CartesianImpedanceControlMode(**parameters)
