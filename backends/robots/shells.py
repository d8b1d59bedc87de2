"""The look of the arm: its shells as small triangle meshes, drawn by us from the kinematics alone.

Every shell between an odd axis (along the arm) and an even axis (across it) is one bent tube. It starts as a
circle around the odd axis, leans out to one side, and ends in half of the barrel around the even axis, whose other
half is the next shell's. This gives the arm its alternating side-offset elbows. Round lids close the barrels.
Sizes are ours, taken by eye from photographs; they enter no computation.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

Point = tuple[float, float]
"""y and z of a bent tube, which lies in the plane x = 0; or radius and z of something turned; m."""
Corner = tuple[float, float, float]

_SEGMENTS = 32
_BARREL_RINGS = 8
_TUBE_RINGS = 9
_ROUNDING = 5
_DECIMALS = 5

_FULLNESS = 3.0
"""Exponent of the superellipse that the outline of a barrel is: 2 is an ellipse, more is more of a cylinder."""
_NECK = 0.8
"""Share of the height above the barrel in which the barrel's breadth becomes the tube's."""
_BARREL_SHARE = 0.12
"""Share of the inner outline that belongs to the barrel."""

BARREL_DEPTH = 1.12
"""From the plane of the even joint to the end of the barrel, in its radii."""


class Side(Enum):
    """Side of the arm a shell leans to, as the sign of y at q = 0."""

    LEFT = 1
    RIGHT = -1


@dataclass(frozen=True, slots=True)
class Mesh:
    """A closed surface: vertices in m in the body's frame, triangles counter-clockwise seen from outside.

    At a sharp edge vertices stand twice, so that each side keeps its own normals.
    """

    vertices: tuple[Corner, ...]
    faces: tuple[tuple[int, int, int], ...]


def carried_shell(height_m: float, elbow_radius_m: float, ring_radius_m: float, side: Side) -> Mesh:
    """Shell of an even body: from its own joint at z = 0 up to the odd axis' ring at ``height_m``."""
    left = _loft(_bent_tube(height_m, elbow_radius_m, ring_radius_m))
    return left if side is Side.LEFT else _mirrored([(x, -y, z) for x, y, z in left.vertices], left)


def rising_shell(height_m: float, ring_radius_m: float, elbow_radius_m: float, side: Side) -> Mesh:
    """Shell of an odd body: from its own axis at z = 0 up to the even joint at ``height_m``."""
    upright = carried_shell(height_m, elbow_radius_m, ring_radius_m, side)
    return _mirrored([(x, y, height_m - z) for x, y, z in upright.vertices], upright)


def turned(profile: Sequence[Point], *, segments: int = _SEGMENTS) -> Mesh:
    """A solid turned around z, from its outline (radius, z) from below upwards; a point given twice is an edge."""
    rings = [[(r * c, r * s, z) for c, s in _circle(segments)] for r, z in profile]
    return _loft(rings)


def rounded_block(low: Corner, high: Corner, radius_m: float) -> Mesh:
    """A block between two corners; all its edges but those of its foot are rounded."""
    rings = [_rounded_rectangle(low, high, radius_m, radius_m, low[2])]
    for step in range(_ROUNDING + 1):
        angle = 0.5 * math.pi * step / _ROUNDING
        inset, rise = radius_m * (1.0 - math.cos(angle)), radius_m * (math.sin(angle) - 1.0)
        rings.append(_rounded_rectangle(low, high, radius_m, radius_m - inset, high[2] + rise))
    return _loft(rings, smooth_end=True)


def _rounded_rectangle(low: Corner, high: Corner, radius_m: float, kept_m: float, z: float) -> list[Corner]:
    """Rectangle with its corners rounded; ``radius_m - kept_m`` smaller all round."""
    points: list[Corner] = []
    middles = (
        (high[0] - radius_m, high[1] - radius_m),
        (low[0] + radius_m, high[1] - radius_m),
        (low[0] + radius_m, low[1] + radius_m),
        (high[0] - radius_m, low[1] + radius_m),
    )
    for quarter, (x, y) in enumerate(middles):
        for step in range(_ROUNDING + 1):
            angle = 0.5 * math.pi * (quarter + step / _ROUNDING)
            points.append((x + kept_m * math.cos(angle), y + kept_m * math.sin(angle), z))
    return points


