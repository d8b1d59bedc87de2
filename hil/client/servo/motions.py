"""Motions as an application describes them: kind, destination and parameters (manual 7.8, 9.1.1, 9.2.1).

Each setter refuses a value outside its range at the call (:class:`hil.values.errors.OutOfRange` with name, value and
range) and returns the motion, so that calls chain. Destinations are not judged here: they travel, and the controller
answers with the manual's errors.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from hil.client.servo.errors import IllegalArgumentException, IllegalStateException
from hil.client.servo.session import MotionRecord
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
from hil.values.servo import MAX_VECTOR_NUMBERS, StartMotion, Vector


@dataclass(frozen=True, slots=True)
class PositionControlMode:
    """Position control, the one control mode there is now."""


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
    """What all motions share: destination (seven axes, rad), joint velocity and acceleration, and the control mode."""

    kind: ClassVar[MotionKind]

    def __init__(self, destination: Iterable[float] | None) -> None:
        self.parameters = MotionParameters()
        """As they are set now."""
        self.destination = None if destination is None else vector("destination", destination)
        """Where the motion goes first, in rad; None: nowhere, until it is told."""
        self.record: MotionRecord | None = None
        """What the session knows of it; None before it is started."""

    def set_joint_velocity_rel(self, value: float) -> Self:
        """Highest axis velocity, as a share of what the axes can do: 0..1, default 1."""
        return self._set(joint_velocity_rel=JOINT_VELOCITY_REL.check(value))

    def set_joint_acceleration_rel(self, value: float) -> Self:
        """Highest axis acceleration, as a share of the base acceleration: 0..1, default 1. No effect on DirectServo."""
        return self._set(joint_acceleration_rel=JOINT_ACCELERATION_REL.check(value))

    def set_mode(self, mode: PositionControlMode) -> Self:
        """Choose the control mode: position control is all there is now, anything else is refused."""
        if not isinstance(mode, PositionControlMode):
            raise IllegalArgumentException(
                f"control mode {type(mode).__name__} is not there yet; motions run under PositionControlMode only"
            )
        return self._set()

    def request(self, number: int) -> StartMotion:
        """Return the request that starts the motion."""
        return StartMotion(number, self.kind, self.parameters, self.destination)

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

    def __init__(self, initial_position: Iterable[float] | None = None) -> None:
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

    def __init__(self, destination: Iterable[float]) -> None:
        super().__init__(destination)

    def set_blending_rel(self, value: float) -> Self:
        """Share of the way, from its end, in which it may turn towards the next PTP: 0..1, default 0 (not blended)."""
        return self._set(blending_rel=BLENDING_REL.check(value))
