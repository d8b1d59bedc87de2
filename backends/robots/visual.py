"""The look of an arm as triangles, for renderers other than MuJoCo's: read from the very model that MuJoCo draws."""

from functools import lru_cache
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from backends.robots import load_mujoco, robot_names
from hil.values.robot import Three

if TYPE_CHECKING:
    import mujoco

Vertices = NDArray[np.float32]
Faces = NDArray[np.int32]

_SEGMENTS: Final = 32
_BOX_CORNERS: Final = ((-1, -1), (1, -1), (1, 1), (-1, 1))


class VisualPart(NamedTuple):
    """Everything of one colour on one body.

    Where the surface has an edge, vertices stand there twice: normals averaged over the faces of a vertex are right.
    """

    body: int
    """0: the base, which stands still; 1 to 7: what turns with A1 to A7. Link 7 ends at the flange."""
    colour: Three
    """Red, green, blue, 0..1."""
    vertices: Vertices
    """N×3, m, in the frame of the body: its origin on the axis, its axes parallel to the base's at q = 0."""
    faces: Faces
    """M×3, counter-clockwise seen from outside."""


@lru_cache(maxsize=len(robot_names()))
def visual_parts(name: str) -> tuple[VisualPart, ...]:
    """Return what there is to see of a robot, in the order of its bodies; ``UnknownName`` if there is none."""
    model = load_mujoco(name)
    pieces: dict[tuple[int, Three], list[tuple[Vertices, Faces]]] = {}
    for geom in range(model.ngeom):
        red, green, blue = map(float, _colour(model, geom))
        key = int(model.geom_bodyid[geom]), (round(red, 4), round(green, 4), round(blue, 4))
        pieces.setdefault(key, []).append(_placed(model, geom))
    return tuple(VisualPart(body, colour, *_joined(pieces[body, colour])) for body, colour in sorted(pieces))


def _colour(model: "mujoco.MjModel", geom: int) -> NDArray[np.float32]:
    material = model.geom_matid[geom]
    rgba: NDArray[np.float32] = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
    return rgba[:3]


def _placed(model: "mujoco.MjModel", geom: int) -> tuple[Vertices, Faces]:
    """Triangles of one geom in the frame of its body."""
    import mujoco

    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    vertices, faces = _triangles(model, geom)
    return (vertices @ turn.reshape(3, 3).T + model.geom_pos[geom]).astype(np.float32), faces


def _triangles(model: "mujoco.MjModel", geom: int) -> tuple[NDArray[np.float64], Faces]:
    """Triangles of one geom in its own frame."""
    import mujoco

    kind, size = mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.mesh(model.geom_dataid[geom])
        vertex, face = int(mesh.vertadr[0]), int(mesh.faceadr[0])
        vertices = model.mesh_vert[vertex : vertex + int(mesh.vertnum[0])].astype(np.float64)
        return vertices, model.mesh_face[face : face + int(mesh.facenum[0])].astype(np.int32)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return _box(size)
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return _cylinder(float(size[0]), float(size[1]))
    raise NotImplementedError(f"a robot's description has a geom of the kind {kind.name}")


def _cylinder(radius_m: float, half_m: float) -> tuple[NDArray[np.float64], Faces]:
    """Wall and two lids, each with vertices of its own."""
    angles = 2.0 * np.pi * np.arange(_SEGMENTS) / _SEGMENTS
    ring = np.stack((radius_m * np.cos(angles), radius_m * np.sin(angles), np.zeros(_SEGMENTS)), axis=1)
    up = np.array((0.0, 0.0, half_m))
    low, high = ring - up, ring + up
    faces: list[tuple[int, int, int]] = []
    for segment in range(_SEGMENTS):
        following = (segment + 1) % _SEGMENTS
        faces += [(segment, following, _SEGMENTS + following), (segment, _SEGMENTS + following, _SEGMENTS + segment)]
    for segment in range(1, _SEGMENTS - 1):
        first, second = 2 * _SEGMENTS, 3 * _SEGMENTS
        faces += [(first, first + segment + 1, first + segment), (second, second + segment, second + segment + 1)]
    return np.concatenate((low, high, low, high)), np.array(faces, dtype=np.int32)


def _box(half_sizes: NDArray[np.float64]) -> tuple[NDArray[np.float64], Faces]:
    vertices: list[NDArray[np.float64]] = []
    faces: list[tuple[int, int, int]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            first = len(vertices)
            for u, v in _BOX_CORNERS:
                corner = np.zeros(3)
                corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3] = sign, sign * u, v
                vertices.append(corner * half_sizes)
            faces += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return np.array(vertices), np.array(faces, dtype=np.int32)


def _joined(pieces: list[tuple[Vertices, Faces]]) -> tuple[Vertices, Faces]:
    firsts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces[:-1])])
    vertices = np.concatenate([vertices for vertices, _ in pieces])
    faces = np.concatenate([faces + first for (_, faces), first in zip(pieces, firsts, strict=True)]).astype(np.int32)
    for array in (vertices, faces):
        array.setflags(write=False)
    return vertices, faces
