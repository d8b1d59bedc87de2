"""Run a station: open everything, serve until asked to stop, close everything, report."""

import asyncio
import gc
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from hil.clock import Clock, MonotonicClock, unix_time_ns
from hil.config.station import RobotConfig, Station
from hil.core.controller import FRI_LINK
from hil.core.events import Event
from hil.core.servo.link import SERVO_LINK
from hil.runtime.assembly import link_addresses, robot_description
from hil.runtime.console import Console
from hil.runtime.garbage import Garbage, no_automatic_collection
from hil.runtime.lifetime import (
    check_result_file,
    claimed_result_file,
    repeated,
    stop_on_signals,
    write_result_file,
)
from hil.runtime.measurements import RunMeasurements
from hil.runtime.operator_channel import OperatorChannel
from hil.runtime.progress import progress_line
from hil.runtime.realtime import Wish, ask_for_realtime
from hil.runtime.robot_process import RobotProcess
from hil.runtime.view_process import ViewPlace, ViewProcess
from hil.values.errors import ConfigurationError
from hil.version import SOFTWARE

if TYPE_CHECKING:
    from hil.runtime.captures import Captures
    from hil.runtime.kst import KstProcess
    from hil.runtime.tcp_probe import TcpProbe

NO_PAD = "off"
START_DELAY_NS = 5_000_000
"""Between the decision to start and the first cycle, so that the first one is not late already.

A robot side that paces the cycle is not waited for: it speaks meanwhile, and nothing can be used before time 0.
"""


@dataclass(frozen=True, slots=True)
class RunOptions:
    """How to run, beside what the station says."""

    duration_s: float | None = None
    status_json: Path | None = None
    progress_s: float = 1.0
    view: ViewPlace | None = None
    settle_s: float = 0.0
    """From the first cycle, until which nothing is measured of how the cycles are paced."""


@dataclass(frozen=True, slots=True)
class RunResult:
    """What became of a run; ``fault`` is None when it ended as it was asked to."""

    status: dict[str, object]
    fault: str | None


def run_station(station: Station, options: RunOptions) -> RunResult:
    """Run until SIGINT, SIGTERM or the duration ends it. Raises HilError when it cannot start."""
    _check_status_file(options.status_json, capture=station.capture)
    with claimed_result_file(options.status_json):
        return asyncio.run(_Run(station, options).run())


