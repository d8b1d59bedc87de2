"""Objects of CiA 301 and CiA 402 that are used here, and what the process data hold."""

from typing import Final, NamedTuple

DEVICE_TYPE: Final = 0x1000
SYNC_ID: Final = 0x1005
SYNC_PERIOD: Final = 0x1006
GUARD_TIME: Final = 0x100C
LIFE_TIME: Final = 0x100D
CONSUMER_HEARTBEAT: Final = 0x1016
PRODUCER_HEARTBEAT: Final = 0x1017
IDENTITY: Final = 0x1018
RPDO: Final = 0x1400
RPDO_MAPPING: Final = 0x1600
TPDO: Final = 0x1800
TPDO_MAPPING: Final = 0x1A00
ERROR_CODE: Final = 0x603F
QUICK_STOP_OPTION: Final = 0x605A
CONTROL_WORD: Final = 0x6040
STATUS_WORD: Final = 0x6041
MODE: Final = 0x6060
MODE_DISPLAY: Final = 0x6061
ACTUAL_POSITION: Final = 0x6064
ACTUAL_VELOCITY: Final = 0x606C
ACTUAL_TORQUE: Final = 0x6077
TARGET_POSITION: Final = 0x607A
INTERPOLATION_TIME: Final = 0x60C2
SUPPORTED_MODES: Final = 0x6502

CYCLIC_SYNCHRONOUS_POSITION: Final = 8
PROFILE_402: Final = 402
SYNC_COB: Final = 0x80
"""Also what the emergencies of node n count from."""
HEARTBEAT_COB: Final = 0x700
OUR_NODE: Final = 127
EVERY_SYNC: Final = 1
"""Transmission type: with each SYNC."""
PDO_OFF: Final = 1 << 31


class Mapped(NamedTuple):
    """One object in a PDO."""

    number: int
    bits: int

    @property
    def entry(self) -> int:
        """As the mapping objects have it."""
        return self.number << 16 | self.bits


COMMANDS: Final[dict[int, tuple[Mapped, ...]]] = {0x200: (Mapped(CONTROL_WORD, 16), Mapped(TARGET_POSITION, 32))}
"""What a drive is sent: identifier of node 0, and what is in it. ``struct`` format: ``<Hi``."""
ANSWERS: Final[dict[int, tuple[Mapped, ...]]] = {
    0x180: (Mapped(STATUS_WORD, 16), Mapped(ACTUAL_POSITION, 32)),
    0x280: (Mapped(ACTUAL_VELOCITY, 32), Mapped(ACTUAL_TORQUE, 16), Mapped(ERROR_CODE, 16)),
}
"""What a drive answers to a SYNC, as above. ``struct`` formats: ``<Hi`` and ``<ihH``."""

NEEDED: Final = (
    DEVICE_TYPE, IDENTITY, RPDO, RPDO_MAPPING, TPDO, TPDO + 1, TPDO_MAPPING, TPDO_MAPPING + 1, MODE, MODE_DISPLAY,
    INTERPOLATION_TIME, *(part.number for parts in (*COMMANDS.values(), *ANSWERS.values()) for part in parts),
)  # fmt: skip
"""Objects that a drive must have."""
