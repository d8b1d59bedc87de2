"""The facts table of the robots: every figure the robot models are made from, and where it comes from.

Figures are those of the project's robot facts; "facts 2.1" names a section there and the letters after it the
source key used there. A figure without a public source is marked "ours", with the reason for its choice.
SI units; tuples of seven run from A1 to A7.
"""

import math
from dataclasses import dataclass, replace

from hil.values.robot import JointLimits, RobotDescription, ServoDynamics, Seven, Three

Four = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class LinkInertia:
    """Inertia of everything that moves with one joint, at q = 0, axes parallel to the base (facts 3.2)."""

    mass_kg: float
    com_m: Three
    """Centre of mass x, y, z in the base frame (not in the joint frame)."""
    moments_kg_m2: Three
    """Ixx, Iyy, Izz about the centre of mass."""
    products_kg_m2: Three
    """Ixy, Ixz, Iyz about the centre of mass, as entries of the tensor."""


@dataclass(frozen=True, slots=True)
class RobotFacts:
    """All figures of one robot."""

    description: RobotDescription
    lengths_m: Four
    """d1 base to shoulder, d3 shoulder to elbow, d5 elbow to wrist, d7 wrist to flange."""
    odd_joint_heights_m: Four
    """Height at q = 0 of the frames of A1, A3, A5, A7 along their axes: a drawing choice, no kinematics."""
    inertia_set: str
    """Key of the inertial set in facts 3.1."""
    links: tuple[LinkInertia, ...]
    viscous_nm_s_rad: Seven
    coulomb_nm: Seven
    armature_kg_m2: Seven

    @property
    def flange_height_m(self) -> float:
        """Height of the flange above the base at q = 0."""
        return math.fsum(self.lengths_m)

    @property
    def joint_heights_m(self) -> Seven:
        """Height above the base of the seven joint frames at q = 0, where all stand on the z axis."""
        d1, d3, d5, _ = self.lengths_m
        a1, a3, a5, a7 = self.odd_joint_heights_m
        return (a1, d1, a3, math.fsum((d1, d3)), a5, math.fsum((d1, d3, d5)), a7)


JOINT_AXES: tuple[Three, ...] = (
    (0.0, 0.0, 1.0),
    (0.0, 1.0, 0.0),
    (0.0, 0.0, 1.0),
    (0.0, -1.0, 0.0),
    (0.0, 0.0, 1.0),
    (0.0, 1.0, 0.0),
    (0.0, 0.0, 1.0),
)
"""Axes at q = 0 in the base frame, pointing to the positive sense of A1 to A7 (facts 1.1, all sources agree)."""

GRAVITY_M_S2 = 9.81
"""As used for the reference torques (facts 3.4)."""

_INITIAL_POSITION_DEG: Seven = (0.0, 30.0, 0.0, 40.0, 0.0, 90.0, 0.0)

_RAMP_S = 0.05
"""Time to reach full acceleration. Ours, no public jerk figure (facts 2.1): jerk = acceleration / 0.05 s.

At these limits an axis needs 0.11 s to 0.32 s to reach full speed. A ramp of 50 ms keeps the acceleration
continuous over at least five cycles of 10 ms, the slowest a client may command at, and still lets every axis
reach its acceleration limit before its velocity limit.
"""


def _radians(degrees: Seven) -> Seven:
    """Seven angles, rates or accelerations, from degrees to radians."""
    a1, a2, a3, a4, a5, a6, a7 = (math.radians(value) for value in degrees)
    return (a1, a2, a3, a4, a5, a6, a7)


def _jerk(acceleration_rad_s2: Seven) -> Seven:
    """Jerk limits, rad/s³, that reach the acceleration in the ramp time."""
    a1, a2, a3, a4, a5, a6, a7 = (value / _RAMP_S for value in acceleration_rad_s2)
    return (a1, a2, a3, a4, a5, a6, a7)


def _negative(values: Seven) -> Seven:
    a1, a2, a3, a4, a5, a6, a7 = values
    return (-a1, -a2, -a3, -a4, -a5, -a6, -a7)


# Lengths and joint heights. Lengths: facts 1.1 (KST, NEU, IFL, LBR). Heights: facts 1.3, IFL for the 7;
# IFL, DRK and MEN for the 14.
_LENGTHS_7_M: Four = (0.340, 0.400, 0.400, 0.126)
_LENGTHS_14_M: Four = (0.360, 0.420, 0.400, 0.126)
_ODD_HEIGHTS_7_M: Four = (0.15, 0.55, 0.95, 1.221)
_ODD_HEIGHTS_14_M: Four = (0.1575, 0.5645, 0.9645, 1.261)