class _Run:
    def __init__(self, station: Station, options: RunOptions) -> None:
        self._station = station
        self._options = options
        self._clock: Clock = MonotonicClock()
        self._console = Console()
        self._wishes: list[Wish] = []
        self._robots: list[RobotProcess] = []
        self._pad: OperatorChannel | None = None
        self._captures: Captures | None = None
        self._probe: TcpProbe | None = None
        self._view: ViewProcess | None = None
        self._epoch_ns = 0
        self._garbage = Garbage()
        self._surroundings = station.surroundings()

    async def run(self) -> RunResult:
        # Signals ask for an orderly end from here to the last written byte, however often they come.
        with stop_on_signals(self._stop):
            result = await self._run()
            write_result_file(self._options.status_json, result.status)
            return result

    async def _run(self) -> RunResult:
        fault: str | None = None
        capture: dict[str, object] | None = None
        try:
            # Before the process asks for real time: a child inherits that, and this one must not have it.
            self._probe = self._open_probe()
            self._robots = [self._robot(number, config) for number, config in enumerate(self._station.robot)]
            self._open_kst()
            self._captures = self._open_captures()
            for robot in self._robots:
                await robot.open()
            self._start_kst()
            self._pad = self._open_pad()
            self._view = self._open_view()
            self._wishes = ask_for_realtime() if self._station.realtime else []
            # Before the time axes begin: the first collection takes longer than a cycle.
            with no_automatic_collection():
                self._start()
                gc.freeze()
                if self._captures is not None:
                    self._captures.begin()
                if self._pad is not None:
                    await self._pad.serve()
                self._say_start()
                fault = await self._serve()
        finally:
            capture = self._close()
        return RunResult(self._status(fault, capture), fault)

    def _close(self) -> dict[str, object] | None:
        """Close everything, also where one of them raises; return what became of the capture."""
        capture: dict[str, object] | None = None

        def end_capture() -> None:
            nonlocal capture
            capture = None if self._captures is None else self._captures.close()

        with ExitStack() as closing:  # from the last line to the first: the robots' last words are in the capture
            closing.callback(self._console.close)
            closing.callback(end_capture)
            for robot in reversed(self._robots):
                closing.callback(robot.close)
            for part in (self._pad, self._view, self._probe):
                if part is not None:
                    closing.callback(part.close)
        return capture

    def _robot(self, number: int, config: RobotConfig) -> RobotProcess:
        return RobotProcess(
            config,
            number=number,
            addresses=link_addresses(config),
            clock=self._clock,
            tell=self._tell,
            on_fault=self._stop,
            say=self._console.say,
            surroundings=self._surroundings,
            # One robot's cycles count the time for all.
            after_cycle=self._garbage.between_cycles if number == 0 else None,
        )

    def _open_captures(self) -> "Captures | None":
        if self._station.capture is None and self._station.pad == NO_PAD:
            return None
        from hil.runtime.captures import Captures

        captures = Captures(self._station, self._robots)
        captures.open()
        return captures

    def _open_pad(self) -> OperatorChannel | None:
        if self._station.pad == NO_PAD:
            return None
        robots = {robot.config.name: robot for robot in self._robots}
        objects = [one.model_dump(mode="json") for one in self._station.object]
        pad = OperatorChannel(self._station.pad, robots, clock=self._clock, captures=self._captures, objects=objects)
        pad.open()
        return pad

    def _open_view(self) -> ViewProcess | None:
        place = self._options.view
        if place is None:
            return None
        if self._pad is None:
            raise ConfigurationError("--view finds the controller by its pad: it cannot be had with --pad off")
        if all(robot.config.servo is None for robot in self._robots):
            raise ConfigurationError(
                "--view sees the robots through their servo links: it cannot be had with --servo off"
            )
        return ViewProcess(place, self._pad.path, say=self._console.say)

    def _open_kst(self) -> None:
        """Bind the KST servers, so that an address in use is told before anything moves."""
        for robot in self._robots:
            config = robot.config
            if config.kst is not None and robot.addresses.kst is not None:
                from hil.runtime.kst import KstProcess

                settings = config.kst.settings(robot_description(config))
                robot.kst = KstProcess(robot.addresses.kst, settings, say=partial(self._say_of, config.name))

    def _start_kst(self) -> None:
        for robot in self._robots:
            servo, controller = robot.config.servo, robot.local_address(SERVO_LINK)
            if robot.kst is not None and servo is not None and controller is not None:
                robot.kst.start(controller, state_period_ms=robot.config.cycle_ms, key_file=servo.key_file)

    def _say_of(self, name: str, line: str) -> None:
        self._console.say(f"{name}: {line}")

    def _open_probe(self) -> "TcpProbe | None":
        config = self._station.tcp_probe
        if config is None:
            return None
        from hil.runtime.tcp_probe import TcpProbe
        from transport.tcp.sockets import parse_tcp_address

        bind = parse_tcp_address(config.bind, port_0=True)
        return TcpProbe(bind, config.behaviour, say=self._console.say)

    def _start(self) -> None:
        """Give all robots their time axes, spread over one millisecond so that their cycles do not collide."""
        now_ns, unix_now_ns = self._clock.now_ns(), unix_time_ns()
        self._epoch_ns = now_ns + START_DELAY_NS
        for index, robot in enumerate(self._robots):
            delay_ns = 0 if robot.paced_by_robot_side else START_DELAY_NS + index * 1_000_000 // len(self._robots)
            robot.start(unix_epoch_ns=unix_now_ns + delay_ns, epoch_ns=now_ns + delay_ns)

    def _say_start(self) -> None:
        for robot in self._robots:
            self._console.say(_serving(robot))
            if robot.kst is not None:
                self._console.say(_serving_kst(robot.config.name, robot.kst))
            if robot.config.permissive:
                self._console.say(f"{robot.config.name}: PERMISSIVE: the monitors only report, they stop nothing")
            if reason := robot.controller.operator.reason:
                unreachable = "" if self._pad is not None else "; there is no pad to do it with (--pad off)"
                self._console.say(f"{robot.config.name}: nothing may move: {reason}{unreachable}")
        if self._pad is not None:
            self._console.say(f"pad: hil pad finds this controller at {self._pad.path}")
        if self._probe is not None:
            self._console.say(f"tcp probe: hil doctor tcp {self._probe.local} ({self._probe.behaviour} peer)")
        for wish in self._wishes:
            self._console.say(f"realtime: {wish.what}: {'yes' if wish.granted else 'NOT GRANTED'}, {wish.detail}")

    async def _serve(self) -> str | None:
        with repeated(self._options.progress_s, self._say_progress):
            loop = asyncio.get_running_loop()
            timers = []
            if self._options.duration_s is not None:
                timers.append(loop.call_later(self._options.duration_s, self._stop))
            if self._options.settle_s > 0.0:
                timers.append(loop.call_later(self._options.settle_s, self._measure_anew))
            try:
                async with asyncio.TaskGroup() as group:
                    for robot in self._robots:
                        group.create_task(robot.run(), name=f"robot {robot.config.name}")
            finally:
                for timer in timers:
                    timer.cancel()
        return "; ".join(robot.faulted for robot in self._robots if robot.faulted is not None) or None

    def _stop(self) -> None:
        for robot in self._robots:
            robot.stop()

    def _measure_anew(self) -> None:
        for robot in self._robots:
            robot.measurements = RunMeasurements()

    def _tell(self, name: str, event: Event) -> None:
        self._console.say(f"[{event.at_ns / 1e9:9.3f} s] {name}: {event}")
        if self._pad is not None:
            self._pad.changed()

    def _say_progress(self) -> None:
        elapsed_s = (self._clock.now_ns() - self._epoch_ns) / 1e9
        for robot in self._robots:
            self._console.say(progress_line(robot, elapsed_s=elapsed_s, duration_s=self._options.duration_s))

    def _status(self, fault: str | None, capture: dict[str, object] | None) -> dict[str, object]:
        return {
            "software": SOFTWARE,
            "fault": fault,
            "realtime": [wish._asdict() for wish in self._wishes],
            "garbage_collections": self._garbage.report(),
            "capture": capture,
            "pad": None if self._pad is None else self._pad.report(),
            "tcp_probe": None if self._probe is None else self._probe.report(),
            "robots": {robot.config.name: robot.report() for robot in self._robots},
        }


def _serving(robot: RobotProcess) -> str:
    config = robot.config
    text = f"{config.name}: {config.model}, backend {config.backend}, mode {config.mode}, cycle {config.cycle_ms} ms"
    if config.fri is not None and robot.addresses.fri is not None:
        text += (
            f"; FRI {config.fri.release} from {robot.local_address(FRI_LINK)} to the client at "
            f"{robot.addresses.fri.peer}, every {config.fri.send_period_ms} ms, overlay {config.fri.overlay}"
        )
    if config.servo is not None:
        key = "with the key of its file" if config.servo.key_file is not None else "no key"
        text += f"; applications at {robot.local_address(SERVO_LINK)}, {key}"
    return text


def _serving_kst(name: str, kst: "KstProcess") -> str:
    settings = kst.settings
    strict = ", strictly as published" if settings.strict else ""
    nagle = ", with Nagle's algorithm" if settings.nagle else ""
    return f"{name}: KST programs at TCP {kst.local}{strict}{nagle}"


def _check_status_file(file: Path | None, *, capture: Path | None) -> None:
    check_result_file(file)
    if file is not None and capture is not None and file.resolve() == capture.resolve():
        raise ConfigurationError(f"{file} cannot be both the status file and the capture")
