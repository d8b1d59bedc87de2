"""``hil bench servo``: destinations from an application process to the interpolator of a real controller, over UDP.

This process sets a destination, waits for the answer, and sets the next; the controller is a process of its own. Both
run on one machine, so its clock times the way of each: from the call to the cycle in which the interpolator had it.
"""

import math
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from hil.client.servo import ServoClient, SmartServo
from hil.core.statistics import Histogram
from hil.runtime.clock import unix_time_ns
from hil.values.errors import EndpointError
from hil.values.servo import MotionState
from tools.bench.bounds import DESTINATION_MEDIAN_US, Bound, at_least, at_most

_AMPLITUDE_RAD: Final = 0.05
_FREQUENCY_HZ: Final = 0.5
RATE_HZ: Final = 1000.0
_RATE_SHARE: Final = 0.99
"""Of 1000 destinations a second, as many as the host's own stalls leave."""


@dataclass(frozen=True, slots=True)
class ServoReport:
    """One benchmark run; ``to_interpolator`` and ``call`` in ns."""

    robot: str
    backend: str
    seconds: float
    sent: int
    motion: MotionState
    to_interpolator: Histogram
    call: Histogram

    @property
    def lost(self) -> int:
        """Destinations that were neither executed nor superseded."""
        return self.sent - self.motion.executed - self.motion.superseded

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound."""
        median_ns = self.to_interpolator.quantile(0.5) or 0
        return [
            at_most("set_destination to interpolator, median", median_ns / 1000, DESTINATION_MEDIAN_US, "us"),
            at_least("destinations", round(self.sent / self.seconds, 1), _RATE_SHARE * RATE_HZ, "a second"),
            at_most("destinations lost", self.lost, 0, ""),
        ]

    def as_dict(self) -> dict[str, Any]:
        """Return the report for JSON."""
        return {
            "robot": self.robot,
            "backend": self.backend,
            "seconds": self.seconds,
            "sent": self.sent,
            "received": self.motion.received,
            "executed": self.motion.executed,
            "superseded": self.motion.superseded,
            "lost": self.lost,
            "to_interpolator_us": self.to_interpolator.summary_us(),
            "call_us": self.call.summary_us(),
            "bounds": [bound._asdict() for bound in self.bounds()],
        }


def bench_servo(*, robot: str, backend: str, seconds: float, progress: Callable[[float], None]) -> ServoReport:
    """Set destinations for ``seconds``, one after the other; ``progress`` is told the seconds done."""
    to_interpolator, call = Histogram(), Histogram()
    with _controller(robot, backend) as address, ServoClient(address, name="bench", state_period_ms=10) as client:
        motion = SmartServo().set_timeout_after_goal_reach(3600)
        client.move_async(motion)
        runtime = motion.get_runtime()
        epoch_ns = client.controller.unix_epoch_ns
        start = runtime.get_command_result_of_interpolation()
        began_ns = unix_time_ns()
        sent = 0
        at_s = 0.0
        while at_s < seconds:
            swing_rad = _AMPLITUDE_RAD * (1.0 - math.cos(2.0 * math.pi * _FREQUENCY_HZ * at_s))
            before_ns = unix_time_ns()
            runtime.set_destination((*start[:3], start[3] + swing_rad, *start[4:]))
            after_ns = unix_time_ns()
            sent += 1
            to_interpolator.add(epoch_ns + runtime.motion_state.executed_at_ns - before_ns)
            call.add(after_ns - before_ns)
            at_s = (after_ns - began_ns) * 1e-9
            if sent % 500 == 0:
                progress(at_s)
        runtime.update_with_realtime_system()
        shown = runtime.motion_state
        runtime.stop_motion()
        return ServoReport(robot, backend, at_s, sent, shown, to_interpolator, call)


@contextmanager
def _controller(robot: str, backend: str) -> Iterator[str]:
    """Run ``hil run`` with the ideal reaction time; yield where applications connect to."""
    arguments = ["run", "--robot", robot, "--backend", backend, "--servo", "127.0.0.1:0", "--reaction", "ideal"]
    process = subprocess.Popen(
        [sys.executable, "-m", "hil.cli.main", *arguments, "--fri-client", "127.0.0.1:9", "--progress", "0"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield _address(process)
    finally:
        process.terminate()
        process.communicate()


def _address(process: "subprocess.Popen[str]") -> str:
    for line in process.stderr or ():
        found = re.search(r"applications at ([^,\s]+)", line)
        if found:
            return found[1]
    raise EndpointError("hil run ended before it served anybody")
