"""An operator's hands in the page: what comes too late holds nothing, and what cannot be is refused."""

import asyncio
import queue
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar, Self

import pytest

from hil.client.pad import PadRefused
from hil.client.servo import SessionEnded, SessionRefused
from hil.values.errors import ConfigurationError
from hil.values.frames import FLANGE
from hil.values.link import Address
from tools.view import jog
from tools.view import operator as hands
from tools.view.browser.panel import _at_once, _held, _let_go, _run_while_held
from tools.view.browser.rendering_tab import _file
from tools.view.jog import Jogger, JogKey, Space
from tools.view.operator import Operator
from tools.view.sources import Source


class Pad:
    """Stands in for the connection to a controller."""

    refuses = False
    mode = "T1"
    started: ClassVar[list[str]] = []
    held: ClassVar[list["Pad"]] = []

    def __init__(self, _socket: Path, *, robot: str) -> None:
        self.robot = robot

    def connect(self) -> None:
        """Do nothing."""

    def enable(self, *, hold: bool) -> None:
        if Pad.refuses:
            raise PadRefused("another pad holds it", {})
        Pad.held.append(self)

    def status(self) -> dict[str, dict[str, str]]:
        return {self.robot: {"mode": Pad.mode}}

    def start(self) -> None:
        Pad.started.append(self.robot)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def close(self) -> None:
        if self in Pad.held:
            Pad.held.remove(self)


@pytest.fixture
def told() -> list[str]:
    return []


@pytest.fixture
def operator(told: list[str], monkeypatch: pytest.MonkeyPatch) -> Iterator[Operator]:
    monkeypatch.setattr(hands, "PadClient", Pad)
    Pad.refuses, Pad.mode, Pad.held, Pad.started = False, "T1", [], []
    one = Operator(Path("pad"), told.append)
    yield one
    one.close()


def test_a_hold_that_comes_after_the_release_holds_nothing(operator: Operator) -> None:
    said_at = operator.grip
    assert operator.hold("arm", grip=said_at)
    operator.release("arm")
    assert not operator.hold("arm", grip=said_at)
    assert Pad.held == []
    assert operator.hold("arm", grip=operator.grip)


def test_a_release_overtakes_the_holds_that_wait_for_a_thread(operator: Operator) -> None:
    waiting, late, done = threading.Event(), threading.Event(), threading.Event()

    def hold(grip: int) -> None:
        waiting.wait(5)
        operator.hold("arm", grip=grip)
        late.set()

    def let_go() -> None:
        operator.release("arm")
        done.set()

    async def browser() -> None:
        await _held(operator, hold)(None)
        await _let_go(operator, let_go)(None)
        await asyncio.to_thread(done.wait, 5)
        waiting.set()
        await asyncio.to_thread(late.wait, 5)

    asyncio.run(browser())
    assert late.is_set()
    assert Pad.held == []


def test_the_emergency_stop_needs_no_thread_of_those_that_wait() -> None:
    pressed = threading.Event()
    asyncio.run(_at_once(pressed.set)(None))
    assert pressed.wait(5)


def test_a_refusal_is_said_once_to_a_key_that_is_held(operator: Operator, told: list[str]) -> None:
    Pad.refuses = True
    for _ in range(20):
        assert not operator.hold("arm")
    assert told == ["another pad holds it"]
    operator.release("arm")
    assert not operator.hold("arm")
    assert len(told) == 2


def test_a_key_that_is_held_starts_nothing_that_letting_go_would_not_stop(operator: Operator, told: list[str]) -> None:
    _run_while_held(operator, "arm", operator.grip)
    assert Pad.started == ["arm"]
    operator.release("arm")
    Pad.mode = "AUT"
    _run_while_held(operator, "arm", operator.grip)
    assert Pad.started == ["arm"]
    assert told == ["AUT runs on when the key is let go: press Start, and Pause; this key is for T1 and T2"]


KEY = JogKey(Space.AXIS, 0, 1)


@pytest.mark.parametrize(
    "wrong",
    [{"share": 1000.0}, {"share": 0.0}, {"share": float("nan")}, {"number": 7}, {"number": -1}, {"sign": 3},
     {"space": Space.TOOL, "number": 6}],
)  # fmt: skip
def test_a_jog_key_that_there_is_not_moves_nothing(wrong: dict[str, Any], told: list[str]) -> None:
    jogger = Jogger(Source("127.0.0.1:1"), "lbr-iiwa-14-r820", press_start=list, say=told.append)
    with pytest.raises(ConfigurationError):
        jogger.hold(KEY._replace(**wrong))
    assert KEY.frame == FLANGE


def test_who_taps_a_jog_key_hears_who_commands_the_arm(told: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    let_go = threading.Event()

    def refuse(*_where: object, **_how: object) -> None:
        assert let_go.wait(5)
        raise SessionRefused(Address("127.0.0.1", 1), "the arm is commanded by another")

    monkeypatch.setattr(jog, "ServoClient", refuse)
    jogger = Jogger(Source("127.0.0.1:1"), "lbr-iiwa-14-r820", press_start=list, say=told.append)
    jogger.hold(KEY)
    jogger.release()
    let_go.set()
    jogger.close()
    assert [text.rpartition(": ")[2] for text in told] == ["the arm is commanded by another"]


class Waiting:
    """Stands in for a session whose request waits for the operator's start."""

    def __init__(self, *_where: object, **_how: object) -> None:
        self.asked, self.closed = threading.Event(), threading.Event()
        sessions.put(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    @property
    def operator(self) -> None:
        self.asked.set()
        assert self.closed.wait(5)
        raise SessionEnded("closed")

    def close(self) -> None:
        self.closed.set()


sessions: queue.SimpleQueue[Waiting] = queue.SimpleQueue()


def test_a_jog_whose_request_waits_for_start_ends_too(told: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jog, "ServoClient", Waiting)
    monkeypatch.setattr(jog, "_BRAKES_S", 0.02)
    jogger = Jogger(Source("127.0.0.1:1"), "lbr-iiwa-14-r820", press_start=list, say=told.append)
    jogger.hold(KEY)
    session = sessions.get(timeout=5)
    assert session.asked.wait(5)
    jogger.close()
    assert session.closed.is_set()
    assert told == []


@pytest.mark.parametrize("typed", ["", "  ", "/", "a\0b"])
def test_what_is_no_station_file_is_refused_in_words(typed: str) -> None:
    with pytest.raises(ConfigurationError, match="is no station file"):
        _file(typed)
