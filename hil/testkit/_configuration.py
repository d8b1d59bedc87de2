"""From ``@pytest.mark.hil(...)`` to a station: keys of the station file, laid over a file or over our defaults.

Of the keys of the whole station there is ``capture``; the others are those of the robot.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from hil.config.station import RobotConfig, Station, parse_station, robot_keys
from hil.values.errors import ConfigurationError

DEFAULT_LIMIT_S: Final = 120.0
_WHERE: Final = "@pytest.mark.hil"
_DEFAULTS: Final[Mapping[str, Any]] = {"backend": "ideal", "fri": {}, "servo": {}}
"""Without a station file: both links, and the arm that costs least."""
_OURS: Final = frozenset({"station", "robot_name", "limit_s", "robot", "capture"})
_SECTIONS: Final = frozenset({"fri", "servo", "kst", "limits", "reaction", "base", "load", "options"})
"""Keys whose value is a section: what a closer mark says of it is laid over what a farther one says."""


@dataclass(frozen=True, slots=True)
class Chosen:
    """What a test asks for."""

    station: Station
    """With one robot."""
    limit_s: float

    @property
    def robot(self) -> RobotConfig:
        """The robot."""
        return self.station.robot[0]


def configuration(marks: Sequence[tuple[tuple[Any, ...], Mapping[str, Any]]], *, folders: Sequence[Path]) -> Chosen:
    """Return what the arguments of ``marks`` (closest first) say; a station file is looked for in ``folders``.

    Raises :class:`ConfigurationError` or :class:`UnknownName`.
    """
    keys: dict[str, Any] = {}
    for positional, named in reversed(marks):
        given = dict(named)
        if positional:
            if len(positional) > 1 or "station" in given:
                raise ConfigurationError(f"{_WHERE}: one station file at most, beside keys by name")
            given["station"] = positional[0]
        for key, value in given.items():
            keys[key] = _laid_over(keys.get(key), key, value)
    ours = {key: keys.pop(key) for key in _OURS & keys.keys()}
    if "robot" in ours:
        keys["model"] = ours["robot"]
    robot = dict(_DEFAULTS)
    if "station" in ours:
        robot = _robot_of(ours["station"], ours.get("robot_name"), folders)
    for key, value in keys.items():
        robot[key] = _laid_over(robot.get(key), key, value)
    content = {"robot": [robot], "pad": "off", **{key: str(ours[key]) for key in ("capture",) if key in ours}}
    station = parse_station(content, where=_WHERE)
    return Chosen(station, float(ours.get("limit_s", DEFAULT_LIMIT_S)))


def _laid_over(before: object, key: str, value: object) -> object:
    if key in _SECTIONS and isinstance(before, Mapping) and isinstance(value, Mapping):
        return {**before, **value}
    return value


def _robot_of(station: str | Path, name: str | None, folders: Sequence[Path]) -> dict[str, Any]:
    path = next((found for folder in folders if (found := folder / station).is_file()), Path(station))
    return robot_keys(path, name, where=_WHERE)
