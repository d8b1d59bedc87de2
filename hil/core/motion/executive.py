"""Which motion the arm is in: hold, overlay or brake, as a table; and the hold it always comes back to."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final

from hil.core.motion.brake import Brake
from hil.core.motion.joint_overlay import JointOverlay
from hil.core.motion.position_hold import PositionHold
from hil.core.motion.set_point import SetPoint
from hil.values.errors import IllegalTransition
from hil.values.robot import JointLimits, Seven


class Phase(StrEnum):
    """What the arm is doing."""

    HOLDING = "holding"
    OVERLAY = "overlay"
    BRAKING = "braking"


PHASES: Final[Mapping[Phase, frozenset[Phase]]] = {
    Phase.HOLDING: frozenset({Phase.OVERLAY}),
    Phase.OVERLAY: frozenset({Phase.BRAKING}),
    Phase.BRAKING: frozenset({Phase.HOLDING}),
}
"""Phase to the phases that may follow it."""


class MotionExecutive:
    """Owns the set point. Starts as a position hold at ``position_rad``."""

    def __init__(self, position_rad: Seven, *, limits: JointLimits, cycle_s: float) -> None:
        self._limits = limits
        self._cycle_s = cycle_s
        self._motion: PositionHold | JointOverlay | Brake = PositionHold(position_rad)
        self.phase = Phase.HOLDING
        self.hold_position_rad = position_rad
        self.set_point = self._motion.interpolate()

    @property
    def tracking_performance(self) -> float:
        """1.0 when the set point follows the overlay at once, less while it is slowed to the axis velocities."""
        return self._motion.tracking_performance if isinstance(self._motion, JointOverlay) else 0.0

    @property
    def at_rest(self) -> bool:
        """True while the arm holds its position."""
        return self.phase is Phase.HOLDING

    def start_overlay(self, *, cycles_per_target: int) -> None:
        """Lay a joint overlay over the hold; raise :class:`IllegalTransition` unless the arm is holding."""
        self._enter(Phase.OVERLAY)
        self._motion = JointOverlay(
            self.set_point, limits=self._limits, cycle_s=self._cycle_s, cycles_per_target=cycles_per_target
        )

    def retarget(self, target: Seven) -> None:
        """Hand a target (rad) to the running overlay."""
        if not isinstance(self._motion, JointOverlay):
            raise IllegalTransition(self.phase.value, "a new overlay target", [Phase.OVERLAY.value])
        self._motion.retarget(target)

    def brake(self) -> bool:
        """End a running overlay by braking; return whether there was one."""
        if self.phase is not Phase.OVERLAY:
            return False
        self._enter(Phase.BRAKING)
        self._motion = Brake(self.set_point, limits=self._limits, cycle_s=self._cycle_s)
        return True

    def brake_harder(self) -> None:
        """Brake from the present set point in half the time the running brake takes, at last within one cycle."""
        if not isinstance(self._motion, Brake):
            raise IllegalTransition(self.phase.value, "braking harder", [Phase.BRAKING.value])
        half_s = self._motion.duration_s / 2
        self._motion = Brake(
            self.set_point,
            limits=self._limits,
            cycle_s=self._cycle_s,
            longest_s=half_s if half_s > self._cycle_s else 0.0,
        )

    def propose(self) -> SetPoint:
        """Return the set point the running motion wants next; it counts only once it is committed."""
        return self._motion.interpolate()

    def commit(self, set_point: SetPoint) -> bool:
        """Take ``set_point`` as the present one; return True when braking ended with it."""
        self.set_point = set_point
        if self.phase is Phase.BRAKING and self._motion.at_rest:
            self._enter(Phase.HOLDING)
            self.hold_position_rad = set_point.position_rad
            self._motion = PositionHold(set_point.position_rad)
            return True
        return False

    def _enter(self, phase: Phase) -> None:
        if phase not in PHASES[self.phase]:
            raise IllegalTransition(self.phase.value, phase.value, [known.value for known in PHASES[self.phase]])
        self.phase = phase
