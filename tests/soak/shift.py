"""One shift of the virtual soak: a controller, real clients of ours in a bad network, and an operator, for minutes.

Every command that reaches the arm is held against :class:`tests.support.laws.Laws`. What clients may see of it is an
error of our tree, nothing else. After the shift the network is good again and the operator sensible: then an honest
program must get the arm to where it wants it, or something stayed behind.
"""

import math
import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from backends.robots import load_pinocchio
from hil.client.fri import Command, FriHandler, FriState
from hil.client.servo import PTP, DirectServo, Role, ServoClient, SmartServo
from hil.config.station import RobotConfig
from hil.core.model import ArmModel
from hil.testkit.controller import VirtualController
from hil.values.arm import JointCommand
from hil.values.errors import HilError
from hil.values.fri import OperationMode, SessionState
from hil.values.operator import PadKey, Press, ProgramState, SelectMode, SetOverride
from tests.support.laws import Laws

FAULTS: Final = (
    "loss=2%", "loss=20%", "burst=5%x20", "jitter=2ms", "jitter=0.5ms/exponential/overtaking", "delay=8ms",
    "reorder=5%", "duplicate=5%", "corrupt=2%x3", "rate=300kbit/8kB", "half-open=to-controller", "half-open=to-peer",
    "skew=500ppm",
)  # fmt: skip
MOST_S: Final = 7200.0
MOST_UNHEARD: Final = 3
"""Applications in a row that get no session; then the network is repaired."""
PATIENCE_S: Final = 15.0
"""Of the operator with a program that does nothing, or takes long."""


@dataclass
class ShiftReport:
    """What was done, and what was seen."""

    seed: int
    virtual_s: float = 0.0
    commands: int = 0
    moved: int = 0
    reconnects: int = 0
    done: Counter[str] = field(default_factory=Counter)
    refusals: Counter[str] = field(default_factory=Counter)
    """Errors of our tree that clients were given, by their class."""
    stops: int = 0


def held_against_the_laws(controller: VirtualController) -> Laws:
    """Let every command that reaches the arm of ``controller`` be held against the laws from now on."""
    world = controller._world
    core, backend = world.core, world.parts.backend
    law = Laws(world.parts.description.limits, ArmModel(load_pinocchio(controller.config.model)))
    drives, write, hung = core._safety.drives, backend.write, True

    def checked(command: JointCommand) -> None:
        nonlocal hung
        # Without drives the set point follows the arm, which hangs in its brakes.
        before, hung = hung, drives.dropped or not drives.hold
        free = before or hung
        if free:
            law.forget()
        running = core.operator.program is ProgramState.RUNNING
        law.check(command, t1=core._safety.monitors.t1, running=running or free)
        write(command)

    backend.write = checked  # type: ignore[method-assign]
    return law


