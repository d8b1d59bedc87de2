"""What stands around the robots, in the page."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import viser

from hil.config.objects import ObjectConfig
from hil.values.surroundings import SceneObject, Shape

_ROOT: Final = "/surroundings"
_PLANE_M: Final = 4.0
_PLANE_DEPTH_M: Final = 0.002


def draw_surroundings(scene: "viser.SceneApi", objects: Sequence[Mapping[str, Any]]) -> None:
    """Draw the objects, which have the keys of an ``[[object]]``, instead of those drawn before."""
    scene.remove_by_name(_ROOT)
    scene.add_frame(_ROOT, show_axes=False)
    for one in objects:
        _draw(scene, ObjectConfig.model_validate(one).scene_object())


def _draw(scene: "viser.SceneApi", one: SceneObject) -> None:
    name = f"{_ROOT}/{one.name}"
    look: dict[str, Any] = {
        "color": tuple(round(255 * share) for share in one.colour),
        "position": one.pose.position_m,
        "wxyz": one.pose.quaternion_wxyz(),
    }
    match one.shape:
        case Shape.BOX:
            length_m, width_m, height_m = one.size_m
            scene.add_box(name, dimensions=(length_m, width_m, height_m), **look)
        case Shape.CYLINDER:
            diameter_m, height_m = one.size_m
            scene.add_cylinder(name, radius=diameter_m / 2.0, height=height_m, **look)
        case Shape.SPHERE:
            scene.add_icosphere(name, radius=one.size_m[0] / 2.0, **look)
        case Shape.PLANE:
            scene.add_box(name, dimensions=(_PLANE_M, _PLANE_M, _PLANE_DEPTH_M), **look)
