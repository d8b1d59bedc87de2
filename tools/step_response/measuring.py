"""The steps: one axis, one kind of motion, from rest, recorded in each control cycle.

A sample stands at the beginning of its cycle: the set point the cycle commanded, and where the arm was when it ended.
That is how ``hil bench reaction`` counts, too.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from hil.config.station import RobotConfig
from hil.core.settings import NS_PER_MS
from hil.runtime.assembly import robot_description
from hil.values.errors import ConfigurationError, OutOfRange
from hil.values.motion import DIRECT_SERVO_DELTA_RAD, MotionKind, MotionParameters
from hil.values.robot import JOINT_NAMES, RobotDescription
from hil.values.servo import SetDestination, StartMotion
from tools.bench import reaction
from tools.bench.servo_virtual import VirtualApplication
from tools.step_response.figures_of_merit import FiguresOfMerit, differences, figures_of_merit

LARGEST_STEP_DEG: Final = math.degrees(DIRECT_SERVO_DELTA_RAD)
"""What DirectServo takes; all motions get the same step."""
SMALLEST_STEP_DEG: Final = 0.01
RECORDED_S: Final = 1.0
"""After the step. The slowest, A2 of size 7 with the defaults, is there after 0.7 s."""
THRESHOLD_DEG: Final = math.degrees(reaction.MOVED_RAD)
"""From which on an axis counts as moved; the simulated arm measures without noise."""
_REST_S: Final = 0.05
_BEFORE_CYCLES: Final = 20


@dataclass(frozen=True, slots=True)
class Case:
    """One way to command the step."""

    name: str
    kind: MotionKind
    parameters: MotionParameters

    def jerk_limit_deg_s3(self, description: RobotDescription, axis: int) -> float | None:
        """Return the jerk that the interpolator keeps; None where it keeps none."""
        if self.kind is not MotionKind.SMART_SERVO:
            return None
        return math.degrees(description.servo.jerk_rad_s3[axis] * self.parameters.joint_jerk_percent / 100.0)


SMART, FAST, DIRECT = (
    Case(name, kind, parameters)
    for name, (_, kind, parameters) in zip(
        ("SmartServo", "SmartServo fast", "DirectServo"), reaction.CASES, strict=True
    )
)
CASES: Final = (SMART, FAST, DIRECT)


@dataclass(frozen=True, slots=True)
class Course:
    """What one step did to its axis: one number of each list a control cycle; degrees from where it stood, and s.

    ``velocity``, ``acceleration`` and ``jerk`` are commanded: the interpolator's own velocity and acceleration, and by
    how much the acceleration changed in the cycle. ``measured_velocity`` is the arm's, ``measured_acceleration`` by how
    much that changed in the cycle. There is no measured jerk: differentiated three times, a position is noise.
    """

    at_ms: tuple[float, ...]
    set_point_deg: tuple[float, ...]
    measured_deg: tuple[float, ...]
    velocity_deg_s: tuple[float, ...]
    acceleration_deg_s2: tuple[float, ...]
    jerk_deg_s3: tuple[float, ...]
    measured_velocity_deg_s: tuple[float, ...]
    measured_acceleration_deg_s2: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Step:
    """One step of ``step_deg`` on ``axis`` (0 to 6); ``tripped`` says why it did not go its way, empty when it did."""

    case: Case
    axis: int
    step_deg: float
    course: Course
    tripped: str
    jerk_limit_deg_s3: float | None

    @property
    def joint(self) -> str:
        """Name of the axis."""
        return JOINT_NAMES[self.axis]

    def figures(self) -> FiguresOfMerit:
        """Return the figures of the measured position; times in ms."""
        towards = math.copysign(1.0, self.step_deg)
        return figures_of_merit(
            self.course.at_ms,
            [towards * way for way in self.course.measured_deg],
            step=abs(self.step_deg),
            threshold=THRESHOLD_DEG,
        )


def measure_steps(
    config: RobotConfig, *, step_deg: float, axes: Sequence[int], progress: Callable[[int], None]
) -> list[Step]:
    """Run each case on each axis; ``progress`` is told how many steps are done. Raises :class:`ConfigurationError`."""
    description = robot_description(config)
    check_step(description, step_deg=step_deg, axes=axes)
    steps: list[Step] = []
    for axis in axes:
        for case in CASES:
            steps.append(measure_step(config, case, axis=axis, step_deg=step_deg))
            progress(len(steps))
    return steps


def check_step(description: RobotDescription, *, step_deg: float, axes: Sequence[int]) -> None:
    """Raise :class:`ConfigurationError` for a step that is nothing to compare, or leaves the range of an axis."""
    if not SMALLEST_STEP_DEG <= abs(step_deg) <= LARGEST_STEP_DEG:
        valid = f"{SMALLEST_STEP_DEG:g}..{LARGEST_STEP_DEG:g} degrees, either way; DirectServo takes no more"
        raise OutOfRange("step", step_deg, valid)
    limits = description.limits
    for axis in axes:
        there = math.degrees(description.initial_position_rad[axis]) + step_deg
        low, high = math.degrees(limits.position_min_rad[axis]), math.degrees(limits.position_max_rad[axis])
        if not low <= there <= high:
            raise ConfigurationError(
                f"a step of {step_deg:g} degrees would bring {JOINT_NAMES[axis]} to {there:g} degrees, outside its "
                f"range {low:g}..{high:g} degrees"
            )


def measure_step(config: RobotConfig, case: Case, *, axis: int, step_deg: float) -> Step:
    """Run one step and record it; what the controller refused or stopped is told in the result."""
    with VirtualApplication(config) as application:
        motion = application.ask(lambda number: StartMotion(number, case.kind, case.parameters, None)).request
        application.run(_REST_S)
        recorder = _Recorder(application, axis)
        for _ in range(_BEFORE_CYCLES):
            application.cycle()
            recorder.take()
        rest = application.snapshot.commanded_position
        goal = tuple(value + (math.radians(step_deg) if place == axis else 0.0) for place, value in enumerate(rest))
        tripped = ""
        arrived_ns = application.now_ns
        try:
            arrived_ns = application.ask(lambda number: SetDestination(number, motion, goal)).at_ns
        except ConfigurationError as refusal:
            tripped = str(refusal)
        recorder.take()
        last_ns = arrived_ns + round(RECORDED_S * 1e9)
        while application.now_ns < last_ns:
            application.cycle()
            recorder.take()
        stops = application.controller.stops
        tripped = tripped or (str(stops[0]) if stops else "")
        course = recorder.course(arrived_ns, period_ms=config.cycle_ms)
    limit = case.jerk_limit_deg_s3(robot_description(config), axis)
    return Step(case, axis, step_deg, course, tripped, limit)


class _Recorder:
    """What one axis was told and did."""

    def __init__(self, application: VirtualApplication, axis: int) -> None:
        self._application, self._axis = application, axis
        self._set_point_rest = application.snapshot.commanded_position[axis]
        self._measured_rest = application.arm.position_rad[axis]
        self._at_ns: list[int] = []
        self._samples: list[tuple[float, ...]] = []

    def take(self) -> None:
        """Add the cycle that just ran."""
        axis, arm = self._axis, self._application.arm
        position, velocity, acceleration = self._application.controller.motion.set_point
        self._at_ns.append(self._application.now_ns)
        sample = (
            position[axis] - self._set_point_rest,
            arm.position_rad[axis] - self._measured_rest,
            velocity[axis],
            acceleration[axis],
            arm.velocity_rad_s[axis],
        )
        self._samples.append(tuple(map(math.degrees, sample)))

    def course(self, arrived_ns: int, *, period_ms: int) -> Course:
        """Return it all, from when the destination arrived."""
        set_point, measured, velocity, acceleration, measured_velocity = zip(*self._samples, strict=True)
        period_s = period_ms * 1e-3
        return Course(
            at_ms=tuple(round((at_ns - arrived_ns) / NS_PER_MS, 6) for at_ns in self._at_ns),
            set_point_deg=set_point,
            measured_deg=measured,
            velocity_deg_s=velocity,
            acceleration_deg_s2=acceleration,
            jerk_deg_s3=tuple(differences(acceleration, period=period_s)),
            measured_velocity_deg_s=measured_velocity,
            measured_acceleration_deg_s2=tuple(differences(measured_velocity, period=period_s)),
        )
