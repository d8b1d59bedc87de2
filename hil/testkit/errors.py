"""Errors of the test kit.

::

    HilError
    ├── UsageError
    │   └── VirtualTimeOver    an application, or a test, waits for what does not come
    ├── NeverHappened          what a test arranged for did not happen, so that it shows nothing
    └── ProcessFailed          a controller process did not start, or not end in order
"""

from collections.abc import Sequence

from hil.core.events import Event
from hil.values.errors import HilError, UsageError

_EVENTS_TOLD = 5


class VirtualTimeOver(UsageError):
    """Somebody waits beyond the limit of ``limit_ns``; ``events`` is what happened up to there."""

    def __init__(self, limit_ns: int, events: Sequence[Event]) -> None:
        self.limit_ns, self.events = limit_ns, tuple(events)
        super().__init__(
            f"virtual time reached its limit of {limit_ns / 1e9:g} s: what the application or the test waits for does "
            f"not come (limit: @pytest.mark.hil(limit_s=...)); last events: {told(events)}"
        )


class NeverHappened(HilError):
    """``what`` a test arranged for did not happen."""


class ProcessFailed(HilError):
    """A controller process did not start, or not end in order; the text has what it said."""


def told(events: Sequence[Event]) -> str:
    """Return the last events in words."""
    last = list(events)[-_EVENTS_TOLD:]
    return "; ".join(f"[{event.at_ns / 1e9:.3f} s] {event}" for event in last) or "none"
