"""Watches running robots: the newest state of each, by an observer on the servo link, and what the pad shows.

A thread a robot and one for the pad; each one begins anew, for as long as it is watched, when its controller is gone.
"""

import contextlib
import threading
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Final, NamedTuple, Self

from hil.client.pad import PadClient, RobotState
from hil.client.servo import Role, ServoClient, load_key
from hil.values.errors import EndpointError, HilError, UnknownName
from tools.view.drawing import ArmNow, DrawnRobot
from tools.view.sources import Source, Sources

STATE_PERIOD_MS: Final = 20
PAD_PERIOD_S: Final = 0.2
RETRY_S: Final = 0.5
CONNECT_TIMEOUT_S: Final = 5.0
_OBSERVER_WATCHDOG_MS: Final = 1000
_MESSAGES: Final = 50
_LATENCIES: Final = 300
"""A minute of them."""


class Message(NamedTuple):
    """Something the operator is told of a robot."""

    robot: str
    at_s: float
    """Seconds of the controller's time."""
    text: str


class Latency(NamedTuple):
    """What the pad said of a robot's times at ``at_s`` of the controller."""

    at_s: float
    answer_ms: float | None
    cycle_ms: float


class Watch:
    """Watches from ``open`` (or ``with``) to ``close``; any thread may ask."""

    def __init__(
        self,
        sources: Sources,
        *,
        name: str = "hil view",
        period_ms: int = STATE_PERIOD_MS,
        connect_timeout_s: float = CONNECT_TIMEOUT_S,
    ) -> None:
        self._observers = _Observers(name, period_ms, connect_timeout_s)
        self._take(sources)

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _take(self, sources: Sources) -> None:
        self.sources = sources
        self._robots = [_Robot(source, self._observers) for source in sources.robots]
        self._pad = None if sources.pad is None else _Pad(sources.pad)

    def renew(self, sources: Sources) -> None:
        """Watch others from now on; raises as :meth:`open` does, and then goes on with those before."""
        new = Watch(sources, **self._observers._asdict())
        new.open()
        self.close()
        self.sources, self._robots, self._pad = sources, new._robots, new._pad

    def open(self) -> None:
        """Meet all robots once, and watch from then on; raises what the first one raised that could not be met."""
        try:
            for robot in self._robots:
                robot.meet()
        except BaseException:
            self.close()
            raise
        for watched in (*self._robots, self._pad):
            if watched is not None:
                watched.start()

    def close(self) -> None:
        """Stop watching; idempotent."""
        for watched in (*self._robots, self._pad):
            if watched is not None:
                watched.close()

    @property
    def robots(self) -> tuple[DrawnRobot, ...]:
        """The robots, as they were told when they were met last."""
        return tuple(robot.drawn for robot in self._robots)

    def source(self, robot: str) -> Source:
        """Return where a robot is; raise :class:`UnknownName`."""
        for one in self._robots:
            if one.drawn.name == robot:
                return one.source
        raise UnknownName("robot", robot, [one.drawn.name for one in self._robots])

    def now(self) -> dict[str, ArmNow]:
        """Return all robots as they are now, by name."""
        return {robot.drawn.name: robot.now for robot in self._robots}

    def pad(self) -> Mapping[str, RobotState]:
        """Return what the pad shows, by robot; empty where there is no pad, or while it is gone."""
        return {} if self._pad is None else self._pad.shown

    def messages(self) -> tuple[Message, ...]:
        """Return what the operator was told, the newest last."""
        return () if self._pad is None else tuple(self._pad.messages)

    def latencies(self, robot: str) -> tuple[Latency, ...]:
        """Return the times of a robot in the last minute."""
        return () if self._pad is None else tuple(self._pad.latencies.get(robot, ()))


class _Observers(NamedTuple):
    """What all observers of a watch have in common."""

    name: str
    period_ms: int
    connect_timeout_s: float


