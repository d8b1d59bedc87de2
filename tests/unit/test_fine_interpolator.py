"""The fine interpolator: every pair of state and trigger is in the table, or refused without a change."""

import itertools

import pytest

from hil.core.motion.fine_interpolator import TABLE, Trigger, diagram, next_state
from hil.values.errors import IllegalTransition
from hil.values.motion import FineInterpolatorState

ENDED = FineInterpolatorState.ENDED


@pytest.mark.parametrize(("state", "trigger"), list(itertools.product(FineInterpolatorState, Trigger)))
def test_every_pair_is_in_the_table_or_refused(state: FineInterpolatorState, trigger: Trigger) -> None:
    if (state, trigger) in TABLE:
        assert next_state(state, trigger) is TABLE[state, trigger]
        return
    with pytest.raises(IllegalTransition) as caught:
        next_state(state, trigger)
    assert state.name in str(caught.value)
    assert trigger.value in str(caught.value)


def test_every_state_can_be_reached_and_ended() -> None:
    """Manual 7.6: every state can be terminated at any time."""
    assert set(TABLE.values()) == set(FineInterpolatorState)
    for state in set(FineInterpolatorState) - {ENDED}:
        assert next_state(state, Trigger.MOTION_STOPPED) is ENDED
        assert next_state(state, Trigger.MOTION_FAILED) is ENDED


def test_a_new_destination_always_makes_it_move_and_nothing_follows_the_end() -> None:
    for state in set(FineInterpolatorState) - {ENDED}:
        assert next_state(state, Trigger.DESTINATION_SET) is FineInterpolatorState.MOVING
    assert ENDED not in {state for state, _ in TABLE}


def test_velocity_after_the_goal_is_only_reached_with_velocity_planned() -> None:
    ways = {trigger for (_, trigger), new in TABLE.items() if new is FineInterpolatorState.VELOCITY_AFTER_GOAL_REACH}
    assert ways == {Trigger.GOAL_REACHED_WITH_VELOCITY}


def test_the_diagram_has_a_row_for_each_transition() -> None:
    rows = diagram().splitlines()
    assert rows[:2] == ["stateDiagram-v2", "    [*] --> MOVING"]
    assert "    RESTING --> ENDED: timeout after goal reach" in rows
    assert len(rows) == 2 + len(TABLE)
