"""The comparison itself: monitoring messages in, differences an axis out. No socket, no clock, no file.

The emulated arm is the simulated one under its stiff position controller. It is led by what the real arm is *commanded*
where the wire says that (1.x), else by where it is *measured* (2.x): then the positions agree by construction, and what
is worth looking at are the torques. Its command of one message shows in the measurement of the next one, as with our
own controller; whether a Cabinet's message holds them so is not public.
"""

import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from backends.cabinet.reading import Said, read_message
from backends.mujoco import MujocoBackend
from backends.robots import load_description, load_pinocchio
from hil.core.control.stage import ControlStage
from hil.core.model import ArmModel
from hil.values.arm import ArmState, JointCommand, seven
from hil.values.errors import MalformedDatagram
from hil.values.fri import SEQUENCE_MODULUS, TRAITS, ControlMode, DriveState, Release, SessionState
from hil.values.fri_messages import MonitoringMessage
from hil.values.load import NO_LOAD, Load
from hil.values.robot import JOINT_COUNT, JOINT_NAMES, Seven

SETTLE_NS: Final = 300_000_000
"""So long after it was put where the real one is, the emulated arm is not compared: that one may have been moving."""
MOST_BRIDGED: Final = 20
"""Messages in a row that may be missing; after more the emulated arm is put anew where the real one is."""
MOST_POINTS: Final = 4000
_NS_PER_MS: Final = 1_000_000
_LARGEST_ANGLE_RAD: Final = 2 * math.pi
_STILL: Seven = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
QUANTITIES: Final = ("position", "measured torque", "external torque")
UNITS: Final = {"position": "mrad", "measured torque": "Nm", "external torque": "Nm"}
_PER_UNIT: Final = {"position": 1e3, "measured torque": 1.0, "external torque": 1.0}


class Point(NamedTuple):
    """Both arms at one time: positions in mrad, torques in Nm, in the order of :data:`QUANTITIES`."""

    at_s: float
    real: tuple[Seven, Seven, Seven]
    emulated: tuple[Seven, Seven, Seven]


@dataclass(slots=True)
class Difference:
    """Of one quantity of one axis, emulated minus real."""

    count: int = 0
    squares: float = 0.0
    worst: float = 0.0
    worst_at_s: float = 0.0

    def add(self, difference: float, at_s: float) -> None:
        """Take one more."""
        self.count += 1
        self.squares += difference * difference
        if abs(difference) > abs(self.worst):
            self.worst, self.worst_at_s = difference, at_s

    @property
    def rms(self) -> float:
        """Root of the mean square."""
        return math.sqrt(self.squares / self.count) if self.count else 0.0


