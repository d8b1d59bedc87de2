"""Limits of one motion: the arm's, times the motion's parameters; and what a set point may be under them.

Source of the factors: manual 7.8, 9.1.1.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Final

from hil.core.motion.application_motion import MotionBasis
from hil.core.motion.set_point import SetPoint
from hil.values.errors import OutOfRange
from hil.values.motion import (
    ACCELERATION_OVERRIDE,
    BLENDING_REL,
    JOINT_ACCELERATION_REL,
    JOINT_JERK,
    JOINT_VELOCITY_REL,
    MINIMUM_EXECUTION_TIME,
    SPEED_TIMEOUT,
    TIMEOUT_AFTER_GOAL,
    ErrorReason,
    Fault,
    MotionParameters,
    ParameterRange,
)
from hil.values.robot import JointLimits, Seven

LONGEST_EXECUTION_TIME_S: Final = 1000.0
"""Ours: the longest minimum execution time. Ruckig synchronises axes reliably to 1000 s, no longer always to 3600 s."""

Checks = Mapping[str, tuple[ParameterRange, ErrorReason]]
"""Attribute of :class:`MotionParameters` to its range and the reason that names a value outside."""

_VELOCITY: Final[Checks] = {"joint_velocity_rel": (JOINT_VELOCITY_REL, ErrorReason.OVERRIDE_OUT_OF_RANGE)}
_ACCELERATION: Final[Checks] = {"joint_acceleration_rel": (JOINT_ACCELERATION_REL, ErrorReason.OVERRIDE_OUT_OF_RANGE)}
_OVERRIDE: Final[Checks] = {
    "acceleration_override": (ACCELERATION_OVERRIDE, ErrorReason.OVERRIDE_OUT_OF_RANGE),
    "joint_jerk_percent": (JOINT_JERK, ErrorReason.OVERRIDE_OUT_OF_RANGE),
}
_TIMES: Final[Checks] = {
    "minimum_execution_time_s": (MINIMUM_EXECUTION_TIME, ErrorReason.USER_TIME_OUT_OF_RANGE),
    "timeout_after_goal_s": (TIMEOUT_AFTER_GOAL, ErrorReason.USER_TIME_OUT_OF_RANGE),
}
_SPEED_TIMEOUT: Final[Checks] = {"speed_timeout_s": (SPEED_TIMEOUT, ErrorReason.USER_TIME_OUT_OF_RANGE)}

POINT_TO_POINT_CHECKS: Final[Checks] = {
    **_VELOCITY,
    **_ACCELERATION,
    "blending_rel": (BLENDING_REL, ErrorReason.INVALID_INPUT_VALUES),
}
SMART_SERVO_CHECKS: Final[Checks] = {**_VELOCITY, **_ACCELERATION, **_OVERRIDE, **_TIMES, **_SPEED_TIMEOUT}
DIRECT_SERVO_CHECKS: Final[Checks] = {**_VELOCITY, **_TIMES}

_SMALLEST_FACTOR: Final = 1e-9
"""Below it a factor is as good as 0, and its square or cube is nothing to divide by."""
_MUST_NOT_BE_ZERO: Final = frozenset(
    {"joint_velocity_rel", "joint_acceleration_rel", "acceleration_override", "joint_jerk_percent"}
)


def bad_parameter(parameters: MotionParameters, checks: Checks) -> Fault | None:
    """Return which parameter no interpolator can work with, with its value and range, or None.

    The ranges of the manual begin at 0; a factor that is 0 would never arrive and is an invalid input value.
    """
    for attribute, (allowed, reason) in checks.items():
        value = getattr(parameters, attribute)
        try:
            allowed.check(value)
        except OutOfRange as error:
            return Fault(reason, str(error))
        if value < _SMALLEST_FACTOR and attribute in _MUST_NOT_BE_ZERO:
            return Fault(ErrorReason.INVALID_INPUT_VALUES, f"{allowed.name} is {value:g}, nothing would move")
    return bad_execution_time(parameters.minimum_execution_time_s) if "minimum_execution_time_s" in checks else None


def bad_execution_time(time_s: float) -> Fault | None:
    """Return why no trajectory can be made to take ``time_s``, or None."""
    if 0.0 <= time_s <= LONGEST_EXECUTION_TIME_S:
        return None
    return Fault(
        ErrorReason.USER_TIME_OUT_OF_RANGE,
        f"minimum trajectory execution time {time_s:g} s is outside 0..{LONGEST_EXECUTION_TIME_S:g} s",
    )


def smart_servo_limits(basis: MotionBasis, parameters: MotionParameters) -> JointLimits:
    """Axis velocity x velocity rel; base acceleration x acceleration rel x override; base jerk x percent / 100."""
    acceleration_factor = parameters.joint_acceleration_rel * parameters.acceleration_override
    return replace(
        basis.limits,
        velocity_rad_s=_scaled(basis.limits.velocity_rad_s, parameters.joint_velocity_rel),
        acceleration_rad_s2=_scaled(basis.servo.acceleration_rad_s2, acceleration_factor),
        jerk_rad_s3=_scaled(basis.servo.jerk_rad_s3, parameters.joint_jerk_percent / 100.0),
    )


def point_to_point_limits(basis: MotionBasis, parameters: MotionParameters) -> JointLimits:
    """Axis velocity x velocity rel, axis acceleration x acceleration rel, axis jerk."""
    return replace(
        basis.limits,
        velocity_rad_s=_scaled(basis.limits.velocity_rad_s, parameters.joint_velocity_rel),
        acceleration_rad_s2=_scaled(basis.limits.acceleration_rad_s2, parameters.joint_acceleration_rel),
    )


def direct_servo_limits(basis: MotionBasis, parameters: MotionParameters) -> JointLimits:
    """Axis velocity x velocity rel; what SmartServo's largest override makes of its base acceleration; no jerk."""
    return replace(
        basis.limits,
        velocity_rad_s=_scaled(basis.limits.velocity_rad_s, parameters.joint_velocity_rel),
        acceleration_rad_s2=_scaled(basis.servo.acceleration_rad_s2, ACCELERATION_OVERRIDE.high),
        jerk_rad_s3=(math.inf,) * 7,
    )


