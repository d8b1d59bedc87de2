"""Jogging: a key that is held moves one axis, or a frame along one of its directions, slowly enough for T1.

What moves the arm is a SmartServo of an application like any other: admission, limits, the enabling switch and T1's
monitor hold for it. It lasts as long as its key is held; letting go, or falling silent, ends its session, and the arm
brakes.
"""

import contextlib
import math
import threading
from collections.abc import Callable, Iterator
from enum import StrEnum
from typing import Final, NamedTuple

from backends.robots import load_description, load_pinocchio
from hil.client.servo import ServoClient, SessionRefused, SmartServo, load_key
from hil.clock import MonotonicClock
from hil.core.model import ArmModel
from hil.values.arm import seven
from hil.values.errors import ConfigurationError, HilError
from hil.values.frames import FLANGE
from hil.values.fri import OperationMode
from hil.values.operator import OperatorView, ProgramState
from hil.values.pose import Pose
from hil.values.robot import JOINT_COUNT, JOINT_NAMES, Seven, Three
from tools.view.operator import RELEASED_AFTER_S
from tools.view.sources import Source

FASTEST_MM_S: Final = 200.0
"""Of the flange, at 100 %: four fifths of what T1 allows."""
FASTEST_RAD_S: Final = math.radians(30.0)
_RAMP_S: Final = 0.3
_STEP_S: Final = 0.02
_STATE_PERIOD_MS: Final = 10
_WATCHDOG_MS: Final = 200
_BRAKES_S: Final = 0.5
"""What a session may last longer than its key."""
_CONNECT_S: Final = 2.0
_ADMISSION_S: Final = 1.0
"""Longer than the controller waits for a commander that fell silent."""
_MARGIN_RAD: Final = math.radians(0.5)
_AHEAD_S: Final = 0.4
"""How far a destination may be ahead of the set point, as time at full speed."""
_FRAME_VELOCITY_REL: Final = 0.3
_NS: Final = 1_000_000_000


class Space(StrEnum):
    """What a jog key moves."""

    AXIS = "axis"
    TOOL = "tool"
    """The moved frame along, or about, its own directions."""
    BASE = "base"
    """The moved frame along, or about, the directions of the robot base."""


class JogKey(NamedTuple):
    """``number`` counts axes A1 to A7, or X, Y, Z, A, B, C, from 0; ``share`` of the fastest is 0 to 1."""

    space: Space
    number: int
    sign: int
    share: float = 0.3
    frame: str = FLANGE
    """What is moved, of the flange or of a tool."""

    def __str__(self) -> str:
        name = JOINT_NAMES[self.number] if self.space is Space.AXIS else "XYZABC"[self.number]
        return f"{name}{'+' if self.sign > 0 else '-'}"


