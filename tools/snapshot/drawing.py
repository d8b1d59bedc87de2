"""A world, drawn."""

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from tools.snapshot.camera import FIELD_OF_VIEW_DEG, Camera, Points
from tools.snapshot.opengl import drawing_surface
from tools.snapshot.world import PictureWorld

Picture = NDArray[np.uint8]

_FINER: Final = 2
"""Drawn so many times as wide and as high, and averaged: smooth edges, also where the background shows through."""
_MOST_GEOMS: Final = 10_000
_FAR: Final = 1.0
_SHADOW_PIXELS: Final = 4096
_ROOM: Final = 1.4
"""The floor is lit and shadowed so far around what stands on it, in radii of that."""


def draw(world: PictureWorld, camera: Camera, *, transparent: bool = False) -> Picture:
    """Return the picture, height × width × 4 (red, green, blue, opacity), on white unless ``transparent``."""
    width, height = _FINER * camera.width, _FINER * camera.height
    model = world.model
    points = world.points_m()
    _set_up(model, width, height)
    model.stat.center[:] = middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    model.stat.extent = _ROOM * np.linalg.norm(points - middle, axis=1).max()
    rgb, depth = np.zeros((height, width, 3), np.uint8), np.zeros((height, width), np.float32)
    with drawing_surface(width, height):
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        try:
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, context)
            scene = mujoco.MjvScene(model, maxgeom=_MOST_GEOMS)
            option, everything = mujoco.MjvOption(), mujoco.mjtCatBit.mjCAT_ALL.value
            mujoco.mjv_updateScene(model, world.data, option, None, camera.in_mujoco(), everything, scene)
            scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = False
            _add_key_light(scene, middle, 2.0 * model.stat.extent)
            rectangle = mujoco.MjrRect(0, 0, width, height)
            mujoco.mjr_render(rectangle, scene, context)
            mujoco.mjr_readPixels(rgb, depth, rectangle, context)
        finally:
            context.free()
    return _averaged(rgb[::-1], depth[::-1] < _FAR, transparent=transparent)


def _set_up(model: "mujoco.MjModel", width: int, height: int) -> None:
    visual = model.vis
    visual.global_.fovy = FIELD_OF_VIEW_DEG
    visual.global_.offwidth, visual.global_.offheight = width, height
    visual.quality.shadowsize = _SHADOW_PIXELS
    visual.headlight.ambient[:] = 0.36
    visual.headlight.diffuse[:] = 0.28
    visual.headlight.specular[:] = 0.15


def _add_key_light(scene: "mujoco.MjvScene", middle_m: Points, distance_m: float) -> None:
    """A lamp above the camera's shoulder, which throws the shadows."""
    eye = scene.camera[0]
    ahead, up = np.array(eye.forward), np.array(eye.up)
    right = np.cross(ahead, up)
    light = scene.lights[scene.nlight]
    light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL.value
    direction = ahead * 0.55 + right * 0.45 - np.array((0.0, 0.0, 0.9))
    light.dir[:] = direction / np.linalg.norm(direction)
    light.pos[:] = middle_m - distance_m * light.dir
    light.attenuation[:] = (1.0, 0.0, 0.0)
    light.ambient[:], light.diffuse[:], light.specular[:] = 0.0, 0.38, 0.30
    light.castshadow = 1
    scene.nlight += 1


def _averaged(rgb: Picture, covered: NDArray[np.bool_], *, transparent: bool) -> Picture:
    """Average blocks of pixels; what is not covered is the background."""
    height, width = rgb.shape[0] // _FINER, rgb.shape[1] // _FINER
    blocks = (height, _FINER, width, _FINER)
    share = covered.reshape(blocks).mean(axis=(1, 3))[..., None]
    colour = (rgb * covered[..., None]).reshape(*blocks, 3).mean(axis=(1, 3))
    if transparent:
        colour = colour / np.maximum(share, 1e-9)
        return np.concatenate((colour, 255.0 * share), axis=2).round().astype(np.uint8)
    white = colour + 255.0 * (1.0 - share)
    return np.concatenate((white, np.full_like(share, 255.0)), axis=2).round().astype(np.uint8)
