"""What the arm is at, as a KST session sees it: a table."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final


class Phase(StrEnum):
    """What the arm is at."""

    IDLE = "idle"
    MOTION = "motion"
    SERVO = "real-time mode"
    IMPEDANCE = "impedance"
    STOPPING = "stopping"
    """A real-time mode was told to stop, and has not ended."""


class Event(StrEnum):
    """What changes the phase."""

    MOTION_STARTED = "motion started"
    SERVO_STARTED = "real-time mode started"
    IMPEDANCE_STARTED = "impedance started"
    STOP_ASKED = "stop asked"
    ENDED = "ended"


PHASES: Final[Mapping[tuple[Phase, Event], Phase]] = {
    (Phase.IDLE, Event.MOTION_STARTED): Phase.MOTION,
    (Phase.IDLE, Event.SERVO_STARTED): Phase.SERVO,
    (Phase.IDLE, Event.IMPEDANCE_STARTED): Phase.IMPEDANCE,
    (Phase.SERVO, Event.STOP_ASKED): Phase.STOPPING,
    (Phase.IMPEDANCE, Event.STOP_ASKED): Phase.STOPPING,
    (Phase.MOTION, Event.ENDED): Phase.IDLE,
    (Phase.SERVO, Event.ENDED): Phase.IDLE,
    (Phase.IMPEDANCE, Event.ENDED): Phase.IDLE,
    (Phase.STOPPING, Event.ENDED): Phase.IDLE,
}
"""What is not here changes nothing: a stop of what does not run is acknowledged, and that is all."""