class Jogger:
    """One robot, jogged by one person; any thread may call it.

    ``press_start`` presses the start key where motions wait for it, ``say`` is told why nothing moves.
    """

    def __init__(
        self, source: Source, model: str, *, press_start: Callable[[], object], say: Callable[[str], None]
    ) -> None:
        self._source = source
        self._limits = load_description(model).limits
        self._arm = ArmModel(load_pinocchio(model))
        self._forward = self._arm.kinematics(self._limits).forward
        self._press_start = press_start
        self._say = say
        self._clock = MonotonicClock()
        self._lock = threading.Lock()
        self._until_ns = 0
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def hold(self, key: JogKey) -> None:
        """Begin, or go on, to move; to be called again while the key is held. What failed begins with a new press.

        Raises :class:`ConfigurationError` for a key that there is not.
        """
        _check(key)
        with self._lock:
            now_ns = self._clock.now_ns()
            pressed_before = now_ns <= self._until_ns and not self._ended.is_set()
            self._until_ns = now_ns + int(RELEASED_AFTER_S * _NS)
            if pressed_before:
                return
            if self._thread is not None and self._thread.is_alive():
                # The key before was let go, and must not go on with this one's breath.
                self._ended.set()
                return
            self._ended.clear()
            self._thread = threading.Thread(target=self._run, args=(key,), name=f"jogs {key}", daemon=True)
            self._thread.start()

    def release(self) -> None:
        """Let the key go; the arm brakes."""
        self._ended.set()

    def close(self) -> None:
        """Let go, and wait until the session is over; idempotent."""
        self.release()
        with self._lock:
            thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()

    def _run(self, key: JogKey) -> None:
        try:
            self._jog(key)
        except HilError as error:
            # Who commands the arm is known after a second: a key that was tapped hears of it too.
            if isinstance(error, SessionRefused) or not self._let_go():
                self._say(f"jog {key}: {error}")

    def _let_go(self) -> bool:
        return self._ended.is_set() or self._clock.now_ns() > self._until_ns

    def _jog(self, key: JogKey) -> None:
        code = None if self._source.key_file is None else load_key(self._source.key_file)
        with ServoClient(
            self._source.address,
            name="jog keys",
            state_period_ms=_STATE_PERIOD_MS,
            watchdog_ms=_WATCHDOG_MS,
            key=code,
            connect_timeout_s=_ADMISSION_S,
        ) as client:
            over = threading.Event()
            ending = threading.Thread(target=self._end_late, args=(client, over), name="ends a jog", daemon=True)
            ending.start()
            try:
                self._lead(client, key)
            finally:
                over.set()
                ending.join()

    def _end_late(self, client: ServoClient, over: threading.Event) -> None:
        """End a session that outlives its key: a request waits as long as the operator's start does (manual 9.1.2)."""
        while not self._let_go():
            if over.wait(_STEP_S):
                return
        if not over.wait(_BRAKES_S):
            with contextlib.suppress(HilError):
                client.close()

    def _lead(self, client: ServoClient, key: JogKey) -> None:
        if client.operator.mode is OperationMode.AUT:
            self._say("the jog keys work in T1 and T2: turn the mode selector")
            return
        if client.operator.override_percent == 0.0:
            self._say("the override is 0 %: turn it up")
            return
        if self._ready(client):
            (self._move_axis if key.space is Space.AXIS else self._move_frame)(client, key)

    def _ready(self, client: ServoClient) -> bool:
        """Press start where that is all that is missing; return whether motions run."""
        view = client.operator
        while not view.enabling and not self._let_go():
            view = self._next(client, view)
        if view.program is ProgramState.PAUSED:
            self._press_start()
        while view.program is ProgramState.PAUSED and not self._let_go():
            view = self._next(client, view)
        if view.program in {ProgramState.STOPPED, ProgramState.EMERGENCY_STOP}:
            self._say(view.reason)
        return view.program is ProgramState.RUNNING

    def _next(self, client: ServoClient, before: OperatorView) -> OperatorView:
        snapshot = client.wait_for_state(timeout_s=_STEP_S)
        return before if snapshot is None else snapshot.operator

    def _move_axis(self, client: ServoClient, key: JogKey) -> None:
        """Go for the end of the axis, as fast as the key says; the flange's distance from the axis stays what it is."""
        axis, limits = key.number, self._limits
        here = seven(client.read_state().commanded_position)
        fastest = limits.velocity_rad_s[axis]
        wanted = key.share * min(_fastest_rad_s(self._arm.flange_speed_mm_s(here, _one(axis))), fastest)
        ends = limits.position_min_rad[axis] + _MARGIN_RAD, limits.position_max_rad[axis] - _MARGIN_RAD
        destination = list(here)
        destination[axis] = max(ends[1], here[axis]) if key.sign > 0 else min(ends[0], here[axis])
        motion = SmartServo(destination).set_joint_velocity_rel(wanted / fastest)
        client.move_async(motion)
        runtime = motion.get_runtime(timeout_s=_CONNECT_S)
        for _ in self._steps():
            runtime.update_with_realtime_system()
        motion.stop_motion()

    def _move_frame(self, client: ServoClient, key: JogKey) -> None:
        """Lead the frame by a destination that is a little ahead of it on its way."""
        frame_in_flange = client.frames.in_flange(key.frame)
        here = seven(client.read_state().commanded_position)
        start = self._forward(here) @ frame_in_flange
        lever_mm = 1e3 * math.hypot(*frame_in_flange.position_m)
        turns = key.number >= 3
        speed = key.share * (_fastest_rad_s(lever_mm) if turns else FASTEST_MM_S * 1e-3)
        motion = SmartServo().set_joint_velocity_rel(_FRAME_VELOCITY_REL)
        client.move_async(motion, key.frame)
        runtime = motion.get_runtime(timeout_s=_CONNECT_S)
        gone = 0.0
        for seconds in self._steps():
            now = self._forward(seven(client.read_state().commanded_position)) @ frame_in_flange
            done = start.angle_rad(now) if turns else start.distance_m(now)
            gone = min(gone + speed * seconds, done + speed * _AHEAD_S)
            runtime.set_destination(moved(start, key, key.sign * gone))
        motion.stop_motion()

    def _steps(self) -> Iterator[float]:
        """Yield, until the key is let go, the seconds at full speed that each step stands for: it ramps up."""
        begun_ns = last_ns = self._clock.now_ns()
        while not self._ended.wait(_STEP_S) and not self._let_go():
            now_ns = self._clock.now_ns()
            seconds, last_ns = (now_ns - last_ns) / _NS, now_ns
            # Whoever was held up must not make a leap of it.
            yield min(seconds, 2.0 * _STEP_S) * min(1.0, (now_ns - begun_ns) / _NS / _RAMP_S)


def _check(key: JogKey) -> None:
    """What a page said of a key is not the page's to decide."""
    if not 0 <= key.number < (JOINT_COUNT if key.space is Space.AXIS else 6) or key.sign not in {-1, 1}:
        raise ConfigurationError(f"there is no jog key {key.number} with the sign {key.sign} for {key.space}")
    if not 0.0 < key.share <= 1.0:
        raise ConfigurationError(f"a jog speed of {100 * key.share:g} % is not above 0 and at most 100 %")


def _fastest_rad_s(lever_mm: float) -> float:
    """Return how fast something may turn that has the flange at its end."""
    return min(FASTEST_RAD_S, FASTEST_MM_S / lever_mm) if lever_mm > 0.0 else FASTEST_RAD_S


def moved(start: Pose, key: JogKey, by: float) -> Pose:
    """Return ``start`` moved by m or rad in a direction of its own, or of the base."""
    if key.number < 3:
        shift = _along(key.number, by)
        if key.space is Space.TOOL:
            return start @ Pose.from_abc_rad(shift, 0.0, 0.0, 0.0)
        x, y, z = (here + more for here, more in zip(start.position_m, shift, strict=True))
        return start._replace(x_m=x, y_m=y, z_m=z)
    # A turns about z, B about y, C about x (robot facts, frames).
    a, b, c = _along(key.number - 3, by)
    turn = Pose.from_abc_rad((0.0, 0.0, 0.0), a, b, c)
    if key.space is Space.TOOL:
        return start @ turn
    return (turn @ start)._replace(x_m=start.x_m, y_m=start.y_m, z_m=start.z_m)


def _along(number: int, by: float) -> Three:
    x, y, z = (by if number == one else 0.0 for one in range(3))
    return x, y, z


def _one(axis: int) -> Seven:
    return seven([1.0 if one == axis else 0.0 for one in range(JOINT_COUNT)])
