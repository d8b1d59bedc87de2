"""Outputs in a command: judged all together, then set."""

import math
from collections.abc import Callable

from hil.core.events import Event
from hil.core.fri.commands import Refusal
from hil.core.signals import SignalTable
from hil.values.fri import MAX_INPUTS_OUTPUTS, IODirection, IOType
from hil.values.fri_messages import IOValue
from hil.values.outcomes import Outcome
from hil.values.signals import Signal, signal_value, valid_values

_TYPES = frozenset(IOType)


class ClientOutputs:
    """What the FRI client sets. ``emit`` takes events."""

    def __init__(self, signals: SignalTable, *, emit: Callable[[Event], None]) -> None:
        self._signals = signals
        self._emit = emit

    @property
    def any(self) -> bool:
        """Whether there are outputs that the client could set."""
        return any(io.direction == IODirection.OUTPUT for io in self._signals.on_wire())

    def refusal(self, values: tuple[IOValue, ...]) -> Refusal | None:
        """Return why these cannot be set, or None."""
        if len(values) > MAX_INPUTS_OUTPUTS:
            return Refusal(
                Outcome.SHAPE, f"the command carries {len(values)} outputs, {MAX_INPUTS_OUTPUTS} are allowed"
            )
        for value in values:
            if refusal := self._refused(value):
                return refusal
        return None

    def take(self, values: tuple[IOValue, ...], *, now_ns: int) -> None:
        """Set what :meth:`refusal` found nothing against."""
        for value in values:
            number = value.analog if value.type == IOType.ANALOG else value.digital
            taken = None if number is None else signal_value(IOType(value.type), number)
            if taken is not None:
                event = self._signals.set_output(value.name, taken, now_ns=now_ns)
                if event is not None:
                    self._emit(event)

    def _refused(self, value: IOValue) -> Refusal | None:
        name = value.name
        signal = self._signals.listed(name)
        if signal is None:
            listed = ", ".join(io.name for io in self._signals.on_wire() if io.direction == IODirection.OUTPUT)
            return Refusal(
                Outcome.NOT_ALLOWED,
                f"the command sets {name[:80]!r}, which the controller does not list; outputs: {listed or 'none'}",
            )
        if signal.direction is not IODirection.OUTPUT or value.direction != IODirection.OUTPUT:
            which = "an input" if signal.direction is not IODirection.OUTPUT else "an output, not an input"
            return Refusal(
                Outcome.NOT_ALLOWED, f"the command sets {name}, which is {which}; a client may set outputs only"
            )
        if value.type != signal.type:
            theirs = IOType(value.type).name.lower() if value.type in _TYPES else f"of type {value.type}"
            return Refusal(
                Outcome.NOT_ALLOWED, f"the command sets {name} as {theirs}; it is {signal.type.name.lower()}"
            )
        return _wrong_value(value, signal)


def _wrong_value(value: IOValue, signal: Signal) -> Refusal | None:
    name = value.name
    number = value.analog if signal.type is IOType.ANALOG else value.digital
    if number is None:
        return Refusal(Outcome.SHAPE, f"the command sets {name} without a value of its type")
    if isinstance(number, float) and not math.isfinite(number):
        return Refusal(Outcome.NOT_FINITE, f"the command sets {name} to {number}")
    if signal_value(signal.type, number) is None:
        return Refusal(
            Outcome.SHAPE,
            f"the command sets {name}, which is {signal.type.name.lower()}, to {number}; "
            f"valid: {valid_values(signal.type)}",
        )
    return None
