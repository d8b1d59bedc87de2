"""Writes a robot's MJCF file from the facts table, in the part of MJCF that MuJoCo and Pinocchio both read.

One body per joint, its origin on the joint axis and its axes parallel to the base at q = 0, so that every figure
of the table enters as it stands; only centres of mass are moved to the body's origin. Inertia comes from explicit
elements alone: geoms weigh nothing, collide with nothing, and are there to be looked at.
"""

from xml.etree import ElementTree as ET

from backends.robots.facts import GRAVITY_M_S2, JOINT_AXES, LinkInertia, RobotFacts
from backends.robots.shells import Mesh, Side, carried_shell, pedestal, rising_shell
from hil.values.robot import JOINT_COUNT, JOINT_NAMES, Three

TIMESTEP_S = 0.001
"""The shortest send period of FRI (facts 6.1)."""

_HEADER = (
    "<!-- Written by tools/make_robots.py from backends/robots/facts.py: change those, not this file.\n"
    "     Contact is not modelled: no geom collides, and all mass is in the inertial elements. -->\n"
)

# What follows is the look of the arm: metres, by eye, ours.
_FOOT_RADIUS_M = 0.105
_RING_RADII_M = (0.084, 0.072, 0.064, 0.046)
"""Of the rings at A1, A3, A5, A7."""
_ELBOW_RADII_M = (0.090, 0.078, 0.066)
"""Of the discs at A2, A4, A6."""
_DOME_DEPTH = 1.2
"""Depth of the housings at A2, A4, A6 along the axis, in radii of the disc."""
_SIDES = (Side.RIGHT, Side.LEFT, Side.LEFT, Side.RIGHT, Side.RIGHT, Side.LEFT)
"""The side links 1 to 6 lean to: that of their centre of mass."""
_FLANGE_RADIUS_M = 0.0315
_FLANGE_DEPTH_M = 0.012
_SEAM_M = 0.003
"""Half the width of an accent ring, and how far it stands out."""


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
    _add_base_look(world, heights[0])
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
        ("shell", "0.90 0.91 0.92 1", "0.5"),
        ("cap", "0.74 0.75 0.77 1", "0.6"),
        ("accent", "0.96 0.45 0.10 1", "0.3"),
        ("dark", "0.20 0.20 0.22 1", "0.6"),
    ):
        ET.SubElement(asset, "material", name=name, rgba=colour, specular=shine, shininess=shine)
    heights = facts.joint_heights_m
    _add_mesh(asset, "base", pedestal(heights[0], _FOOT_RADIUS_M, _RING_RADII_M[0]))
    for index, side in enumerate(_SIDES):
        rise = heights[index + 1] - heights[index]
        elbow = _ELBOW_RADII_M[index // 2]
        if index % 2 == 0:
            mesh = rising_shell(rise, _RING_RADII_M[index // 2], elbow, side)
        else:
            mesh = carried_shell(rise, elbow, _RING_RADII_M[index // 2 + 1], side)
        _add_mesh(asset, f"link_{index + 1}", mesh)


def _add_mesh(asset: ET.Element, name: str, mesh: Mesh) -> None:
    vertices = _text(*(value for vertex in mesh.vertices for value in vertex))
    faces = " ".join(str(value) for face in mesh.faces for value in face)
    ET.SubElement(asset, "mesh", name=name, inertia="shell", vertex=vertices, face=faces)


def _add_base_look(world: ET.Element, height_m: float) -> None:
    """The pedestal, the plate it stands on, and the box of the connectors behind it."""
    _add_shell(world, "base")
    _add_cylinder(world, "dark", _FOOT_RADIUS_M + 0.004, (0.0, 0.0, 0.0), (0.0, 0.0, 0.010))
    box_height = height_m / 4.0
    ET.SubElement(
        world,
        "geom",
        type="box",
        size=_text(0.04, 0.062, box_height),
        pos=_text(-0.085, 0.0, box_height),
        material="cap",
    )


def _add_link_look(body: ET.Element, facts: RobotFacts, index: int) -> None:
    """Shell, accent ring, and where the link covers half of an even joint, that joint's housing and cap."""
    heights = facts.joint_heights_m
    if index == JOINT_COUNT - 1:
        _add_flange_look(body, facts.flange_height_m - heights[index])
        return
    _add_shell(body, f"link_{index + 1}")
    elbow, sign = _ELBOW_RADII_M[index // 2], float(_SIDES[index].value)
    if index % 2 == 0:
        ring = _RING_RADII_M[index // 2] + _SEAM_M
        _add_cylinder(body, "accent", ring, (0.0, 0.0, -_SEAM_M), (0.0, 0.0, _SEAM_M))
        z = round(heights[index + 1] - heights[index], 9)
    else:
        z = 0.0
        _add_cylinder(body, "accent", elbow + _SEAM_M, (0.0, -_SEAM_M, z), (0.0, _SEAM_M, z))
    _add_dome(body, elbow, z)
    _add_cylinder(body, "cap", 0.5 * elbow, (0.0, 0.0, z), (0.0, sign * (_DOME_DEPTH + 0.15) * elbow, z))


def _add_flange_look(body: ET.Element, length_m: float) -> None:
    """The last link: a short drum, and the dark flange whose face is the flange frame's plane."""
    drum, plate = length_m - _FLANGE_DEPTH_M, _RING_RADII_M[3]
    _add_cylinder(body, "accent", plate + _SEAM_M, (0.0, 0.0, -_SEAM_M), (0.0, 0.0, _SEAM_M))
    _add_cylinder(body, "shell", plate, (0.0, 0.0, 0.0), (0.0, 0.0, drum))
    _add_cylinder(body, "dark", _FLANGE_RADIUS_M, (0.0, 0.0, drum), (0.0, 0.0, length_m))


def _add_shell(body: ET.Element, mesh: str) -> None:
    ET.SubElement(body, "geom", type="mesh", mesh=mesh, material="shell")


def _add_dome(body: ET.Element, radius_m: float, height_m: float) -> None:
    """The housing of an even joint: an ellipsoid around its axis, y. Its other half is the neighbour's."""
    radii = (radius_m, _DOME_DEPTH * radius_m, radius_m)
    size = _text(*(round(value, 6) for value in radii))
    ET.SubElement(body, "geom", type="ellipsoid", size=size, pos=_text(0.0, 0.0, height_m), material="shell")


def _add_cylinder(body: ET.Element, material: str, radius_m: float, start: Three, end: Three) -> None:
    """A cylinder between two points of the body's frame, m."""
    ends = _text(*(round(value, 6) for value in (*start, *end)))
    radius = _text(round(radius_m, 6))
    ET.SubElement(body, "geom", type="cylinder", size=radius, fromto=ends, material=material)


def _text(*values: float) -> str:
    """Numbers as MJCF writes them, each the shortest text that reads back as the same number."""
    return " ".join(repr(float(value) + 0.0).removesuffix(".0") for value in values)
