"""``hil doctor host``: what this machine can hold: how late its timers are, and what makes them late."""

from collections.abc import Callable

from hil.values.finding import Diagnosis
from tools.doctor.host.condition import look, over
from tools.doctor.host.lateness import measure_lateness
from tools.doctor.host.verdict import judge


def diagnose_host(*, seconds: float, cycle_ms: int, progress: Callable[[float], None] = lambda _: None) -> Diagnosis:
    """Measure the pacer's timer for ``seconds`` and look at the machine meanwhile; ``progress`` gets the seconds."""
    before = look()
    timing = measure_lateness(seconds=seconds, cycle_ms=cycle_ms, progress=progress)
    return judge(timing, over(before, look()))
