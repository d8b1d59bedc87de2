"""Errors of the FRI client.

::

    UsageError           the application author's mistake
    ├── NotAvailable     a value the release does not have, or does not send in the present session state
    ├── CommandShape     a command whose vectors have the wrong number of elements
    └── WrongSignal      an input or output that is read or set as what it is not
    EndpointError
    └── NothingHeard     a run ended without a single monitoring message
"""

from collections.abc import Mapping

from hil.values.errors import EndpointError, UsageError
from hil.values.fri import Release, SessionState
from hil.values.outcomes import Outcome


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


class WrongSignal(UsageError):
    """The input or output ``name`` cannot be read or set so; ``reason`` says what it is."""

    def __init__(self, name: str, reason: str) -> None:
        self.name, self.reason = name, reason
        super().__init__(f"{name}: {reason}")


class NothingHeard(EndpointError):
    """A run ended without a monitoring message of ``release``; ``malformed`` counts what came instead."""

    def __init__(self, release: Release, malformed: Mapping[Outcome, int]) -> None:
        self.release, self.malformed = release, dict(malformed)
        if malformed:
            came = ", ".join(f"{count} {outcome.value}" for outcome, count in malformed.items())
            text = f"no datagram was a monitoring message of release {release.value}: {came}; is it the controller's?"
        else:
            text = "no datagram came: does the controller run, and send to this address and port?"
        super().__init__(text)
