"""One person's hands on the pad of a controller: keys at once, and an enabling switch that must be held.

Whoever holds a switch says so again and again (:meth:`Operator.hold`); who falls silent for ``RELEASED_AFTER_S`` let
go, whatever became of him. The controller does the same with this process: it lets go what a closed connection held.
"""

import contextlib
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Final

from hil.client.pad import PadClient
from hil.clock import MonotonicClock
from hil.values.errors import HilError

RELEASED_AFTER_S: Final = 0.5
"""Silence after which the enabling switch counts as let go: a browser that is slow in drawing says it late."""
HOLD_HZ: Final = 20.0
_LOOK_S: Final = 0.05
_NS: Final = 1_000_000_000

Key = Callable[[PadClient], object]


class Operator:
    """Works from ``open`` to ``close``; any thread may call it. ``say`` is told what the controller refused."""

    def __init__(self, socket: Path, say: Callable[[str], None]) -> None:
        self._socket = socket
        self._say = say
        self._clock = MonotonicClock()
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._pads: dict[str, PadClient] = {}
        """Connections that hold an enabling switch, by robot."""
        self._held_until_ns: dict[str, int] = {}
        self._refused: dict[str, str] = {}
        self.grip = 0
        """Number of the press that goes on; what was said under an older one comes too late."""
        self._watcher = threading.Thread(target=self._watch, name="watches the enabling switch", daemon=True)

    def open(self) -> None:
        """Begin to watch what is held."""
        self._watcher.start()

    def close(self) -> None:
        """Let go of everything; idempotent."""
        self._ended.set()
        if self._watcher.is_alive() and threading.current_thread() is not self._watcher:
            self._watcher.join()
        with self._lock:
            for robot in list(self._pads):
                self._let_go(robot)

    def press(self, robot: str, key: Key) -> bool:
        """Do something with the pad of ``robot``, at once; return whether the controller did it."""
        try:
            with PadClient(self._socket, robot=robot) as pad:
                key(pad)
        except HilError as refused:
            self._say(str(refused))
            return False
        return True

    def stop_everything(self) -> None:
        """Press the emergency stop of all robots."""
        try:
            with PadClient(self._socket) as pad:
                pad.emergency_stop()
        except HilError as refused:
            self._say(f"THE EMERGENCY STOP WAS NOT PRESSED: {refused}")

    def hold(self, robot: str, *, grip: int | None = None) -> bool:
        """Hold the enabling switch of ``robot``, or go on holding it; return whether it is held.

        ``grip`` is what :attr:`grip` was when the browser said so: its thread may come here after the one that lets go.
        """
        with self._lock:
            if self._ended.is_set() or (grip is not None and grip != self.grip):
                return False
            self._held_until_ns[robot] = self._clock.now_ns() + int(RELEASED_AFTER_S * _NS)
            if robot in self._pads:
                return True
            pad = PadClient(self._socket, robot=robot)
            try:
                pad.connect()
                pad.enable(hold=True)
            except HilError as refused:
                pad.close()
                del self._held_until_ns[robot]
                self._say_once(robot, str(refused))
                return False
            self._pads[robot] = pad
            self._refused.pop(robot, None)
            return True

    def begin_release(self) -> None:
        """Let nothing that was said before hold a switch any more; never waits."""
        self.grip += 1

    def release(self, robot: str) -> None:
        """Let the enabling switch of ``robot`` go; does nothing when it is not held."""
        self.begin_release()
        with self._lock:
            self._refused.pop(robot, None)
            self._let_go(robot)

    def _say_once(self, robot: str, refusal: str) -> None:
        """Say it once to a key that is held, which asks again twenty times a second."""
        if self._refused.get(robot) != refusal:
            self._refused[robot] = refusal
            self._say(refusal)

    def holds(self, robot: str) -> bool:
        """Whether the enabling switch of ``robot`` is held here."""
        with self._lock:
            return robot in self._pads

    def _let_go(self, robot: str) -> None:
        self._held_until_ns.pop(robot, None)
        pad = self._pads.pop(robot, None)
        if pad is not None:
            # Closing the connection is what lets go, whatever is said before.
            with contextlib.suppress(HilError):
                pad.close()

    def _watch(self) -> None:
        while not self._ended.wait(_LOOK_S):
            now_ns = self._clock.now_ns()
            with self._lock:
                for robot in [one for one, until_ns in self._held_until_ns.items() if until_ns < now_ns]:
                    self._let_go(robot)
