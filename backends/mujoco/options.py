"""``[robot.options]`` of the backend ``mujoco``."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from hil.values.errors import ConfigurationError


class MujocoOptions(BaseModel):
    """Options, checked."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    scene: Path | None = None
    world: Annotated[str | None, Field(min_length=1, max_length=40)] = None


def parse_options(options: Mapping[str, object]) -> MujocoOptions:
    """Return the options; raise :class:`ConfigurationError` in one sentence."""
    try:
        return MujocoOptions.model_validate(dict(options))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        name = ".".join(map(str, first["loc"]))
        if first["type"] == "extra_forbidden":
            known = ", ".join(MujocoOptions.model_fields)
            raise ConfigurationError(f"options of the backend mujoco: there is no {name!r}; valid: {known}") from None
        raise ConfigurationError(
            f"options of the backend mujoco: {name}: {first['msg']}, got {first['input']!r}"
        ) from None
