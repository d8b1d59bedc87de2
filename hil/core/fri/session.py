"""The FRI session as a table. Source: fri-wire page, "What the controller decides"."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final

from hil.core.state_table import StateTable
from hil.values.fri import SessionState

_S = SessionState


class Trigger(StrEnum):
    """What moves the session."""

    SESSION_OPENED = "session opened"
    QUALITY_REACHED = "quality GOOD reached"
    QUALITY_LOST = "quality lost"
    OVERLAY_STARTED = "overlay started"
    CLIENT_MIRRORS = "client mirrors the interpolator"
    MOTION_ENDED = "motion ended"
    SESSION_CLOSED = "session closed"


TABLE: Final[Mapping[tuple[SessionState, Trigger], SessionState]] = {
    (_S.IDLE, Trigger.SESSION_OPENED): _S.MONITORING_WAIT,
    (_S.MONITORING_WAIT, Trigger.QUALITY_REACHED): _S.MONITORING_READY,
    (_S.MONITORING_READY, Trigger.QUALITY_LOST): _S.MONITORING_WAIT,
    (_S.MONITORING_READY, Trigger.OVERLAY_STARTED): _S.COMMANDING_WAIT,
    (_S.COMMANDING_WAIT, Trigger.CLIENT_MIRRORS): _S.COMMANDING_ACTIVE,
    (_S.COMMANDING_WAIT, Trigger.MOTION_ENDED): _S.MONITORING_READY,
    (_S.COMMANDING_WAIT, Trigger.QUALITY_LOST): _S.MONITORING_WAIT,
    (_S.COMMANDING_ACTIVE, Trigger.MOTION_ENDED): _S.MONITORING_READY,
    (_S.COMMANDING_ACTIVE, Trigger.QUALITY_LOST): _S.MONITORING_WAIT,
    (_S.MONITORING_WAIT, Trigger.SESSION_CLOSED): _S.IDLE,
    (_S.MONITORING_READY, Trigger.SESSION_CLOSED): _S.IDLE,
    (_S.COMMANDING_WAIT, Trigger.SESSION_CLOSED): _S.IDLE,
    (_S.COMMANDING_ACTIVE, Trigger.SESSION_CLOSED): _S.IDLE,
}

_MACHINE: Final = StateTable(_S.IDLE, TABLE)
next_state = _MACHINE.after
diagram = _MACHINE.diagram
