"""Errors of the FRI client; both are the application author's mistakes.

::

    UsageError
    ├── NotAvailable     a value the release does not have, or does not send in the present session state
    └── CommandShape     a command whose vectors have the wrong number of elements
"""

from hil.values.errors import UsageError
from hil.values.fri import Release, SessionState


class NotAvailable(UsageError):
    """``what`` does not exist in ``release``, or not in the session state ``state``; ``reason`` says which."""

    def __init__(self, what: str, *, release: Release, state: SessionState, reason: str) -> None:
        self.what, self.release, self.state, self.reason = what, release, state, reason
        super().__init__(f"there is no {what} in FRI {release.value} in session state {state.name}: {reason}")


class CommandShape(UsageError):
    """``field`` of a command has ``got`` elements where ``want`` are needed."""

    def __init__(self, field: str, *, got: int, want: int) -> None:
        self.field, self.got, self.want = field, got, want
        super().__init__(f"{field} of a command has {got} elements, {want} are needed")