def _bent_tube(height_m: float, elbow_radius_m: float, ring_radius_m: float) -> list[list[Corner]]:
    """Rings of a shell that leans to the left, from the plane of the even joint to the ring of the odd one.

    Each is an ellipse that spans between a point of the outer outline (under the barrel, around its end, up the tube)
    and one of the inner outline (from the rim of the barrel over the neighbour's to the back of the tube).
    """
    depth, gap = BARREL_DEPTH * elbow_radius_m, height_m - elbow_radius_m
    inner = (
        (0.0, elbow_radius_m),
        (-0.35 * ring_radius_m, elbow_radius_m + 0.12 * gap),
        (-ring_radius_m, elbow_radius_m + 0.12 * gap),
        (-ring_radius_m, height_m),
    )
    outer = (
        (depth, 0.0),
        (depth, 0.45 * height_m),
        (ring_radius_m, 0.5 * height_m),
        (ring_radius_m, height_m),
    )
    reach = elbow_radius_m + gap * _NECK

    def section(below: Point, above: Point) -> list[Corner]:
        middle = 0.5 * (below[1] + above[1]) / reach
        chord = elbow_radius_m * math.sqrt(max(0.0, 1.0 - middle * middle))
        return _ellipse(below, above, max(ring_radius_m, chord))

    rings = []
    for step in range(_BARREL_RINGS):
        share = step / _BARREL_RINGS
        angle = 0.5 * math.pi * share
        below = (
            depth * math.sin(angle) ** (2.0 / _FULLNESS),
            -elbow_radius_m * math.cos(angle) ** (2.0 / _FULLNESS),
        )
        rings.append(section(below, _bezier(inner, _BARREL_SHARE * share)))
    for step in range(_TUBE_RINGS + 1):
        share = step / _TUBE_RINGS
        above = _BARREL_SHARE + (1.0 - _BARREL_SHARE) * share
        rings.append(section(_bezier(outer, share), _bezier(inner, above)))
    return rings


def _ellipse(outer: Point, inner: Point, half_width_m: float) -> list[Corner]:
    y, z = 0.5 * (outer[0] + inner[0]), 0.5 * (outer[1] + inner[1])
    dy, dz = 0.5 * (outer[0] - inner[0]), 0.5 * (outer[1] - inner[1])
    return [(half_width_m * c, y + s * dy, z + s * dz) for c, s in _circle(_SEGMENTS)]


def _circle(segments: int) -> list[Point]:
    angles = (2.0 * math.pi * segment / segments for segment in range(segments))
    return [(math.cos(angle), math.sin(angle)) for angle in angles]


def _bezier(points: tuple[Point, Point, Point, Point], t: float) -> Point:
    """Point of a cubic Bézier curve at ``t`` in 0 to 1."""
    u = 1.0 - t
    weights = (u * u * u, 3.0 * u * u * t, 3.0 * u * t * t, t * t * t)
    first = math.fsum(w * p[0] for w, p in zip(weights, points, strict=True))
    second = math.fsum(w * p[1] for w, p in zip(weights, points, strict=True))
    return first, second


def _loft(rings: list[list[Corner]], *, smooth_end: bool = False) -> Mesh:
    """The surface over rings of equally many points, closed with a flat lid of its own edge at both ends."""
    vertices = [point for ring in rings for point in ring]
    count = len(rings[0])
    faces: list[tuple[int, int, int]] = []
    for number in range(len(rings) - 1):
        if rings[number] == rings[number + 1]:
            continue
        for segment in range(count):
            following = (segment + 1) % count
            a, b = number * count + segment, number * count + following
            faces += [(a, b, b + count), (a, b + count, a + count)]
    for ring, upwards in ((rings[0], False), (rings[-1], True)):
        if upwards and smooth_end:
            first = (len(rings) - 1) * count
        else:
            first = len(vertices)
            vertices += ring
        middle = len(vertices)
        x, y, z = (math.fsum(point[axis] for point in ring) / count for axis in range(3))
        vertices.append((x, y, z))
        for segment in range(count):
            a, b = first + segment, first + (segment + 1) % count
            faces.append((middle, a, b) if upwards else (middle, b, a))
    rounded = tuple(_rounded(*vertex) for vertex in vertices)
    return Mesh(rounded, tuple(face for face in faces if len({rounded[corner] for corner in face}) == 3))


def _mirrored(vertices: list[Corner], mesh: Mesh) -> Mesh:
    return Mesh(tuple(_rounded(*vertex) for vertex in vertices), tuple((c, b, a) for a, b, c in mesh.faces))


def _rounded(x: float, y: float, z: float) -> Corner:
    """A vertex to 0.01 mm, without negative zeros: the same text on every machine."""
    return round(x, _DECIMALS) + 0.0, round(y, _DECIMALS) + 0.0, round(z, _DECIMALS) + 0.0
