"""When each message was due, from when they passed: a straight line over the sequence counters that a few cannot move.

The controller's clock is not the recorder's, and nobody tells where the grid begins. So the line follows the messages
by a small step each: as many lie before it as behind it, however far a late one is off. It is put anew where a row of
messages lies apart from it, as when the controller stood still.
"""

from typing import Final

_FIRST: Final = 100
"""Messages in which the line may still be far off."""
_ROW: Final = 5
_FIRST_STEPS, _STEPS = 50, 1000
"""Parts of a period that the line moves for a message: at first, and then, which follows clocks 0.1 % apart."""


class SendGrid:
    """Of one session; times in nanoseconds, ``period_ns`` nominal."""

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._due_ns: int | None = None
        self._counted = 0
        self._row: list[int] = []
        self.shifts = 0
        """How often it was put anew."""

    def due_ns(self, steps: int, at_ns: int) -> int:
        """Return when the message was due that passed at ``at_ns``, ``steps`` counters behind the one before."""
        if self._due_ns is None:
            self._due_ns = at_ns
            return at_ns
        due_ns = self._due_ns + steps * self._period_ns
        off_ns = at_ns - due_ns
        self._counted += 1
        step_ns = self._period_ns // (_FIRST_STEPS if self._counted < _FIRST else _STEPS)
        due_ns += min(max(off_ns, -step_ns), step_ns)
        if 4 * abs(off_ns) > self._period_ns and (not self._row or (self._row[0] > 0) is (off_ns > 0)):
            self._row.append(off_ns)
        else:
            self._row.clear()
        if len(self._row) >= _ROW:
            due_ns += sorted(self._row)[_ROW // 2]
            self._row.clear()
            self.shifts += 1
        self._due_ns = due_ns
        return due_ns
