"""``hil bench servo``: destinations from an application process to the interpolator of a real controller, over UDP.

Two runs against a controller process. In the first, this process sets a destination, waits for the answer, and sets the
next; both run on one machine, so its clock times the way of each, from the call to the cycle in which the interpolator
had it. In the second, it sets a thousand a second, whether the ones before are answered or not.
"""

import asyncio
import math
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from hil.client.servo import AsyncServoClient, AsyncSmartServo, ServoClient, SmartServo
from hil.clock import MonotonicClock, unix_time_ns
from hil.core.statistics import Histogram
from hil.runtime.pacer import open_pacer
from hil.values.errors import EndpointError
from hil.values.servo import MotionState
from tools.bench.bounds import DESTINATION_MEDIAN_US, Bound, at_least, at_most

_AMPLITUDE_RAD: Final = 0.05
_FREQUENCY_HZ: Final = 0.5
RATE_HZ: Final = 1000.0
_LEAST_HZ: Final = 999.0
_PERIOD_NS: Final = 1_000_000


@dataclass(frozen=True, slots=True)
class Answered:
    """One destination after the other; ``to_interpolator`` and ``call`` in ns."""

    seconds: float
    sent: int
    motion: MotionState
    to_interpolator: Histogram
    call: Histogram

    @property
    def lost(self) -> int:
        """Destinations that were neither executed nor superseded."""
        return self.sent - self.motion.executed - self.motion.superseded


@dataclass(frozen=True, slots=True)
class Paced:
    """A thousand destinations a second; ``replaced`` by a newer one before they were known to have arrived."""

    seconds: float
    asked: int
    acknowledged: int
    replaced: int
    motion: MotionState
    last_executed: bool

    @property
    def lost(self) -> int:
        """Destinations nobody answered for, and the last one unless the arm went there."""
        received_lost = self.motion.received - self.motion.executed - self.motion.superseded
        return self.asked - self.acknowledged + received_lost + (not self.last_executed)


@dataclass(frozen=True, slots=True)
class ServoReport:
    """Both runs."""

    robot: str
    backend: str
    answered: Answered
    paced: Paced

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound."""
        median_ns = self.answered.to_interpolator.quantile(0.5) or 0
        return [
            at_most("set_destination to interpolator, median", median_ns / 1000, DESTINATION_MEDIAN_US, "us"),
            at_most("lost, one after the other", self.answered.lost, 0, ""),
            at_least("destinations, paced", round(self.paced.asked / self.paced.seconds, 1), _LEAST_HZ, "a second"),
            at_most("lost, paced", self.paced.lost, 0, ""),
        ]

    def as_dict(self) -> dict[str, Any]:
        """Return the report for JSON."""
        answered, paced = self.answered, self.paced
        return {
            "robot": self.robot,
            "backend": self.backend,
            "answered": {
                "seconds": answered.seconds,
                "sent": answered.sent,
                **_accounts(answered.motion),
                "lost": answered.lost,
                "to_interpolator_us": answered.to_interpolator.summary_us(),
                "call_us": answered.call.summary_us(),
            },
            "paced": {
                "seconds": paced.seconds,
                "asked": paced.asked,
                "acknowledged": paced.acknowledged,
                "replaced": paced.replaced,
                **_accounts(paced.motion),
                "lost": paced.lost,
            },
            "bounds": [bound._asdict() for bound in self.bounds()],
        }


def bench_servo(*, robot: str, backend: str, seconds: float, progress: Callable[[float], None]) -> ServoReport:
    """Do both runs, ``seconds`` each; ``progress`` is told the seconds done."""
    with servo_controller(robot, backend) as address:
        answered = one_after_the_other(address, seconds, progress)
        paced = asyncio.run(_a_thousand_a_second(address, seconds, lambda done: progress(seconds + done)))
    return ServoReport(robot, backend, answered, paced)


def one_after_the_other(address: str, seconds: float, progress: Callable[[float], None]) -> Answered:
    """Set a destination, wait for the answer, and so on, for ``seconds``."""
    to_interpolator, call = Histogram(), Histogram()
    with ServoClient(address, name="bench", state_period_ms=10) as client:
        motion = SmartServo().set_timeout_after_goal_reach(3600)
        client.move_async(motion)
        runtime = motion.get_runtime()
        epoch_ns = client.controller.unix_epoch_ns
        start = runtime.get_command_result_of_interpolation()
        began_ns = unix_time_ns()
        sent = 0
        at_s = 0.0
        while at_s < seconds:
            before_ns = unix_time_ns()
            runtime.set_destination(_destination(start, at_s))
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
        return Answered(at_s, sent, shown, to_interpolator, call)


async def _a_thousand_a_second(address: str, seconds: float, progress: Callable[[float], None]) -> Paced:
    clock = MonotonicClock()
    async with AsyncServoClient(address, name="bench", state_period_ms=5) as client:
        motion = AsyncSmartServo().set_timeout_after_goal_reach(3600)
        await client.move_async(motion)
        runtime = await motion.get_runtime()
        start = runtime.get_command_result_of_interpolation()
        tasks: set[asyncio.Task[int]] = set()
        asked = acknowledged = 0
        began_ns = clock.now_ns()
        pacer = open_pacer(clock=clock, first_due_ns=began_ns + _PERIOD_NS, period_ns=_PERIOD_NS)
        try:
            while asked < seconds * RATE_HZ:
                tick = await pacer.next_tick()
                for _ in range(tick.missed + 1):
                    asked += 1
                    tasks.add(asyncio.create_task(runtime.set_destination(_destination(start, asked / RATE_HZ))))
                done = {task for task in tasks if task.done()}
                acknowledged += sum(1 for task in done if task.exception() is None)
                tasks -= done
                if asked % 500 == 0:
                    progress(asked / RATE_HZ)
        finally:
            pacer.close()
        took_s = (clock.now_ns() - began_ns) * 1e-9
        acknowledged += sum(1 for result in await asyncio.gather(*tasks, return_exceptions=True) if type(result) is int)
        while not runtime.is_destination_reached():
            await runtime.update_with_realtime_system()
        there = runtime.get_command_result_of_interpolation() == _destination(start, asked / RATE_HZ)
        shown = runtime.motion_state
        await runtime.stop_motion()
        return Paced(took_s, asked, acknowledged, client.session.requests.superseded, shown, there)


def _destination(start: tuple[float, ...], at_s: float) -> tuple[float, ...]:
    swing_rad = _AMPLITUDE_RAD * (1.0 - math.cos(2.0 * math.pi * _FREQUENCY_HZ * at_s))
    return (*start[:3], start[3] + swing_rad, *start[4:])


def _accounts(motion: MotionState) -> dict[str, int]:
    return {"received": motion.received, "executed": motion.executed, "superseded": motion.superseded}


@contextmanager
def servo_controller(robot: str, backend: str, *more: str) -> Iterator[str]:
    """Run ``hil run`` with the ideal reaction time; yield where applications connect to."""
    arguments = ["run", "--robot", robot, "--backend", backend, "--servo", "127.0.0.1:0", "--reaction", "ideal"]
    process = subprocess.Popen(
        [sys.executable, "-m", "hil.cli.main", *arguments, "--fri-client", "127.0.0.1:9", "--progress", "0", *more],
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
