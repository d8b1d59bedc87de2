"""The choices kept with a station: per renderer the scene, and which robot of it each robot is (manual 6.2).

A small TOML file beside the station file, ``cell.rendering.toml`` for ``cell.toml``; the station file is the user's.
"""

import json
import os
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from hil.values.errors import ConfigurationError

BROWSER = "browser"
COPPELIASIM = "coppeliasim"


class Choices(BaseModel):
    """What was chosen for one renderer."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    scene: Annotated[str, Field(strict=True, max_length=4096, description="scene, as the renderer knows it")] = ""
    devices: Annotated[
        dict[str, str], Field(max_length=16, description="robot of the scene, by the robot of the station")
    ] = {}  # pydantic copies a default


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    browser: Choices = Choices()
    coppeliasim: Choices = Choices()


def choices_path(station: Path) -> Path:
    """Return the file of the choices of a station file."""
    return station.with_name(f"{station.stem}.rendering.toml")


def load_choices(station: Path, renderer: str) -> Choices:
    """Return what was chosen, nothing before the first time; raise :class:`ConfigurationError` for a broken file."""
    chosen: Choices = getattr(_read(choices_path(station)), renderer)
    return chosen


def keep_choices(station: Path, renderer: str, choices: Choices) -> None:
    """Keep what was chosen for a renderer; the others' choices stay.

    Raises :class:`ConfigurationError` for a broken file, which is left as it is, and where it cannot be written.
    """
    path = choices_path(station)
    kept = _read(path)
    if getattr(kept, renderer) == choices:
        return
    new = _File.model_validate({**dict(kept), renderer: choices})
    beside = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        beside.write_text(_toml(new), encoding="utf-8")
        beside.replace(path)
    except OSError as error:
        raise ConfigurationError(f"cannot keep the choices for {station} in {path}: {error.strerror}") from error
    finally:
        with suppress(OSError):
            beside.unlink(missing_ok=True)


def _read(path: Path) -> _File:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return _File()
    except OSError as error:
        raise ConfigurationError(f"cannot read the choices kept in {path}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise _broken(path, f"is no TOML: {error}") from error
    try:
        return _File.model_validate(content)
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        place = ".".join(map(str, problem["loc"]))
        raise _broken(path, f"is not what was kept: {place}: {problem['msg']}") from None


def _broken(path: Path, what: str) -> ConfigurationError:
    return ConfigurationError(f"{path} {what}; repair it, or remove it to choose anew")


def _toml(file: _File) -> str:
    lines = ["# Kept by the rendering connections; the station file itself stays as it is."]
    for renderer, choices in sorted(dict(file).items()):
        if choices != Choices():
            lines += ["", f"[{renderer}]", f"scene = {_quoted(choices.scene)}", *_table(renderer, choices.devices)]
    return "\n".join(lines) + "\n"


def _table(renderer: str, devices: Mapping[str, str]) -> list[str]:
    if not devices:
        return []
    return ["", f"[{renderer}.devices]", *(f"{_quoted(robot)} = {_quoted(devices[robot])}" for robot in devices)]


def _quoted(text: str) -> str:
    # A basic string of TOML is one of JSON, but for DEL, which has to be escaped, and surrogates, which cannot be.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
