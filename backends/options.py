"""``[robot.options]`` of a backend, checked by its pydantic model, with errors in one sentence."""

from collections.abc import Mapping
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from hil.values.errors import ConfigurationError

_M = TypeVar("_M", bound=BaseModel)


def read_options(model: type[_M], options: Mapping[str, object], *, backend: str) -> _M:
    """Return the options as ``model`` reads them; raise :class:`ConfigurationError` for what it does not take."""
    try:
        return model.model_validate(dict(options))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
    name = ".".join(map(str, first["loc"]))
    if first["type"] == "extra_forbidden":
        known = ", ".join(model.model_fields)
        raise ConfigurationError(f"options of the backend {backend}: there is no {name!r}; valid: {known}")
    where = f"{name}: " if name else ""
    got = "" if first["type"] == "value_error" else f", got {first['input']!r}"
    message = str(first["msg"]).removeprefix("Value error, ")
    raise ConfigurationError(f"options of the backend {backend}: {where}{message}{got}")