# Limits: facts 2.1. Positions and velocities hold for the Med of the same size as well (LBR, DRK, DRV, EPF).
_POSITION_DEG: Seven = (170.0, 120.0, 170.0, 120.0, 170.0, 120.0, 175.0)
_VELOCITY_7_DEG_S: Seven = (98.0, 98.0, 100.0, 130.0, 140.0, 180.0, 180.0)
_VELOCITY_14_DEG_S: Seven = (85.0, 85.0, 100.0, 75.0, 130.0, 135.0, 135.0)
# DRK, an estimate. For the Med 7 ours: no public figure, the same drives are assumed.
_ACCELERATION_7_RAD_S2: Seven = (8.65, 5.44, 5.69, 11.01, 11.78, 13.76, 13.17)
# LAR, measured averages. For the Med 14 ours: no public figure, the same drives are assumed.
_ACCELERATION_14_DEG_S2: Seven = (490.77, 490.80, 500.77, 650.71, 700.73, 900.66, 900.69)
# DRK, EPF. For the Meds ours: no public figure, the same drives are assumed.
_TORQUE_7_NM: Seven = (176.0, 176.0, 110.0, 110.0, 110.0, 40.0, 40.0)
_TORQUE_14_NM: Seven = (320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0)

# SmartServo's base acceleration and jerk. Ours: no public figure; the manual (7.8, 7.12) says what they are for. "The
# preset performance parameters refer to a full load in the extended position"; override 20 with jerk 500 % is for what
# an unloaded arm has in reserve in the pose of the step responses, A = [0, 30, 0, 40, 0, 90, 0] degrees.
# Acceleration is the smaller of two, rounded down, of the two robots that share the drives:
# - half of (torque limit - gravity) / (sum of the row of the mass matrix, armature included) with the rated payload at
#   the flange, all axes accelerating against each other, in the worst pose: the stretched arm for A1, A2, A4 and A6, a
#   bent elbow for A3 and A5. The other half is for friction, Coriolis torques and loads away from the flange;
# - a twentieth of 90 % of (torque limit - gravity) / (diagonal of the mass matrix) of the unloaded arm in that pose.
# In rad/s², from A1: size 7 5.0 1.1 2.9 2.6 16.7 5.0 14.3 and 3.5 0.87 1.4 1.9 3.5 1.2 1.2; size 14 5.0 1.7 2.7 2.0
# 9.9 2.4 17.1 and 3.6 1.6 2.1 1.8 3.6 1.4 1.5. So override 20 is what the drives of the unloaded arm can do there, one
# axis at a time; elsewhere, loaded, or with all axes at once it may be more, and the arm may not follow, as the manual
# warns. An axis reaches that acceleration only where its jerk lets it before its velocity is reached.
# Jerk: override 20 with jerk 500 % just reaches its acceleration in a step of 5 degrees (the farthest DirectServo
# takes, and what a step response compares): 500 % is sqrt(2 a³ / 5 degrees). It is never above the jerk of a PTP,
# which is what bounds A1, A3 and A5, A4 of size 7 and A2 of size 14.
# A step of 5 degrees takes 0.33 s (A1) to 0.65 s (A2) with the defaults, and 0.13 s to 0.20 s with 20 and 500 %; the
# arm in MuJoCo is never more than 2.1 mrad behind in either (measured, all robots).
_SERVO_ACCELERATION_7_RAD_S2: Seven = (3.5, 0.87, 1.4, 1.9, 3.5, 1.2, 1.2)
_SERVO_ACCELERATION_14_RAD_S2: Seven = (3.6, 1.6, 2.1, 1.8, 3.6, 1.4, 1.5)
_SERVO_JERK_7_RAD_S3: Seven = (170.0, 69.0, 110.0, 220.0, 230.0, 110.0, 110.0)
_SERVO_JERK_14_RAD_S3: Seven = (170.0, 170.0, 170.0, 200.0, 240.0, 140.0, 150.0)

# Joint friction: facts 4.1, physical set of STZ, link side of the torque sensor. It was identified on an
# iiwa 14 R820; for the other three ours: no public figure, the same joints are assumed.
_VISCOUS_NM_S_RAD: Seven = (0.2415, 0.3733, 0.1103, 0.1, 0.1, 0.1248, 0.1)
_COULOMB_NM: Seven = (0.3191, 0.1813, 0.0730, 0.1767, 0.0346, 0.1339, 0.0871)