class Shift:
    """Plays for ``seconds`` of virtual time; the same seed does the same every time."""

    def __init__(self, seed: int, *, seconds: float, reconnects: int, capture: Path | None = None) -> None:
        self.random = random.Random(seed)
        self.report = ShiftReport(seed)
        self._seconds = seconds
        self._reconnects = reconnects
        self._capture = capture
        self._fri: Any = None
        self._unheard = 0
        self._patience_until_s = PATIENCE_S
        choose = self.random.choice
        self.config = RobotConfig.model_validate(
            {
                "model": choose(("lbr-iiwa-7-r800", "lbr-iiwa-14-r820", "lbr-med-7", "lbr-med-14")),
                "backend": choose(("mujoco", "ideal")),
                "mode": choose(("AUT", "T1", "T2")),
                "enabled": True,
                "seed": seed,
                "fri": {
                    "release": choose(("1.11", "1.14", "1.15", "1.16", "2.5", "2.7")),
                    "send_period_ms": choose((1, 2, 5, 10)),
                },
                "servo": {},
            }
        )

    def run(self) -> ShiftReport:
        """Play it; raise AssertionError where a law is broken, or what is no HilError where a client is given that."""
        controller = self._controller = VirtualController(self.config, limit_s=MOST_S, capture=self._capture)
        law = held_against_the_laws(controller)
        with controller.active():
            pieces: tuple[tuple[int, Callable[[], None]], ...] = (
                (10, self._ptp), (8, self._stream), (6, self._fri_comes), (4, self._fri_goes), (6, self._operator),
                (8, self._network), (8, self._network_heals), (4, self._waits), (2, self._push),
            )  # fmt: skip
            controller.when(self._waits_for_ever, self._lets_go_on)
            weights, actions = zip(*pieces, strict=True)
            every_s = self._seconds / max(self._reconnects, 1)
            next_s = every_s
            latest_s = 2.0 * self._seconds
            while controller.now_s < self._seconds or (
                self.report.reconnects < self._reconnects and controller.now_s < latest_s
            ):
                if controller.now_s >= next_s:
                    next_s += every_s
                    self._reconnect()
                else:
                    self._try(self.random.choices(actions, weights)[0])
            self._ends_well()
            self.report.virtual_s = controller.now_s
            self.report.stops = len(controller.stops)
            controller.shut_down()
            controller.run_until(lambda: controller.closed, at_most_s=5.0)
        self.report.commands, self.report.moved = law.checked, law.moved
        return self.report

    def _try(self, action: Callable[[], None]) -> None:
        self._patience_until_s = self._controller.now_s + PATIENCE_S
        self.report.done[action.__name__.strip("_")] += 1
        try:
            action()
        except HilError as error:
            self.report.refusals[type(error).__name__] += 1

    def _reconnect(self) -> None:
        """An application or an observer comes and goes, with a goodbye or without."""
        role = self.random.choice((Role.COMMANDER, Role.OBSERVER))
        client = ServoClient(
            role=role,
            name=f"guest {self.report.reconnects}",
            watchdog_ms=self.random.choice((50, 500)),
            connect_timeout_s=0.3,
        )
        try:
            client.connect()
            client.read_state()
            self.report.reconnects += 1
            self._unheard = 0
            if self.random.random() < 0.3:
                self._vanish(client)
        except HilError as error:
            self.report.refusals[type(error).__name__] += 1
            self._unheard += 1
            if self._unheard >= MOST_UNHEARD:
                self._network_heals()
        finally:
            client.close()

    def _vanish(self, client: ServoClient) -> None:
        """Let nothing of what it says arrive any more, its goodbye neither: to the controller it was killed."""
        network = self._controller.network
        network.arm("half-open=to-controller")
        client.close()
        network.disarm()

    def _goal(self) -> list[float]:
        low, high = self.config_limits
        if self.random.random() < 0.5:
            return [self.random.uniform(a, b) for a, b in zip(low, high, strict=True)]
        here = self._controller.commanded_position_rad
        return [
            min(max(value + self.random.uniform(-0.3, 0.3), a), b) for value, a, b in zip(here, low, high, strict=True)
        ]

    @property
    def config_limits(self) -> tuple[Any, Any]:
        """Axis ranges, rad."""
        limits = self._controller._world.parts.description.limits
        return limits.position_min_rad, limits.position_max_rad

    def _ptp(self) -> None:
        with ServoClient(name="ptp") as robot:
            robot.move(PTP(self._goal()).set_joint_velocity_rel(self.random.choice((0.05, 0.3, 1.0))))

    def _stream(self) -> None:
        with ServoClient(name="stream") as robot:
            if self.random.random() < 0.5:
                smart = SmartServo().set_joint_jerk(self.random.choice((100, 1500)))
                robot.move_async(smart)
                runtime: Any = smart.get_runtime(2.0)
            else:
                direct = DirectServo()
                robot.move_async(direct)
                runtime = direct.get_runtime(2.0)
            goal = list(self._controller.commanded_position_rad)
            for _ in range(self.random.randrange(1, 60)):
                axis = self.random.randrange(7)
                goal[axis] += self.random.uniform(-0.05, 0.05)
                runtime.set_destination(goal)
                self._controller.run(self.random.choice((0.002, 0.01, 0.05)))
            if self.random.random() < 0.7:
                runtime.stop_motion()
            else:
                self._vanish(robot)

    def _fri_comes(self) -> None:
        self._fri_goes()
        self._fri = self._controller.attach_fri(_Restless(self.random))
        self.report.reconnects += 1
        controller = self._controller
        controller.run_until(lambda: controller.session_state is SessionState.COMMANDING_ACTIVE, at_most_s=3.0)
        controller.run(self.random.uniform(0.1, 3.0))

    def _fri_goes(self) -> None:
        if self._fri is not None:
            self._fri.detach()
            self._fri = None

    def _operator(self) -> None:
        operate = self._controller._world.operate
        what = self.random.randrange(4)
        if what == 0:
            operate(SelectMode(self.random.choice(list(OperationMode))))
        elif what == 1:
            operate(SetOverride(self.random.choice((0.0, 3.0, 50.0, 100.0))))
        else:
            operate(Press(self.random.choice(list(PadKey))))
        self._controller.run(self.random.uniform(0.0, 1.0))
        if self.random.random() < 0.8:
            self._sensible_operator()

    def _waits_for_ever(self) -> bool:
        return self._controller.now_s > self._patience_until_s

    def _lets_go_on(self) -> None:
        """A program that was paused, or whose override is 0, waits for the operator, as long as it takes."""
        self.report.done["operator lets go on"] += 1
        self._patience_until_s = self._controller.now_s + PATIENCE_S
        operate = self._controller._world.operate
        operate(SetOverride(100.0))
        for key in (PadKey.RESET, PadKey.ENABLE, PadKey.START):
            operate(Press(key))
        self._controller.when(self._waits_for_ever, self._lets_go_on)

    def _sensible_operator(self) -> None:
        operate = self._controller._world.operate
        operate(SetOverride(100.0))
        for key in (PadKey.RESET, PadKey.ENABLE, PadKey.START):
            operate(Press(key))
            self._controller.run(0.05)

    def _network(self) -> None:
        # What was armed before stays behind the new stretch of the way; three at once are enough.
        self._network_heals()
        self._controller.network.arm(
            *self.random.sample(FAULTS, self.random.randrange(1, 4)), seed=self.random.getrandbits(30)
        )

    def _network_heals(self) -> None:
        self._controller.network.disarm()

    def _waits(self) -> None:
        self._controller.run(self.random.uniform(0.0, 5.0))

    def _push(self) -> None:
        push = [self.random.uniform(-20.0, 20.0) for _ in range(3)]
        with ServoClient(name="push", role=Role.OPERATOR) as robot:
            robot.push(push, duration_s=self.random.uniform(0.01, 0.5))

    def _ends_well(self) -> None:
        """Whatever happened: an honest program gets the arm to where it wants it."""
        controller = self._controller
        self._fri_goes()
        self._network_heals()
        controller._world.operate(SelectMode(OperationMode.AUT))
        controller.run(2.0)
        self._sensible_operator()
        controller.run(1.0)
        goal = (0.1, 0.5, 0.0, -1.2, 0.0, 0.9, 0.0)
        with ServoClient(name="honest") as robot:
            robot.move(PTP(goal))
        controller.run(0.5)
        off = max(abs(a - b) for a, b in zip(controller.measured_position_rad, goal, strict=True))
        assert off < 5e-3, f"after the shift the arm is {off} rad from where an honest program moved it"


class _Restless(FriHandler):
    """An FRI client whose offsets wander, mostly within what is allowed."""

    def __init__(self, chance: random.Random) -> None:
        self._random = random.Random(chance.getrandbits(32))
        self._axis = self._random.randrange(7)
        self._amplitude = self._random.choice((0.01, 0.05, 0.3))
        self._phase = 0.0

    def on_state_change(self, old: SessionState, new: SessionState) -> None:
        self._phase = 0.0

    def command(self, state: FriState) -> Command | None:
        self._phase += 2.0 * math.pi * 0.3 * state.sample_time_s
        position = list(state.interpolator_position_rad)
        position[self._axis] += self._amplitude * math.sin(self._phase)
        if self._random.random() < 0.0005:
            position[self._random.randrange(7)] += self._random.choice((0.01, 1.0))
        return Command(joint_position_rad=tuple(position))
