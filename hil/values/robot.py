"""What is known of a robot: plain figures, in SI units, as read-only tuples of seven."""

from dataclasses import dataclass

Three = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]
Seven = tuple[float, float, float, float, float, float, float]

JOINT_COUNT = 7
JOINT_NAMES = ("A1", "A2", "A3", "A4", "A5", "A6", "A7")


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Limits of the seven axes. Sources: robot facts 2.1; what has no public source says so at its figure."""

    position_min_rad: Seven
    position_max_rad: Seven
    velocity_rad_s: Seven
    acceleration_rad_s2: Seven
    jerk_rad_s3: Seven
    torque_nm: Seven


@dataclass(frozen=True, slots=True)
class ServoDynamics:
    """Base acceleration and jerk of SmartServo, which its factors multiply; conservative: full load, stretched arm."""

    acceleration_rad_s2: Seven
    jerk_rad_s3: Seven


@dataclass(frozen=True, slots=True)
class RobotDescription:
    """One robot model: name, limits, and the pose it starts in."""

    name: str
    title: str
    limits: JointLimits
    servo: ServoDynamics
    payload_kg: float
    reach_mm: float
    initial_position_rad: Seven
    """Start pose of a run: the pose of the recorded client traffic, A = [0, 30, 0, 40, 0, 90, 0] degrees."""
