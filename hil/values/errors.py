"""The one tree of errors.

::

    HilError
    ├── UsageError (also ValueError)     the caller's mistake: command line, station file, argument
    │   ├── UnknownName                  a name that is not in the list it was looked up in
    │   ├── ConfigurationError           a value or a pairing of values that cannot work
    │   │   └── OutOfRange               a number outside the range its parameter has
    │   └── IllegalTransition            an event a state machine does not know in its state
    ├── PeerError                        the other side's fault: counted, never ends a loop
    │   └── MalformedDatagram            bytes that are not a message of the configured release
    ├── EndpointError                    an address that cannot be bound or reached
    └── BackendError                     the robot side failed: ends the session, cause chained

Every message says what, where, the value, and what would have been valid.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from hil.values.outcomes import Outcome

if TYPE_CHECKING:
    from hil.values.fri import Release


class HilError(Exception):
    """Root of every error this project raises on purpose."""


class UsageError(HilError, ValueError):
    """The caller's mistake; the command line ends with exit code 2."""


class UnknownName(UsageError):
    """``name`` is none of the ``valid`` names of a ``kind``."""

    def __init__(self, kind: str, name: str, valid: Iterable[str]) -> None:
        self.kind, self.name, self.valid = kind, name, tuple(valid)
        super().__init__(f"unknown {kind} {name!r}; valid: {', '.join(self.valid)}")


class ConfigurationError(UsageError):
    """A configured value, or a pairing of values, that cannot work."""


class OutOfRange(ConfigurationError):
    """``name`` is ``value``; ``valid`` says in words what it may be."""

    def __init__(self, name: str, value: float, valid: str) -> None:
        self.name, self.value, self.valid = name, value, valid
        super().__init__(f"{name} {value:g} is outside its range {valid}")


class IllegalTransition(UsageError):
    """A state machine met an event it does not know in its present state; it stayed where it was."""

    def __init__(self, state: str, event: str, valid: Iterable[str]) -> None:
        self.state, self.event, self.valid = state, event, tuple(valid)
        super().__init__(f"{event} is not possible in {state}; possible there: {', '.join(self.valid) or 'nothing'}")


class PeerError(HilError):
    """The other side's fault."""


class MalformedDatagram(PeerError):
    """Bytes that are not a message of the configured release; ``outcome`` names the counter.

    ``looks_like`` is the release whose message they could be; None where they are none of any.
    """

    def __init__(self, outcome: Outcome, detail: str, *, looks_like: "Release | None" = None) -> None:
        self.outcome, self.detail, self.looks_like = outcome, detail, looks_like
        super().__init__(f"{outcome.value}: {detail}")


class EndpointError(HilError):
    """An address that cannot be bound or reached."""


class BackendError(HilError):
    """The robot side failed."""
