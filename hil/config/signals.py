"""``[[robot.io]]``: inputs and outputs of a robot in groups, each ``Group.Name``."""

from enum import StrEnum
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StrictBool, StrictFloat, StrictInt

from hil.values.errors import ConfigurationError
from hil.values.fri import IODirection, IOType
from hil.values.signals import MAX_SIGNALS, Signal


class SignalType(StrEnum):
    """Type of an input or output."""

    BOOLEAN = "boolean"
    DIGITAL = "digital"
    ANALOG = "analog"


class SignalDirection(StrEnum):
    """Direction, seen from the robot."""

    INPUT = "input"
    OUTPUT = "output"


_ZERO: dict[SignalType, bool | int | float] = {
    SignalType.BOOLEAN: False,
    SignalType.DIGITAL: 0,
    SignalType.ANALOG: 0.0,
}


class SignalConfig(BaseModel):
    """``[[robot.io.signal]]``: one input or output."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: Annotated[str, Field(min_length=1, description="name in its group")]
    type: Annotated[SignalType, Field(description="boolean, digital (0 ... 2^64 - 1) or analog")]
    direction: Annotated[
        SignalDirection, Field(description="input (the operator sets it: hil pad io) or output (the FRI client does)")
    ]
    initial: Annotated[
        StrictBool | StrictInt | StrictFloat | None, Field(description="value at the start; default: false or 0")
    ] = None
    fri: Annotated[bool, Field(strict=True, description="whether FRI shows it")] = True


class GroupConfig(BaseModel):
    """``[[robot.io]]``: a group of inputs and outputs."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Annotated[str, Field(min_length=1, description="name of the group, without a dot")]
    signal: Annotated[
        tuple[SignalConfig, ...], Field(max_length=MAX_SIGNALS, description="its inputs and outputs")
    ] = ()


def signals(groups: tuple[GroupConfig, ...]) -> tuple[Signal, ...]:
    """Return what the groups define; raise :class:`ConfigurationError` for the name of a group with a dot."""
    for group in groups:
        if "." in group.name:
            raise ConfigurationError(f"the I/O group {group.name!r} has a dot in its name, which ends it: Group.Name")
    return tuple(
        Signal(
            f"{group.name}.{one.name}",
            IOType[one.type.name],
            IODirection[one.direction.name],
            _ZERO[one.type] if one.initial is None else one.initial,
            one.fri,
        )
        for group in groups
        for one in group.signal
    )
