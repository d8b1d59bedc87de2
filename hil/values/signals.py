"""Inputs and outputs of a robot by name, ``Group.Name``, and what values each type takes.

Inputs come from the robot's periphery, which here is the operator's pad; outputs are set by the FRI client.
"""

import math
from collections.abc import Iterable
from typing import Final, NamedTuple, TypeAlias

from hil.values.errors import ConfigurationError
from hil.values.fri import (
    MAX_DATAGRAM_BYTES,
    MAX_INPUTS_OUTPUTS,
    MAX_NAME_BYTES,
    MAX_TRANSFORMATIONS,
    TRAITS,
    IODirection,
    IOType,
    Release,
)

SignalValue: TypeAlias = bool | int | float
MAX_SIGNALS: Final = 128
_MOST_DIGITAL: Final = (1 << 64) - 1


class Signal(NamedTuple):
    """One input or output."""

    name: str
    """``Group.Name``."""
    type: IOType
    direction: IODirection
    initial: SignalValue
    fri: bool = True
    """Whether FRI lists it."""


def signal_value(type_: IOType, value: SignalValue) -> SignalValue | None:
    """Return ``value`` as its type has it; None when it is none of its values."""
    match type_:
        case IOType.BOOLEAN:
            return bool(value) if value in {0, 1} and not isinstance(value, float) else None
        case IOType.DIGITAL:
            whole = isinstance(value, int) and not isinstance(value, bool)
            return value if whole and 0 <= value <= _MOST_DIGITAL else None
        case IOType.ANALOG:
            if isinstance(value, bool):
                return None
            try:
                number = float(value)
            except OverflowError:
                return None
            return number if math.isfinite(number) else None


def valid_values(type_: IOType) -> str:
    """Return in words what :func:`signal_value` takes."""
    return _VALID[type_]


_VALID: Final = {
    IOType.BOOLEAN: "true or false",
    IOType.DIGITAL: "a whole number 0 ... 2^64 - 1",
    IOType.ANALOG: "a finite number",
}


def check_signals(signals: Iterable[Signal]) -> None:
    """Raise :class:`ConfigurationError` where these cannot be the inputs and outputs of one robot."""
    names: set[str] = set()
    shown = 0
    for signal in signals:
        check_fri_name(signal.name, "an input or output")
        if signal.name in names:
            raise ConfigurationError(f"two inputs or outputs have the name {signal.name!r}; each needs its own")
        names.add(signal.name)
        if signal_value(signal.type, signal.initial) is None:
            raise ConfigurationError(
                f"{signal.name} is {signal.type.name.lower()} and cannot begin with {signal.initial!r}; "
                f"valid: {valid_values(signal.type)}"
            )
        shown += signal.fri
    if shown > MAX_INPUTS_OUTPUTS:
        raise ConfigurationError(
            f"FRI shows {shown} inputs and outputs, {MAX_INPUTS_OUTPUTS} at most; hide the others with fri = false"
        )
    if len(names) > MAX_SIGNALS:
        raise ConfigurationError(f"{len(names)} inputs and outputs, {MAX_SIGNALS} at most")


def check_fri_name(name: str, whose: str) -> None:
    """Raise :class:`ConfigurationError` unless FRI can carry ``name``; ``whose`` it is, with its article."""
    size = len(name.encode(errors="replace"))
    if not 1 <= size <= MAX_NAME_BYTES or not name.isprintable():
        raise ConfigurationError(
            f"the name {name[:80]!r} of {whose} has {size} bytes; valid: printable text of 1 to {MAX_NAME_BYTES} bytes"
        )


def check_transformation_names(names: tuple[str, ...]) -> None:
    """Raise :class:`ConfigurationError` where these cannot be what a client is asked for."""
    if len(names) > MAX_TRANSFORMATIONS:
        raise ConfigurationError(f"{len(names)} transformations, {MAX_TRANSFORMATIONS} at most")
    for name in names:
        check_fri_name(name, "a transformation")
        if names.count(name) > 1:
            raise ConfigurationError(f"two transformations have the name {name!r}; each needs its own")


def check_message_fits(release: Release, signals: Iterable[Signal], transformations: tuple[str, ...]) -> None:
    """Raise :class:`ConfigurationError` where the names make a monitoring message longer than a datagram may be."""
    listed = [signal.name for signal in signals if signal.fri] if TRAITS[release].inputs_outputs else []
    transformation_bytes = _NAMED_BYTES + _DOUBLE_BYTES * TRAITS[release].transformation_values
    size = (
        _MESSAGE_BYTES
        + sum(_SIGNAL_BYTES + len(name.encode()) for name in listed)
        + sum(transformation_bytes + len(name.encode()) for name in transformations)
    )
    if size > MAX_DATAGRAM_BYTES:
        raise ConfigurationError(
            f"monitoring messages with these {len(listed)} inputs and outputs and {len(transformations)} "
            f"transformations may have {size} bytes, {MAX_DATAGRAM_BYTES} at most; shorten or leave out some"
        )


_MESSAGE_BYTES: Final = 600
"""Of a monitoring message without the two; the longest recorded one has 563."""
_NAMED_BYTES: Final = 5
_DOUBLE_BYTES: Final = 9
_SIGNAL_BYTES: Final = 19
"""Beside the name: its own head and that of the message, type, direction, and eleven for the longest digital value."""
