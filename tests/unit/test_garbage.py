"""The garbage collector runs between control cycles, never in one."""

import gc
from collections.abc import Callable

import pytest

from hil.config.station import FriConfig, RobotConfig, ServoConfig, Station
from hil.core.controller import Controller
from hil.runtime.garbage import FULL_EVERY, YOUNG_EVERY, Garbage, no_automatic_collection
from hil.runtime.run import RunOptions, run_station
from tests.support.processes import own_host
from transport.udp import free_port


def noting(during: list[int]) -> Callable[[str, dict[str, int]], object]:
    def note(phase: str, info: dict[str, int]) -> None:
        if phase == "start":
            during.append(info["generation"])

    return note


def test_nothing_is_collected_by_itself_until_the_block_ends() -> None:
    generations: list[int] = []
    note = noting(generations)
    assert gc.isenabled()
    with no_automatic_collection():
        gc.callbacks.append(note)
        kept = [[number] for number in range(5000)]
        gc.callbacks.remove(note)
    assert (generations, len(kept)) == ([], 5000)
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


def test_what_is_new_is_looked_through_each_second_and_everything_each_minute() -> None:
    generations: list[int] = []
    note = noting(generations)
    garbage = Garbage()
    gc.callbacks.append(note)
    with no_automatic_collection():
        generations.clear()
        for cycles in (1, YOUNG_EVERY - 1, YOUNG_EVERY, YOUNG_EVERY + 1, 2 * YOUNG_EVERY, FULL_EVERY):
            garbage.between_cycles(cycles)
    gc.callbacks.remove(note)
    assert generations == [0, 0, 2]
    assert (garbage.young, garbage.full) == (2, 1)
    assert garbage.longest_ns > 0
    assert set(garbage.report()) == {"young", "full", "longest_us"}


def test_a_running_controller_is_never_interrupted_by_the_collector(monkeypatch: pytest.MonkeyPatch) -> None:
    in_cycle = False
    cycles = 0
    found: list[bool] = []
    tick = Controller.tick

    def watched(controller: Controller, **times: int) -> None:
        nonlocal in_cycle, cycles
        in_cycle, cycles = True, cycles + 1
        try:
            tick(controller, **times)
        finally:
            in_cycle = False

    def note(phase: str, _info: dict[str, int]) -> None:
        if phase == "start":
            found.append(in_cycle)

    monkeypatch.setattr(Controller, "tick", watched)
    host = own_host()
    fri = FriConfig(client=f"{host}:{free_port(host)}")
    robot = RobotConfig(backend="ideal", fri=fri, servo=ServoConfig(bind=f"{host}:0"))
    gc.callbacks.append(note)
    try:
        result = run_station(Station(robot=[robot], pad="off"), RunOptions(duration_s=1.3, progress_s=0.0))
    finally:
        gc.callbacks.remove(note)
    assert cycles > 1000
    assert not any(found)
    told = result.status["garbage_collections"]
    assert isinstance(told, dict)
    assert told["young"] == 1
    assert gc.isenabled()