class ShadowComparison:
    """One real arm; ``load`` is what hangs on its flange, as far as the emulated one is told."""

    def __init__(self, *, release: Release, robot: str, load: Load = NO_LOAD) -> None:
        self._release = release
        self._robot = robot
        self._load = load
        self._description = load_description(robot)
        self._model = ArmModel(load_pinocchio(robot))
        self._arm: MujocoBackend | None = None
        self._stage: ControlStage | None = None
        self._led_by_command = TRAITS[release].commanded_position
        self._last: Said | None = None
        self._before_last: Seven | None = None
        """Lead of the message before the last one."""
        self._first_ns: int | None = None
        self._arm_ns = 0
        """Time of the emulated arm."""
        self._compare_from_ns = 0
        self.differences = {what: [Difference() for _ in range(JOINT_COUNT)] for what in QUANTITIES}
        self.points: list[Point] = []
        self._every = 1
        self.compared = 0
        self.counts = dict.fromkeys(("messages", "malformed", "old", "missing", "not held", "begun anew"), 0)
        self.control_modes: dict[ControlMode, int] = {}
        self.last_at_s = 0.0

    def take(self, message: MonitoringMessage, now_ns: int) -> None:
        """Take a message that came at ``now_ns``; one that says too little, or came before, is counted and no more."""
        try:
            said = read_message(message, self._release)
        except MalformedDatagram:
            self.counts["malformed"] += 1
            return
        if max(map(abs, self._lead(said))) > _LARGEST_ANGLE_RAD:
            self.counts["malformed"] += 1
            return
        self.counts["messages"] += 1
        if self._first_ns is None:
            self._first_ns = now_ns
        last = self._last
        periods = 0 if last is None else (said.counter - last.counter) % SEQUENCE_MODULUS
        if last is not None and periods in {0, *range(SEQUENCE_MODULUS - MOST_BRIDGED, SEQUENCE_MODULUS)}:
            self.counts["old"] += 1
            return
        self.last_at_s = (now_ns - self._first_ns) * 1e-9
        self.control_modes[said.control_mode] = self.control_modes.get(said.control_mode, 0) + 1
        if said.drive_states.count(DriveState.ACTIVE) != JOINT_COUNT:
            self.counts["not held"] += 1
            self._forget()
        elif last is None or periods > MOST_BRIDGED or last.send_period_ms != said.send_period_ms:
            self._put(said)
        else:
            self.counts["missing"] += periods - 1
            self._follow(last, said, periods)
            self._compare(said)
            self._before_last = self._lead(last)
            self._last = said

    def close(self) -> None:
        """Release the emulated arm."""
        self._forget()

    def report(self) -> dict[str, object]:
        """Return what was found, for programs; mrad, Nm, seconds."""
        return {
            "release": self._release.value,
            "robot": self._robot,
            "led_by": "commanded position" if self._led_by_command else "measured position",
            "duration_s": round(self.last_at_s, 6),
            "compared": self.compared,
            **{name.replace(" ", "_"): count for name, count in self.counts.items()},
            "control_modes": {mode.name: count for mode, count in self.control_modes.items()},
            "differences": {
                what: {
                    name: {"rms": one.rms, "worst": one.worst, "worst_at_s": one.worst_at_s}
                    for name, one in zip(JOINT_NAMES, axes, strict=True)
                }
                for what, axes in self.differences.items()
            },
        }

    def notes(self) -> list[str]:
        """Return what must be known to read the figures, in words."""
        notes = []
        if not self._led_by_command:
            notes.append(
                "2.x does not say what the arm is commanded: the emulated one is led by where it is measured, so that "
                "only torques tell something"
            )
        others = [mode.name for mode in self.control_modes if mode is not ControlMode.POSITION]
        if others:
            notes.append(f"the real arm was under {', '.join(others)} too; the emulated one is always stiff")
        if not self.compared:
            notes.append("nothing was compared: it takes 0.3 s of messages of an arm whose drives hold it")
        return notes

    def _lead(self, said: Said) -> Seven:
        commanded = said.commanded_position_rad
        return seven(commanded) if self._led_by_command and commanded is not None else said.position_rad

    def _forget(self) -> None:
        if self._arm is not None:
            self._arm.close()
        self._arm, self._stage, self._last, self._before_last = None, None, None, None

    def _put(self, said: Said) -> None:
        """Put a new emulated arm where the real one is told to be."""
        self._forget()
        self.counts["begun anew"] += 1
        arm = MujocoBackend(
            replace(self._description, initial_position_rad=self._lead(said)), load=self._load, torque_noise=False
        )
        arm.open(period_ns=said.send_period_ms * _NS_PER_MS)
        self._arm = arm
        self._stage = ControlStage(self._model.dynamics(self._load), sensor_sigma_nm=arm.capabilities.torque_sigma_nm)
        self._compare_from_ns = self._arm_ns + SETTLE_NS
        self._last = said

    def _follow(self, last: Said, said: Said, periods: int) -> None:
        """Let the emulated arm go on to ``said``, led on a straight line where messages are missing."""
        arm, stage = self._arm, self._stage
        if arm is None or stage is None:
            return
        period_s = said.send_period_ms * 1e-3
        start, end = self._lead(last), self._lead(said)
        for number in range(periods):
            self._arm_ns += said.send_period_ms * _NS_PER_MS
            if self._led_by_command:
                planned = last.state < SessionState.COMMANDING_WAIT
                arm.write(self._command(start, end, number / periods, periods * period_s, planned=planned))
            else:
                rate = seven([(b - a) / (periods * period_s) for a, b in zip(start, end, strict=True)])
                arm.write(JointCommand(_between(start, end, (number + 1) / periods), rate))
            arm.step()
            self._emulated = stage.read(arm.read(), now_ns=self._arm_ns)

    def _command(self, start: Seven, end: Seven, share: float, step_s: float, *, planned: bool) -> JointCommand:
        """Return the command of the last message: its neighbours tell its velocity, and its acceleration.

        What a client lays over is not ``planned``: our controller knows where it came from, and not how it goes on.
        """
        before = self._before_last
        if before is None or share > 0.0:
            rate = seven([(b - a) / step_s for a, b in zip(start, end, strict=True)])
            return JointCommand(_between(start, end, share), rate)
        if not planned:
            return JointCommand(start, seven([(b - a) / step_s for a, b in zip(before, start, strict=True)]))
        rate = seven([(b - a) / (2 * step_s) for a, b in zip(before, end, strict=True)])
        bend = seven([(a - 2 * b + c) / step_s**2 for a, b, c in zip(before, start, end, strict=True)])
        return JointCommand(start, rate, bend)

    def _compare(self, said: Said) -> None:
        if self._arm_ns < self._compare_from_ns:
            return
        self.compared += 1
        real = (_milli(said.position_rad), said.torque_nm, said.external_torque_nm)
        arm: ArmState = self._emulated
        emulated = (_milli(arm.position_rad), arm.torque_nm, arm.external_torque_nm)
        for what, here, there in zip(QUANTITIES, real, emulated, strict=True):
            for one, value, other in zip(self.differences[what], here, there, strict=True):
                one.add(other - value, self.last_at_s)
        if self.compared % self._every == 0:
            self.points.append(Point(self.last_at_s, real, emulated))
            if len(self.points) >= MOST_POINTS:
                self.points = self.points[::2]
                self._every *= 2


def _between(start: Seven, end: Seven, share: float) -> Seven:
    return seven([a + share * (b - a) for a, b in zip(start, end, strict=True)])


def _milli(values: Seven) -> Seven:
    return seven([1e3 * value for value in values])
