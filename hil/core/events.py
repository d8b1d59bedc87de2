"""What the core tells its shell: frozen values, drained with ``events()``. Times are core times in nanoseconds."""

from dataclasses import dataclass

from hil.values.fri import Quality, Release, SafetyState, SessionState
from hil.values.outcomes import Outcome


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
    """The arm brakes on its own; ``category`` as FRI reports safety stops, NORMAL_OPERATION for a motion's end."""

    category: SafetyState
    reason: str

    def __str__(self) -> str:
        return f"arm brakes: {self.reason}"


@dataclass(frozen=True, slots=True)
class ArmResting(Event):
    """Braking ended; the arm stands still."""

    def __str__(self) -> str:
        return "arm stands still"
