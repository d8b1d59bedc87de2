"""What truly hangs on the flange of the simulated arm: part of the last link's mass, centre and inertia."""

import mujoco
import numpy as np

from hil.values.load import Load

_LAST = "link_7"
_FLANGE = "flange"


def hang(load: Load, model: "mujoco.MjModel", *, prefix: str = "") -> None:
    """Give the last link mass, centre and inertia of itself with ``load``, which is told in the flange.

    ``prefix`` is that of the arm's names.
    """
    if load.mass_kg == 0.0:
        return
    body, site = model.body(prefix + _LAST).id, model.site(prefix + _FLANGE).id
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[body])
    axes = turn.reshape(3, 3)
    own = axes @ np.diag(model.body_inertia[body]) @ axes.T
    own_mass, own_centre = float(model.body_mass[body]), np.array(model.body_ipos[body])
    hung_centre = np.array(model.site_pos[site]) + np.array(load.centre_m)
    mass = own_mass + load.mass_kg
    centre = (own_mass * own_centre + load.mass_kg * hung_centre) / mass
    whole = own + load.tensor_kg_m2()
    for part, at in ((own_mass, own_centre), (load.mass_kg, hung_centre)):
        off = at - centre
        whole = whole + part * (float(off @ off) * np.eye(3) - np.outer(off, off))
    moments, axes = np.linalg.eigh(whole)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] = -axes[:, 0]
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, axes.flatten())
    model.body_mass[body] = mass
    model.body_ipos[body] = centre
    model.body_iquat[body] = quaternion
    model.body_inertia[body] = moments
    mujoco.mj_setConst(model, mujoco.MjData(model))
