"""The look of the arm: its shells as small triangle meshes, drawn by us from the kinematics alone.

Every shell between an odd axis (along the arm) and an even axis (across it) is one bent tube. It starts as a
circle around the odd axis, leans out to one side, and comes back to meet the next shell in the plane of the even
joint, where each of the two covers its own half. This gives the arm its alternating side-offset elbows.
Radii are ours, taken by eye from photographs; they enter no computation.
"""

import math
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

Point = tuple[float, float]
"""y and z, m: all spines lie in the plane x = 0."""

_SECTIONS = 12
_SEGMENTS = 24
_DECIMALS = 4

_REACH = 0.85
"""How far the spine's handle points out of the joint plane, in elbow radii: an elbow about as deep as round."""
_STRAIGHT = 0.25
"""Share of a shell's height after which its spine is nearly upright."""


class Side(Enum):
    """Side of the arm a shell leans to, as the sign of y at q = 0."""

    LEFT = 1
    RIGHT = -1


@dataclass(frozen=True, slots=True)
class Mesh:
    """A closed surface: vertices in m in the body's frame, triangles counter-clockwise seen from outside."""

    vertices: tuple[tuple[float, float, float], ...]
    faces: tuple[tuple[int, int, int], ...]


def carried_shell(height_m: float, elbow_radius_m: float, ring_radius_m: float, side: Side) -> Mesh:
    """Shell of an even body: from its own joint at z = 0 up to the odd axis' ring at ``height_m``."""
    reach = side.value * _REACH * elbow_radius_m
    spine = ((0.0, 0.0), (reach, 0.0), (0.0, _STRAIGHT * height_m), (0.0, height_m))
    return _tube(spine, elbow_radius_m, ring_radius_m)


def rising_shell(height_m: float, ring_radius_m: float, elbow_radius_m: float, side: Side) -> Mesh:
    """Shell of an odd body: from its own axis at z = 0 up to the even joint at ``height_m``."""
    upright = carried_shell(height_m, elbow_radius_m, ring_radius_m, side)
    vertices = tuple(_rounded(x, y, height_m - z) for x, y, z in upright.vertices)
    return Mesh(vertices, tuple((c, b, a) for a, b, c in upright.faces))


def pedestal(height_m: float, foot_radius_m: float, ring_radius_m: float) -> Mesh:
    """The base: a round foot that narrows to the ring of A1."""
    spine = ((0.0, 0.0), (0.0, height_m / 3.0), (0.0, 2.0 * height_m / 3.0), (0.0, height_m))
    return _tube(spine, foot_radius_m, ring_radius_m)


def _tube(spine: tuple[Point, Point, Point, Point], start_radius_m: float, end_radius_m: float) -> Mesh:
    """Circles swept along a cubic Bézier curve in the plane x = 0, closed with a disc at both ends.

    The circles stand closer together near the start, where an elbow's spine turns.
    """
    vertices: list[tuple[float, float, float]] = []
    for section in range(_SECTIONS + 1):
        t = (section / _SECTIONS) ** 1.5
        (y, z), (ty, tz) = _point(spine, t), _direction(spine, t)
        blend = t * t * (3.0 - 2.0 * t)
        radius = start_radius_m + blend * (end_radius_m - start_radius_m)
        for segment in range(_SEGMENTS):
            angle = 2.0 * math.pi * segment / _SEGMENTS
            across, along = radius * math.cos(angle), radius * math.sin(angle)
            # The circle is spanned by x and by tangent × x = (0, tz, −ty).
            vertices.append(_rounded(across, y + along * tz, z - along * ty))
    start, end = len(vertices), len(vertices) + 1
    vertices += [_rounded(0.0, *spine[0]), _rounded(0.0, *spine[3])]
    return Mesh(tuple(vertices), tuple(_faces(start, end)))


def _faces(start: int, end: int) -> list[tuple[int, int, int]]:
    """Triangles between neighbouring circles, and the two end discs around vertices ``start`` and ``end``."""
    faces: list[tuple[int, int, int]] = []
    last = _SECTIONS * _SEGMENTS
    for segment in range(_SEGMENTS):
        following = (segment + 1) % _SEGMENTS
        for base in range(0, last, _SEGMENTS):
            a, b = base + segment, base + following
            faces += [(a, b, b + _SEGMENTS), (a, b + _SEGMENTS, a + _SEGMENTS)]
        faces += [(start, following, segment), (end, last + segment, last + following)]
    return faces


def _point(spine: tuple[Point, Point, Point, Point], t: float) -> Point:
    """Point of the curve at ``t`` in 0 to 1."""
    u = 1.0 - t
    weights = (u * u * u, 3.0 * u * u * t, 3.0 * u * t * t, t * t * t)
    y = math.fsum(w * p[0] for w, p in zip(weights, spine, strict=True))
    z = math.fsum(w * p[1] for w, p in zip(weights, spine, strict=True))
    return y, z


def _direction(spine: tuple[Point, Point, Point, Point], t: float) -> Point:
    """Unit tangent of the curve at ``t`` in 0 to 1."""
    u = 1.0 - t
    weights = (u * u, 2.0 * u * t, t * t)
    steps = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(spine)]
    y = math.fsum(w * s[0] for w, s in zip(weights, steps, strict=True))
    z = math.fsum(w * s[1] for w, s in zip(weights, steps, strict=True))
    length = math.hypot(y, z)
    return y / length, z / length


def _rounded(x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vertex to 0.1 mm, without negative zeros: the same text on every machine."""
    return round(x, _DECIMALS) + 0.0, round(y, _DECIMALS) + 0.0, round(z, _DECIMALS) + 0.0
