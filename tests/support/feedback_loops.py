"""Loops of gain and dead time without a controller, and deliberate swings, for the detector of the feedback effect."""

import math
import random
from collections.abc import Callable, Sequence

from hil.core.diagnosis.feedback_oscillation import FeedbackOscillation, Oscillation
from hil.values.robot import Seven

Path = Callable[[float], float]


def on_axis(value: float, axis: int = 0) -> Seven:
    """Seven axes, one of which is at ``value`` rad."""
    return tuple(value if number == axis else 0.1 for number in range(7))  # type: ignore[return-value]


def closed_loop(
    gain: float | Sequence[float],
    *,
    steps: int,
    dead_steps: int = 3,
    arm_steps: int = 1,
    period_ms: int = 50,
    noise_rad: float = 0.0,
    target_rad: float = 0.001,
    limit_rad: float = 1.0,
    seed: int = 1,
    axis: int = 0,
) -> list[tuple[int, Oscillation]]:
    """Run G(z) = 1 / (1 + k z^-n), whose arm is ``arm_steps`` of the dead time; return what was seen in which step."""
    noise = random.Random(seed)  # pixels, not secrets
    detector = FeedbackOscillation()
    commanded = [0.0] * (dead_steps + arm_steps)
    seen: list[tuple[int, Oscillation]] = []
    for step in range(steps):
        at_step = gain if isinstance(gain, float) else gain[step]
        error = (target_rad if step > 5 else 0.0) - commanded[-dead_steps] + noise.gauss(0.0, noise_rad)
        wanted = min(max(at_step * error, -limit_rad), limit_rad)
        measured = on_axis(commanded[-arm_steps], axis)
        commanded.append(wanted)
        found = detector.take(on_axis(wanted, axis), measured, now_ns=step * period_ms * 1_000_000)
        seen += [(step, one) for one in found]
    return seen


def commanded_on_purpose(path: Path, *, seconds: float, period_ms: float, arm_lag_s: float = 0.06) -> list[Oscillation]:
    """Let an arm that is ``arm_lag_s`` late follow ``path``, which maps s to rad; return what was seen."""
    detector = FeedbackOscillation()
    seen: list[Oscillation] = []
    for step in range(round(seconds * 1e3 / period_ms)):
        at_s = step * period_ms * 1e-3
        measured = on_axis(path(max(0.0, at_s - arm_lag_s)))
        seen += detector.take(on_axis(path(at_s)), measured, now_ns=round(at_s * 1e9))
    return seen


def sine(amplitude_rad: float, frequency_hz: float) -> Path:
    """A sine of constant amplitude."""
    return lambda at_s: amplitude_rad * math.sin(2.0 * math.pi * frequency_hz * at_s)
