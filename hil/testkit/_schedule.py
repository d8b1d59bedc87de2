"""What is to happen while an application has the calling thread: at a time, or as soon as something holds."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(eq=False)
class Order:
    """One action that is to come: when ``condition`` holds, or at ``at_ns``; ``what`` is for people."""

    what: str
    action: Callable[[], object]
    at_ns: int = 0
    condition: Callable[[], bool] | None = None

    def due(self, now_ns: int) -> bool:
        """Whether it is time."""
        return now_ns >= self.at_ns if self.condition is None else self.condition()


class Schedule:
    """Orders that wait; each is carried out once."""

    def __init__(self) -> None:
        self.waiting: list[Order] = []

    def carry_out(self, *, now_ns: int) -> None:
        """Do all that is due, in the order it was asked for."""
        if not self.waiting:
            return
        for order in tuple(self.waiting):
            if order.due(now_ns):
                self.waiting.remove(order)
                order.action()
