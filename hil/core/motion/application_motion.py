"""What every motion of a robot application offers to the executive, which asks it once a control cycle.

A motion is told times, never reads them: ``now_ns`` is the nominal time of the cycle, ``started_ns`` when it really
began, both on the core's axis. What goes wrong is returned as a :class:`Fault`, because it happens in the cycle.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from hil.core.diagnosis.seconds_hand import SecondsHand
from hil.core.kinematics.answers import NoPosition
from hil.core.motion.destination_account import DestinationAccount
from hil.core.motion.flange_limit import FlangeLimit
from hil.core.motion.set_point import SetPoint
from hil.values.control import ControlSetup
from hil.values.motion import (
    MINIMUM_EXECUTION_TIME,
    ErrorReason,
    Fault,
    FineInterpolatorState,
    MotionKind,
    MotionParameters,
)
from hil.values.pose import Pose
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
    axes_nearest: Callable[[Pose, Seven], Seven | NoPosition]
    """Axis positions of a pose of the flange in the robot base, nearest to others in rad; or why there are none."""


class Accounting(NamedTuple):
    """What became of a motion's destinations; see :class:`hil.values.servo.MotionState`."""

    received: int = 0
    superseded: int = 0
    executed: int = 0
    executed_at_ns: int = 0


class ApplicationMotion(ABC):
    """One PTP, SmartServo or DirectServo. It is asked nothing before ``begin`` but ``set_destination``."""

    kind: MotionKind
    out_of_range: ErrorReason
    """What a destination outside the axis ranges is called, and a pose no axis positions lead to."""
    account: DestinationAccount | None = None
    """Of motions that take destinations while they run."""
    seconds_hand: SecondsHand | None = None
    """Who watches their destinations for it."""

    def __init__(self, parameters: MotionParameters, *, basis: MotionBasis, destination: Vector | Pose | None) -> None:
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
        self.control = ControlSetup()
        """How the arm is controlled while it has it; its kind stays."""
        self._initial_destination = destination

    def first_destination(self, start: SetPoint) -> Vector | Fault | None:
        """Return the axis positions it was made to go to, from ``start``; None if it was made without a destination."""
        made = self._initial_destination
        return self.axes_of(made, near_rad=start.position_rad) if isinstance(made, Pose) else made

    def axes_of(self, flange_in_base: Pose, *, near_rad: Seven) -> Seven | Fault:
        """Return the axis positions of a destination that is a pose, nearest to others; or why the motion ends."""
        x_m, y_m, z_m, rotation = flange_in_base
        if not all(map(math.isfinite, flange_in_base.position_m)):
            return Fault(ErrorReason.INVALID_INPUT_VALUES, f"destination at x {x_m}, y {y_m}, z {z_m} m")
        if not all(map(math.isfinite, rotation)):
            return Fault(ErrorReason.INVALID_INPUT_VALUES, f"destination with the rotation {rotation}")
        found = self.basis.axes_nearest(flange_in_base, near_rad)
        return Fault(self.out_of_range, str(found)) if isinstance(found, NoPosition) else found

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
