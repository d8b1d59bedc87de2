"""What is said of a swing of the loop, with the remedies of manual 11.4 in its order."""

import math
from collections.abc import Sequence
from typing import Final

from hil.core.diagnosis.feedback_oscillation import Oscillation
from hil.core.motion.application_motion import ApplicationMotion
from hil.values.finding import Finding, Severity, Whose
from hil.values.motion import ACCELERATION_OVERRIDE, JOINT_JERK, MotionKind
from hil.values.robot import JOINT_NAMES

KIND: Final = "feedback-oscillation"
FRI: Final = "FRI overlay"


def name_of(motion: ApplicationMotion | None) -> str:
    """Return what carries the loop: a servo motion, or without one the FRI overlay."""
    return FRI if motion is None else motion.kind.manual_name


def oscillation_finding(
    seen: Oscillation,
    *,
    with_it: Sequence[int] = (),
    motion: ApplicationMotion | None,
    override: float,
    yields: bool,
) -> Finding:
    """Return the finding; ``with_it`` are axes (from 0) that swing too, ``motion`` is None for the FRI overlay."""
    axis = JOINT_NAMES[seen.axis]
    means_it = not (seen.growing or seen.grown)
    amplitude_deg = math.degrees(seen.amplitude_rad)
    return Finding(
        KIND,
        Severity.FAULT if seen.growing else Severity.NOTE if means_it else Severity.WARNING,
        Whose.APPLICATION,
        _sentence(seen, axis, amplitude_deg),
        _evidence(seen, axis, amplitude_deg, with_it, name_of(motion)),
        _remedies(seen, motion, override=override, yields=yields),
        {
            "axis": axis,
            "growing": seen.growing,
            "grew_before": seen.grown,
            "frequency_hz": round(seen.frequency_hz, 3),
            "amplitude_deg": round(amplitude_deg, 3),
            "growth_per_period": round(seen.growth, 3),
            "loop_gain_about": round(seen.gain, 3),
            "loop_delay_ms": round(seen.half_period_ms, 1),
            "arm_behind_ms": round(_behind_ms(seen), 1),
            "half_periods": seen.half_periods,
        },
    )


def _sentence(seen: Oscillation, axis: str, amplitude_deg: float) -> str:
    frequency = f"{seen.frequency_hz:.3g} Hz"
    if seen.growing:
        return (
            f"{axis} oscillates at {frequency} and grows by {seen.growth:.2f} a period: the application's loop is "
            f"unstable (feedback effect, manual 7.11); its gain is about {seen.gain:.2f} where below 1 is stable"
        )
    if seen.grown:
        return (
            f"{axis} oscillates at {frequency} by {amplitude_deg:.2g} degrees, and grew before: the application's loop "
            "is unstable (feedback effect, manual 7.11), only a limit keeps the oscillation from growing"
        )
    return (
        f"{axis} swings at {frequency} by {amplitude_deg:.2g} degrees and neither grows nor decays: either the "
        "application means it to, or its loop has a gain of about 1 and is at the border of stability (feedback "
        "effect, manual 7.11); positions alone do not tell the two apart"
    )


def _evidence(seen: Oscillation, axis: str, amplitude_deg: float, with_it: Sequence[int], name: str) -> tuple[str, ...]:
    swings = (
        f"{name}: the destinations of {axis} turned {seen.half_periods + 1} times, {seen.half_period_ms:.0f} ms apart, "
        f"each swing {seen.gain:.2f} times the one before; amplitude now {amplitude_deg:.2g} degrees"
    )
    lag = (
        f"the measured position is {_behind_ms(seen):.0f} ms ({seen.lag_deg:.0f} degrees of the period) behind, "
        "as seen when destinations arrive; in a loop of gain and dead time half a period, "
        f"{seen.half_period_ms:.0f} ms, is the whole delay"
    )
    others = (f"{', '.join(JOINT_NAMES[other] for other in with_it)} swing with it",) if with_it else ()
    return swings, lag, *others


def _behind_ms(seen: Oscillation) -> float:
    return seen.lag_deg / 180.0 * seen.half_period_ms


def _remedies(seen: Oscillation, motion: ApplicationMotion | None, *, override: float, yields: bool) -> tuple[str, ...]:
    below = f"about {1.0 / seen.gain:.2f} of what it is" if seen.gain > 1.0 else "what it is"
    half = f"half of that, {0.5 / max(seen.gain, 1.0):.2f}, leaves a margin"
    remedies = [f"in the application: check the control law, and reduce its gain to below {below} ({half})"]
    if motion is not None:
        remedies.append(f"lower the program override, now {100 * override:g} %")
        remedies.append(_slower(motion))
    if yields:
        remedies.append("make the arm more compliant: change spring stiffness and damping of the impedance control")
    if motion is None:
        remedies.append(
            f"answer sooner: the loop takes {seen.half_period_ms:.0f} ms, about {_behind_ms(seen):.0f} ms of them "
            "the arm"
        )
    elif quicker := _quicker(motion):
        remedies.append(f"or make the arm quicker: raise {quicker}")
    return tuple(remedies)


def _slower(motion: ApplicationMotion) -> str:
    had = motion.parameters
    velocity = f"set_joint_velocity_rel, now {had.joint_velocity_rel:g}"
    if motion.kind is MotionKind.DIRECT_SERVO:
        return f"lower the maximum velocity ({velocity})"
    return (
        f"lower the maximum velocity and acceleration ({velocity}; "
        f"set_joint_acceleration_rel, now {had.joint_acceleration_rel:g})"
    )


def _quicker(motion: ApplicationMotion) -> str:
    if motion.kind is not MotionKind.SMART_SERVO:
        return ""
    had = motion.parameters
    room = []
    if had.acceleration_override < ACCELERATION_OVERRIDE.high:
        room.append(
            f"override_joint_acceleration, now {had.acceleration_override:g}, at most {ACCELERATION_OVERRIDE.high:g}"
        )
    if had.joint_jerk_percent < JOINT_JERK.high:
        room.append(f"set_joint_jerk, now {had.joint_jerk_percent:g} %, at most {JOINT_JERK.high:g} %")
    return "; ".join(room)
