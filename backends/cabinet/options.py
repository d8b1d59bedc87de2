"""``[robot.options]`` of the backend ``cabinet``."""

from collections.abc import Mapping
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, field_validator

from backends.options import read_options
from hil.values.fri import CLIENT_PORT, OverlayKind, Release
from transport.udp import ANY_HOST, parse_address

_OVERLAYS = (OverlayKind.JOINT_POSITION, OverlayKind.TORQUE, OverlayKind.WRENCH)


class CabinetOptions(BaseModel):
    """Options, checked."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    release: Release = Release.V1_15
    bind: str = f"{ANY_HOST}:{CLIENT_PORT}"
    cabinet: str | None = None
    overlay: OverlayKind = OverlayKind.JOINT_POSITION
    connect_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 10.0
    silence_ms: Annotated[int | None, Field(strict=True, ge=2, le=1000)] = None
    shadow: Annotated[bool, Field(strict=True)] = False

    @field_validator("release", mode="before")
    @classmethod
    def _number_or_text(cls, value: object) -> object:
        # In TOML, and on the command line, a release looks like a number.
        return str(value) if isinstance(value, float) else value

    @field_validator("overlay")
    @classmethod
    def _spoken(cls, overlay: OverlayKind) -> OverlayKind:
        if overlay not in _OVERLAYS:
            raise ValueError(f"the link to a Cabinet speaks {', '.join(_OVERLAYS)}, not {overlay}")
        return overlay

    @field_validator("bind", "cabinet")
    @classmethod
    def _address(cls, text: str | None) -> str | None:
        if text is not None:
            parse_address(text, default_port=CLIENT_PORT, resolve=False)
        return text


def parse_options(options: Mapping[str, object]) -> CabinetOptions:
    """Return the options; raise :class:`ConfigurationError` in one sentence."""
    return read_options(CabinetOptions, options, backend="cabinet")