def admissible(start: SetPoint, limits: JointLimits) -> SetPoint:
    """Return ``start`` with accelerations that ``limits`` can carry: position and velocity stay, no axis gets faster.

    An acceleration above the limit is cut to it. One that would take the axis beyond its velocity before it is down to
    0 (from velocity v it takes it to v + a|a| / (2 jerk)) becomes the largest that does not; 0 where v is beyond it.
    """
    acceleration: Seven = tuple(
        _carried(velocity, value, fastest, strongest, jerk)
        for velocity, value, fastest, strongest, jerk in zip(
            start.velocity_rad_s,
            start.acceleration_rad_s2,
            limits.velocity_rad_s,
            limits.acceleration_rad_s2,
            limits.jerk_rad_s3,
            strict=True,
        )
    )  # type: ignore[assignment]
    return start._replace(acceleration_rad_s2=acceleration)


def stopping_distance_rad(velocity_rad_s: float, acceleration_rad_s2: float, jerk_rad_s3: float) -> float:
    """Return how far an axis that moves steadily goes on until it stands; the way it needs to get so fast, too."""
    speed = abs(velocity_rad_s)
    if speed * jerk_rad_s3 <= acceleration_rad_s2 * acceleration_rad_s2:
        return speed * math.sqrt(speed / jerk_rad_s3)
    return 0.5 * speed * (speed / acceleration_rad_s2 + acceleration_rad_s2 / jerk_rad_s3)


def _carried(velocity: float, acceleration: float, fastest: float, strongest: float, jerk: float) -> float:
    if acceleration == 0.0:
        return 0.0
    towards = math.copysign(1.0, acceleration)
    room = fastest - towards * velocity
    return towards * min(abs(acceleration), strongest, math.sqrt(2.0 * jerk * room) if room > 0.0 else 0.0)


def _scaled(values: Iterable[float], factor: float) -> Seven:
    return tuple(value * factor for value in values)  # type: ignore[return-value]
