"""``[robot.options]`` of the backend ``mujoco``."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, field_validator

from backends.options import read_options


class MujocoOptions(BaseModel):
    """Options, checked."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    scene: Path | None = None
    world: Annotated[str | None, Field(min_length=1, max_length=40)] = None

    @field_validator("scene")
    @classmethod
    def _is_there(cls, scene: Path | None) -> Path | None:
        if scene is not None and not scene.is_file():
            raise ValueError(f"there is no scene file {scene}")
        return scene


def parse_options(options: Mapping[str, object]) -> MujocoOptions:
    """Return the options; raise :class:`ConfigurationError` in one sentence."""
    return read_options(MujocoOptions, options, backend="mujoco")
