"""The fine interpolator of a motion as a table. Source: manual 7.6, state diagram."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final

from hil.core.state_table import StateTable
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

_MACHINE: Final = StateTable(_S.MOVING, TABLE)
next_state = _MACHINE.after
diagram = _MACHINE.diagram