# Reflected rotor inertia, gear ratio squared times rotor inertia: facts 4.2, DRK. Both are estimates from
# earlier arms of the same family. For the Meds ours: no public figure, the same drives are assumed.
_ARMATURE_7_KG_M2: Seven = (1.836, 4.447, 3.242, 1.817, 1.392, 1.402, 1.392)
_ARMATURE_14_KG_M2: Seven = (3.382, 3.382, 3.382, 3.382, 1.321, 1.162, 1.162)

# Inertial sets: facts 3.2. Every tensor fulfils the triangle inequality as printed there; none was altered.
_D14: tuple[LinkInertia, ...] = (
    LinkInertia(5.76, (0.0, -0.03, 0.2775), (0.033, 0.0333, 0.0123), (0.0, 0.0, 0.0)),
    LinkInertia(6.35, (-0.0003, 0.042, 0.419), (0.0305, 0.0304, 0.011), (0.0, 0.0, 0.0)),
    LinkInertia(3.5, (0.0, 0.03, 0.6945), (0.025, 0.0238, 0.0076), (0.0, 0.0, 0.0)),
    LinkInertia(3.5, (0.0, -0.034, 0.847), (0.017, 0.0164, 0.006), (0.0, 0.0, 0.0)),
    LinkInertia(3.5, (-0.0001, -0.021, 1.0405), (0.01, 0.0087, 0.00449), (0.0, 0.0, 0.0)),
    LinkInertia(1.8, (0.0, 0.0004, 1.1806), (0.0049, 0.0036, 0.0047), (0.0, 0.0, 0.0)),
    LinkInertia(1.2, (0.0, 0.0, 1.281), (0.001, 0.001, 0.001), (0.0, 0.0, 0.0)),
)
_L7: tuple[LinkInertia, ...] = (
    LinkInertia(3.394, (0.0, -0.0348, 0.2708), (0.02138, 0.0204, 0.00756), (0.0, 0.0, 0.0038)),
    LinkInertia(4.032, (0.0, 0.0293, 0.4269), (0.0317, 0.03008, 0.00967), (0.0, 0.0, 0.00589)),
    LinkInertia(3.394, (0.0, 0.0348, 0.6708), (0.02138, 0.0204, 0.00756), (0.0, 0.0, -0.0038)),
    LinkInertia(4.032, (0.0, -0.0293, 0.8269), (0.0317, 0.03008, 0.00966), (0.0, 0.0, -0.00589)),
    LinkInertia(1.5292, (0.0, -0.0298, 1.0238), (0.00848, 0.00714, 0.00385), (0.0, 0.0, 0.00281)),
    LinkInertia(2.4036, (0.0, 0.0003, 1.145), (0.00707, 0.0068, 0.00463), (0.0, 0.0, 0.00031)),
    LinkInertia(0.2595, (0.0, 0.0, 1.2448), (0.00017, 0.00017, 0.0003), (0.0, 0.0, 0.0)),
)
_LM7: tuple[LinkInertia, ...] = (
    LinkInertia(3.2715, (0.0, -0.0348, 0.2708), (0.02061, 0.01967, 0.00729), (0.0, 0.0, 0.00366)),
    LinkInertia(3.8864, (0.0, 0.0293, 0.4269), (0.03055, 0.02899, 0.00932), (0.0, 0.0, 0.00568)),
    LinkInertia(3.2715, (0.0, 0.0348, 0.6708), (0.02061, 0.01967, 0.00729), (0.0, 0.0, -0.00366)),
    LinkInertia(3.8864, (0.0, -0.0293, 0.8269), (0.03055, 0.02899, 0.00931), (0.0, 0.0, -0.00568)),
    LinkInertia(1.474, (0.0, -0.0298, 1.0238), (0.00818, 0.00688, 0.00371), (0.0, 0.0, 0.0027)),
    LinkInertia(2.3169, (0.0, 0.0003, 1.145), (0.00681, 0.00656, 0.00446), (0.0, 0.0, 0.0003)),
    LinkInertia(0.2501, (0.0, 0.0, 1.2448), (0.00016, 0.00016, 0.00029), (0.0, 0.0, 0.0)),
)
_LM14: tuple[LinkInertia, ...] = (
    LinkInertia(5.5914, (0.0, -0.0338, 0.2794), (0.04489, 0.04528, 0.01678), (0.0, 0.0, 0.0067)),
    LinkInertia(6.0134, (0.0001, 0.0375, 0.4358), (0.05833, 0.05706, 0.01747), (-0.00003, 0.00006, 0.0106)),
    LinkInertia(3.6588, (0.0, 0.0349, 0.7106), (0.02296, 0.02191, 0.00814), (0.0, 0.0, -0.00407)),
    LinkInertia(4.3583, (0.0, -0.0293, 0.8664), (0.03426, 0.03251, 0.01044), (0.0, 0.0, -0.00636)),
    LinkInertia(1.653, (0.0, -0.0298, 1.0633), (0.00917, 0.00771, 0.00416), (0.0, 0.0, 0.00303)),
    LinkInertia(2.5982, (0.0, 0.0003, 1.1845), (0.00764, 0.00736, 0.005), (0.0, 0.0, 0.00034)),
    LinkInertia(0.2805, (0.0, 0.0, 1.2843), (0.00018, 0.00018, 0.00032), (0.0, 0.0, 0.0)),
)


