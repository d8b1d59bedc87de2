"""Running application motions by hand, and the laws their set points keep; for the tests of the interpolators."""

import random
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from backends.robots import load_description
from hil.core.motion.application_motion import ApplicationMotion, MotionBasis
from hil.core.motion.direct_servo import DirectServo
from hil.core.motion.flange_limit import FlangeLimit
from hil.core.motion.point_to_point import PointToPoint
from hil.core.motion.set_point import STILL, SetPoint
from hil.core.motion.smart_servo import SmartServo
from hil.values.motion import Fault, MotionKind, MotionParameters
from hil.values.robot import JOINT_COUNT, JointLimits, Seven
from hil.values.servo import Vector

Array: TypeAlias = NDArray[np.float64]
MOTIONS: dict[MotionKind, type[ApplicationMotion]] = {
    MotionKind.PTP: PointToPoint,
    MotionKind.SMART_SERVO: SmartServo,
    MotionKind.DIRECT_SERVO: DirectServo,
}
START: Seven = load_description("lbr-iiwa-7-r800").initial_position_rad
FAST = MotionParameters(acceleration_override=20.0, joint_jerk_percent=500.0)
"""SmartServo with the reserves of an unloaded arm (manual 7.12)."""
SMART_SERVO_SETTINGS = (
    MotionParameters(),
    FAST,
    MotionParameters(acceleration_override=20.0, joint_jerk_percent=1500.0),
    MotionParameters(acceleration_override=20.0, joint_jerk_percent=20.0),
    MotionParameters(joint_velocity_rel=0.02, acceleration_override=20.0, joint_jerk_percent=500.0),
    MotionParameters(joint_velocity_rel=0.5, joint_acceleration_rel=0.1, acceleration_override=5.0),
)
PRECISION_RAD = 4e-8
"""Ruckig meets a position to 1e-8 rad and the last step makes it good; at the end of a range twice 2e-8 are kept."""


def basis_of(robot: str = "lbr-iiwa-7-r800", *, cycle_ms: int = 1, dead_time_ms: float = 0.0) -> MotionBasis:
    """Return the basis of a robot's motions."""
    description = load_description(robot)
    dead_time_ns = round(dead_time_ms * 1e6)
    flange = FlangeLimit(lambda _position, _velocity: 0.0)
    return MotionBasis(
        description.limits,
        description.servo,
        cycle_ms * 1_000_000,
        dead_time_ns,
        dead_time_ns,
        flange,
        axes_nearest=lambda _pose, near: near,
    )


def at(position: Seven = START) -> SetPoint:
    """Return a set point that stands still."""
    return SetPoint(position, STILL)


def moved(start: Seven = START, /, **axes: float) -> Seven:
    """Return ``start`` with the named axes (``A1`` to ``A7``) moved by so many rad."""
    return tuple(value + axes.get(f"A{axis}", 0.0) for axis, value in enumerate(start, start=1))  # type: ignore[return-value]


def smart(parameters: MotionParameters | None = None, destination: Vector | None = None, **basis: float) -> SmartServo:
    """Return a SmartServo of the iiwa 7."""
    return SmartServo(parameters or MotionParameters(), basis=basis_of(**basis), destination=destination)  # type: ignore[arg-type]


