"""The state machine of a CiA 402 drive, as tables: what a status word says, and which control word leads on."""

from enum import StrEnum
from typing import Final

from hil.values.fri import DriveState


class PowerState(StrEnum):
    """State of one drive (CiA 402-2, power drive system)."""

    NOT_READY = "not ready to switch on"
    DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    ENABLED = "operation enabled"
    QUICK_STOP = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"
    UNKNOWN = "no state of CiA 402"


_MASKED: Final = (
    (0x4F, 0x00, PowerState.NOT_READY),
    (0x4F, 0x40, PowerState.DISABLED),
    (0x6F, 0x21, PowerState.READY),
    (0x6F, 0x23, PowerState.SWITCHED_ON),
    (0x6F, 0x27, PowerState.ENABLED),
    (0x6F, 0x07, PowerState.QUICK_STOP),
    (0x4F, 0x0F, PowerState.FAULT_REACTION),
    (0x4F, 0x08, PowerState.FAULT),
)
_STATES: Final = tuple(
    next((state for mask, value, state in _MASKED if word & mask == value), PowerState.UNKNOWN) for word in range(0x80)
)

SHUTDOWN: Final = 0x06
SWITCH_ON: Final = 0x07
ENABLE: Final = 0x0F
QUICK_STOP: Final = 0x02
DISABLE_VOLTAGE: Final = 0x00
FAULT_RESET: Final = 0x80

TO_ENABLED: Final = {
    PowerState.NOT_READY: DISABLE_VOLTAGE,
    PowerState.DISABLED: SHUTDOWN,
    PowerState.READY: SWITCH_ON,
    PowerState.SWITCHED_ON: ENABLE,
    PowerState.ENABLED: ENABLE,
    PowerState.QUICK_STOP: DISABLE_VOLTAGE,
    PowerState.FAULT_REACTION: DISABLE_VOLTAGE,
    PowerState.FAULT: DISABLE_VOLTAGE,
    PowerState.UNKNOWN: DISABLE_VOLTAGE,
}
"""Control word that leads from a state towards operation enabled; a fault is only reset when somebody says so."""
TO_OFF: Final = {
    PowerState.NOT_READY: DISABLE_VOLTAGE,
    PowerState.DISABLED: DISABLE_VOLTAGE,
    PowerState.READY: DISABLE_VOLTAGE,
    PowerState.SWITCHED_ON: DISABLE_VOLTAGE,
    PowerState.ENABLED: QUICK_STOP,
    PowerState.QUICK_STOP: QUICK_STOP,
    PowerState.FAULT_REACTION: DISABLE_VOLTAGE,
    PowerState.FAULT: DISABLE_VOLTAGE,
    PowerState.UNKNOWN: DISABLE_VOLTAGE,
}
"""Control word that stops a drive and takes its power: a quick stop, which ends in switch on disabled."""
DRIVE_STATES: Final = {
    PowerState.NOT_READY: DriveState.OFF,
    PowerState.DISABLED: DriveState.OFF,
    PowerState.READY: DriveState.TRANSITIONING,
    PowerState.SWITCHED_ON: DriveState.TRANSITIONING,
    PowerState.ENABLED: DriveState.ACTIVE,
    PowerState.QUICK_STOP: DriveState.TRANSITIONING,
    PowerState.FAULT_REACTION: DriveState.OFF,
    PowerState.FAULT: DriveState.OFF,
    PowerState.UNKNOWN: DriveState.OFF,
}


def power_state(status_word: int) -> PowerState:
    """Return what a status word says."""
    return _STATES[status_word & 0x7F]
