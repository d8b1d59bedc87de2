"""A person's hands on the pad: what is held is let go when nobody says any more that he holds it."""

import asyncio
import tempfile
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from hil.client.pad import PadClient
from hil.clock import MonotonicClock
from hil.runtime.operator_channel import OperatorChannel
from hil.values.operator import OperatorAction, PadKey, Press
from tools.view.operator import RELEASED_AFTER_S, Operator

ENABLE, RELEASE, STOP = Press(PadKey.ENABLE), Press(PadKey.RELEASE), Press(PadKey.EMERGENCY_STOP)


class Notes:
    """A robot that notes what the operator did."""

    moves_real_drives = False

    def __init__(self) -> None:
        self.actions: list[OperatorAction] = []
        self.refuses = ""
        self.told = asyncio.Event()

    def operate(self, action: OperatorAction) -> str:
        self.actions.append(action)
        self.told.set()
        return self.refuses

    def operator_state(self) -> dict[str, object]:
        return {}

    def kst_report(self) -> dict[str, object] | None:
        return {"sessions": 3}

    def description(self) -> dict[str, object]:
        return {}

    async def until_last(self, action: OperatorAction) -> None:
        while not self.actions or self.actions[-1] != action:
            self.told.clear()
            await asyncio.wait_for(self.told.wait(), 5)


class Hands:
    """An operator, the robots he has, and what he was told."""

    def __init__(self, channel: OperatorChannel, robots: dict[str, Notes]) -> None:
        self.robots = robots
        self.arm = robots["arm"]
        self.said: list[str] = []
        self.operator = Operator(channel.path, self.said.append)

    async def do(self, action: Callable[[], object]) -> object:
        return await asyncio.to_thread(action)


@asynccontextmanager
async def hands() -> AsyncIterator[Hands]:
    robots = {"arm": Notes(), "other": Notes()}
    with tempfile.TemporaryDirectory(prefix="pad") as folder:
        channel = OperatorChannel(str(Path(folder, "pad.sock")), robots, clock=MonotonicClock())
        channel.open()
        await channel.serve()
        held = Hands(channel, robots)
        held.operator.open()
        try:
            yield held
        finally:
            await asyncio.to_thread(held.operator.close)
            channel.close()


async def test_a_switch_is_held_while_somebody_says_so_and_then_let_go() -> None:
    async with hands() as held:
        clock = MonotonicClock()
        assert await held.do(lambda: held.operator.hold("arm"))
        assert await held.do(lambda: held.operator.hold("arm"))
        last_ns = clock.now_ns()
        assert held.arm.actions == [ENABLE]
        assert held.operator.holds("arm")
        await held.arm.until_last(RELEASE)
        assert RELEASED_AFTER_S - 0.01 < (clock.now_ns() - last_ns) / 1e9 < RELEASED_AFTER_S + 0.5
        assert held.robots["other"].actions == []


async def test_letting_go_is_told_at_once() -> None:
    async with hands() as held:
        await held.do(lambda: held.operator.hold("arm"))
        await held.do(lambda: held.operator.release("arm"))
        await held.arm.until_last(RELEASE)
        assert not held.operator.holds("arm")


async def test_who_is_gone_lets_go_and_holds_nothing_any_more() -> None:
    async with hands() as held:
        await held.do(lambda: held.operator.hold("arm"))
        await held.do(held.operator.close)
        await held.arm.until_last(RELEASE)
        assert await held.do(lambda: held.operator.hold("arm")) is False
        assert held.arm.actions == [ENABLE, RELEASE]


async def test_the_emergency_stop_is_that_of_all_robots() -> None:
    async with hands() as held:
        await held.do(held.operator.stop_everything)
        assert [robot.actions for robot in held.robots.values()] == [[STOP], [STOP]]
        assert held.said == []


async def test_what_the_controller_refuses_is_told() -> None:
    async with hands() as held:
        held.arm.refuses = "turn the key first"
        assert await held.do(lambda: held.operator.press("arm", PadClient.start)) is False
        assert await held.do(lambda: held.operator.hold("arm")) is False
        assert held.said == ["turn the key first", "turn the key first"]
        assert not held.operator.holds("arm")


def test_an_emergency_stop_that_reaches_nobody_says_so(tmp_path: Path) -> None:
    said: list[str] = []
    Operator(tmp_path / "nobody.sock", said.append).stop_everything()
    assert said[0].startswith("THE EMERGENCY STOP WAS NOT PRESSED: no controller at")


@pytest.mark.parametrize("robot", ["arm", "nobody"])
def test_releasing_what_is_not_held_does_nothing(robot: str, tmp_path: Path) -> None:
    operator = Operator(tmp_path / "nobody.sock", print)
    operator.release(robot)
    operator.close()
