"""State machines as tables: what follows a trigger, what is refused, and the diagram of it for the documentation."""

from collections.abc import Mapping
from enum import Enum, StrEnum
from typing import Generic, TypeVar

from hil.values.errors import IllegalTransition

S = TypeVar("S", bound=Enum)
T = TypeVar("T", bound=StrEnum)


class StateTable(Generic[S, T]):
    """A literal table of (state, trigger) to the next state; it begins in ``initial``."""

    def __init__(self, initial: S, table: Mapping[tuple[S, T], S]) -> None:
        self.initial = initial
        self.table = dict(table)

    def after(self, state: S, trigger: T) -> S:
        """Return the state after ``trigger``; raise :class:`IllegalTransition` where the table has none."""
        try:
            return self.table[state, trigger]
        except KeyError:
            valid = [known.value for origin, known in self.table if origin is state]
            raise IllegalTransition(state.name, trigger.value, valid) from None

    def diagram(self) -> str:
        """Return the table as a Mermaid state diagram."""
        rows = [f"    {old.name} --> {new.name}: {trigger.value}" for (old, trigger), new in self.table.items()]
        return "\n".join(("stateDiagram-v2", f"    [*] --> {self.initial.name}", *rows))
