"""Writes a robot's MJCF file from the facts table, in the part of MJCF that MuJoCo and Pinocchio both read.

One body per joint, its origin on the joint axis and its axes parallel to the base at q = 0, so that every figure
of the table enters as it stands; only centres of mass are moved to the body's origin. Inertia comes from explicit
elements alone: geoms weigh nothing, collide with nothing, and are there to be looked at.
"""

import math
from xml.etree import ElementTree as ET

from backends.robots.facts import GRAVITY_M_S2, JOINT_AXES, LinkInertia, RobotFacts
from backends.robots.shells import (
    BARREL_DEPTH,
    Mesh,
    Point,
    Side,
    carried_shell,
    rising_shell,
    rounded_block,
    turned,
)
from hil.values.robot import JOINT_COUNT, JOINT_NAMES, Three

TIMESTEP_S = 0.001
"""The shortest send period of FRI (facts 6.1)."""

_HEADER = (
    "<!-- Written by tools/make_robots.py from backends/robots/facts.py: change those, not this file.\n"
    "     Contact is not modelled: no geom collides, and all mass is in the inertial elements. -->\n"
)

# What follows is the look of the arm: metres, by eye, ours.
_RING_RADII_M = (0.084, 0.072, 0.064, 0.046)
"""Of the rings at A1, A3, A5, A7."""
_ELBOW_RADII_M = (0.090, 0.078, 0.066)
"""Of the barrels at A2, A4, A6."""
_SIDES = (Side.RIGHT, Side.LEFT, Side.LEFT, Side.RIGHT, Side.RIGHT, Side.LEFT)
"""The side links 1 to 6 lean to: that of their centre of mass."""
_LID_RADIUS = 0.74
"""Of the lids of the barrels, in radii of the barrel."""
_LID_LEFT, _LID_RIGHT = "0.70710678 -0.70710678 0 0", "0.70710678 0.70710678 0 0"
"""Turns that lay z along +y and along -y."""
_FLANGE_RADIUS_M = 0.0315
_FLANGE_DEPTH_M = 0.006
_MEDIA_DEPTH_M = 0.016
_SEAM_M = 0.0012
"""How far an accent ring stands out."""


