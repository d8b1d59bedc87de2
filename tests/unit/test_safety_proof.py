"""Whatever hostile clients and a restless operator do: what reaches the arm keeps the laws. Proof of docs/safety.md.

The laws are in :class:`tests.support.hostile.Hostile`. ``make soak`` runs the same with many more stories.
"""

import os

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

from backends.robots import robot_names
from hil.values.fri import OperationMode
from hil.values.operator import PadKey, Press, ProgramState
from tests.support.hostile import Hostile
from tests.support.laws import BRAKING_CYCLES

STORIES = int(os.environ.get("HIL_SOAK_STORIES", "40"))
"""For each mode and link; each of them has some hundred commands."""
CYCLES = 400


@pytest.mark.parametrize("mode", list(OperationMode))
def test_hostile_applications(mode: OperationMode) -> None:
    moved = 0
    for seed in range(STORIES):
        story = Hostile(seed, mode=mode, robot=robot_names()[seed % 4], fri=False)
        story.run(CYCLES)
        moved += story.told_to_move
    assert moved > 30 * STORIES, "a proof about an arm that does not move proves nothing"


@pytest.mark.parametrize("mode", list(OperationMode))
def test_a_hostile_fri_client(mode: OperationMode) -> None:
    moved = 0
    for seed in range(STORIES // 4):
        story = Hostile(1000 + seed, mode=mode, robot=robot_names()[seed % 4])
        story.until_commanding()
        story.run(4 * CYCLES)
        moved += story.told_to_move
    assert moved > 30 * STORIES


@pytest.mark.parametrize("mode", list(OperationMode))
def test_after_any_story_the_arm_can_be_brought_to_rest_and_stays(mode: OperationMode) -> None:
    for seed in range(STORIES // 4):
        story = Hostile(2000 + seed, mode=mode, fri=seed % 2 == 0)
        story.run(CYCLES)
        controller = story.bench.controller
        controller.operate(Press(PadKey.EMERGENCY_STOP), now_ns=story.bench.now_ns)
        for _ in range(BRAKING_CYCLES + 200):
            story.servo_request()
            story.cycle()
        assert controller.operator.program is ProgramState.EMERGENCY_STOP


class HostileWorld(RuleBasedStateMachine):
    """The same world, in the order hypothesis chooses, so that a law that breaks breaks with few steps."""

    @initialize(mode=st.sampled_from(OperationMode), seed=st.integers(0, 2**16))
    def begins(self, mode: OperationMode, seed: int) -> None:
        self.story = Hostile(seed, mode=mode)

    @rule()
    def an_application_asks(self) -> None:
        self.story.servo_request()
        self.story.cycle()

    @rule()
    def the_fri_client_turns(self) -> None:
        self.story.fri_turn()

    @rule()
    def somebody_comes_or_goes(self) -> None:
        self.story.comes_or_goes()

    @rule()
    def the_operator_acts(self) -> None:
        self.story.operator_acts()

    @rule()
    def there_is_noise(self) -> None:
        self.story.noise()

    @rule(cycles=st.sampled_from((1, 3, 30, 120)))
    def time_passes(self, cycles: int) -> None:
        for _ in range(cycles):
            self.story.cycle()


TestHostileWorld = HostileWorld.TestCase
TestHostileWorld.settings = settings(
    max_examples=STORIES, stateful_step_count=40, deadline=None, suppress_health_check=list(HealthCheck)
)
