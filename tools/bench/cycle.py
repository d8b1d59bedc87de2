"""``hil bench cycle``: what one control cycle costs, whole and by stage, in virtual time.

What the client sends is recorded beforehand, so that nothing but the controller runs in the measured loop, as in
replay. Two passes over the same work. The first measures whole cycles, from the client's answer to the datagram that
is ready to be sent; the second asks the core to report its stages, which costs a little itself: they add up to more.
"""

import gc
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.clock import elapsed_ns
from hil.config.control import ControlName
from hil.config.station import RobotConfig
from hil.core.controller import Controller
from hil.runtime.assembly import RobotParts, make_controller, open_parts
from hil.values.fri import Release
from hil.values.fri_messages import CommandMessage, ControllerCodec, MonitoringMessage
from hil.values.link import Outgoing
from tools.bench.bounds import CYCLE_MEDIAN_US, MONITORS_US, VIRTUAL_TIME_FACTOR, Bound, at_least, at_most
from tools.bench.clients import PEER, BenchMotion, Datagrams, RecordedClient, recorded_client
from transport.fri import FriCodec

_ANSWER_NS = 200_000
_MONITOR_STAGES = ("safety on the set point", "safety on the measured state")
WARM_UP_CYCLES = 2500
"""Long enough in virtual time to get an FRI client through the quality levels into COMMANDING_ACTIVE."""


@dataclass(frozen=True, slots=True)
class Distribution:
    """Median and tail in microseconds."""

    p50_us: float
    p99_us: float
    max_us: float

    @staticmethod
    def of(samples_ns: Sequence[int]) -> "Distribution":
        """Return the distribution of a series."""
        p50, p99, largest = np.quantile(np.array(samples_ns, dtype=np.float64), (0.5, 0.99, 1.0)) / 1000
        return Distribution(round(float(p50), 2), round(float(p99), 2), round(float(largest), 1))

    def as_dict(self) -> dict[str, float]:
        """Return it for JSON."""
        return {"p50": self.p50_us, "p99": self.p99_us, "max": self.max_us}


