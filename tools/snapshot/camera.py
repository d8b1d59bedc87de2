"""Where a picture is taken from, and where in it a point of the world is."""

import math
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.values.errors import ConfigurationError, OutOfRange

if TYPE_CHECKING:
    import mujoco

FIELD_OF_VIEW_DEG: Final = 30.0
"""From the lower edge of the picture to the upper one."""
_MARGIN: Final = 0.92
"""Share of the picture that is filled."""
_FOCUS_M: Final = 1.0

Points = NDArray[np.float64]


class View(NamedTuple):
    """The side a picture is taken from, degrees: where the camera stands, seen from what it looks at.

    Azimuth 0 is in front of a robot (x of the world), 90 at its left (y); elevation 90 is above it.
    """

    azimuth_deg: float
    elevation_deg: float


VIEWS: Final = {
    "corner": View(-50.0, 15.0),
    "front": View(0.0, 5.0),
    "left": View(90.0, 5.0),
    "back": View(180.0, 5.0),
    "right": View(-90.0, 5.0),
    "top": View(-90.0, 90.0),
}


def parse_view(text: str) -> View:
    """Return the view of a name, or of ``AZIMUTH/ELEVATION``; raise :class:`ConfigurationError` in one sentence."""
    if text in VIEWS:
        return VIEWS[text]
    parts = text.split("/")
    try:
        azimuth, elevation = map(float, parts)
    except ValueError:
        raise ConfigurationError(
            f"the view {text!r} is none of {', '.join(VIEWS)}, nor AZIMUTH/ELEVATION in degrees such as -30/20"
        ) from None
    for name, value, most in (("azimuth", azimuth, 360.0), ("elevation", elevation, 90.0)):
        if not -most <= value <= most:
            raise OutOfRange(f"{name} of the view", value, f"-{most:g} ... {most:g} degrees")
    return View(azimuth, elevation)


class Camera(NamedTuple):
    """A camera that stands still."""

    position_m: Points
    axes: Points
    """Its axes in the world, as rows: to the right, upwards, forwards."""
    view: View
    width: int
    height: int

    def pixel(self, point_m: Points) -> tuple[float, float]:
        """Return where a point of the world is in the picture: columns from the left, rows from above."""
        right, up, ahead = self.axes @ (point_m - self.position_m)
        scale = 0.5 * self.height / math.tan(0.5 * math.radians(FIELD_OF_VIEW_DEG))
        return 0.5 * self.width + scale * right / ahead, 0.5 * self.height - scale * up / ahead

    def in_mujoco(self) -> "mujoco.MjvCamera":
        """Return it as MuJoCo has it; the model's field of view must be ours."""
        import mujoco

        camera = mujoco.MjvCamera()
        camera.lookat[:] = self.position_m + _FOCUS_M * self.axes[2]
        camera.distance = _FOCUS_M
        camera.azimuth, camera.elevation = self.view.azimuth_deg + 180.0, -self.view.elevation_deg
        return camera


def camera_for(points_m: Points, view: View, width: int, height: int) -> Camera:
    """Return the camera at the side ``view``, as near as it can be with all of ``points_m`` (N×3) in the picture."""
    azimuth, elevation = map(math.radians, view)
    ahead = -np.array(
        (math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation))
    )
    right = np.array((-math.sin(azimuth), math.cos(azimuth), 0.0))
    axes = np.stack((right, np.cross(right, ahead), ahead))
    across, upwards, depth = axes @ points_m.T
    slope = _MARGIN * math.tan(0.5 * math.radians(FIELD_OF_VIEW_DEG))
    places, nearest = [], float(depth.min()) - 0.1
    for values, most in ((across, slope * width / height), (upwards, slope)):
        # A point is in the picture where |value - place| <= most * (depth - where the camera is).
        low, high = float((values - most * depth).max()), float((values + most * depth).min())
        places.append(0.5 * (low + high))
        nearest = min(nearest, 0.5 * (high - low) / most)
    return Camera(np.array((*places, nearest)) @ axes, axes, view, width, height)
