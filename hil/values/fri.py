"""FRI's names and numbers: releases and what tells them apart, enumerations, identifiers, bounds.

Source: fri-wire page, sections "Messages" and "Transport". Numbers are the wire's; names are ours.
"""

from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Final

MONITORING_IDENTIFIER: Final = 0x245142
COMMAND_IDENTIFIER: Final = 0x34001
MAX_DATAGRAM_BYTES: Final = 1500
SEQUENCE_MODULUS: Final = 1 << 32
CLIENT_PORT: Final = 30200
MIN_PERIOD_MS: Final = 1
MAX_PERIOD_MS: Final = 100
MAX_INPUTS_OUTPUTS: Final = 10
"""Of a message, either way."""
MAX_TRANSFORMATIONS: Final = 5
"""Of a message, either way."""
MAX_NAME_BYTES: Final = 63
"""Of an input, an output or a transformation."""


class Release(StrEnum):
    """The six releases of the client library that are served."""

    V1_11 = "1.11"
    V1_14 = "1.14"
    V1_15 = "1.15"
    V1_16 = "1.16"
    V2_5 = "2.5"
    V2_7 = "2.7"


class SessionState(IntEnum):
    """State of the FRI session."""

    IDLE = 0
    MONITORING_WAIT = 1
    MONITORING_READY = 2
    COMMANDING_WAIT = 3
    COMMANDING_ACTIVE = 4


class Quality(IntEnum):
    """Connection quality; GOOD is needed for commanding."""

    POOR = 0
    FAIR = 1
    GOOD = 2
    EXCELLENT = 3


class SafetyState(IntEnum):
    """What kind of stop is active."""

    NORMAL_OPERATION = 0
    SAFETY_STOP_LEVEL_0 = 1
    SAFETY_STOP_LEVEL_1 = 2
    SAFETY_STOP_LEVEL_2 = 3


class OperationMode(IntEnum):
    """Operation mode of the controller."""

    T1 = 0
    T2 = 1
    AUT = 2


class DriveState(IntEnum):
    """State of one drive."""

    OFF = 0
    TRANSITIONING = 1
    ACTIVE = 2


class ControlMode(IntEnum):
    """Control mode of the arm."""

    POSITION = 0
    CARTESIAN_IMPEDANCE = 1
    JOINT_IMPEDANCE = 2
    NO_CONTROL = 3


class ClientCommandMode(IntEnum):
    """What the client may command."""

    NONE = 0
    JOINT_POSITION = 1
    WRENCH = 2
    TORQUE = 3
    CARTESIAN_POSE = 4


class OverlayType(IntEnum):
    """Kind of the running overlay."""

    NONE = 0
    JOINT = 1
    CARTESIAN = 2


class OverlayKind(StrEnum):
    """What the robot application lets the client lay over its position hold."""

    NONE = "none"
    JOINT_POSITION = "joint-position"
    TORQUE = "torque"
    WRENCH = "wrench"
    CARTESIAN_POSE = "cartesian-pose"


class IOType(IntEnum):
    """Type of an input or output."""

    BOOLEAN = 0
    DIGITAL = 1
    ANALOG = 2


class IODirection(IntEnum):
    """Direction of an input or output, seen from the robot."""

    INPUT = 0
    OUTPUT = 1


class RedundancyStrategy(IntEnum):
    """How the redundancy of a pose is given."""

    E1 = 0
    NONE = 4


@dataclass(frozen=True, slots=True)
class ReleaseTraits:
    """What tells one release from another on the wire."""

    framed: bool
    """Length prefix and CRC-32 around the message (2.7)."""
    commanded_position: bool
    """MonitorData carries the commanded position (1.x)."""
    pose: bool
    """Measured pose, redundancy, pose command mode (2.x)."""
    external_force: bool
    """MonitorData carries the external force (2.7)."""
    inputs_outputs: bool
    """Inputs and outputs exist (from 1.14)."""
    transformation_values: int
    """Numbers of a Transformation: 12 (3x4 matrix rows) or 7 (translation in mm, quaternion w x y z)."""


_ONE = ReleaseTraits(
    framed=False,
    commanded_position=True,
    pose=False,
    external_force=False,
    inputs_outputs=True,
    transformation_values=12,
)
_TWO = ReleaseTraits(
    framed=False,
    commanded_position=False,
    pose=True,
    external_force=False,
    inputs_outputs=True,
    transformation_values=7,
)

TRAITS: Final[dict[Release, ReleaseTraits]] = {
    Release.V1_11: ReleaseTraits(
        framed=False,
        commanded_position=True,
        pose=False,
        external_force=False,
        inputs_outputs=False,
        transformation_values=12,
    ),
    Release.V1_14: _ONE,
    Release.V1_15: _ONE,
    Release.V1_16: _ONE,
    Release.V2_5: _TWO,
    Release.V2_7: ReleaseTraits(
        framed=True,
        commanded_position=False,
        pose=True,
        external_force=True,
        inputs_outputs=True,
        transformation_values=7,
    ),
}
