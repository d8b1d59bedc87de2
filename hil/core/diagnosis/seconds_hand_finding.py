"""The seconds hand effect in a sentence, and the manual's remedies (11.2) with the numbers to set."""

import math
from typing import Final

from hil.core.diagnosis.seconds_hand import Pattern
from hil.core.motion.motion_limits import direct_servo_limits, smart_servo_limits
from hil.core.motion.servo_motion import ServoMotion
from hil.core.motion.way_time import AxisLimits, acceleration_for, velocity_for, way_for, way_time_s
from hil.values.finding import Finding, Severity, Whose
from hil.values.motion import MotionKind
from hil.values.robot import JOINT_NAMES

SECONDS_HAND: Final = "seconds-hand"
LEAST_SHARE: Final = 1.5
MOST_SHARE: Final = 2.0
"""Manual 11.2: the minimum execution time is 1.5 to 2 times the cycle time of the application."""


def seconds_hand(motion: ServoMotion, number: int) -> Finding:
    """Return what was found of ``motion``, which the application knows by ``number``."""
    found, account = motion.seconds_hand.pattern(), motion.account
    smart = motion.kind is MotionKind.SMART_SERVO
    replaced = account.replaced_on_the_way
    # As many as came were replaced before they came: then it is not the program that is slow.
    on_the_way = replaced > account.spacing.count
    comes = f"{found.spacing_mean_ms:.1f} ms after it (at most {found.spacing_max_ms:.1f} ms)"
    reached = (
        f"a destination is reached in {found.way_ms:.1f} ms, the next one comes {comes}"
        if found.stood_ms > 0.0
        else f"a destination is all but reached when the next one comes, {comes}"
    )
    cause = (
        f"the application's destinations do not get through, {replaced} were replaced on the way"
        if on_the_way
        else "the application sets its destinations too late for this motion, or too near"
    )
    sentence = (
        f"motion {number} ({motion.kind.manual_name}): the arm stood still before {found.standstills} of the last "
        f"{found.sections} destinations (seconds hand effect): {reached}: {cause}"
    )
    low_s, high_s = minimum_execution_times_s(found.cycle_ms)
    stood = f"the last ones {found.stood_ms:.1f} ms long"
    way = f"{math.degrees(found.way_rad):.4g} degrees a destination"
    received = motion.accounting.received + account.refused
    return Finding(
        SECONDS_HAND,
        Severity.WARNING,
        Whose.PEER_OR_WIRE if on_the_way else Whose.APPLICATION,
        sentence,
        evidence=(
            f"arrivals of destinations since the motion began: {account.spacing}",
            f"{motion.seconds_hand.standstills} standstills since the motion began, {stood}",
            f"{JOINT_NAMES[found.axis]} goes farthest, {way}",
            f"destinations received {received}, replaced on the way {replaced}",
        ),
        remedies=_smart_servo_remedies(motion, found) if smart else _direct_servo_remedies(motion, found),
        figures={
            "motion": number,
            "standstills": motion.seconds_hand.standstills,
            "standstills_in_window": found.standstills,
            "window": found.sections,
            "application_cycle_mean_ms": round(found.spacing_mean_ms, 3),
            "application_cycle_max_ms": round(found.spacing_max_ms, 3),
            "way_ms": round(found.way_ms, 3),
            "stood_ms": round(found.stood_ms, 3),
            "minimum_execution_time_low_s": low_s,
            "minimum_execution_time_high_s": high_s,
        },
    )


def minimum_execution_times_s(spacing_ms: float) -> tuple[float, float]:
    """Return the least and the most to set for destinations so far apart, in s, rounded up to ms."""
    return math.ceil(LEAST_SHARE * spacing_ms - 1e-6) / 1e3, math.ceil(MOST_SHARE * spacing_ms - 1e-6) / 1e3


def _smart_servo_remedies(motion: ServoMotion, found: Pattern) -> tuple[str, ...]:
    axis, way_rad, spacing_s = found.axis, found.way_rad, found.cycle_ms / 1e3
    limits = smart_servo_limits(motion.basis, motion.parameters)
    of_axis = AxisLimits(limits.velocity_rad_s[axis], limits.acceleration_rad_s2[axis], limits.jerk_rad_s3[axis])
    time_s = LEAST_SHARE * spacing_s
    # Slower than the destinations move the arm would fall behind them more and more.
    velocity = max(velocity_for(way_rad, time_s, of_axis), min(way_rad / spacing_s, of_axis.velocity))
    velocity_rel = motion.parameters.joint_velocity_rel * velocity / of_axis.velocity
    acceleration = acceleration_for(way_rad, time_s, of_axis)
    acceleration_rel = motion.parameters.joint_acceleration_rel * acceleration / of_axis.acceleration
    takes_ms = 1e3 * way_time_s(way_rad, of_axis._replace(velocity=velocity))
    farther = way_for(way_rad, time_s, of_axis) / way_rad
    slower = (
        f"or go slower: set_joint_velocity_rel({_rounded_up(velocity_rel)}) "
        f"(now {motion.parameters.joint_velocity_rel:.3g}) makes a destination take {takes_ms:.1f} ms, "
        f"set_joint_acceleration_rel({_rounded_up(acceleration_rel)}) "
        f"(now {motion.parameters.joint_acceleration_rel:.3g}) {1e3 * time_s:.1f} ms"
    )
    sections = f"{math.degrees(way_rad * farther):.3g} instead of {math.degrees(way_rad):.3g} degrees"
    larger = (
        f"or set destinations {_rounded_up(farther)} times as far apart ({sections}), as visual servoing does: "
        f"one then takes {1e3 * time_s:.1f} ms"
    )
    return _more_time(motion, found), slower, larger


def _direct_servo_remedies(motion: ServoMotion, found: Pattern) -> tuple[str, ...]:
    """Larger sections are not among them: its filter takes nearly as long for any way of less than 5 degrees."""
    axis, way_rad, spacing_s = found.axis, found.way_rad, found.cycle_ms / 1e3
    fastest = direct_servo_limits(motion.basis, motion.parameters).velocity_rad_s[axis]
    velocity_rel = motion.parameters.joint_velocity_rel * min(way_rad / spacing_s, fastest) / fastest
    other = (
        f"or use SmartServo: DirectServo is for destinations in short intervals, and these are "
        f"{found.spacing_mean_ms:.1f} ms apart"
    )
    slower = (
        f"or go slower: set_joint_velocity_rel({_rounded_up(velocity_rel)}) is as fast as the destinations move "
        f"(now {motion.parameters.joint_velocity_rel:.3g})"
    )
    return _more_time(motion, found), other, slower


def _more_time(motion: ServoMotion, found: Pattern) -> str:
    low_s, high_s = minimum_execution_times_s(found.cycle_ms)
    regular = found.cycle_ms == found.spacing_mean_ms
    what = "the cycle time of the application" if regular else "the long ones of its irregular cycles"
    advice = (
        f"give a destination more time: set_minimum_trajectory_execution_time({low_s:.3f}) to ({high_s:.3f}): "
        f"{LEAST_SHARE:g} to {MOST_SHARE:g} x {found.cycle_ms:.3g} ms, {what} "
        f"(now {motion.parameters.minimum_execution_time_s:.3f})"
    )
    if found.spacing_max_ms > 1e3 * high_s:
        advice += f"; its longest, {found.spacing_max_ms:.1f} ms, needs as much, or must become shorter"
    return advice


def _rounded_up(value: float) -> str:
    """Return three digits that are not less."""
    step = 10.0 ** (math.floor(math.log10(value)) - 2)
    return f"{math.ceil(value / step - 1e-9) * step:.3g}"
