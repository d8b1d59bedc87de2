"""Motions as an application describes them: kind, destination and parameters (manual 7.8, 9.1.1, 9.2.1).

Each setter refuses a value outside its range at the call (:class:`hil.values.errors.OutOfRange` with name, value and
range) and returns the motion, so that calls chain. Destinations are not judged here: they travel, and the controller
answers with the manual's errors.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import replace
from typing import ClassVar, Self, get_args

from hil.client.servo import _frames as frames
from hil.client.servo._frames import FLANGE_ITSELF, MovedFrame
from hil.client.servo.errors import IllegalArgumentException, IllegalStateException
from hil.client.servo.session import MotionRecord
from hil.values.control import POSITION_CONTROL, ControlModeSettings
from hil.values.motion import (
    ACCELERATION_OVERRIDE,
    BLENDING_REL,
    JOINT_ACCELERATION_REL,
    JOINT_JERK,
    JOINT_VELOCITY_REL,
    MINIMUM_EXECUTION_TIME,
    SPEED_TIMEOUT,
    TIMEOUT_AFTER_GOAL,
    MotionKind,
    MotionParameters,
)
from hil.values.pose import Pose
from hil.values.servo import MAX_VECTOR_NUMBERS, StartMotion, Vector


def control_mode(mode: object) -> ControlModeSettings:
    """Return ``mode``; raise :class:`IllegalArgumentException` where it is none."""
    if not isinstance(mode, ControlModeSettings):
        names = ", ".join(kind.__name__ for kind in get_args(ControlModeSettings))
        raise IllegalArgumentException(f"{mode!r} is no control mode; one of {names} is needed")
    return mode


def vector(name: str, values: Iterable[float]) -> Vector:
    """Return ``values`` as floats; raise :class:`IllegalArgumentException` where that cannot be or is too long."""
    try:
        numbers = tuple(map(float, values))
    except (TypeError, ValueError):
        raise IllegalArgumentException(f"{name} is {values!r}; a sequence of seven numbers is needed") from None
    if len(numbers) > MAX_VECTOR_NUMBERS:
        raise IllegalArgumentException(f"{name} has {len(numbers)} numbers; at most {MAX_VECTOR_NUMBERS} can be sent")
    return numbers


class Motion(ABC):
    """What all motions share: destination, joint velocity and acceleration, and the control mode.

    A destination is seven axis positions in rad, or a :class:`Pose` of the moved frame in the robot base.
    """

    kind: ClassVar[MotionKind]

    def __init__(self, destination: Iterable[float] | Pose | None) -> None:
        self.parameters = MotionParameters()
        """As they are set now."""
        self.destination: Vector | Pose | None = None
        """Where the motion goes first; None: nowhere, until it is told."""
        if isinstance(destination, Pose):
            self.destination = frames.pose("destination", destination)
        elif destination is not None:
            self.destination = vector("destination", destination)
        self.mode: ControlModeSettings = POSITION_CONTROL
        """How the arm is controlled."""
        self.record: MotionRecord | None = None
        """What the session knows of it; None before it is started."""

    def set_joint_velocity_rel(self, value: float) -> Self:
        """Highest axis velocity, as a share of what the axes can do: 0..1, default 1."""
        return self._set(joint_velocity_rel=JOINT_VELOCITY_REL.check(value))

    def set_joint_acceleration_rel(self, value: float) -> Self:
        """Highest axis acceleration, as a share of the base acceleration: 0..1, default 1. No effect on DirectServo."""
        return self._set(joint_acceleration_rel=JOINT_ACCELERATION_REL.check(value))

    def set_mode(self, mode: ControlModeSettings) -> Self:
        """Choose how the arm is controlled while the motion has it (manual 7.10.2); default: position control.

        Impedance control needs a load that was validated: ``validate_for_impedance_mode`` of the client.
        """
        self.must_not_run("its control mode is set before move_async")
        self.mode = control_mode(mode)
        return self

    def request(self, number: int, moved: MovedFrame = FLANGE_ITSELF) -> StartMotion:
        """Return the request that starts the motion of a frame."""
        destination, start = self.destination, StartMotion(number, self.kind, self.parameters, None)
        start = start._replace(mode=self.mode, frame=moved.name, tool=moved.tool)
        if isinstance(destination, Pose):
            return start._replace(flange_in_base=destination @ moved.flange_in_it)
        return start._replace(destination=destination)

    @property
    def started(self) -> bool:
        """Whether it runs or waits now; one that ended may be started again."""
        return self.record is not None and self.record.ended is None

    @abstractmethod
    def bind(self, client: object) -> None:
        """Belong to ``client`` from now on; raise where that cannot be."""

    def must_not_run(self, what: str) -> None:
        """Raise :class:`IllegalStateException` if the motion runs or waits: then ``what`` is not possible."""
        if self.started:
            raise IllegalStateException(f"this motion runs or waits already; {what}")

    def _set(self, **changed: float) -> Self:
        self.must_not_run("its parameters are set before move_async")
        self.parameters = replace(self.parameters, **changed)  # type: ignore[arg-type]  # all of these are floats
        return self


class ServoMotion(Motion):
    """What SmartServo and DirectServo share beside: it goes to ``initial_position`` first, or stays (None)."""

    def __init__(self, initial_position: Iterable[float] | Pose | None = None) -> None:
        super().__init__(initial_position)

    def set_minimum_trajectory_execution_time(self, seconds: float) -> Self:
        """Shortest time in s from a destination to reaching it: >= 0, default 0.01. Changes the path."""
        return self._set(minimum_execution_time_s=MINIMUM_EXECUTION_TIME.check(seconds))

    def set_speed_timeout_after_goal_reach(self, seconds: float) -> Self:
        """How long in s to keep the velocity of a destination after reaching it: >= 0, default 0."""
        return self._set(speed_timeout_s=SPEED_TIMEOUT.check(seconds))

    def set_timeout_after_goal_reach(self, seconds: float) -> Self:
        """How long in s to rest at a destination before the motion ends: >= 0, default 120."""
        return self._set(timeout_after_goal_s=TIMEOUT_AFTER_GOAL.check(seconds))


class SmartServoMotion(ServoMotion):
    """Jerk-limited, with new destinations at any time."""

    kind = MotionKind.SMART_SERVO

    def override_joint_acceleration(self, factor: float) -> Self:
        """Multiply the base acceleration, which is that of full load and stretched arm: 0..20, default 1."""
        return self._set(acceleration_override=ACCELERATION_OVERRIDE.check(factor))

    def set_joint_jerk(self, percent: float) -> Self:
        """Jerk in % of the base jerk: 0..1500, default 100."""
        return self._set(joint_jerk_percent=JOINT_JERK.check(percent))


class DirectServoMotion(ServoMotion):
    """Velocity-limited digital filter; destinations within 5 degrees of the measured axis position."""

    kind = MotionKind.DIRECT_SERVO


class PtpMotion(Motion):
    """Jerk-limited, to one point."""

    kind = MotionKind.PTP

    def __init__(self, destination: Iterable[float] | Pose) -> None:
        super().__init__(destination)

    def set_blending_rel(self, value: float) -> Self:
        """Share of the way, from its end, in which it may turn towards the next PTP: 0..1, default 0 (not blended)."""
        return self._set(blending_rel=BLENDING_REL.check(value))
