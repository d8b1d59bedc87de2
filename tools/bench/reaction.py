"""``hil bench reaction``: from the arrival of a destination to the effective motion, on the measured position.

One step on each axis in turn, from rest, in virtual time. Effective motion is the first cycle in which the measured
axis is more than :data:`MOVED_RAD` from where it stood; the simulated arm has no position noise.
"""

import statistics
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from hil.config.station import RobotConfig
from hil.core.settings import ReactionSettings
from hil.values.errors import ConfigurationError
from hil.values.motion import MotionKind, MotionParameters
from hil.values.robot import JOINT_COUNT, JOINT_NAMES
from hil.values.servo import SetDestination, StartMotion, StopMotion
from tools.bench.bounds import Bound, near
from tools.bench.servo_virtual import VirtualApplication

MOVED_RAD: Final = 1e-6
STEP_RAD: Final = 0.035
"""Two degrees, within what DirectServo takes."""
TOLERANCE_MS: Final = 1.0
"""One cycle: a destination arrives at any time of it."""
_PATIENCE_CYCLES = 500

CASES: Final[tuple[tuple[str, MotionKind, MotionParameters], ...]] = (
    ("SmartServo, default", MotionKind.SMART_SERVO, MotionParameters()),
    (
        "SmartServo, jerk 500 %, override 20",
        MotionKind.SMART_SERVO,
        MotionParameters(joint_jerk_percent=500.0, acceleration_override=20.0),
    ),
    ("DirectServo", MotionKind.DIRECT_SERVO, MotionParameters()),
)


@dataclass(frozen=True, slots=True)
class Reaction:
    """Times in ms of one case, one for each axis."""

    case: str
    set_point_ms: tuple[float, ...]
    measured_ms: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ReactionReport:
    """One benchmark run."""

    robot: str
    backend: str
    settings: ReactionSettings
    reactions: tuple[Reaction, ...]

    def bounds(self) -> list[Bound]:
        """Return the default cases against the reaction times that are set; slower axes show in the table."""
        by_case = {reaction.case: statistics.median(reaction.measured_ms) for reaction in self.reactions}
        return [
            near("SmartServo, median axis", by_case[CASES[0][0]], self.settings.smart_servo_ms, TOLERANCE_MS, "ms"),
            near("DirectServo, median axis", by_case[CASES[2][0]], self.settings.direct_servo_ms, TOLERANCE_MS, "ms"),
        ]

    def as_dict(self) -> dict[str, Any]:
        """Return the report for JSON."""
        return {
            "robot": self.robot,
            "backend": self.backend,
            "reactions": {
                reaction.case: {
                    "set_point_ms": dict(zip(JOINT_NAMES, reaction.set_point_ms, strict=True)),
                    "measured_ms": dict(zip(JOINT_NAMES, reaction.measured_ms, strict=True)),
                }
                for reaction in self.reactions
            },
            "bounds": [bound._asdict() for bound in self.bounds()],
        }


def bench_reaction(config: RobotConfig, *, progress: Callable[[int], None]) -> ReactionReport:
    """Measure all cases; ``progress`` is told how many steps are done."""
    reactions = []
    done = 0
    for case, kind, parameters in CASES:
        times = []
        for axis in range(JOINT_COUNT):
            with VirtualApplication(config) as application:
                times.append(_step(application, kind, parameters, axis))
            done += 1
            progress(done)
        set_point_ms, measured_ms = zip(*times, strict=True)
        reactions.append(Reaction(case, set_point_ms, measured_ms))
    return ReactionReport(config.model, config.backend, config.reaction.settings(), tuple(reactions))


def _step(
    application: VirtualApplication, kind: MotionKind, parameters: MotionParameters, axis: int
) -> tuple[float, float]:
    """Return when set point and measured axis began to move after a step's destination arrived, in ms."""
    motion = application.ask(lambda number: StartMotion(number, kind, parameters, None)).request
    application.run(0.5)
    rest = application.snapshot.commanded_position
    measured_rest = application.arm.position_rad[axis]
    goal = tuple(value + (STEP_RAD if place == axis else 0.0) for place, value in enumerate(rest))
    arrived_ns = application.ask(lambda number: SetDestination(number, motion, goal)).at_ns
    set_point_ms = None
    for _ in range(_PATIENCE_CYCLES):
        after_ms = (application.now_ns - arrived_ns) * 1e-6
        if set_point_ms is None and application.controller.motion.set_point.position_rad[axis] != rest[axis]:
            set_point_ms = after_ms
        if set_point_ms is not None and abs(application.arm.position_rad[axis] - measured_rest) > MOVED_RAD:
            application.ask(lambda number: StopMotion(number, motion))
            return round(set_point_ms, 3), round(after_ms, 3)
        application.cycle()
    raise ConfigurationError(f"{JOINT_NAMES[axis]} did not move within {_PATIENCE_CYCLES} cycles of its destination")