class Run:
    """One motion and the time; every set point it gives is kept. The arm is where its set point is."""

    def __init__(
        self,
        motion: ApplicationMotion,
        start: SetPoint | None = None,
        *,
        robot: str = "lbr-iiwa-7-r800",
        now_ns: int = 0,
    ) -> None:
        self.motion = motion
        self.now_ns = now_ns
        self.set_points = [SetPoint(load_description(robot).initial_position_rad, STILL) if start is None else start]
        self.refused = motion.begin(self.now, measured_rad=self.now.position_rad, now_ns=now_ns)

    @property
    def now(self) -> SetPoint:
        """The present set point."""
        return self.set_points[-1]

    def go_to(self, position: Vector | None, velocity: Vector | None = None) -> Fault | None:
        """Set a destination now."""
        return self.motion.set_destination(
            position, velocity, measured_rad=self.now.position_rad, arrived_ns=self.now_ns
        )

    def cycle(self, count: int = 1) -> SetPoint:
        """Let cycles pass; fail on a fault."""
        for _ in range(count):
            self.now_ns += self.motion.basis.cycle_ns
            set_point = self.motion.interpolate(now_ns=self.now_ns, started_ns=self.now_ns)
            assert isinstance(set_point, SetPoint), set_point
            self.set_points.append(set_point)
        return self.now

    def until(self, condition: Callable[[], bool], *, at_most: int = 100_000) -> int:
        """Let cycles pass until ``condition`` holds; return how many."""
        for count in range(at_most):
            if condition():
                return count
            self.cycle()
        raise AssertionError(f"did not happen in {at_most} cycles")

    def arrays(self) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration of all set points, one row a cycle."""
        position, velocity, acceleration = (np.array(column) for column in zip(*self.set_points, strict=True))
        return position, velocity, acceleration


def shares(source: random.Random, limits: Sequence[float], factor: float = 1.0) -> Seven:
    """Return a random share of each limit."""
    return tuple(source.uniform(-factor, factor) * limit for limit in limits)  # type: ignore[return-value]


def place(source: random.Random, limits: JointLimits, here: Seven) -> Seven:
    """Return a random place in the range: anywhere, near ``here``, exactly here, or at the very ends of the range."""
    chosen = []
    way = source.choice((0.0, 1e-9, 1e-4, 0.05, 0.5))
    ends = source.random() < 0.3
    for axis in range(JOINT_COUNT):
        low, high = limits.position_min_rad[axis], limits.position_max_rad[axis]
        if ends and source.random() < 0.5:
            chosen.append(source.choice((low, high)))
        elif source.random() < 0.4:
            chosen.append(source.uniform(low, high))
        else:
            chosen.append(min(max(here[axis] + source.uniform(-way, way), low), high))
    return tuple(chosen)  # type: ignore[return-value]


def assert_in_range(run: Run) -> None:
    """No axis leaves its range."""
    position = run.arrays()[0]
    limits = run.motion.basis.limits
    assert np.all(position >= np.array(limits.position_min_rad) - 1e-9)
    assert np.all(position <= np.array(limits.position_max_rad) + 1e-9)


def assert_no_jump(run: Run, *, start: int = 0, hardest: float = 1.0) -> None:
    """Position is continuous, the integral of velocity, which changes no faster than ``hardest`` x any motion may.

    From the set point ``start`` on: with 0 the one that was taken over is among them.
    """
    position, velocity, acceleration = (column[start:] for column in run.arrays())
    basis = run.motion.basis
    cycle_s = basis.cycle_ns * 1e-9
    strongest = hardest * np.maximum(20.0 * np.array(basis.servo.acceleration_rad_s2), basis.limits.acceleration_rad_s2)
    moved, change = np.diff(position, axis=0), np.diff(velocity, axis=0)
    assert np.all(np.abs(change) <= strongest * cycle_s + 1e-7)
    steady = 0.5 * (velocity[1:] + velocity[:-1]) * cycle_s
    # Between two set points the velocity may be either of theirs, and jerk may bend it a little more.
    bent = 0.5 * np.abs(change) * cycle_s + np.abs(np.diff(acceleration, axis=0)) * cycle_s**2
    assert np.all(np.abs(moved - steady) <= bent + PRECISION_RAD + 100.0 * cycle_s**3)


def assert_within(run: Run, limits: JointLimits, *, after_take_over: int = 0) -> None:
    """Velocity, acceleration and jerk are kept by what is reported and by finite differences."""
    position, velocity, acceleration = (column[after_take_over:] for column in run.arrays())
    cycle_s = run.motion.basis.cycle_ns * 1e-9
    fastest = np.array(limits.velocity_rad_s) * (1 + 1e-9)
    strongest = np.array(limits.acceleration_rad_s2) * (1 + 1e-6) + 1e-9
    sharpest = np.array(limits.jerk_rad_s3) * (1 + 1e-6)
    assert np.all(np.abs(velocity) <= fastest)
    assert np.all(np.abs(acceleration) <= strongest)
    assert np.all(np.abs(np.diff(position, axis=0)) <= fastest * cycle_s + PRECISION_RAD)
    assert np.all(np.abs(np.diff(velocity, axis=0)) <= strongest * cycle_s + 1e-7)
    assert np.all(np.abs(np.diff(acceleration, axis=0)) <= sharpest * cycle_s + 1e-5)


def began(motion: ApplicationMotion, start: SetPoint, *, robot: str = "lbr-iiwa-7-r800") -> Run:
    """Begin a motion at ``start``; fail if it will not."""
    run = Run(motion, start, robot=robot)
    assert run.refused is None, run.refused
    return run


def make(
    kind: MotionKind, basis: MotionBasis, destination: Vector | None = None, **parameters: float | bool
) -> ApplicationMotion:
    """Return a motion of a kind."""
    return MOTIONS[kind](MotionParameters(**parameters), basis=basis, destination=destination)  # type: ignore[arg-type]
