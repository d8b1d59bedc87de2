"""``[robot.options]`` of the backend ``elastic``."""

from collections.abc import Mapping
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from backends.options import read_options


class ElasticOptions(BaseModel):
    """How soft the joints are, all seven alike."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    frequency_hz: Annotated[float, Field(ge=1.0, le=40.0)] = 12.0
    damping_ratio: Annotated[float, Field(ge=0.05, le=2.0)] = 0.7


def parse_options(options: Mapping[str, object]) -> ElasticOptions:
    """Return the options; raise :class:`ConfigurationError` in one sentence."""
    return read_options(ElasticOptions, options, backend="elastic")
