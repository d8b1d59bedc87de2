"""The inputs and outputs of one robot: their values, and who may set which."""

from collections.abc import Sequence

from hil.core.counters import EVENT_INTERVAL_NS
from hil.core.events import OutputChanged
from hil.values.fri import IODirection, IOType
from hil.values.fri_messages import IOValue
from hil.values.signals import Signal, SignalValue, signal_value, valid_values


class SignalTable:
    """Values by name. The operator's side sets inputs, the FRI client sets outputs; both are judged before."""

    def __init__(self, signals: Sequence[Signal] = ()) -> None:
        self._signals = {signal.name: signal for signal in signals}
        self._values: dict[str, SignalValue] = {
            signal.name: _checked(signal.type, signal.initial) for signal in signals
        }
        self._listed = [signal for signal in signals if signal.fri]
        self._on_wire: tuple[IOValue, ...] | None = None
        self._unreported = dict.fromkeys(self._signals, 0)
        self._told_before_ns = dict.fromkeys(self._signals, 0)

    def set_input(self, name: str, value: SignalValue) -> str:
        """Set an input; return why that changes nothing, or an empty text."""
        signal = self._signals.get(name)
        inputs = [one.name for one in self._signals.values() if one.direction is IODirection.INPUT]
        if signal is None:
            return f"there is no input {name[:80]!r}; valid: {_shown(inputs)}"
        if signal.direction is not IODirection.INPUT:
            return f"{name} is an output, which the FRI client sets; inputs: {_shown(inputs)}"
        taken = signal_value(signal.type, value)
        if taken is None:
            return (
                f"{name} is {signal.type.name.lower()}, {str(value)[:40]} is none of its values; "
                f"valid: {valid_values(signal.type)}"
            )
        self._set(name, taken)
        return ""

    def listed(self, name: str) -> Signal | None:
        """Return the signal that FRI lists under ``name``."""
        signal = self._signals.get(name)
        return signal if signal is not None and signal.fri else None

    def set_output(self, name: str, value: SignalValue, *, now_ns: int) -> OutputChanged | None:
        """Set an output to what :func:`signal_value` gave; return an event when one is due: one a second for each."""
        before = self._values[name]
        if value == before:
            return None
        self._set(name, value)
        self._unreported[name] += 1
        if now_ns < self._told_before_ns[name]:
            return None
        self._told_before_ns[name] = now_ns + EVENT_INTERVAL_NS
        count, self._unreported[name] = self._unreported[name], 0
        return OutputChanged(now_ns, name, before, value, count)

    def on_wire(self) -> tuple[IOValue, ...]:
        """Return what FRI lists, with its values."""
        if self._on_wire is None:
            self._on_wire = tuple(_io_value(signal, self._values[signal.name]) for signal in self._listed)
        return self._on_wire

    def report(self) -> dict[str, dict[str, object]]:
        """Return type, direction, value and whether FRI lists it, by name."""
        return {
            name: {
                "type": signal.type.name.lower(),
                "direction": signal.direction.name.lower(),
                "value": self._values[name],
                "fri": signal.fri,
            }
            for name, signal in self._signals.items()
        }

    def _set(self, name: str, value: SignalValue) -> None:
        self._values[name] = value
        self._on_wire = None


def _checked(type_: IOType, initial: SignalValue) -> SignalValue:
    value = signal_value(type_, initial)
    return initial if value is None else value


def _io_value(signal: Signal, value: SignalValue) -> IOValue:
    if signal.type is IOType.ANALOG:
        return IOValue(signal.name, signal.type, signal.direction, analog=float(value))
    return IOValue(signal.name, signal.type, signal.direction, digital=int(value))


def _shown(names: list[str], most: int = 8) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return (", ".join(names[:most]) or "none") + more
