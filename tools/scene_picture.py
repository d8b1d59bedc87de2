"""A station's MuJoCo world as a picture, its robots at their start: ``python -m tools.scene_picture STATION PNG``.

Needs EGL or OSMesa (MUJOCO_GL), as every picture of MuJoCo without a screen does.
"""

import sys
from pathlib import Path

import mujoco

from backends.mujoco.options import parse_options
from backends.mujoco.scene import build, prefix_of
from backends.robots import load_description
from hil.config.station import load_station
from hil.values.robot import JOINT_NAMES

_SIZE = 1000, 560
_LIGHT = 0.35


def draw_scene(station: Path, picture: Path) -> None:
    """Draw the world of the first robot of ``station`` with all that stand in it."""
    from matplotlib import image

    surroundings = load_station(station).surroundings()
    model = build(surroundings.arms, surroundings.objects, scene=parse_options(surroundings.arms[0].options).scene)
    model.vis.headlight.ambient[:] = _LIGHT
    model.vis.global_.offwidth, model.vis.global_.offheight = _SIZE
    data = mujoco.MjData(model)
    for arm in surroundings.arms:
        start = load_description(arm.model).initial_position_rad
        for joint, value in zip(JOINT_NAMES, start, strict=True):
            data.joint(prefix_of(arm.name) + joint).qpos[0] = value
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = (0.6, 0.0, 0.5)
    camera.distance, camera.azimuth, camera.elevation = 2.1, 60.0, -22.0
    with mujoco.Renderer(model, _SIZE[1], _SIZE[0]) as renderer:
        renderer.update_scene(data, camera)
        image.imsave(picture, renderer.render())


if __name__ == "__main__":
    draw_scene(Path(sys.argv[1]), Path(sys.argv[2]))
