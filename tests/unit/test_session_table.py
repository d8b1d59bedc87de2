"""Every pair of state and trigger: in the table, or refused without a change."""

import itertools
from pathlib import Path

import pytest

from hil.core.fri.session import TABLE, Trigger, diagram, next_state
from hil.core.motion import fine_interpolator
from hil.values.errors import IllegalTransition
from hil.values.fri import SessionState


@pytest.mark.parametrize(("state", "trigger"), list(itertools.product(SessionState, Trigger)))
def test_every_pair_is_in_the_table_or_refused(state: SessionState, trigger: Trigger) -> None:
    if (state, trigger) in TABLE:
        assert next_state(state, trigger) is TABLE[state, trigger]
        return
    with pytest.raises(IllegalTransition) as caught:
        next_state(state, trigger)
    assert state.name in str(caught.value)
    assert trigger.value in str(caught.value)


def test_every_state_can_be_reached_and_closed() -> None:
    assert set(TABLE.values()) == set(SessionState)
    for state in SessionState:
        if state is not SessionState.IDLE:
            assert next_state(state, Trigger.SESSION_CLOSED) is SessionState.IDLE


def test_commanding_is_never_entered_from_poor_monitoring() -> None:
    origins = {old for (old, _), new in TABLE.items() if new is SessionState.COMMANDING_WAIT}
    assert origins == {SessionState.MONITORING_READY}


@pytest.mark.parametrize(
    ("page", "shown"),
    [
        ("architecture.md", diagram()),
        ("architecture.md", fine_interpolator.diagram()),
        ("servo-api.md", fine_interpolator.diagram()),
    ],
)
def test_documentation_shows_the_tables(page: str, shown: str) -> None:
    text = (Path(__file__).parents[2] / "docs" / page).read_text()
    assert shown in text, "put the diagram() of the table into the page"
