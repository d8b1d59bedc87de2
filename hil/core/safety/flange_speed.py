"""The speed limit of the flange in T1, 250 mm/s, for the set point and for the measured state. Source: manual 4."""

from hil.core.model import ArmModel
from hil.core.safety.margins import Margin
from hil.values.robot import Seven


class FlangeSpeedMonitor:
    """Watches one stream of positions and velocities. The exact speed is worked out only where it can matter."""

    def __init__(self, model: ArmModel, *, limit_mm_s: float) -> None:
        self._model = model
        self._limit_mm_s = limit_mm_s
        self.margin = Margin()

    def too_fast(self, position: Seven, velocity: Seven, *, now_ns: int) -> str:
        """Return speed and limit in words if the flange is too fast, else an empty text."""
        if self._model.flange_keeps_below(self.margin.no_news * self._limit_mm_s, position, velocity):
            return ""
        return self.judge(self._model.flange_speed_mm_s(position, velocity), position, velocity, now_ns=now_ns)

    def judge(self, speed_mm_s: float, position: Seven, velocity: Seven, *, now_ns: int) -> str:
        """The same for a speed that is known."""
        margin, used = self.margin, speed_mm_s / self._limit_mm_s
        if used > margin.used:
            margin.used, margin.at_ns, margin.no_news = used, now_ns, min(used, 1.0)
            margin.position_rad, margin.velocity_rad_s = position, velocity
        return f"{speed_mm_s:.2f} mm/s, the limit is {self._limit_mm_s:g} mm/s" if used > 1.0 else ""
