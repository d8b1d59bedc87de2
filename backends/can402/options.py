"""``[robot.options]`` of the backend ``can402``."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from backends.options import read_options
from hil.values.robot import JOINT_COUNT

_Node = Annotated[int, Field(strict=True, ge=1, le=126)]


class AxisOptions(BaseModel):
    """What turns the counts of one drive into radians of its axis, and back."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    counts_per_turn: Annotated[int, Field(strict=True, ge=1, le=1 << 30)] = 1 << 20
    """Of the encoder the drive counts with, in one turn of its motor."""
    gear: Annotated[float, Field(gt=0.0, le=10_000.0)] = 100.0
    """Turns of the motor for one of the axis."""
    sign: Annotated[int, Field(strict=True)] = 1
    """-1 where the drive counts against the axis."""
    offset_rad: Annotated[float, Field(ge=-2.0 * math.pi, le=2.0 * math.pi)] = 0.0
    """Position of the axis where the drive counts 0."""
    rated_torque_nm: Annotated[float, Field(gt=0.0, le=10_000.0)] = 100.0
    """At the axis, of which the drive tells thousandths."""

    @model_validator(mode="after")
    def _sign_is_one(self) -> Self:
        if self.sign not in {1, -1}:
            raise ValueError(f"sign is {self.sign}; 1 or -1 is needed")
        return self


class Can402Options(BaseModel):
    """Options, checked."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    interface: Annotated[str, Field(min_length=1, max_length=40)] = "socketcan"
    channel: Annotated[str, Field(min_length=1, max_length=200)] = "can0"
    bitrate: Annotated[int, Field(strict=True, ge=10_000, le=1_000_000)] = 1_000_000
    simulated: Annotated[bool, Field(strict=True)] = False
    eds: Path | None = None
    nodes: Annotated[tuple[_Node, ...], Field(min_length=JOINT_COUNT, max_length=JOINT_COUNT)] = (1, 2, 3, 4, 5, 6, 7)
    axis: tuple[AxisOptions, ...] = (AxisOptions(),) * JOINT_COUNT
    heartbeat_ms: Annotated[int, Field(strict=True, ge=10, le=10_000)] = 100
    enable_timeout_s: Annotated[float, Field(gt=0.0, le=60.0)] = 5.0
    lost_after: Annotated[int, Field(strict=True, ge=1, le=100)] = 3

    @model_validator(mode="before")
    @classmethod
    def _one_axis_for_all(cls, options: Any) -> Any:  # what pydantic was given, of any shape
        if isinstance(options, dict) and isinstance(options.get("axis"), dict):
            return {**options, "axis": [options["axis"]] * JOINT_COUNT}
        return options

    @model_validator(mode="after")
    def _seven_different(self) -> Self:
        twice = sorted({node for node in self.nodes if self.nodes.count(node) > 1})
        if twice:
            raise ValueError(f"node {twice[0]} is there twice; each drive has its own number")
        if len(self.axis) != JOINT_COUNT:
            raise ValueError(f"{len(self.axis)} axis tables; one for all, or one for each of the {JOINT_COUNT} axes")
        return self


def parse_options(options: Mapping[str, object]) -> Can402Options:
    """Return the options; raise :class:`ConfigurationError` in one sentence."""
    return read_options(Can402Options, options, backend="can402")
