"""The superposed force oscillation in time: sine, bias, fading, limits. Six numbers in the order of the law's axes.

Changed while it runs, it goes on from the angle each sine has reached and from the place in its rise, hold and fall
where it is: a new frequency alone changes no force, a new amplitude, phase or bias by what it differs in.
"""

import math
from typing import Final

from hil.values.control import ForceOscillation
from hil.values.robot import Six

_FULL_TURN: Final = 2.0 * math.pi


class Oscillation:
    """One oscillation; it begins with the first call of :meth:`force`."""

    def __init__(self, settings: ForceOscillation) -> None:
        self._settings = settings
        self._angle = [0.0] * 6
        self._first_ns: int | None = None
        self._last_ns = 0

    def change(self, settings: ForceOscillation) -> None:
        """Take other settings from the next cycle on."""
        self._settings = settings

    def force(self, deviation: Six, *, now_ns: int) -> list[float]:
        """Return what is on top of the springs now, X Y Z A B C, N and Nm.

        ``deviation`` is how far the TCP is off its set point along each of these, mm and rad.
        """
        settings = self._settings
        if self._first_ns is None:
            self._first_ns = self._last_ns = now_ns
        elapsed_s = (now_ns - self._last_ns) * 1e-9
        self._last_ns = now_ns
        share = self._share((now_ns - self._first_ns) * 1e-9)
        forces: list[float] = []
        for axis in range(6):
            angle = (self._angle[axis] + _FULL_TURN * settings.frequency_hz[axis] * elapsed_s) % _FULL_TURN
            self._angle[axis] = angle
            amplitude = settings.amplitude[axis]
            force = settings.bias[axis]
            if amplitude:
                force += amplitude * math.sin(angle + math.radians(settings.phase_deg[axis]))
            limit = settings.force_limit[axis]
            force = share * max(-limit, min(limit, force))
            off = deviation[axis]
            if abs(off) > settings.position_limit[axis] and force * off > 0.0:
                force = 0.0
            forces.append(force)
        return forces

    @property
    def over(self) -> bool:
        """Whether it has faded out."""
        if self._first_ns is None:
            return False
        settings = self._settings
        whole_s = settings.rise_time_s + settings.hold_time_s + settings.fall_time_s
        return (self._last_ns - self._first_ns) * 1e-9 >= whole_s

    def _share(self, time_s: float) -> float:
        settings = self._settings
        if time_s < settings.rise_time_s:
            return time_s / settings.rise_time_s
        time_s -= settings.rise_time_s + settings.hold_time_s
        if time_s < 0.0:
            return 1.0
        return 1.0 - time_s / settings.fall_time_s if time_s < settings.fall_time_s else 0.0