class _Thread:
    """A loop in a thread, which ends when it is told to."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        self._thread = threading.Thread(target=self._run, name=self._what, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ended.set()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()

    def _run(self) -> None:
        try:
            while not self._ended.is_set():
                try:
                    self._watch()
                except HilError as error:
                    self._lost(str(error))
                self._ended.wait(RETRY_S)
        finally:
            if not self._ended.is_set():
                self._lost("what watches it failed, and said why on standard error: that is a bug of ours")

    def _watch(self) -> None:
        raise NotImplementedError

    def _lost(self, why: str) -> None:
        raise NotImplementedError


class _Robot(_Thread):
    def __init__(self, source: Source, observers: "_Observers") -> None:
        super().__init__(f"watches {source.name or source.address}")
        self.source = source
        self.now = ArmNow(None, "it was not met yet")
        self._observers = observers
        self._client: ServoClient | None = None
        self._drawn: DrawnRobot | None = None

    @property
    def drawn(self) -> DrawnRobot:
        if self._drawn is None:
            raise EndpointError(f"the robot at {self.source.address} was not met yet")
        return self._drawn

    def meet(self) -> None:
        self._client = self._connect()

    def close(self) -> None:
        super().close()
        self._leave()

    def _connect(self) -> ServoClient:
        key = None if self.source.key_file is None else load_key(self.source.key_file)
        client = ServoClient(
            self.source.address,
            name=self._observers.name,
            role=Role.OBSERVER,
            state_period_ms=self._observers.period_ms,
            connect_timeout_s=self._observers.connect_timeout_s,
            watchdog_ms=_OBSERVER_WATCHDOG_MS,
            key=key,
        )
        client.connect()
        model = self.source.model or client.controller.robot
        self._drawn = DrawnRobot(self.source.name or self.source.address, model, client.frames)
        self.now = ArmNow(client.read_state())
        return client

    def _watch(self) -> None:
        if self._client is None:
            self._client = self._connect()
        client = self._client
        while not self._ended.is_set():
            snapshot = client.wait_for_state(timeout_s=RETRY_S)
            if snapshot is not None:
                self.now = ArmNow(snapshot)
            elif self.now.snapshot is not None:
                self.now = ArmNow(self.now.snapshot, f"no state came from {self.source.address} for {RETRY_S:g} s")

    def _lost(self, why: str) -> None:
        self._leave()
        self.now = ArmNow(self.now.snapshot, why)

    def _leave(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            with contextlib.suppress(HilError):
                client.close()


class _Pad(_Thread):
    def __init__(self, socket: Path) -> None:
        super().__init__("watches the pad")
        self._socket = socket
        self.shown: Mapping[str, RobotState] = {}
        self.messages: deque[Message] = deque(maxlen=_MESSAGES)
        self.latencies: dict[str, deque[Latency]] = {}
        self._told: dict[tuple[str, str], str] = {}

    def _watch(self) -> None:
        with PadClient(self._socket) as pad:
            while not self._ended.is_set():
                shown = pad.status()
                for name, state in shown.items():
                    self._note(name, state)
                self.shown = shown
                self._ended.wait(PAD_PERIOD_S)

    def _note(self, name: str, state: RobotState) -> None:
        at_s, latency, stop, session = state["time_s"], state["latency"], state["last_stop"], state["session"]
        times = self.latencies.setdefault(name, deque(maxlen=_LATENCIES))
        times.append(Latency(at_s, latency["answer_ms"], latency["cycle_ms"]))
        self._say(name, at_s, "mode", f"{state['mode']}, program {state['program']}")
        self._say(name, at_s, "reason", state["reason"])
        self._say(name, at_s, "commander", f"commanded by {state['commander']}" if state["commander"] else "")
        if session is not None:
            self._say(name, at_s, "session", f"FRI session {session['state']}, quality {session['quality']}")
        if stop is not None:
            category = "" if stop["category"] is None else f"stop of category {stop['category']}: "
            self._say(name, stop["at_s"], "stop", f"{category}{stop['reason']}", key=f"{stop['at_s']}")

    def _say(self, name: str, at_s: float, what: str, text: str, *, key: str = "") -> None:
        """Note ``text`` where it, or what tells two of the same text apart, is not what was said before."""
        before = self._told.get((name, what))
        self._told[name, what] = key + text
        if text and before != key + text:
            self.messages.append(Message(name, at_s, text))

    def _lost(self, why: str) -> None:
        self.shown = {}
        last = self.messages[-1] if self.messages else Message("", 0.0, "")
        if last.text != why:
            self.messages.append(Message("", last.at_s, why))
