"""Random stories with an arm that yields: whatever is asked and whoever pushes, it comes to rest and is held.

HIL_SOAK_STORIES sets the number of stories; ``make soak`` does.
"""

import math
import os
import random

import pytest

from backends.mujoco import MujocoBackend
from hil.core.motion.executive import Phase
from hil.values.arm import JointCommand, Push
from hil.values.control import (
    CartesianImpedanceControlMode,
    CartesianSineImpedanceControlMode,
    ControlModeSettings,
    ForceOscillation,
    JointImpedanceControlMode,
    PositionControlMode,
    by_translation,
    six,
)
from hil.values.fri import OperationMode
from hil.values.motion import MotionKind, MotionParameters
from hil.values.operator import OperatorAction, PadKey, Press, SelectMode, SetOverride
from hil.values.robot import RobotDescription
from hil.values.servo import ChangeControlMode, SetDestination, StartMotion, StopMotion, ValidateLoad
from tests.support.servo_virtual import Application, ServoBench

STORIES = max(8, int(os.environ.get("HIL_SOAK_STORIES", "0")) // 100)
SECONDS = 4.0


class Checked(MujocoBackend):
    """An arm that refuses what no motor can be asked for."""

    def __init__(self, description: RobotDescription) -> None:
        super().__init__(description)
        self._limits = description.limits

    def _write(self, command: JointCommand) -> None:
        position, velocity, acceleration, torque = command[:4]
        assert math.isfinite(sum(position) + sum(velocity) + sum(acceleration))
        for low, value, high in zip(
            self._limits.position_min_rad, position, self._limits.position_max_rad, strict=True
        ):
            assert low - 1e-9 <= value <= high + 1e-9
        if torque is not None:
            assert math.isfinite(sum(torque))
        super()._write(command)


class Story:
    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        robot = self.random.choice(["lbr-iiwa-7-r800", "lbr-iiwa-14-r820", "lbr-med-7"])
        cycle_ms = self.random.choice([1, 1, 2, 5])
        self.bench = ServoBench(robot=robot, backend=Checked, cycle_ms=cycle_ms)
        self.application = Application(self.bench, state_period_ms=10)
        self.application.join()
        self.application.run(0.05)
        self.motions: list[int] = [0]
        self.application.ask(lambda number: ValidateLoad(number, "flange"))
        self.yielding = 0

    def run(self) -> None:
        for _ in range(round(SECONDS * 1e3) // self.bench.settings.cycle_ms):
            if self.random.random() < 0.02 * self.bench.settings.cycle_ms:
                self.act()
            self.application.command()
            self.bench.cycle()
            self.yielding += self.bench.controller.motion.control.yields

    def act(self) -> None:
        chance, now_ns, home = self.random, self.bench.now_ns, self.bench.description.initial_position_rad
        controller = self.bench.controller
        what = chance.random()
        if what < 0.2:
            self.application.ask(lambda number: ValidateLoad(number, "flange"))
        elif what < 0.4:
            kind, mode = chance.choice(list(MotionKind)), self.mode()
            goal = tuple(value + chance.uniform(-0.3, 0.3) for value in home) if chance.random() < 0.6 else None
            done = self.application.ask(lambda number: StartMotion(number, kind, MotionParameters(), goal, mode=mode))
            self.motions += [one.request for one in done if not one.error]
        elif what < 0.55:
            mode, motion = self.mode(), chance.choice(self.motions)
            self.application.ask(lambda number: ChangeControlMode(number, motion, mode))
        elif what < 0.7:
            motion = chance.choice(self.motions)
            near = controller.motion.set_point.position_rad
            goal = tuple(value + chance.uniform(-0.08, 0.08) for value in near)
            self.application.ask(lambda number: SetDestination(number, motion, goal))
        elif what < 0.85:
            force = (chance.uniform(-60, 60), chance.uniform(-60, 60), chance.uniform(-60, 60))
            push = Push(chance.randint(1, 7), force, (0.0, 0.0, chance.uniform(-5, 5)), chance.uniform(0.0, 0.5))
            assert not controller.operate(push, now_ns=now_ns)
        elif what < 0.9:
            motion = chance.choice(self.motions)
            self.application.ask(lambda number: StopMotion(number, motion))
        else:
            keys = (PadKey.PAUSE, *[PadKey.START] * 4, PadKey.EMERGENCY_STOP, *[PadKey.RESET] * 3, PadKey.ENABLE)
            actions: list[OperatorAction] = [
                *map(Press, keys),
                SelectMode(chance.choice(list(OperationMode))),
                SetOverride(chance.choice([0.0, 30.0, 100.0, 100.0])),
            ]
            controller.operate(chance.choice(actions), now_ns=now_ns)

    def mode(self) -> ControlModeSettings:
        chance = self.random
        cartesian = CartesianImpedanceControlMode(
            stiffness=by_translation(chance.uniform(0.0, 5000.0), chance.uniform(0.0, 300.0)),
            damping=(chance.uniform(0.1, 1.0),) * 6,
            null_space_stiffness_nm_rad=chance.uniform(0.0, 200.0),
            max_path_deviation=by_translation(chance.choice([20.0, 1e6]), 1e6),
            max_control_force=by_translation(chance.choice([10.0, 1e6]), 1e6),
            stop_on_max_control_force=chance.random() < 0.3,
        )
        swing = ForceOscillation(
            amplitude=six([chance.uniform(0.0, 10.0)] * 3 + [0.0] * 3), frequency_hz=six(chance.uniform(0.0, 15.0))
        )
        modes: list[ControlModeSettings] = [
            PositionControlMode(),
            JointImpedanceControlMode((chance.uniform(0.0, 3000.0),) * 7, (chance.uniform(0.0, 1.0),) * 7),
            cartesian,
            CartesianSineImpedanceControlMode(cartesian, swing),
        ]
        return chance.choice(modes)


@pytest.mark.parametrize("seed", range(STORIES))
def test_after_any_story_the_arm_comes_to_rest_and_is_held(seed: int) -> None:
    story = Story(seed)
    story.run()
    bench = story.bench
    story.application.goodbye()
    bench.run(1.0)
    for key in (PadKey.RESET, PadKey.ENABLE, PadKey.START):
        bench.press(key)
    bench.run(2.0)
    controller = bench.controller
    assert controller.motion.phase is Phase.HOLDING
    assert controller.motion.control.mode == PositionControlMode()
    before = bench.backend.read()
    bench.run(0.5)
    after = bench.backend.read()
    assert max(map(abs, after.velocity_rad_s)) < 1e-3
    assert after.position_rad == pytest.approx(before.position_rad, abs=1e-3)


def test_the_stories_are_of_arms_that_yield() -> None:
    stories = [Story(seed) for seed in (2, 4, 7)]
    for story in stories:
        story.run()
    assert sum(story.yielding for story in stories) > 1000
