"""Lines and circles of a TCP, and how fast they are run: pure geometry, poses in the robot base.

A real controller's planner is not public. Ours: a profile with limited acceleration and jerk along the path, at the
speed asked for or slower where the orientation needs more time; orientation turns about one axis from start to end (a
circle's auxiliary point says only where it passes).
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from hil.values.errors import ConfigurationError
from hil.values.pose import Pose

ACCELERATION_MM_S2: Final = 1000.0
JERK_MM_S3: Final = 10_000.0
TURNING_RAD_S: Final = math.radians(90.0)
"""Most a TCP turns on its path; acceleration and jerk as the figures for lengths, at one radian for 300 mm."""
TURN_AS_LENGTH_MM: Final = 300.0
T1_MM_S: Final = 225.0
"""Most the flange may do on a path in T1: nine tenths of what the monitor stops at."""
FASTEST_MM_S: Final = 5000.0
"""Whatever is asked for: no axis lets a TCP be so fast."""
JERK_SHARES: Final = (1.0, 1.0 - 1e-6)
"""Tried one after the other: on the border between two shapes of profile, as a path of 20 mm is, Ruckig finds none."""
_SAMPLES: Final = 64
_COLLINEAR: Final = 1e-6
_SAME_PLACE_M: Final = 1e-6


class Path(Protocol):
    """A way of a TCP; ``fraction`` runs from 0 to 1, evenly over its length."""

    @property
    def length_m(self) -> float:
        """How long it is."""

    @property
    def turn_rad(self) -> float:
        """How far it turns."""

    def at(self, fraction: float) -> Pose:
        """Return the pose of the TCP."""


class _Turn(NamedTuple):
    """A rotation from one orientation to another about one axis, the short way."""

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    angle_rad: float

    @classmethod
    def between(cls, start: Pose, end: Pose) -> Self:
        first, second = np.array(start.quaternion_wxyz()), np.array(end.quaternion_wxyz())
        if first @ second < 0.0:
            second = -second
        # Half the angle between the quaternions; exact for small ones, unlike an arc cosine.
        half = 2.0 * math.asin(min(1.0, float(np.linalg.norm(second - first)) / 2.0))
        return cls(first, second, 2.0 * half)

    def at(self, fraction: float, position_m: tuple[float, float, float]) -> Pose:
        half = self.angle_rad / 2.0
        if half < 1e-9:
            mixed = self.start
        else:
            mixed = math.sin((1.0 - fraction) * half) * self.start + math.sin(fraction * half) * self.end
        w, x, y, z = mixed.tolist()
        return Pose.from_quaternion(position_m, (w, x, y, z))


class Line:
    """From one pose straight to another."""

    def __init__(self, start: Pose, end: Pose) -> None:
        self._start, self._way = np.array(start.position_m), np.subtract(end.position_m, start.position_m)
        self._turn = _Turn.between(start, end)
        self.length_m = float(np.linalg.norm(self._way))
        self.turn_rad = self._turn.angle_rad

    def at(self, fraction: float) -> Pose:
        """Return the pose of the TCP."""
        x, y, z = (self._start + fraction * self._way).tolist()
        return self._turn.at(fraction, (x, y, z))


class Circle:
    """From one pose through the origin of another to a third; raise ConfigurationError where no circle has them."""

    def __init__(self, start: Pose, auxiliary: Pose, end: Pose) -> None:
        a, b, c = (np.array(pose.position_m) for pose in (start, auxiliary, end))
        to_b, to_c = b - a, c - a
        normal = np.cross(to_b, to_c)
        size = float(np.linalg.norm(normal))
        longest = max(float(np.linalg.norm(to_b)), float(np.linalg.norm(to_c)))
        if min(np.linalg.norm(to_b), np.linalg.norm(c - b)) < _SAME_PLACE_M or size < _COLLINEAR * longest * longest:
            raise ConfigurationError("start, auxiliary point and end of the circle are on one line; no circle has them")
        normal /= size
        in_plane = np.cross(normal, to_b)
        # The centre is on the bisector of start and auxiliary point, as far from the end.
        along = (to_c @ to_c - to_c @ to_b) / (2.0 * (to_c @ in_plane))
        self._centre = a + 0.5 * to_b + along * in_plane
        self._spoke = a - self._centre
        self._quarter = np.cross(normal, self._spoke)
        # About this normal, the three points follow one another in the positive sense.
        spoke = c - self._centre
        self._angle_rad = math.atan2(float(spoke @ self._quarter), float(spoke @ self._spoke)) % (2.0 * math.pi)
        self._turn = _Turn.between(start, end)
        self.length_m = float(np.linalg.norm(self._spoke)) * self._angle_rad
        self.turn_rad = self._turn.angle_rad

    def at(self, fraction: float) -> Pose:
        """Return the pose of the TCP."""
        angle = fraction * self._angle_rad
        x, y, z = (self._centre + math.cos(angle) * self._spoke + math.sin(angle) * self._quarter).tolist()
        return self._turn.at(fraction, (x, y, z))


@dataclass(frozen=True, slots=True)
class Limits:
    """What a path is run with, at most; fractions of it a second, and so on."""

    velocity: float
    acceleration: float
    jerk: float


def limits_of(path: Path, *, speed_mm_s: float, tcp_in_flange: Pose, in_t1: bool) -> Limits | None:
    """Return the limits of a path; None for one that has no length and no turn."""
    size_mm = max(path.length_m * 1e3, path.turn_rad * TURN_AS_LENGTH_MM)
    if path.length_m < _SAME_PLACE_M and path.turn_rad < 1e-6:
        return None
    velocity = math.inf
    if path.length_m >= _SAME_PLACE_M:
        velocity = min(speed_mm_s, FASTEST_MM_S) / (path.length_m * 1e3)
    if path.turn_rad >= 1e-6:
        velocity = min(velocity, TURNING_RAD_S / path.turn_rad)
    if in_t1:
        velocity = min(velocity, T1_MM_S / max(_longest_step_mm(path, tcp_in_flange) * _SAMPLES, 1e-9))
    return Limits(velocity, ACCELERATION_MM_S2 / size_mm, JERK_MM_S3 / size_mm)


def _longest_step_mm(path: Path, tcp_in_flange: Pose) -> float:
    flange_in_tcp = tcp_in_flange.inverse()
    flange = [(path.at(step / _SAMPLES) @ flange_in_tcp).position_m for step in range(_SAMPLES + 1)]
    return max(math.dist(*pair) for pair in pairwise(flange)) * 1e3


class Profile:
    """How far along its path a TCP is, as a function of time; raise ConfigurationError where it would take for ever."""

    def __init__(self, limits: Limits) -> None:
        # Imported where a path is run: joints and set-points do not wait for it.
        from ruckig import InputParameter, Ruckig, RuckigError, Trajectory

        wanted = InputParameter(1)
        wanted.current_position, wanted.target_position = [0.0], [1.0]
        wanted.max_velocity, wanted.max_acceleration = [limits.velocity], [limits.acceleration]
        self._trajectory = Trajectory(1)
        for share in JERK_SHARES:
            wanted.max_jerk = [limits.jerk * share]
            try:
                Ruckig(1).calculate(wanted, self._trajectory)
            except RuckigError:
                continue
            break
        else:
            sentence = f"the path takes {1.0 / max(limits.velocity, 1e-300):.1g} s at its speed; a faster one is needed"
            raise ConfigurationError(sentence)
        self.duration_s: float = self._trajectory.duration

    def at(self, time_s: float) -> float:
        """Return the fraction of the path, 0..1."""
        position, _, _ = self._trajectory.at_time(min(max(time_s, 0.0), self.duration_s))
        return min(max(float(position[0]), 0.0), 1.0)
