"""The shell of one robot with a scripted pacer: overruns, a failing robot side, orderly ends."""

import asyncio
from collections.abc import Iterator
from dataclasses import replace

import pytest

from backends.ideal import IdealBackend
from hil.clock import VirtualClock
from hil.config.station import FriConfig, Overrun, RobotConfig
from hil.core.events import Event
from hil.runtime import robot_process
from hil.runtime.assembly import LinkAddresses, RobotParts, open_parts
from hil.runtime.pacer import Pacer
from hil.runtime.robot_process import CATCH_UP_MOST, RobotProcess
from hil.values.arm import Capabilities
from hil.values.errors import BackendError

MS = 1_000_000


class ScriptedPacer(Pacer):
    """Tells how many due times went by, as scripted; then one at a time."""

    def __init__(self, clock: VirtualClock, script: list[int]) -> None:
        super().__init__(clock=clock, first_due_ns=0, period_ns=MS)
        self._virtual = clock
        self._script: Iterator[int] = iter(script)

    async def _wait(self) -> int:
        await asyncio.wait_for(asyncio.get_running_loop().create_task(_nothing()), 1)
        expired = next(self._script, 1)
        self._virtual.advance(expired * MS)
        return expired

    def close(self) -> None:
        return


async def _nothing() -> None:
    return


async def run(
    monkeypatch: pytest.MonkeyPatch, config: RobotConfig, script: list[int], *, stop_after: int
) -> tuple[RobotProcess, list[Event]]:
    clock = VirtualClock()
    events: list[Event] = []
    process = RobotProcess(
        config,
        addresses=LinkAddresses(None, None),
        clock=clock,
        tell=lambda _, event: events.append(event),
        on_fault=lambda: process.stop(),  # noqa: PLW0108  # there is no process yet
    )
    monkeypatch.setattr(robot_process, "open_pacer", lambda **_: ScriptedPacer(clock, script))
    await process.open()
    process.start(unix_epoch_ns=0, epoch_ns=0)
    ticked = process.measurements.ticked

    def counting(*, began_ns: int, lateness_ns: int, cost_ns: int) -> None:
        ticked(began_ns=began_ns, lateness_ns=lateness_ns, cost_ns=cost_ns)
        if process.measurements.lateness.count >= stop_after:
            process.stop()

    monkeypatch.setattr(process.measurements, "ticked", counting)
    try:
        await process.run()
    finally:
        process.close()
    return process, events


def config(overrun: Overrun = Overrun.CATCH_UP) -> RobotConfig:
    return RobotConfig(backend="ideal", overrun=overrun)


async def test_missed_cycles_are_caught_up_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    process, _ = await run(monkeypatch, config(), [1, 1, 4, 1], stop_after=7)
    assert process.measurements.missed_cycles == 3
    assert process.controller.ticks >= 7
    assert process.measurements.lateness.maximum >= 3 * MS


async def test_no_more_than_ten_are_caught_up(monkeypatch: pytest.MonkeyPatch) -> None:
    process, _ = await run(monkeypatch, config(), [1, 101, 1], stop_after=CATCH_UP_MOST + 3)
    assert process.measurements.missed_cycles == 100
    assert process.controller.ticks <= CATCH_UP_MOST + 5


async def test_skipped_cycles_are_counted_and_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    process, _ = await run(monkeypatch, config(Overrun.SKIP), [1, 8, 1, 1], stop_after=4)
    assert process.measurements.missed_cycles == 7
    assert process.measurements.lateness.count <= 6


async def test_real_drives_are_not_told_several_set_points_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    class Real(IdealBackend):
        @property
        def capabilities(self) -> Capabilities:
            return replace(super().capabilities, moves_real_drives=True)

    def real_parts(chosen: RobotConfig, **_: object) -> RobotParts:
        parts = open_parts(chosen)
        parts.backend.close()
        backend = Real(parts.description)
        backend.open(period_ns=MS)
        return RobotParts(parts.description, parts.model, backend, parts.servo_codec)

    monkeypatch.setattr(robot_process, "open_parts", real_parts)
    process, _ = await run(monkeypatch, config(Overrun.CATCH_UP), [1, 8, 1, 1], stop_after=4)
    assert process.measurements.missed_cycles == 7
    assert process.measurements.lateness.count <= 6


async def test_fault_ends_the_run_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    process, _ = await run(monkeypatch, config(Overrun.FAULT), [1, 1, 3], stop_after=1000)
    assert process.faulted is not None
    assert "2 control cycles were missed" in process.faulted
    assert process.controller.closed


async def test_a_failing_robot_side_ends_the_run_with_its_error(monkeypatch: pytest.MonkeyPatch) -> None:
    class Failing(IdealBackend):
        def _step(self) -> None:
            raise BackendError("the arm is on fire")

    def failing_parts(chosen: RobotConfig, **_: object) -> RobotParts:
        parts = open_parts(chosen)
        parts.backend.close()
        backend = Failing(parts.description)
        backend.open(period_ns=MS)
        return RobotParts(parts.description, parts.model, backend, parts.servo_codec)

    monkeypatch.setattr(robot_process, "open_parts", failing_parts)
    process, _ = await run(monkeypatch, config(), [1], stop_after=1000)
    assert process.faulted == "arm: the arm is on fire"
    assert process.controller.closed


async def test_a_robot_without_fri_runs_too(monkeypatch: pytest.MonkeyPatch) -> None:
    process, _ = await run(monkeypatch, config(), [], stop_after=20)
    report = process.report()
    assert report["fri"] is None
    assert report["session"] is None
    assert FriConfig().release == "1.15"
