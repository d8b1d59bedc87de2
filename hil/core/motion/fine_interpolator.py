"""The fine interpolator of a motion as a table. Source: manual 7.6, state diagram."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final

from hil.values.errors import IllegalTransition
from hil.values.motion import FineInterpolatorState

_S = FineInterpolatorState


class Trigger(StrEnum):
    """What moves the fine interpolator."""

    DESTINATION_SET = "destination set"
    GOAL_REACHED = "goal reached"
    GOAL_REACHED_WITH_VELOCITY = "goal reached with velocity planned"
    SPEED_TIMEOUT = "speed timeout after goal reach"
    TIMEOUT_AFTER_GOAL = "timeout after goal reach"
    MOTION_STOPPED = "motion stopped"
    MOTION_FAILED = "motion failed"


TABLE: Final[Mapping[tuple[FineInterpolatorState, Trigger], FineInterpolatorState]] = {
    (_S.MOVING, Trigger.DESTINATION_SET): _S.MOVING,
    (_S.MOVING, Trigger.GOAL_REACHED): _S.RESTING,
    (_S.MOVING, Trigger.GOAL_REACHED_WITH_VELOCITY): _S.VELOCITY_AFTER_GOAL_REACH,
    (_S.VELOCITY_AFTER_GOAL_REACH, Trigger.DESTINATION_SET): _S.MOVING,
    (_S.VELOCITY_AFTER_GOAL_REACH, Trigger.SPEED_TIMEOUT): _S.RESTING,
    (_S.RESTING, Trigger.DESTINATION_SET): _S.MOVING,
    (_S.RESTING, Trigger.TIMEOUT_AFTER_GOAL): _S.ENDED,
    (_S.MOVING, Trigger.MOTION_STOPPED): _S.ENDED,
    (_S.VELOCITY_AFTER_GOAL_REACH, Trigger.MOTION_STOPPED): _S.ENDED,
    (_S.RESTING, Trigger.MOTION_STOPPED): _S.ENDED,
    (_S.MOVING, Trigger.MOTION_FAILED): _S.ENDED,
    (_S.VELOCITY_AFTER_GOAL_REACH, Trigger.MOTION_FAILED): _S.ENDED,
    (_S.RESTING, Trigger.MOTION_FAILED): _S.ENDED,
}


def next_state(state: FineInterpolatorState, trigger: Trigger) -> FineInterpolatorState:
    """Return the state after ``trigger``; raise :class:`IllegalTransition` where the table has none."""
    try:
        return TABLE[state, trigger]
    except KeyError:
        valid = [known.value for origin, known in TABLE if origin is state]
        raise IllegalTransition(state.name, trigger.value, valid) from None


def diagram() -> str:
    """Return the table as a Mermaid state diagram, for the documentation."""
    rows = [f"    {old.name} --> {new.name}: {trigger.value}" for (old, trigger), new in TABLE.items()]
    return "\n".join(("stateDiagram-v2", "    [*] --> MOVING", *rows))
