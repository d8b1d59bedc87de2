"""``hil bench cycle``: what one control cycle costs, whole and by stage, in virtual time.

The client's answers are recorded beforehand, so that nothing but the controller runs in the measured loop, as in
replay. Two passes over the same work. The first measures whole cycles, from the client's answer to the datagram that
is ready to be sent; the second asks the core to report its stages, which costs a little itself: they add up to more.
"""

import gc
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from apps.fri_joint_sine import JointSine
from hil.client.fri import ClientSession
from hil.config.station import RobotConfig
from hil.core.controller import FRI_LINK, Controller
from hil.runtime.assembly import RobotParts, make_controller, open_parts
from hil.runtime.clock import elapsed_ns
from hil.values.errors import ConfigurationError
from hil.values.fri import Release, SessionState
from hil.values.fri_messages import CommandMessage, ControllerCodec, MonitoringMessage
from hil.values.link import Address, Source
from tools.bench.bounds import CYCLE_MEDIAN_US, VIRTUAL_TIME_FACTOR, Bound, at_least, at_most
from transport.fri import FriCodec

_PEER = Address("127.0.0.1", 30200)
_SOURCE = Source(FRI_LINK, _PEER)
_ANSWER_NS = 200_000
WARM_UP_CYCLES = 2500
"""Long enough in virtual time to get through the quality levels into COMMANDING_ACTIVE."""


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


@dataclass(frozen=True, slots=True)
class CycleReport:
    """One benchmark run."""

    robot: str
    backend: str
    release: str
    cycles: int
    cycle: Distribution
    stages: dict[str, Distribution]
    virtual_time_factor: float

    def bounds(self) -> list[Bound]:
        """Return the figures that have a bound."""
        return [
            at_most("one cycle, median", self.cycle.p50_us, CYCLE_MEDIAN_US, "us"),
            at_least("virtual time", self.virtual_time_factor, VIRTUAL_TIME_FACTOR, "x real time"),
        ]


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


class _Loop:
    """A controller that gets one recorded answer a cycle."""

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
            fri_peer=_PEER,
            codec=codec,
            on_stage=on_stage,
        )
        self._period_ns = config.cycle_ms * 1_000_000
        self._now_ns = 0
        self.sent: list[bytes] = []

    def cycle(self, answer: bytes | None) -> tuple[int, int]:
        """Receive ``answer``, run one cycle; return what each cost in ns."""
        controller = self.controller
        before = elapsed_ns()
        if answer is not None:
            controller.receive(answer, _SOURCE, now_ns=self._now_ns - self._period_ns + _ANSWER_NS)
        received = elapsed_ns()
        controller.tick(now_ns=self._now_ns)
        outgoing = controller.outgoing()
        controller.events()
        ticked = elapsed_ns()
        self.sent = [datagram.payload for datagram in outgoing]
        self._now_ns += self._period_ns
        return received - before, ticked - received

    def warm_up(self, answers: Sequence[bytes | None]) -> None:
        """Get the session to COMMANDING_ACTIVE; raise if that does not happen."""
        for answer in answers:
            self.cycle(answer)
        fri = self.controller.fri
        if fri is None or fri.state is not SessionState.COMMANDING_ACTIVE:
            raise ConfigurationError("the benchmark did not reach COMMANDING_ACTIVE; use a send period of one cycle")
        gc.collect()
        gc.freeze()


def _record_answers(config: RobotConfig, cycles: int) -> list[bytes | None]:
    """Return what a joint sine client answers, cycle by cycle; the ideal arm will do, it changes no answer."""
    if config.fri is None:
        raise ConfigurationError("the benchmark needs an FRI link")
    client = ClientSession(config.fri.release, JointSine())
    config = config.model_copy(update={"backend": "ideal"})
    parts = open_parts(config)
    answers: list[bytes | None] = [None]
    try:
        loop = _Loop(config, parts)
        for _ in range(WARM_UP_CYCLES + cycles):
            loop.cycle(answers[-1])
            answers.append(client.receive(loop.sent[0]) if loop.sent else None)
    finally:
        parts.backend.close()
    return answers


def bench_cycle(config: RobotConfig, *, cycles: int, progress: Callable[[int], None]) -> CycleReport:
    """Measure ``cycles`` cycles twice; ``progress`` is told how many are done."""
    if config.fri is None:
        raise ConfigurationError("the benchmark needs an FRI link")
    if config.fri is None:
        raise ConfigurationError("the benchmark needs an FRI link")
    release = config.fri.release.value
    answers = _record_answers(config, cycles)
    whole = _measure_whole(config, answers, progress)
    stages = _measure_stages(config, answers, progress)
    return CycleReport(
        robot=config.model,
        backend=config.backend,
        release=release,
        cycles=cycles,
        cycle=Distribution.of(whole),
        stages={name: Distribution.of(samples) for name, samples in stages.items()},
        virtual_time_factor=round(cycles * config.cycle_ms * 1e6 / sum(whole), 1),
    )


def _measure_whole(config: RobotConfig, answers: Sequence[bytes | None], progress: Callable[[int], None]) -> list[int]:
    parts = open_parts(config)
    try:
        loop = _Loop(config, parts)
        loop.warm_up(answers[:WARM_UP_CYCLES])
        samples: list[int] = []
        for done, answer in enumerate(answers[WARM_UP_CYCLES:-1]):
            samples.append(sum(loop.cycle(answer)))
            if done % 1000 == 0:
                progress(done)
        return samples
    finally:
        parts.backend.close()


def _measure_stages(
    config: RobotConfig, answers: Sequence[bytes | None], progress: Callable[[int], None]
) -> dict[str, list[int]]:
    if config.fri is None:
        raise ConfigurationError("the benchmark needs an FRI link")
    parts = open_parts(config)
    codec = _TimedCodec(FriCodec(config.fri.release))
    stages: dict[str, list[int]] = {"decode": [], "admission": []}
    last_ns = 0

    def on_stage(name: str) -> None:
        nonlocal last_ns
        now_ns = elapsed_ns()
        stages.setdefault(name, []).append(now_ns - last_ns)
        last_ns = elapsed_ns()

    try:
        loop = _Loop(config, parts, codec=codec, on_stage=on_stage)
        loop.warm_up(answers[:WARM_UP_CYCLES])
        stages.update({name: [] for name in stages})
        encode: list[int] = []
        for done, answer in enumerate(answers[WARM_UP_CYCLES:-1]):
            last_ns = elapsed_ns()
            receive_ns, _ = loop.cycle(answer)
            stages["decode"].append(codec.decode_ns)
            stages["admission"].append(receive_ns - codec.decode_ns)
            stages["read"][-1] -= receive_ns
            encode.append(codec.encode_ns)
            if done % 1000 == 0:
                progress(len(answers) - WARM_UP_CYCLES + done)
        stages["message"] = [whole - part for whole, part in zip(stages.pop("send"), encode, strict=True)]
        stages["encode"] = encode
        return stages
    finally:
        parts.backend.close()


def as_dict(report: CycleReport) -> dict[str, Any]:
    """Return the report for JSON."""
    return {
        "robot": report.robot,
        "backend": report.backend,
        "release": report.release,
        "cycles": report.cycles,
        "cycle_us": _figures(report.cycle),
        "stages_us": {name: _figures(stage) for name, stage in report.stages.items()},
        "virtual_time_factor": report.virtual_time_factor,
        "bounds": [bound._asdict() for bound in report.bounds()],
    }


def _figures(distribution: Distribution) -> dict[str, float]:
    return {"p50": distribution.p50_us, "p99": distribution.p99_us, "max": distribution.max_us}