@dataclass(frozen=True, slots=True)
class CycleReport:
    """One benchmark run."""

    robot: str
    backend: str
    motion: str
    release: str | None
    control: str
    cycles: int
    cycle: Distribution
    stages: dict[str, Distribution]
    virtual_time_factor: float

    @property
    def monitors_us(self) -> float:
        """Median cost of the stages in which the monitors run."""
        return sum(self.stages[stage].p50_us for stage in _MONITOR_STAGES)

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound."""
        bounds = [
            at_most("one cycle, median", self.cycle.p50_us, CYCLE_MEDIAN_US, "us"),
            at_least("virtual time", self.virtual_time_factor, VIRTUAL_TIME_FACTOR, "x real time"),
        ]
        if self.stages:
            bounds.append(at_most("all monitors together, median", round(self.monitors_us, 2), MONITORS_US, "us"))
        return bounds


class _TimedCodec:
    """A codec that remembers what it cost."""

    def __init__(self, codec: ControllerCodec) -> None:
        self._codec = codec
        self.decode_ns = 0
        self.encode_ns = 0

    @property
    def release(self) -> Release:
        return self._codec.release

    def encode_monitoring(self, message: MonitoringMessage) -> bytes:
        before = elapsed_ns()
        datagram = self._codec.encode_monitoring(message)
        self.encode_ns = elapsed_ns() - before
        return datagram

    def decode_command(self, datagram: bytes) -> CommandMessage:
        before = elapsed_ns()
        message = self._codec.decode_command(datagram)
        self.decode_ns = elapsed_ns() - before
        return message


class CycleLoop:
    """A controller that gets what was recorded for each cycle."""

    def __init__(
        self,
        config: RobotConfig,
        parts: RobotParts,
        *,
        codec: ControllerCodec | None = None,
        on_stage: Callable[[str], None] | None = None,
    ) -> None:
        self.controller: Controller = make_controller(
            config,
            parts,
            unix_epoch_ns=1_700_000_000 * 10**9,
            fri_peer=None if config.fri is None else PEER,
            codec=codec,
            token_secret=b"the same tokens in each pass",
            on_stage=on_stage,
        )
        self._period_ns = config.cycle_ms * 1_000_000
        self._now_ns = 0
        self.outgoing: list[Outgoing] = []

    def cycle(self, datagrams: Datagrams) -> tuple[int, int]:
        """Receive ``datagrams``, run one cycle; return what each cost in ns."""
        controller = self.controller
        before = elapsed_ns()
        for source, datagram in datagrams:
            controller.receive(datagram, source, now_ns=self._now_ns - self._period_ns + _ANSWER_NS)
        received = elapsed_ns()
        controller.tick(now_ns=self._now_ns)
        self.outgoing = controller.outgoing()
        controller.events()
        ticked = elapsed_ns()
        self._now_ns += self._period_ns
        return received - before, ticked - received

    def warm_up(self, recording: Sequence[Datagrams], client: RecordedClient) -> None:
        """Get the arm moving; raise if that does not happen."""
        for datagrams in recording:
            self.cycle(datagrams)
        client.check(self.controller)
        gc.collect()
        gc.freeze()


def record_client(config: RobotConfig, client: RecordedClient, cycles: int) -> list[Datagrams]:
    """Return what the client sends, cycle by cycle; the ideal arm will do for positions, it changes nothing of that.

    ``cycles`` come behind those of the warm-up. Raises :class:`ConfigurationError` where the client moves no arm.
    """
    ideal = config.fri is None or config.fri.control.name_for(config.fri.overlay) is ControlName.POSITION
    parts = open_parts(config.model_copy(update={"backend": "ideal"}) if ideal else config)
    recording: list[Datagrams] = [()]
    try:
        loop = CycleLoop(config, parts)
        for _ in range(WARM_UP_CYCLES + cycles):
            loop.cycle(recording[-1])
            recording.append(client.answer(loop.outgoing))
        client.check(loop.controller)
    finally:
        parts.backend.close()
    return recording


def bench_cycle(
    config: RobotConfig, *, motion: BenchMotion, cycles: int, progress: Callable[[int], None]
) -> CycleReport:
    """Measure ``cycles`` cycles twice; ``progress`` is told how many are done."""
    client = recorded_client(config, motion)
    recording = record_client(config, client, cycles)
    whole = _measure_whole(config, recording, client, progress)
    stages = _measure_stages(config, recording, client, progress)
    gc.unfreeze()
    return _report(config, motion, whole, stages)


def measure_whole(config: RobotConfig, *, motion: BenchMotion, cycles: int) -> CycleReport:
    """Measure ``cycles`` cycles as a whole; the report has no stages."""
    client = recorded_client(config, motion)
    whole = _measure_whole(config, record_client(config, client, cycles), client, lambda _: None)
    gc.unfreeze()
    return _report(config, motion, whole, {})


def _report(
    config: RobotConfig, motion: BenchMotion, whole: Sequence[int], stages: dict[str, list[int]]
) -> CycleReport:
    cycles = len(whole)
    return CycleReport(
        robot=config.model,
        backend=config.backend,
        motion=motion.value,
        release=None if config.fri is None else config.fri.release.value,
        control=(ControlName.POSITION if config.fri is None else config.fri.control.name_for(config.fri.overlay)).value,
        cycles=cycles,
        cycle=Distribution.of(whole),
        stages={name: Distribution.of(samples) for name, samples in stages.items() if samples},
        virtual_time_factor=round(cycles * config.cycle_ms * 1e6 / sum(whole), 1),
    )


def _measure_whole(
    config: RobotConfig, recording: Sequence[Datagrams], client: RecordedClient, progress: Callable[[int], None]
) -> list[int]:
    parts = open_parts(config)
    try:
        loop = CycleLoop(config, parts)
        loop.warm_up(recording[:WARM_UP_CYCLES], client)
        samples: list[int] = []
        for done, datagrams in enumerate(recording[WARM_UP_CYCLES:-1]):
            samples.append(sum(loop.cycle(datagrams)))
            if done % 1000 == 0:
                progress(done)
        client.check(loop.controller)
        return samples
    finally:
        parts.backend.close()


def _measure_stages(
    config: RobotConfig, recording: Sequence[Datagrams], client: RecordedClient, progress: Callable[[int], None]
) -> dict[str, list[int]]:
    parts = open_parts(config)
    codec = None if config.fri is None else _TimedCodec(FriCodec(config.fri.release))
    stages: dict[str, list[int]] = {}
    last_ns = 0

    def on_stage(name: str) -> None:
        nonlocal last_ns
        now_ns = elapsed_ns()
        stages.setdefault(name, []).append(now_ns - last_ns)
        last_ns = elapsed_ns()

    try:
        loop = CycleLoop(config, parts, codec=codec, on_stage=on_stage)
        loop.warm_up(recording[:WARM_UP_CYCLES], client)
        before: dict[str, list[int]] = {"decode": [], "admission": []}
        encode: list[int] = []
        stages.clear()
        for done, datagrams in enumerate(recording[WARM_UP_CYCLES:-1]):
            last_ns = elapsed_ns()
            receive_ns, _ = loop.cycle(datagrams)
            decode_ns, encode_ns = (0, 0) if codec is None else (codec.decode_ns, codec.encode_ns)
            before["decode"].append(decode_ns)
            before["admission"].append(receive_ns - decode_ns)
            stages["read"][-1] -= receive_ns
            encode.append(encode_ns)
            if done % 1000 == 0:
                progress(len(recording) - WARM_UP_CYCLES + done)
    finally:
        parts.backend.close()
    if codec is None:
        return {"decode and admission": before["admission"], **stages}
    message = [whole - part for whole, part in zip(stages.pop("send"), encode, strict=True)]
    return {**before, **stages, "message": message, "encode": encode}


def as_dict(report: CycleReport) -> dict[str, Any]:
    """Return the report for JSON."""
    return {
        "robot": report.robot,
        "backend": report.backend,
        "motion": report.motion,
        "release": report.release,
        "control": report.control,
        "cycles": report.cycles,
        "cycle_us": report.cycle.as_dict(),
        "stages_us": {name: stage.as_dict() for name, stage in report.stages.items()},
        "virtual_time_factor": report.virtual_time_factor,
        "bounds": [bound._asdict() for bound in report.bounds()],
    }
