"""Motions of robot applications: kinds, parameters with their ranges, states, and the manual's reasons for their end.

Source: servoing manual, chapters 3.1.1 (kinds), 7.6 (states), 7.8 and 9 (parameters), 10.3 (reasons, word for word).
"""

import math
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Final, NamedTuple

from hil.values.errors import ConfigurationError, OutOfRange

MAX_MOTIONS: Final = 16
"""Motions of one arm that run or wait; one more is refused."""
DIRECT_SERVO_DELTA_RAD: Final = math.radians(5.0)
"""How far a DirectServo destination may be from the measured axis position (manual 3.1.1, 7.5.2.1)."""


class _Named(IntEnum):
    """Numbers on the wire, names for people."""

    def __str__(self) -> str:
        return self.name


class MotionKind(_Named):
    """Kind of a motion."""

    PTP = 1
    SMART_SERVO = 2
    DIRECT_SERVO = 3

    @property
    def manual_name(self) -> str:
        """As the manual spells it."""
        return _MANUAL_NAMES[self]


_MANUAL_NAMES: Final = {
    MotionKind.PTP: "PTP",
    MotionKind.SMART_SERVO: "SmartServo",
    MotionKind.DIRECT_SERVO: "DirectServo",
}


class MotionPhase(_Named):
    """Where a motion is on its way through the controller."""

    QUEUED = 1
    """Waits behind motions that wait themselves."""
    TRANSFERRED = 2
    """In the real-time system: it takes over as soon as the running motion ends."""
    ACTIVE = 3
    """It has the arm."""
    ENDED = 4


class FineInterpolatorState(_Named):
    """State of the fine interpolator (manual 7.6, state diagram)."""

    MOVING = 1
    VELOCITY_AFTER_GOAL_REACH = 2
    RESTING = 3
    ENDED = 4


class MotionEnd(_Named):
    """How a motion ended."""

    FINISHED = 1
    """A PTP reached its point; a servo motion rested for its timeout after the goal."""
    STOPPED = 2
    """The application stopped it."""
    FAILED = 3
    """An error: the arm brakes on its own, and the motions behind it end too."""


class ErrorReason(StrEnum):
    """Why a command is no longer active: the texts of manual chapter 10.3, word for word."""

    TRACKING_ERROR = "tracking error"
    SPEED_LIMIT = "speed limit exceeded"
    AXIS_TORQUE_LIMIT = "checkAxisTorqueLimit"
    MEASURED_T1 = "msr T1 illegal speed limit detected"
    COMMANDED_T1 = "cmd T1 illegal speed limit detected"
    DIRECT_SERVO_DELTA = "directServo: Target Outside accepted Delta"
    DIRECT_SERVO_LIMIT = "directServo: Target Outside Joint Limit"
    POSITIONAL_LIMITS = "interpolation error: RML_ERROR_POSITIONAL_LIMITS"
    INVALID_INPUT_VALUES = "interpolation error: ERROR_INVALID_INPUT_VALUES"
    ERROR = "interpolation error: ERROR"
    EXECUTION_TIME_CALCULATION = "interpolation error: ERROR_EXECUTION_TIME_CALCULATION"
    SYNCHRONIZATION = "interpolation error: ERROR_SYNCHRONIZATION"
    NUMBER_OF_DOFS = "interpolation error: ERROR_NUMBER_OF_DOFS"
    NO_PHASE_SYNCHRONIZATION = "interpolation error: ERROR_NO_PHASE_SYNCHRONIZATION"
    NULL_POINTER = "interpolation error: ERROR_NULL_POINTER"
    EXECUTION_TIME_TOO_BIG = "interpolation error: ERROR_EXECUTION_TIME_TOO_BIG"
    USER_TIME_OUT_OF_RANGE = "interpolation error: RML_ERROR_USER_TIME_OUT_OF_RANGE"
    OVERRIDE_OUT_OF_RANGE = "interpolation error: RML_ERROR_OVERRIDE_OUT_OF_RANGE"


class Fault(NamedTuple):
    """Why something is not done: the public ``reason``, and ``detail`` with axis, value and limit."""

    reason: str
    detail: str = ""

    def __str__(self) -> str:
        return f"{self.reason}: {self.detail}" if self.detail else self.reason


class ParameterRange(NamedTuple):
    """What a motion parameter may be; ``high`` is infinite where the manual names no upper end."""

    name: str
    low: float
    high: float
    default: float
    unit: str

    def check(self, value: float) -> float:
        """Return ``value`` as a float; raise :class:`OutOfRange` with name, value and range if it is outside."""
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise ConfigurationError(f"{self.name} is {value!r}; a number {self._range()} is needed") from None
        if not self.contains(number):
            raise OutOfRange(self.name, number, self._range())
        return number

    def contains(self, value: float) -> bool:
        """Return whether ``value`` is a finite number in the range, ends included."""
        return math.isfinite(value) and self.low <= value <= self.high

    def _range(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.low:g} ... {self.high:g}{unit}" if math.isfinite(self.high) else f">= {self.low:g}{unit}"


JOINT_VELOCITY_REL = ParameterRange("joint velocity rel", 0.0, 1.0, 1.0, "")
JOINT_ACCELERATION_REL = ParameterRange("joint acceleration rel", 0.0, 1.0, 1.0, "")
ACCELERATION_OVERRIDE = ParameterRange("joint acceleration override", 0.0, 20.0, 1.0, "")
JOINT_JERK = ParameterRange("joint jerk", 0.0, 1500.0, 100.0, "%")
MINIMUM_EXECUTION_TIME = ParameterRange("minimum trajectory execution time", 0.0, math.inf, 0.01, "s")
SPEED_TIMEOUT = ParameterRange("speed timeout after goal reach", 0.0, math.inf, 0.0, "s")
TIMEOUT_AFTER_GOAL = ParameterRange("timeout after goal reach", 0.0, math.inf, 120.0, "s")
BLENDING_REL = ParameterRange("blending rel", 0.0, 1.0, 0.0, "")
"""Of a PTP: share of its way, from its end, in which it may already turn towards the next PTP. 0: not blended."""


@dataclass(frozen=True, slots=True)
class MotionParameters:
    """Parameters of one motion (manual 9.1.1, 9.2.1); a kind ignores what is not its own.

    The defaults are the manual's, but for the jerk, for which it has none: 100 % is the base jerk of the robot. Values
    are not checked here: the client refuses a wrong one at the call, the controller once more at its door.
    """

    joint_velocity_rel: float = JOINT_VELOCITY_REL.default
    joint_acceleration_rel: float = JOINT_ACCELERATION_REL.default
    acceleration_override: float = ACCELERATION_OVERRIDE.default
    joint_jerk_percent: float = JOINT_JERK.default
    minimum_execution_time_s: float = MINIMUM_EXECUTION_TIME.default
    speed_timeout_s: float = SPEED_TIMEOUT.default
    timeout_after_goal_s: float = TIMEOUT_AFTER_GOAL.default
    blending_rel: float = BLENDING_REL.default
    velocity_planning: bool = False
    wait_for_pause: bool = True
