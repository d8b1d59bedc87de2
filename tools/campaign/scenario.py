"""One scenario: everything a worker anywhere needs to play it, and to play it again."""

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Annotated, Any, Final, TypedDict, get_type_hints

from pydantic import BaseModel, ConfigDict, Field

from hil.version import SOFTWARE


class Require(BaseModel):
    """``[require]``: what a scenario must keep. What is not given is not asked for, but stops."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    stops: Annotated[int, Field(ge=0, description="stops of the arm, and motions ended for an error, at most")] = 0
    margin_used: Annotated[
        float | None, Field(gt=0.0, description="share of any monitored limit that is used at most; 1.0 trips")
    ] = None
    answer_latency_p99_us: Annotated[float | None, Field(gt=0.0, description="of the FRI client's answers")] = None
    late_answers: Annotated[int | None, Field(ge=0, description="of the FRI client, at most")] = None
    commanded: Annotated[bool, Field(strict=True, description="whether the arm must have been moved at all")] = False


@dataclass(frozen=True, slots=True)
class Scenario:
    """``robot`` has the keys of a robot in a station file; ``run`` or ``capture`` is what speaks to it."""

    application: str
    impairment: str
    gains: str
    load: str
    seed: int
    run: str | None
    arguments: tuple[str, ...]
    capture: str | None
    faults: tuple[str, ...]
    robot: dict[str, Any]
    seconds: float
    require: Require
    content: str = ""
    """Digest of the program's file, or of the capture: another one is another scenario."""

    @property
    def name(self) -> str:
        """What people, and ``--scenario``, call it."""
        return f"{self.application}/{self.impairment}/{self.gains}/{self.load}/{self.seed}"

    @property
    def key(self) -> str:
        """The same for the same scenario of the same release of fri-hil, and only for that."""
        told = {**asdict(self), "require": self.require.model_dump(), "software": SOFTWARE}
        return hashlib.sha256(json.dumps(told, sort_keys=True, default=str).encode()).hexdigest()[:20]


class Row(TypedDict):
    """What became of a scenario: one line of the table."""

    scenario: str
    key: str
    application: str
    impairment: str
    gains: str
    load: str
    seed: int
    outcome: str
    """passed, failed (the application, or what was required), timeout, hung, worker-died, refused."""
    reason: str
    attempts: int
    virtual_s: float
    wall_s: float
    stops: int
    first_stop_s: float | None
    first_stop: str
    margin_used: float
    """Largest share of a monitored limit that the scenario used, beyond what the arm's first posture does."""
    margin_monitor: str
    margin_axis: str
    margin_at_s: float
    axis_range_used: float
    axis_velocity_used: float
    axis_torque_used: float
    tracking_used: float
    t1_speed_used: float
    commanded_s: float
    messages: int
    answers: int
    answer_latency_p50_us: float | None
    answer_latency_p99_us: float | None
    answer_latency_max_us: float | None
    late_answers: int
    dropped_answers: int
    quality: str
    destinations_asked: int
    destinations_executed: int
    packets_to_controller: int
    packets_to_peer: int
    faults_fired: int


COLUMNS: Final = get_type_hints(Row)
"""Every column with its type; what may be unknown is a union with None."""


def empty_row(scenario: Scenario, outcome: str, reason: str, *, attempts: int = 1) -> Row:
    """Return the row of a scenario of which nothing else is known."""
    nothing = {name: hint() if isinstance(hint, type) else None for name, hint in COLUMNS.items()}
    told = {
        "scenario": scenario.name,
        "key": scenario.key,
        **{name: getattr(scenario, name) for name in ("application", "impairment", "gains", "load", "seed")},
        "outcome": outcome,
        "reason": reason,
        "attempts": attempts,
    }
    row: Row = {**nothing, **told}  # type: ignore[typeddict-item]  # its columns, each of its type
    return row
