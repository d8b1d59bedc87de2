"""stub, replaced by the merge."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from backends.robots import load_mujoco


class VisualPart(NamedTuple):
    body: int
    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    colour: tuple[float, float, float]


def visual_parts(name: str) -> tuple[VisualPart, ...]:
    m = load_mujoco(name)
    parts = []
    for g in range(m.ngeom):
        if m.geom_type[g] != mujoco.mjtGeom.mjGEOM_MESH:
            continue
        k = m.geom_dataid[g]
        va, vn = m.mesh_vertadr[k], m.mesh_vertnum[k]
        fa, fn = m.mesh_faceadr[k], m.mesh_facenum[k]
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, m.geom_quat[g])
        vertices = m.mesh_vert[va : va + vn] @ rotation.reshape(3, 3).T + m.geom_pos[g]
        c = m.geom_rgba[g] if m.geom_matid[g] < 0 else m.mat_rgba[m.geom_matid[g]]
        parts.append(
            VisualPart(int(m.geom_bodyid[g]), vertices.astype(np.float32), m.mesh_face[fa : fa + fn], tuple(c[:3]))
        )
    return tuple(parts)
