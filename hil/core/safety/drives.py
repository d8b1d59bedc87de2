"""Whether the drives hold the arm: dropped and switched on as the operator's side asks for it."""

from typing import Final

from hil.values.arm import ArmState, Backend
from hil.values.fri import DriveState
from hil.values.operator import StopCategory

_ACTIVE = DriveState.ACTIVE
STANDSTILL_RAD_S = 0.01
"""An axis that is slower stands still, as far as brakes and noise tell. Ours."""
LONGEST_COASTING_NS: Final = 200_000_000
"""For how long an arm whose set point stands may still move before its brakes grip it all the same. Ours."""


class Drives:
    """The drives of one arm. A robot side that cannot switch them keeps them on: then such stops brake and hold."""

    def __init__(self, backend: Backend) -> None:
        self._backend = backend
        self._switches = backend.capabilities.switches_drives
        self._state = _ACTIVE
        self._stands_since_ns: int | None = None
        """Since when the set point stands that is to be dropped."""
        self._states: tuple[DriveState, ...] = ()
        """What was read last; mostly the same tuple again, cycle after cycle."""
        self.dropped = False
        """Whether they were dropped from here, and are not asked for again."""
        self.hold = True
        """Whether all of them are active: what they are told counts."""
        self.lost = False
        """Whether they stopped holding the arm though nobody dropped them."""

    def read(self, arm: ArmState) -> DriveState | None:
        """Look at the measured state; return the state of the drives if it is another one than before."""
        states = arm.drive_states
        if states is self._states:
            return None
        self._states = states
        # All seven are alike but in a robot side that fails: the worst of them counts.
        state = states[0] if states.count(states[0]) == len(states) else min(states)
        self.hold = state is _ACTIVE
        if state is self._state:
            return None
        self.lost = self._state is _ACTIVE and not self.dropped
        self._state = state
        return state

    def follow(self, category: StopCategory | None, *, stands: bool, arm: ArmState, now_ns: int) -> None:
        """Drop the drives as ``category`` says, at once or when the arm stands; None: switch them on.

        ``stands``: the set point does; an arm that lags behind it is not gripped by its brakes before it does too.
        """
        if not self._switches:
            return
        coasts = category is StopCategory.BRAKE_AND_DROP and not self.dropped
        came_to_rest = self._came_to_rest(arm, stands=coasts and stands, now_ns=now_ns)
        drop = came_to_rest or category is StopCategory.DROP
        if drop and not self.dropped:
            self.dropped = True
            self._backend.switch_drives(on=False)
        elif category is None and self.dropped:
            self.dropped = False
            self._backend.switch_drives(on=True)

    def _came_to_rest(self, arm: ArmState, *, stands: bool, now_ns: int) -> bool:
        if not stands:
            self._stands_since_ns = None
            return False
        if self._stands_since_ns is None:
            self._stands_since_ns = now_ns
        coasted_ns = now_ns - self._stands_since_ns
        return coasted_ns >= LONGEST_COASTING_NS or max(map(abs, arm.velocity_rad_s)) <= STANDSTILL_RAD_S

    def off_or_at_rest(self, arm: ArmState) -> bool:
        """Whether an arm whose drives were to be dropped is stopped: they are, and it stands still."""
        return not self._switches or (self.dropped and max(map(abs, arm.velocity_rad_s)) <= STANDSTILL_RAD_S)

    def waits_because(self) -> str:
        """Return why nothing may move, as far as the drives are concerned; empty when they hold the arm."""
        return "" if self.hold else f"the drives are {self._state.name}"
