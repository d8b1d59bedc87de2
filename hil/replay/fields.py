"""Two messages compared field by field, and told in the words of the field: "A3 commanded +0.2 mrad"."""

import enum
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from hil.values.robot import JOINT_COUNT, JOINT_NAMES

_WORDS: Final = {
    "measured_position": "measured",
    "commanded_position": "commanded",
    "measured_torque": "measured torque",
    "commanded_torque": "commanded torque",
    "external_torque": "external torque",
    "external_force": "external force",
    "monitor measured_pose values": "measured pose",
    "command pose values": "commanded pose",
    "ipo position": "interpolator",
    "ipo pose values": "interpolator pose",
    "command position": "commanded",
    "command torque": "commanded torque",
    "command wrench": "commanded wrench",
    "drive_states": "drive state",
    "flange_speed_mm_s": "flange speed",
    "point_m": "point",
    "force_n": "force",
    "connection": "",
    "robot": "",
    "monitor": "",
    "snapshot": "",
}
"""What a person calls a field; what is not here is called by its name."""
_BY_JOINT: Final = {
    **dict.fromkeys(("measured_position", "commanded_position", "position", "destination"), "rad"),
    **dict.fromkeys(("measured_torque", "commanded_torque", "external_torque", "torque"), "Nm"),
    "drive_states": "",
}
"""Units of what has a value for each joint."""
_UNITS: Final = (("_ns", "ns"), ("_ms", "ms"), ("_mm_s", "mm/s"), ("_s", "s"), ("_m", "m"), ("_n", "N"))
"""Units of fields that say theirs, longer endings first."""
_WRENCH: Final = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
_WRENCHES: Final = frozenset({"external_force", "wrench", "flange_force"})
_THREES: Final = frozenset({"point_m", "force_n"})
_POSE_7: Final = ("tx", "ty", "tz", "qw", "qx", "qy", "qz")
_MRAD: Final = 1e3
_MOST_SHOWN: Final = 60


class FieldDifference(NamedTuple):
    """One field that is not the same."""

    name: str
    """In words, with the axis."""
    unit: str
    recorded: object
    """None where the recording has no such field."""
    emulated: object

    @property
    def change(self) -> float | None:
        """Return emulator minus recording; None where that is no number."""
        both = self.recorded, self.emulated
        if any(isinstance(value, bool | enum.Enum) or not isinstance(value, int | float) for value in both):
            return None
        return float(self.emulated) - float(self.recorded)  # type: ignore[arg-type]

    def told(self, other: str = "emulator") -> str:
        """Return it in words; ``other`` is who was compared with the recording."""
        change = self.change
        if change is None or not isinstance(self.recorded, float):
            return f"{self.name}: recorded {_shown(self.recorded)}, {other} {_shown(self.emulated)}"
        return f"{self.name} {_with_unit(change, self.unit)} (recorded {self.recorded!r}, {other} {self.emulated!r})"

    def __str__(self) -> str:
        return self.told()


def differences(recorded: object, emulated: object) -> Iterator[FieldDifference]:
    """Yield the fields in which two messages of one kind are not the same, in the order of the message."""
    if type(recorded) is not type(emulated):
        yield FieldDifference("message", "", type(recorded).__name__, type(emulated).__name__)
        return
    yield from _compare((), recorded, emulated)


def _compare(path: tuple[str, ...], recorded: Any, emulated: Any) -> Iterator[FieldDifference]:
    if recorded == emulated and type(recorded) is type(emulated):
        return
    if _is_record(recorded) and type(recorded) is type(emulated):
        for name, one, other in zip(recorded._fields, recorded, emulated, strict=True):
            yield from _compare((*path, name), one, other)
    elif isinstance(recorded, tuple) and isinstance(emulated, tuple) and len(recorded) == len(emulated):
        for place, (one, other) in enumerate(zip(recorded, emulated, strict=True)):
            if one != other:
                yield from _compare((*path, str(place)), one, other)
    elif recorded != emulated or type(recorded) is not type(emulated):
        yield FieldDifference(*_named(path), recorded, emulated)


def _is_record(value: object) -> bool:
    return isinstance(value, tuple) and hasattr(value, "_fields")


def _named(path: tuple[str, ...]) -> tuple[str, str]:
    """Return the words for a field, and its unit."""
    place = path[-1] if path and path[-1].isdigit() else None
    names = path[:-1] if place is not None else path
    field = names[-1] if names else "message"
    element, unit = _element(field, names, None if place is None else int(place))
    words = _words(names)
    return (f"{element} {words}".strip(), unit)


def _words(names: tuple[str, ...]) -> str:
    for start in range(len(names)):
        if (whole := _WORDS.get(" ".join(names[start:]))) is not None and start < len(names):
            before = [_word(name) for name in names[:start]]
            return " ".join(filter(None, [*before, whole]))
    return " ".join(filter(None, map(_word, names))) or "message"


def _word(name: str) -> str:
    return _WORDS.get(name, name.replace("_", " "))


def _element(field: str, names: tuple[str, ...], place: int | None) -> tuple[str, str]:
    """Return what a part of a vector is called, and its unit."""
    unit = next((unit for ending, unit in _UNITS if field.endswith(ending)), "")
    if place is None:
        return "", unit
    if field in _BY_JOINT and place < JOINT_COUNT:
        return JOINT_NAMES[place], _BY_JOINT[field]
    if field in _WRENCHES and place < len(_WRENCH):
        return _WRENCH[place], "N" if place < 3 else "Nm"
    if field in _THREES and place < len("xyz"):
        return "xyz"[place], unit
    if field == "values" and "pose" in "".join(names) and place < len(_POSE_7):
        return _POSE_7[place], "mm" if place < 3 else ""
    return f"[{place}]", unit


def _with_unit(change: float, unit: str) -> str:
    return f"{change * _MRAD:+.6g} mrad" if unit == "rad" else f"{change:+.6g} {unit}".strip()


def _shown(value: object) -> str:
    if value is None:
        return "nothing"
    text = value.name if isinstance(value, enum.Enum) else str(value)
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."
