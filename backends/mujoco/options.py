"""``[robot.options]`` of the backend ``mujoco``."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from backends.options import read_options


class MujocoOptions(BaseModel):
    """Options, checked."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    scene: Path | None = None
    world: Annotated[str | None, Field(min_length=1, max_length=40)] = None


def parse_options(options: Mapping[str, object]) -> MujocoOptions:
    """Return the options; raise :class:`ConfigurationError` in one sentence."""
    return read_options(MujocoOptions, options, backend="mujoco")
