"""The look of a robot as triangles, for whoever draws it without MuJoCo: the geoms of its model, tessellated."""

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from backends.robots import load_mujoco
from hil.values.errors import BackendError
from hil.values.robot import Three

if TYPE_CHECKING:
    import mujoco

_SEGMENTS: Final = 40
_RINGS: Final = 20
_QUAD: Final = ((0, 1, 2), (0, 2, 3))

Surface = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices (n, 3) in m, and triangles (k, 3), counter-clockwise seen from outside."""


class VisualPart(NamedTuple):
    """All of one colour on one body: 0 is the base, 7 the last link. Vertices in m, in the body's frame."""

    body: int
    vertices: NDArray[np.float32]
    """(n, 3)."""
    faces: NDArray[np.int32]
    """(k, 3): triangles, counter-clockwise seen from outside."""
    colour: Three
    """Red, green, blue: 0 to 1."""


def visual_parts(name: str) -> tuple[VisualPart, ...]:
    """Return what is to be seen of a robot; raise :class:`UnknownName` if there is none of that name."""
    model = load_mujoco(name)
    merged: dict[tuple[int, Three], list[Surface]] = {}
    for geom in range(model.ngeom):
        material = int(model.geom_matid[geom])
        rgba = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
        red, green, blue, _ = (round(float(share), 4) for share in rgba)
        merged.setdefault((int(model.geom_bodyid[geom]), (red, green, blue)), []).append(_surface(model, geom))
    return tuple(VisualPart(body, *_merged(surfaces), colour) for (body, colour), surfaces in merged.items())


def _surface(model: "mujoco.MjModel", geom: int) -> Surface:
    import mujoco

    shape = mujoco.mjtGeom(model.geom_type[geom])
    if shape == mujoco.mjtGeom.mjGEOM_MESH:
        vertices, faces = _mesh(model, int(model.geom_dataid[geom]))
    else:
        try:
            make = _SHAPES[shape.name]
        except KeyError:
            raise BackendError(f"a geom of type {shape.name} cannot be drawn; valid: {', '.join(_SHAPES)}") from None
        vertices, faces = make(model.geom_size[geom])
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    return vertices @ rotation.reshape(3, 3).T + model.geom_pos[geom], faces


def _mesh(model: "mujoco.MjModel", mesh: int) -> Surface:
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    first_face, face_count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    vertices = np.array(model.mesh_vert[first : first + count], np.float64)
    return vertices, np.array(model.mesh_face[first_face : first_face + face_count], np.int64)


def _ellipsoid(size: NDArray[np.float64]) -> Surface:
    """A ball of rings and segments, stretched; its poles are on z."""
    latitudes = np.linspace(0.0, math.pi, _RINGS + 1)
    turns = np.linspace(0.0, 2.0 * math.pi, _SEGMENTS, endpoint=False)
    across, along = np.sin(latitudes)[:, None], np.cos(latitudes)[:, None]
    ball = np.stack([across * np.cos(turns), across * np.sin(turns), along + 0.0 * turns], axis=-1)
    faces = [
        (ring * _SEGMENTS + corner[0], ring * _SEGMENTS + corner[1], ring * _SEGMENTS + corner[2])
        for ring in range(_RINGS)
        for corner in _band()
    ]
    return ball.reshape(-1, 3) * size, np.array(faces)


def _sphere(size: NDArray[np.float64]) -> Surface:
    return _ellipsoid(np.full(3, size[0]))


def _cylinder(size: NDArray[np.float64]) -> Surface:
    """Radius, half the height; wall and discs have vertices of their own, so that the edge stays sharp."""
    radius, half = float(size[0]), float(size[1])
    turns = np.linspace(0.0, 2.0 * math.pi, _SEGMENTS, endpoint=False)
    circle = np.stack([radius * np.cos(turns), radius * np.sin(turns), np.zeros(_SEGMENTS)], axis=-1)
    up = np.array([0.0, 0.0, half])
    top, bottom = circle + up, circle - up
    wall = np.concatenate([top, bottom])
    discs = [np.concatenate([[[0.0, 0.0, half]], top]), np.concatenate([[[0.0, 0.0, -half]], bottom])]
    around = [(0, 1 + one, 1 + (one + 1) % _SEGMENTS) for one in range(_SEGMENTS)]
    upper = np.array(around)
    return _together([(wall, np.array(_band())), (discs[0], upper), (discs[1], upper[:, ::-1])])


def _box(size: NDArray[np.float64]) -> Surface:
    """Half its lengths; each side has vertices of its own."""
    sides = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            corners = np.zeros((4, 3))
            corners[:, axis] = sign
            corners[:, (axis + 1) % 3] = (-1.0, 1.0, 1.0, -1.0)
            corners[:, (axis + 2) % 3] = (-1.0, -1.0, 1.0, 1.0)
            faces = np.array(_QUAD)
            sides.append((corners * size, faces if sign > 0.0 else faces[:, ::-1]))
    return _together(sides)


def _band() -> list[tuple[int, int, int]]:
    """Triangles between a circle and the one below it, seen from outside."""
    faces = []
    for one in range(_SEGMENTS):
        following = (one + 1) % _SEGMENTS
        faces += [(one, _SEGMENTS + one, _SEGMENTS + following), (one, _SEGMENTS + following, following)]
    return faces


def _together(surfaces: list[Surface]) -> Surface:
    before = np.cumsum([0, *(len(vertices) for vertices, _ in surfaces)])
    faces = [faces + offset for (_, faces), offset in zip(surfaces, before[:-1], strict=True)]
    return np.concatenate([vertices for vertices, _ in surfaces]), np.concatenate(faces)


def _merged(surfaces: list[Surface]) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    vertices, faces = _together(surfaces)
    return vertices.astype(np.float32), faces.astype(np.int32)


_SHAPES: Final[Mapping[str, Callable[[NDArray[np.float64]], Surface]]] = {
    "mjGEOM_SPHERE": _sphere,
    "mjGEOM_ELLIPSOID": _ellipsoid,
    "mjGEOM_CYLINDER": _cylinder,
    "mjGEOM_BOX": _box,
}
