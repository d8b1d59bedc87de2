"""Errors of the servo client. The first three are named as the manual's exception types are (chapter 10.2).

::

    UsageError (also ValueError)     the application author's mistake
    ├── IllegalArgumentException     an argument the call cannot take
    └── IllegalStateException        a call the motion, or the controller, cannot take in its present state
    HilError
    └── CommandInvalidException      the motion is over: an error, a stop, a timeout (manual 10.3)
    EndpointError
    ├── ControllerSilent             nothing that answers as a controller does is at the address
    ├── SessionRefused               a controller answers, and gives no session
    └── SessionEnded                 the session is over: the controller ended it, or was not heard any more

What the controller says in addition (axis, value, limit) is in ``detail``, and a note of the exception, so that a
traceback shows it and the text stays the manual's.
"""

from collections.abc import Mapping
from typing import Final

from hil.values.errors import EndpointError, HilError, UsageError
from hil.values.link import Address
from hil.values.outcomes import Outcome

NOT_TRANSFERRED_IN_TIME: Final = "waitForTransferred timeout to become activated in realtime-system"
"""Manual 10.2, of getRuntime: the motions before it take too long."""
CALLED_PREMATURELY: Final = "waitForTransferred called prematurely - RealtimeMotion is not active"
"""Manual 10.2, of getRuntime and stopMotion: the motion was not started."""
FRAME_ON_FLANGE_IS_NULL: Final = "frameOnFlange is null"
BASE_IS_NULL: Final = "base is null"
FRAME_IS_NOT_ON_FLANGE: Final = "frameOnFlange is not frame below or equal to the flange of this robot"
BASE_IS_NOT_STATIC: Final = "base is not static relative to the base of this robot"
"""Manual 10.2, of the Cartesian getters; ours raise them of destinations and of the moved frame too."""


_WATCHDOG: Final = "the watchdog allows"
"""In the controller's words about a session that was silent."""
_LATENCY_BUDGET: Final = "latency budget"
"""In its words where packets came, but too late to count."""


class IllegalArgumentException(UsageError):
    """An argument the call cannot take; ``detail`` has figures where the controller sent some."""

    def __init__(self, message: str, detail: str = "") -> None:
        self.detail = detail
        super().__init__(message)
        _note(self, detail)


class IllegalStateException(UsageError):
    """A call that is not possible now; ``detail`` has figures where the controller sent some."""

    def __init__(self, message: str, detail: str = "") -> None:
        self.detail = detail
        super().__init__(message)
        _note(self, detail)


class CommandInvalidException(HilError):
    """The motion is over. ``error_reason`` is the manual's text (10.3), or ours where it just stopped or timed out."""

    def __init__(self, error_reason: str, detail: str = "") -> None:
        self.error_reason, self.detail = error_reason, detail
        super().__init__(f"Command is no longer active, because {error_reason}")
        _note(self, detail)


class ControllerSilent(EndpointError):
    """No session with ``controller`` in time; ``dropped`` counts what came and was none of its packets."""

    def __init__(
        self,
        controller: Address,
        *,
        timeout_s: float,
        dropped: Mapping[Outcome, int],
        offered: bool = False,
        trouble: str = "",
    ) -> None:
        self.controller, self.dropped = controller, dict(dropped)
        came = ", ".join(f"{count} {outcome.value}" for outcome, count in dropped.items())
        if offered:
            hint = "a controller offered one and then sent no state: do packets get lost on the way there?"
        elif came:
            hint = f"what came is no controller's packet ({came}): do both sides have the same key and release?"
        else:
            hint = "does a controller with a servo link run at that address, with this key, and no firewall between?"
        said = f" ({trouble})" if trouble else ""
        super().__init__(f"no session with the controller at UDP {controller} within {timeout_s:g} s{said}; {hint}")


class SessionRefused(EndpointError):
    """The controller at ``controller`` gives no session; ``reason`` has its words."""

    def __init__(self, controller: Address, reason: str) -> None:
        self.controller, self.reason = controller, reason
        super().__init__(f"the controller at UDP {controller} gives no session: {reason}")


class SessionEnded(EndpointError):
    """The session is over for the ``reason``, and with it everything that was moved through it."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(f"the session with the controller is over: {reason}")
        if _LATENCY_BUDGET in reason:
            self.add_note(
                "what was sent reflected states that were too old: does the network take so long, or did a call hold "
                "the interpreter? A larger latency_budget_ms bears that"
            )
        elif _WATCHDOG in reason:
            self.add_note(
                "nothing was sent for so long: did a call hold the interpreter (C code, a debugger), or was the "
                "machine busy? A larger watchdog_ms bears that"
            )


def wrong_client(motion: object, client: object, *, needed: type[object]) -> IllegalArgumentException:
    """Return the error of a blocking motion in the hands of an asyncio client, or the other way round."""
    return IllegalArgumentException(
        f"{type(motion).__name__} is a motion for {needed.__name__}, not for {type(client).__name__}"
    )


def _note(error: BaseException, detail: str) -> None:
    if detail:
        error.add_note(detail)
