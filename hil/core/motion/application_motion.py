"""What every motion of a robot application offers to the executive, which asks it once a control cycle.

A motion is told times, never reads them: ``now_ns`` is the nominal time of the cycle, ``started_ns`` when it really
began, both on the core's axis. What goes wrong is returned as a :class:`Fault`, because it happens in the cycle.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import NamedTuple

from hil.core.motion.flange_limit import FlangeLimit
from hil.core.motion.set_point import SetPoint
from hil.values.motion import (
    MINIMUM_EXECUTION_TIME,
    ErrorReason,
    Fault,
    FineInterpolatorState,
    MotionKind,
    MotionParameters,
)
from hil.values.robot import JointLimits, ServoDynamics, Seven
from hil.values.servo import Vector


@dataclass(frozen=True, slots=True)
class MotionBasis:
    """What every motion of one robot is built on."""

    limits: JointLimits
    servo: ServoDynamics
    cycle_ns: int
    smart_servo_dead_time_ns: int
    """From the arrival of a destination to the cycle in which the interpolator has it."""
    direct_servo_dead_time_ns: int
    flange: FlangeLimit
    """What a PTP has to keep in T1."""


class Accounting(NamedTuple):
    """What became of a motion's destinations; see :class:`hil.values.servo.MotionState`."""

    received: int = 0
    superseded: int = 0
    executed: int = 0
    executed_at_ns: int = 0


class ApplicationMotion(ABC):
    """One PTP, SmartServo or DirectServo. It is asked nothing before ``begin`` but ``set_destination``."""

    kind: MotionKind

    def __init__(self, parameters: MotionParameters, *, basis: MotionBasis, destination: Vector | None) -> None:
        self.parameters = parameters
        self.basis = basis
        self.interpolator = FineInterpolatorState.MOVING
        self.accounting = Accounting()
        self.goals_reached = 0
        """How often the fine interpolator reached its destination."""
        self.destination: Seven | None = None
        """Last destination taken, rad; None before ``begin`` of a motion that was given none."""
        self.destination_at_ns = 0
        """When it arrived at the controller."""
        self._initial_destination = destination

    @abstractmethod
    def begin(self, start: SetPoint, *, measured_rad: Seven, now_ns: int) -> Fault | None:
        """Take over from ``start``, moving or not, without a jump in position or velocity; or say why not."""

    @abstractmethod
    def set_destination(
        self, position: Vector | None, velocity: Vector | None, *, measured_rad: Seven, arrived_ns: int
    ) -> Fault | None:
        """Take a new destination that arrived at ``arrived_ns``; or say why the motion ends with it."""

    @abstractmethod
    def interpolate(self, *, now_ns: int, started_ns: int) -> SetPoint | Fault:
        """Return the set point of this cycle; a fault ends the motion, and the executive brakes."""

    @abstractmethod
    def remaining_s(self, *, now_ns: int) -> float:
        """Return the time in s until the last destination taken is reached, dead time included; 0.0 when it is."""

    def set_runtime_parameters(
        self,
        *,
        minimum_execution_time_s: float | None,
        velocity_planning: bool | None,
        wait_for_pause: bool | None,
    ) -> Fault | None:
        """Change what may change while the motion runs (None: leave it); or say why not, and change nothing."""
        time_s = (
            self.parameters.minimum_execution_time_s if minimum_execution_time_s is None else minimum_execution_time_s
        )
        if not MINIMUM_EXECUTION_TIME.contains(time_s):
            return Fault(ErrorReason.USER_TIME_OUT_OF_RANGE, f"minimum trajectory execution time {time_s:g} s")
        self.parameters = replace(
            self.parameters,
            minimum_execution_time_s=time_s,
            velocity_planning=self.parameters.velocity_planning if velocity_planning is None else velocity_planning,
            wait_for_pause=self.parameters.wait_for_pause if wait_for_pause is None else wait_for_pause,
        )
        return None

    def resumed(self, *, paused_ns: int) -> None:  # noqa: B027  # most motions have no clock of their own
        """The motion was paused so long: its timeouts did not run."""

    def blend_begins(self, *, now_ns: int) -> bool:  # noqa: ARG002  # it is a PTP that looks at the time
        """Whether the next PTP may take over before this one ends; only a PTP is ever blended."""
        return False

    @property
    @abstractmethod
    def ended(self) -> bool:
        """Whether the motion is over by itself: point reached, or rested for its timeout."""