def mjcf_text(facts: RobotFacts) -> str:
    """The whole MJCF file of a robot, with a final newline; the same text for the same facts."""
    root = ET.Element("mujoco", model=facts.description.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    ET.SubElement(
        root, "option", timestep=_text(TIMESTEP_S), integrator="implicitfast", gravity=_text(0.0, 0.0, -GRAVITY_M_S2)
    )
    ET.SubElement(ET.SubElement(root, "default"), "geom", contype="0", conaffinity="0", mass="0", group="2")
    _add_assets(root, facts)
    _add_bodies(ET.SubElement(root, "worldbody"), facts)
    _add_motors(ET.SubElement(root, "actuator"), facts)
    keyframe = ET.SubElement(root, "keyframe")
    ET.SubElement(keyframe, "key", name="initial", qpos=_text(*facts.description.initial_position_rad))
    ET.indent(root)
    return _HEADER + ET.tostring(root, encoding="unicode") + "\n"


def _add_bodies(world: ET.Element, facts: RobotFacts) -> None:
    """The base, which is part of the world, and the chain of seven links with the flange at its end."""
    heights = facts.joint_heights_m
    _add_base_look(world)
    parent, parent_height = world, 0.0
    for index, (link, height) in enumerate(zip(facts.links, heights, strict=True)):
        rise = round(height - parent_height, 9)
        parent = ET.SubElement(parent, "body", name=f"link_{index + 1}", pos=_text(0.0, 0.0, rise))
        _add_inertial(parent, link, height)
        _add_joint(parent, facts, index)
        _add_link_look(parent, facts, index)
        parent_height = height
    tip = round(facts.flange_height_m - parent_height, 9)
    ET.SubElement(parent, "site", name="flange", pos=_text(0.0, 0.0, tip), size="0.005", group="3")


def _add_inertial(body: ET.Element, link: LinkInertia, height_m: float) -> None:
    """Mass, centre of mass from the body's origin at ``height_m``, and inertia, of one link."""
    x, y, z = link.com_m
    ET.SubElement(
        body,
        "inertial",
        pos=_text(x, y, round(z - height_m, 9)),
        mass=_text(link.mass_kg),
        fullinertia=_text(*link.moments_kg_m2, *link.products_kg_m2),
    )


def _add_joint(body: ET.Element, facts: RobotFacts, index: int) -> None:
    """One hinge; ``actuatorfrcrange`` repeats the motor's limit because Pinocchio reads it from the joint."""
    limits = facts.description.limits
    torque = limits.torque_nm[index]
    ET.SubElement(
        body,
        "joint",
        name=JOINT_NAMES[index],
        type="hinge",
        axis=_text(*JOINT_AXES[index]),
        range=_text(limits.position_min_rad[index], limits.position_max_rad[index]),
        actuatorfrcrange=_text(-torque, torque),
        damping=_text(facts.viscous_nm_s_rad[index]),
        frictionloss=_text(facts.coulomb_nm[index]),
        armature=_text(facts.armature_kg_m2[index]),
    )


def _add_motors(actuator: ET.Element, facts: RobotFacts) -> None:
    """Seven torque motors: control value = torque at the joint, Nm, cut off at the torque limit."""
    for name, torque in zip(JOINT_NAMES, facts.description.limits.torque_nm, strict=True):
        ET.SubElement(actuator, "motor", name=name, joint=name, forcerange=_text(-torque, torque))


def _add_assets(root: ET.Element, facts: RobotFacts) -> None:
    """Colours, and the meshes of the base and of links 1 to 6."""
    asset = ET.SubElement(root, "asset")
    for name, colour, shine in (
        ("shell", "0.93 0.94 0.95 1", "0.5"),
        ("cap", "0.80 0.81 0.83 1", "0.6"),
        ("accent", "0.96 0.45 0.10 1", "0.3"),
        ("dark", "0.20 0.20 0.22 1", "0.6"),
        ("steel", "0.62 0.64 0.67 1", "0.7"),
    ):
        ET.SubElement(asset, "material", name=name, rgba=colour, specular=shine, shininess=shine)
    heights = facts.joint_heights_m
    _add_mesh(asset, "base", turned(_pedestal(heights[0])))
    _add_mesh(asset, "foot", turned([(0.110, 0.0), (0.110, 0.006), (0.108, 0.008)]))
    _add_mesh(asset, "connectors", rounded_block((-0.168, -0.066, 0.004), (-0.04, 0.066, 0.096), 0.014))
    _add_mesh(asset, "flange", turned([(_FLANGE_RADIUS_M, -_FLANGE_DEPTH_M), (_FLANGE_RADIUS_M, 0.0)]))
    drum = facts.flange_height_m - heights[-1] - _FLANGE_DEPTH_M - _MEDIA_DEPTH_M
    ring = _RING_RADII_M[3]
    _add_mesh(asset, "drum", turned([(ring, 0.0), (ring, drum - 0.002), (ring - 0.002, drum)]))
    _add_mesh(asset, "media", turned(_media(ring - 0.003)))
    for number, elbow in enumerate(_ELBOW_RADII_M):
        _add_mesh(asset, f"lid_{number + 1}", turned(_lid(_LID_RADIUS * elbow)))
    for index, side in enumerate(_SIDES):
        rise = heights[index + 1] - heights[index]
        elbow = _ELBOW_RADII_M[index // 2]
        if index % 2 == 0:
            mesh = rising_shell(rise, _RING_RADII_M[index // 2], elbow, side)
        else:
            mesh = carried_shell(rise, elbow, _RING_RADII_M[index // 2 + 1], side)
        _add_mesh(asset, f"link_{index + 1}", mesh)


def _pedestal(height_m: float) -> list[Point]:
    """Outline of the base: a shoulder above the foot, then narrower up to the ring of A1."""
    top = _RING_RADII_M[0]
    straight, share = 0.3 * height_m, 1.0 / 6.0
    outline = [(0.104, 0.008), (0.104, straight)]
    for step in range(1, 7):
        t = step * share
        outline.append((0.104 + t * t * (3.0 - 2.0 * t) * (top - 0.104), straight + t * (0.86 * height_m - straight)))
    return [*outline, (top, height_m)]


def _lid(radius_m: float) -> list[Point]:
    """Outline of a lid, its edge at z = 0: sunk into the barrel, with a rounded edge and a face a little domed."""
    edge = 0.004
    rounding = [
        (radius_m - edge + edge * math.cos(angle), edge * (math.sin(angle) - 1.0))
        for angle in (0.0, math.pi / 8.0, math.pi / 4.0, 3.0 * math.pi / 8.0)
    ]
    return [(radius_m, -0.4 * radius_m), *rounding, (0.8 * radius_m, 0.0004), (0.4 * radius_m, 0.0016), (0.0, 0.002)]


def _media(radius_m: float) -> list[Point]:
    """Outline of the media flange, its upper face at z = 0, with a groove around it."""
    low, high = -_MEDIA_DEPTH_M, -0.0015
    return [(radius_m, low), (radius_m, high), (radius_m, high), (radius_m - 0.0015, 0.0)]


def _add_mesh(asset: ET.Element, name: str, mesh: Mesh) -> None:
    vertices = _text(*(value for vertex in mesh.vertices for value in vertex))
    faces = " ".join(str(value) for face in mesh.faces for value in face)
    ET.SubElement(asset, "mesh", name=name, inertia="shell", vertex=vertices, face=faces)


def _add_base_look(world: ET.Element) -> None:
    """The foot plate, the pedestal, and the housing of the connectors behind it with its panel."""
    _add_shape(world, "dark", "foot")
    _add_shape(world, "shell", "base")
    _add_shape(world, "shell", "connectors")
    ET.SubElement(world, "geom", type="box", size="0.001 0.05 0.032", pos="-0.1685 0 0.046", material="dark")
    for y, z in ((-0.028, 0.056), (0.0, 0.056), (0.028, 0.056), (-0.022, 0.03), (0.022, 0.03)):
        _add_cylinder(world, "cap", 0.010, (-0.168, y, z), (-0.173, y, z))


def _add_link_look(body: ET.Element, facts: RobotFacts, index: int) -> None:
    """Shell, accent ring, and the lid of the half barrel that the link has around an even joint."""
    heights = facts.joint_heights_m
    if index == JOINT_COUNT - 1:
        _add_flange_look(body, facts.flange_height_m - heights[index])
        return
    _add_shape(body, "shell", f"link_{index + 1}")
    elbow, side = _ELBOW_RADII_M[index // 2], _SIDES[index]
    if index % 2 == 0:
        ring = _RING_RADII_M[index // 2] + _SEAM_M
        _add_cylinder(body, "accent", ring, (0.0, 0.0, -0.002), (0.0, 0.0, 0.002))
        z = round(heights[index + 1] - heights[index], 9)
    else:
        z = 0.0
        _add_cylinder(body, "dark", elbow + 0.0005, (0.0, -0.0012, z), (0.0, 0.0012, z))
    depth = side.value * BARREL_DEPTH * elbow
    turn = _LID_LEFT if side is Side.LEFT else _LID_RIGHT
    _add_shape(body, "cap", f"lid_{index // 2 + 1}", pos=_text(0.0, round(depth, 6), z), quat=turn)
    inside = depth - side.value * 0.020
    radius = _LID_RADIUS * elbow + 0.002
    _add_cylinder(body, "accent", radius, (0.0, inside, z), (0.0, depth - side.value * 0.008, z))


def _add_flange_look(body: ET.Element, length_m: float) -> None:
    """The last link: a short drum, the media flange, and the face whose plane is the flange frame's."""
    _add_cylinder(body, "accent", _RING_RADII_M[3] + _SEAM_M, (0.0, 0.0, -0.002), (0.0, 0.0, 0.002))
    _add_shape(body, "shell", "drum")
    face = round(length_m, 9)
    _add_shape(body, "dark", "media", pos=_text(0.0, 0.0, round(face - _FLANGE_DEPTH_M, 9)))
    _add_shape(body, "steel", "flange", pos=_text(0.0, 0.0, face))


def _add_shape(body: ET.Element, material: str, mesh: str, **where: str) -> None:
    ET.SubElement(body, "geom", {"type": "mesh", "mesh": mesh, "material": material, **where})


def _add_cylinder(body: ET.Element, material: str, radius_m: float, start: Three, end: Three) -> None:
    """A cylinder between two points of the body's frame, m."""
    ends = _text(*(round(value, 6) for value in (*start, *end)))
    radius = _text(round(radius_m, 6))
    ET.SubElement(body, "geom", type="cylinder", size=radius, fromto=ends, material=material)


def _text(*values: float) -> str:
    """Numbers as MJCF writes them, each the shortest text that reads back as the same number."""
    return " ".join(repr(float(value) + 0.0).removesuffix(".0") for value in values)