def _raised(links: tuple[LinkInertia, ...], by_m: float) -> tuple[LinkInertia, ...]:
    """The same links with every centre of mass higher by ``by_m``."""
    return tuple(replace(link, com_m=(link.com_m[0], link.com_m[1], link.com_m[2] + by_m)) for link in links)


def _limits(velocity_deg_s: Seven, acceleration_rad_s2: Seven, torque_nm: Seven) -> JointLimits:
    """Limits of a robot; the position limits are the same for all four."""
    position = _radians(_POSITION_DEG)
    return JointLimits(
        position_min_rad=_negative(position),
        position_max_rad=position,
        velocity_rad_s=_radians(velocity_deg_s),
        acceleration_rad_s2=acceleration_rad_s2,
        jerk_rad_s3=_jerk(acceleration_rad_s2),
        torque_nm=torque_nm,
    )


def _size_7(name: str, title: str, inertia_set: str, links: tuple[LinkInertia, ...]) -> RobotFacts:
    """A robot with the lengths and drives of the iiwa 7 R800. Payload and reach: facts 2.3."""
    return RobotFacts(
        description=RobotDescription(
            name=name,
            title=title,
            limits=_limits(_VELOCITY_7_DEG_S, _ACCELERATION_7_RAD_S2, _TORQUE_7_NM),
            servo=ServoDynamics(_SERVO_ACCELERATION_7_RAD_S2, _SERVO_JERK_7_RAD_S3),
            payload_kg=7.0,
            reach_mm=800.0,
            initial_position_rad=_radians(_INITIAL_POSITION_DEG),
        ),
        lengths_m=_LENGTHS_7_M,
        odd_joint_heights_m=_ODD_HEIGHTS_7_M,
        inertia_set=inertia_set,
        links=links,
        viscous_nm_s_rad=_VISCOUS_NM_S_RAD,
        coulomb_nm=_COULOMB_NM,
        armature_kg_m2=_ARMATURE_7_KG_M2,
    )


def _size_14(name: str, title: str, inertia_set: str, links: tuple[LinkInertia, ...]) -> RobotFacts:
    """A robot with the lengths and drives of the iiwa 14 R820. Payload and reach: facts 2.3."""
    return RobotFacts(
        description=RobotDescription(
            name=name,
            title=title,
            limits=_limits(_VELOCITY_14_DEG_S, _radians(_ACCELERATION_14_DEG_S2), _TORQUE_14_NM),
            servo=ServoDynamics(_SERVO_ACCELERATION_14_RAD_S2, _SERVO_JERK_14_RAD_S3),
            payload_kg=14.0,
            reach_mm=820.0,
            initial_position_rad=_radians(_INITIAL_POSITION_DEG),
        ),
        lengths_m=_LENGTHS_14_M,
        odd_joint_heights_m=_ODD_HEIGHTS_14_M,
        inertia_set=inertia_set,
        links=links,
        viscous_nm_s_rad=_VISCOUS_NM_S_RAD,
        coulomb_nm=_COULOMB_NM,
        armature_kg_m2=_ARMATURE_14_KG_M2,
    )


_LM14_SHOULDER_OFFSET_M = 0.0005
"""LM14's heights belong to a source that has the shoulder at 0.3595 m and the flange at 1.3055 m (facts 1.2).

All its axes from A2 on stand half a millimetre below ours. Raised by that, each centre of mass keeps its place
against its own joint, and the torques of facts 3.4 come out; as printed, A2 would be off by 0.034 Nm.
"""

ROBOTS: tuple[RobotFacts, ...] = (
    _size_7("lbr-iiwa-7-r800", "LBR iiwa 7 R800", "L7", _L7),
    _size_14("lbr-iiwa-14-r820", "LBR iiwa 14 R820", "D14", _D14),
    _size_7("lbr-med-7", "LBR Med 7", "LM7", _LM7),
    _size_14("lbr-med-14", "LBR Med 14", "LM14", _raised(_LM14, _LM14_SHOULDER_OFFSET_M)),
)
"""The robots this project knows. D14 is the one set that agrees with identified torques (facts 3.3, 3.4)."""
