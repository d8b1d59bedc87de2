"""What a controller says of a KST link, from the JSON of its pad: whatever is missing or odd there is left out."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from hil.client.pad import PadClient
from hil.clock import Pause
from hil.values.errors import EndpointError
from hil.values.finding import Figure, Finding, Severity, Whose

_NOTHING: Final[Mapping[str, Any]] = {}
_NO_FIGURE: Final = 1e15
"""Nothing that is counted or measured here is as large; NaN is not smaller either."""


@dataclass(frozen=True, slots=True)
class Link:
    """The KST link of a robot, at two moments."""

    robot: str
    before: Mapping[str, Any]
    now: Mapping[str, Any] = field(default_factory=lambda: _NOTHING)

    @property
    def address(self) -> str:
        """Return where it is served."""
        return self.text("address") or "an unknown address"

    def text(self, key: str) -> str:
        """Return a text of the report; empty where there is none."""
        value = self.now.get(key)
        return value if isinstance(value, str) else ""

    def number(self, *keys: str) -> float | None:
        """Return a number of the report, by the keys that lead to it; None where there is none."""
        return _number(self.now, keys)

    def count(self, *keys: str) -> int:
        """Return a counter; 0 where there is none."""
        return int(self.number(*keys) or 0)

    def table(self, *keys: str) -> Mapping[str, Any]:
        """Return an object of the report; an empty one where there is none."""
        return _table(self.now, keys)

    @property
    def set_points_per_s(self) -> float | None:
        """Return the rate between the two moments, by the link's own clock; None where that is not told."""
        first, last = (_number(one, ("counters", "set_points")) for one in (self.before, self.now))
        begun, ended = (_number(one, ("tcp", "seconds")) for one in (self.before, self.now))
        if first is None or last is None or last < first:
            return None
        if last == first:
            return 0.0
        return None if begun is None or ended is None or ended <= begun else (last - first) / (ended - begun)

    def findings(self) -> list[Finding]:
        """Return what the link's own diagnosis found."""
        told = self.table("tcp").get("findings")
        return [_finding(one) for one in told if isinstance(one, dict)] if isinstance(told, list) else []


def ask(socket: Path | None, robot: str | None, *, seconds: float) -> list[Link]:
    """Ask a controller twice, ``seconds`` apart, for its KST links; raise :class:`EndpointError` where it has none."""
    with PadClient(socket, robot=robot) as pad:
        pause = Pause(1.0)
        pause.until(0)
        before = pad.kst()
        pause.until(round(seconds * 1e9))
        return links(before, pad.kst())


def links(before: Mapping[str, object], now: Mapping[str, object]) -> list[Link]:
    """Return the KST links of what was told of each robot; raise :class:`EndpointError` where there is none."""
    found = []
    for robot, told in now.items():
        if isinstance(told, dict):
            earlier = before.get(robot)
            found.append(Link(robot, earlier if isinstance(earlier, dict) else _NOTHING, told))
    if not found:
        names = ", ".join(now) or "no robot"
        raise EndpointError(
            f"the controller has no KST link ({names}): start it with hil run --kst ADDR[:PORT], or with a [robot.kst] "
            f"in its station file"
        )
    return found


def _finding(told: Mapping[str, Any]) -> Finding:
    figures = {
        str(name): value
        for name, value in _table(told, ("figures",)).items()
        if value is None or isinstance(value, bool | int | float | str)
    }
    return Finding(
        kind=_text(told, "kind") or "kst-unnamed",
        severity=_severity(_text(told, "severity")),
        whose=_whose(_text(told, "whose")),
        sentence=_text(told, "sentence") or "a finding without a sentence",
        evidence=_texts(told, "evidence"),
        remedies=_texts(told, "remedies"),
        figures=dict[str, Figure](figures),
    )


def _severity(name: str) -> Severity:
    return next((one for one in Severity if one.name.lower() == name), Severity.NOTE)


def _whose(name: str) -> Whose:
    return next((one for one in Whose if one.value == name), Whose.NOBODY)


def _text(told: Mapping[str, Any], key: str) -> str:
    value = told.get(key)
    return value if isinstance(value, str) else ""


def _texts(told: Mapping[str, Any], key: str) -> tuple[str, ...]:
    value = told.get(key)
    return tuple(one for one in value if isinstance(one, str)) if isinstance(value, list) else ()


def _table(told: Mapping[str, Any], keys: tuple[str, ...]) -> Mapping[str, Any]:
    value: object = told
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    return value if isinstance(value, dict) else _NOTHING


def _number(told: Mapping[str, Any], keys: tuple[str, ...]) -> float | None:
    value = _table(told, keys[:-1]).get(keys[-1])
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < _NO_FIGURE:
        return None
    return float(value)
