"""The operator's side as the core sees it: mode, keys, override, and stops that must be acknowledged; as a table.

Nothing resumes by itself: whatever ends RUNNING, only the start key begins it again, and a stop must be acknowledged
before. Which keys exist and when they count: manual 9.1.2 and 4; what the manual leaves open is ours and marked.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final, NamedTuple

from hil.core.state_table import StateTable
from hil.values.arm import Push
from hil.values.errors import OutOfRange
from hil.values.fri import OperationMode, SafetyState
from hil.values.motion import Fault
from hil.values.operator import (
    OperatorView,
    PadKey,
    Press,
    ProgramAction,
    ProgramState,
    SelectMode,
    StopCategory,
)

_P = ProgramState

EMERGENCY_STOP: Final = "the emergency stop was pressed"
NOT_STARTED: Final = "the program is paused"
NOT_ENABLED: Final = "the enabling switch is not held"
_RESET: Final = "acknowledge the stop (hil pad reset)"


class Trigger(StrEnum):
    """What changes whether motions may run."""

    START = "start key"
    PAUSE = "start key released"
    RELEASE = "enabling switch released in T1 or T2"
    SELECT = "mode changed at rest"
    STOP = "stop by a monitor, or mode changed while moving"
    EMERGENCY_STOP = "emergency stop pressed"
    RESET = "stop acknowledged"


TABLE: Final[Mapping[tuple[ProgramState, Trigger], ProgramState]] = {
    (_P.PAUSED, Trigger.START): _P.RUNNING,
    (_P.RUNNING, Trigger.START): _P.RUNNING,
    (_P.RUNNING, Trigger.PAUSE): _P.PAUSED,
    (_P.PAUSED, Trigger.PAUSE): _P.PAUSED,
    (_P.RUNNING, Trigger.RELEASE): _P.PAUSED,
    (_P.PAUSED, Trigger.RELEASE): _P.PAUSED,
    (_P.RUNNING, Trigger.SELECT): _P.PAUSED,
    (_P.PAUSED, Trigger.SELECT): _P.PAUSED,
    (_P.RUNNING, Trigger.STOP): _P.STOPPED,
    (_P.PAUSED, Trigger.STOP): _P.STOPPED,
    (_P.RUNNING, Trigger.EMERGENCY_STOP): _P.EMERGENCY_STOP,
    (_P.PAUSED, Trigger.EMERGENCY_STOP): _P.EMERGENCY_STOP,
    (_P.STOPPED, Trigger.EMERGENCY_STOP): _P.EMERGENCY_STOP,
    (_P.STOPPED, Trigger.RESET): _P.PAUSED,
    (_P.EMERGENCY_STOP, Trigger.RESET): _P.PAUSED,
}
"""What is not here is refused, in words; a stop while there is one only makes its category more severe."""

_TRIGGERS: Final = {PadKey.START: Trigger.START, PadKey.PAUSE: Trigger.PAUSE}
_MACHINE: Final = StateTable(_P.PAUSED, TABLE)
diagram = _MACHINE.diagram


class ActiveStop(NamedTuple):
    """A stop that was not acknowledged yet."""

    category: StopCategory
    reason: str


class Operator:
    """What the pad says now. ``enabled``: begin with the enabling switch held and the start key pressed."""

    def __init__(
        self, *, mode: OperationMode, enabled: bool, permissive: bool = False, enabling_there: bool = False
    ) -> None:
        self._enable = "at the robot side" if enabling_there else "hil pad enable"
        """How the enabling switch is held."""
        self.mode = mode
        self.enabling = enabled
        self.override_percent = 100.0
        self.stop: ActiveStop | None = None
        self._permissive = permissive
        self._program = _P.RUNNING if enabled or mode is OperationMode.AUT else _P.PAUSED
        self.view: OperatorView
        """What the pad shows; an attribute, because every cycle asks for it."""
        self._settle()

    @property
    def needs_enabling(self) -> bool:
        """Whether the enabling switch must be held for the drives to be on: in T1 and T2."""
        return self.mode is not OperationMode.AUT

    @property
    def may_move(self) -> bool:
        """Whether motions may run."""
        return self._program is _P.RUNNING

    @property
    def drops_drives(self) -> StopCategory | None:
        """How the drives are to be dropped now; None when they are to hold the arm."""
        if self.stop is not None and self.stop.category is not StopCategory.BRAKE_AND_HOLD:
            return self.stop.category
        return StopCategory.BRAKE_AND_DROP if self.needs_enabling and not self.enabling else None

    def press(self, key: PadKey) -> str:
        """Use a key; return why that changes nothing, or an empty text."""
        if key is PadKey.ENABLE:
            self.enabling = True
        elif key is PadKey.RELEASE:
            self.enabling = False
            if self.needs_enabling and (self._program, Trigger.RELEASE) in TABLE:
                self._go(Trigger.RELEASE)
        elif key is PadKey.EMERGENCY_STOP:
            # Pressing it once more is no new stop.
            if self._program is not _P.EMERGENCY_STOP:
                self._go(Trigger.EMERGENCY_STOP)
            self._worsen(ActiveStop(StopCategory.BRAKE_AND_DROP, EMERGENCY_STOP))
        elif refusal := self._refused(key):
            return refusal
        elif key is PadKey.RESET:
            self._go(Trigger.RESET)
            self.stop = None
        elif (self._program, _TRIGGERS[key]) in TABLE:
            self._go(_TRIGGERS[key])
        self._settle()
        return ""

    def select(self, mode: OperationMode, *, moving: bool) -> Fault | None:
        """Turn the mode selector; return the stop it is when something moves. The enabling switch stays as it is."""
        if mode is self.mode:
            return None
        before, self.mode = self.mode, mode
        if moving:
            fault = Fault("the operation mode was changed", f"{before.name} -> {mode.name}")
            self.stopped(StopCategory.BRAKE_AND_DROP, fault)
            return fault
        if (self._program, Trigger.SELECT) in TABLE:
            self._go(Trigger.SELECT)
        self._settle()
        return None

    def set_override(self, percent: float) -> None:
        """Set the program override, which the caller has checked."""
        self.override_percent = percent
        self._settle()

    def stopped(self, category: StopCategory, fault: Fault) -> bool:
        """The arm is stopped; return whether that is news: no stop was active, or a less severe one."""
        news = self.stop is None or category < self.stop.category
        if (self._program, Trigger.STOP) in TABLE:
            self._go(Trigger.STOP)
        self._worsen(ActiveStop(category, str(fault)))
        self._settle()
        return news

    def _refused(self, key: PadKey) -> str:
        if key is PadKey.RESET:
            return "" if self.stop is not None else "there is no stop to acknowledge"
        if key is PadKey.START:
            if self.stop is not None:
                return f"{_RESET} first: the arm is stopped: {self.stop.reason}"
            if self.needs_enabling and not self.enabling:
                return f"{self.mode.name}: {NOT_ENABLED}; hold it first ({self._enable})"
        return ""

    def _worsen(self, stop: ActiveStop) -> None:
        if self.stop is None or stop.category < self.stop.category:
            self.stop = stop

    def _go(self, trigger: Trigger) -> None:
        self._program = _MACHINE.after(self._program, trigger)

    def _settle(self) -> None:
        self.view = OperatorView(
            self.mode,
            self._program,
            self.enabling,
            self.override_percent,
            self._safety_state(),
            self._reason(),
            self._permissive,
        )

    def _safety_state(self) -> SafetyState:
        active = [self.stop.category] if self.stop is not None else []
        if self.needs_enabling and not self.enabling:
            active.append(StopCategory.BRAKE_AND_DROP)
        return min(active).safety_state if active else SafetyState.NORMAL_OPERATION

    def _reason(self) -> str:
        enable = f", hold the enabling switch ({self._enable})" if self.needs_enabling and not self.enabling else ""
        if self.stop is not None:
            # What to do comes first: the servo link cuts a long text at its end.
            return f"{_RESET}{enable} and press start (hil pad start): the arm is stopped: {self.stop.reason}"
        if enable:
            return f"{self.mode.name}: {NOT_ENABLED}: hold it ({self._enable}) and press start (hil pad start)"
        return "" if self.may_move else f"{NOT_STARTED}: press start (hil pad start)"


def describe(action: ProgramAction) -> str:
    """Return what the operator did, in words."""
    if isinstance(action, Press):
        return f"pad: {action.key.value}"
    if isinstance(action, SelectMode):
        return f"pad: mode {action.mode.name}"
    if isinstance(action, Push):
        (fx, fy, fz), (mx, my, mz) = action.force_n, action.moment_nm
        moment = f" and {mx:g}, {my:g}, {mz:g} Nm" if any(action.moment_nm) else ""
        return f"pad: push link {action.link} with {fx:g}, {fy:g}, {fz:g} N{moment} for {action.duration_s:g} s"
    return f"pad: override {action.percent:g} %"


def checked(action: ProgramAction) -> str:
    """Return why ``action`` can never be done, or an empty text."""
    if isinstance(action, Press | SelectMode):
        return ""
    try:
        action.check()
    except OutOfRange as error:
        return str(error)
    return ""
