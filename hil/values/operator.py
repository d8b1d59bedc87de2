"""What the operator does with the pad, and what the pad shows.

Inputs of the core like any other: an :class:`OperatorAction` with its time goes in, an :class:`OperatorView` comes out.
Categories of stops: IEC 60204-1, 9.2.2. How FRI numbers them: fri-wire page, "safety state".
"""

from enum import IntEnum, StrEnum
from typing import Final, NamedTuple, TypeAlias

from hil.values.arm import Push
from hil.values.errors import OutOfRange
from hil.values.fri import OperationMode, SafetyState
from hil.values.signals import SignalValue


class PadKey(StrEnum):
    """Keys of the pad."""

    ENABLE = "enable"
    """The enabling switch is pressed to its middle, and held."""
    RELEASE = "release"
    """The enabling switch is let go."""
    START = "start"
    """The start key is pressed, and held in T1 and T2."""
    PAUSE = "pause"
    """The start key is let go, or the pause key is pressed."""
    EMERGENCY_STOP = "estop"
    """The emergency stop is pressed; it stays down."""
    RESET = "reset"
    """The emergency stop is pulled out again, and a stop acknowledged."""


class Press(NamedTuple):
    """A key of the pad is used."""

    key: PadKey


class SelectMode(NamedTuple):
    """The mode selector is turned."""

    mode: OperationMode


class SetOverride(NamedTuple):
    """The program override is set, 0..100 %."""

    percent: float

    def check(self) -> None:
        """Raise :class:`OutOfRange` unless it is 0..100 %."""
        if not 0.0 <= self.percent <= 100.0:
            raise OutOfRange("program override", self.percent, "0 ... 100 %")


class SetInput(NamedTuple):
    """An input of the robot's periphery gets a value."""

    name: str
    """``Group.Name``."""
    value: SignalValue


ProgramAction: TypeAlias = Press | SelectMode | SetOverride | Push
"""What decides whether motions run, and how fast; and pushes."""
OperatorAction: TypeAlias = ProgramAction | SetInput


class ProgramState(IntEnum):
    """Whether motions may run; numbers are the servo link's."""

    RUNNING = 1
    PAUSED = 2
    """The start key must be pressed; motions wait, and go on then."""
    STOPPED = 3
    """A stop ended all motions; it must be acknowledged before the start key is."""
    EMERGENCY_STOP = 4
    """As STOPPED, and the emergency stop is still pressed."""


class StopCategory(IntEnum):
    """How the arm is stopped."""

    DROP = 0
    """The drives are dropped at once, the brakes stop the arm."""
    BRAKE_AND_DROP = 1
    """The drives brake the arm on its path, then they are dropped."""
    BRAKE_AND_HOLD = 2
    """The drives brake the arm on its path and hold it."""

    @property
    def safety_state(self) -> SafetyState:
        """What FRI calls it."""
        return _SAFETY_STATES[self]


_SAFETY_STATES: Final = {
    StopCategory.DROP: SafetyState.SAFETY_STOP_LEVEL_0,
    StopCategory.BRAKE_AND_DROP: SafetyState.SAFETY_STOP_LEVEL_1,
    StopCategory.BRAKE_AND_HOLD: SafetyState.SAFETY_STOP_LEVEL_2,
}


class OperatorView(NamedTuple):
    """What the pad shows."""

    mode: OperationMode
    program: ProgramState
    enabling: bool
    """Whether the enabling switch is held; it means nothing in AUT."""
    override_percent: float
    safety_state: SafetyState
    reason: str
    """Why nothing may move, and what to do about it; empty when motions may run."""
    permissive: bool
    """Whether the monitors only report."""
