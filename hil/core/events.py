"""What the core tells its shell: frozen values, drained with ``events()``. Times are core times in nanoseconds."""

from dataclasses import dataclass

from hil.values.finding import Finding
from hil.values.fri import DriveState, Quality, Release, SessionState
from hil.values.motion import MotionEnd, MotionKind
from hil.values.operator import OperatorView, StopCategory
from hil.values.outcomes import Outcome
from hil.values.servo import Role
from hil.values.signals import SignalValue


@dataclass(frozen=True, slots=True)
class Event:
    """Something happened at ``at_ns``."""

    at_ns: int

    def __str__(self) -> str:
        return type(self).__name__


@dataclass(frozen=True, slots=True)
class StateChanged(Event):
    """The session went from one state to another."""

    old: SessionState
    new: SessionState
    quality: Quality
    reason: str

    def __str__(self) -> str:
        return f"{self.old.name} -> {self.new.name}: {self.reason}"


@dataclass(frozen=True, slots=True)
class TransitionRefused(Event):
    """The session stays where it is; told once for each new reason."""

    state: SessionState
    wanted: SessionState
    reason: str

    def __str__(self) -> str:
        return f"{self.state.name}, not {self.wanted.name}: {self.reason}"


@dataclass(frozen=True, slots=True)
class QualityChanged(Event):
    """The connection quality rose or fell."""

    old: Quality
    new: Quality
    reason: str

    def __str__(self) -> str:
        return f"quality {self.old.name} -> {self.new.name}: {self.reason}"


@dataclass(frozen=True, slots=True)
class PacketDropped(Event):
    """A datagram was ignored; at most one event a second for each outcome, with the number since the last one."""

    outcome: Outcome
    count: int
    detail: str

    def __str__(self) -> str:
        return f"{self.count} dropped, {self.outcome.value}: {self.detail}"


@dataclass(frozen=True, slots=True)
class ClientRestarted(Event):
    """The client's sequence counter started again while its answers are fresh."""

    old_counter: int
    new_counter: int

    def __str__(self) -> str:
        return f"client restarted: its sequence counter went from {self.old_counter} to {self.new_counter}"


@dataclass(frozen=True, slots=True)
class ReleaseDoubted(Event):
    """The client's answers in monitoring look like those of another release than the configured one; told once."""

    release: Release
    echoes_positions: bool

    def __str__(self) -> str:
        if self.echoes_positions:
            return f"the client answers with positions in monitoring, as 1.x clients do; configured is {self.release}"
        return (
            f"the client answers with a header alone in monitoring, as 2.x clients (and clients that only set outputs) "
            f"do; configured is {self.release}"
        )


@dataclass(frozen=True, slots=True)
class ArmStopped(Event):
    """The arm brakes on its own, or is dropped; ``category`` is None for the end of a motion that is no safety stop."""

    category: StopCategory | None
    reason: str

    def __str__(self) -> str:
        if self.category is None:
            return f"arm brakes: {self.reason}"
        return f"stop of category {self.category.value}: {self.reason}"


@dataclass(frozen=True, slots=True)
class ArmResting(Event):
    """Braking ended; the arm stands still."""

    def __str__(self) -> str:
        return "arm stands still"


@dataclass(frozen=True, slots=True)
class ApplicationJoined(Event):
    """A session of the servo link began; ``who`` is the application's name and address."""

    who: str
    role: Role

    def __str__(self) -> str:
        return f"{self.role.name.lower()} {self.who} joined"


@dataclass(frozen=True, slots=True)
class ApplicationLeft(Event):
    """A session of the servo link ended."""

    who: str
    role: Role
    reason: str

    def __str__(self) -> str:
        return f"{self.role.name.lower()} {self.who} left: {self.reason}"


@dataclass(frozen=True, slots=True)
class MotionBegan(Event):
    """A motion of an application has the arm now."""

    number: int
    kind: MotionKind

    def __str__(self) -> str:
        return f"motion {self.number} ({self.kind.name}) begins"


@dataclass(frozen=True, slots=True)
class MotionOver(Event):
    """A motion of an application ended, or never began."""

    number: int
    kind: MotionKind
    end: MotionEnd
    reason: str

    def __str__(self) -> str:
        return f"motion {self.number} ({self.kind.name}) {self.end.name.lower()}: {self.reason}"


@dataclass(frozen=True, slots=True)
class OperatorActed(Event):
    """The operator did something with the pad; ``refusal`` says why it changed nothing, empty when it did."""

    action: str
    view: OperatorView
    refusal: str

    def __str__(self) -> str:
        if self.refusal:
            return f"{self.action} refused: {self.refusal}"
        return f"{self.action}: {self.view.reason or 'motions may run'}"


@dataclass(frozen=True, slots=True)
class OutputChanged(Event):
    """The FRI client changed an output; at most one event a second for each, with the changes since the last one."""

    name: str
    old: SignalValue
    new: SignalValue
    count: int

    def __str__(self) -> str:
        often = f" ({self.count} changes)" if self.count > 1 else ""
        return f"output {self.name}: {_shown(self.old)} -> {_shown(self.new)}{often}"


@dataclass(frozen=True, slots=True)
class InputSet(Event):
    """The operator set an input; ``refusal`` says why it changed nothing, empty when it did."""

    name: str
    value: SignalValue
    refusal: str

    def __str__(self) -> str:
        if self.refusal:
            return f"pad: input refused: {self.refusal}"
        return f"pad: input {self.name} = {_shown(self.value)}"


@dataclass(frozen=True, slots=True)
class DrivesChanged(Event):
    """The drives were dropped, are being switched on, or hold the arm again."""

    state: DriveState

    def __str__(self) -> str:
        return f"drives {self.state.name}"


@dataclass(frozen=True, slots=True)
class RobotSideChanged(Event):
    """The robot side takes commands now, or it takes none, or none for another reason."""

    reason: str

    def __str__(self) -> str:
        return f"the robot side takes no commands: {self.reason}" if self.reason else "the robot side takes commands"


@dataclass(frozen=True, slots=True)
class WouldHaveStopped(Event):
    """A monitor tripped that only reports (``--permissive``); told at most once a second for each monitor."""

    monitor: str
    category: StopCategory
    reason: str

    def __str__(self) -> str:
        return f"PERMISSIVE: would have been a stop of category {self.category.value}: {self.reason}"


@dataclass(frozen=True, slots=True)
class Diagnosed(Event):
    """Something is not as it should be, and whose fault it is."""

    finding: Finding

    def __str__(self) -> str:
        helps = f"; what helps: {self.finding.remedies[0]}" if self.finding.remedies else ""
        return f"{self.finding.sentence}{helps}"


def _shown(value: SignalValue) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:.6g}" if isinstance(value, float) else str(value)
