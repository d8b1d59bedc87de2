"""The look of a robot as triangles: where it is, which way its faces look, and how little of it there is."""

import numpy as np
import pytest
from numpy.typing import NDArray

from backends.robots import load_mujoco, robot_names
from backends.robots.visual import VisualPart, visual_parts
from hil.values.errors import UnknownName
from hil.values.robot import JOINT_COUNT

MOST_TRIANGLES = 25_000
"""Two arms of them are drawn thirty times a second without a GPU."""


@pytest.mark.parametrize("name", robot_names())
def test_every_link_is_seen_in_few_parts(name: str) -> None:
    parts = visual_parts(name)
    assert {part.body for part in parts} == set(range(JOINT_COUNT + 1))
    assert len({(part.body, part.colour) for part in parts}) == len(parts) <= 4 * (JOINT_COUNT + 1)
    assert sum(len(part.faces) for part in parts) < MOST_TRIANGLES


@pytest.mark.parametrize("name", robot_names())
def test_all_faces_look_outwards(name: str) -> None:
    for part in visual_parts(name):
        assert part.faces.min() >= 0
        assert part.faces.max() < len(part.vertices)
        assert enclosed_m3(part) > 0.0


def enclosed_m3(part: VisualPart) -> float:
    """Return the volume that the triangles enclose; negative where they look inwards."""
    first, second, third = (part.vertices[part.faces[:, corner]].astype(np.float64) for corner in range(3))
    return float(np.sum(first * np.cross(second, third)) / 6.0)


@pytest.mark.parametrize("name", robot_names())
def test_the_last_link_ends_at_the_flange(name: str) -> None:
    flange = load_mujoco(name, shells=False).site("flange").pos
    ends: NDArray[np.float32] = np.concatenate(
        [part.vertices for part in visual_parts(name) if part.body == JOINT_COUNT]
    )
    assert ends[:, 2].max() == pytest.approx(flange[2], abs=1e-6)
    assert np.hypot(ends[:, 0], ends[:, 1]).max() < 0.06


def test_an_unknown_robot_is_refused() -> None:
    with pytest.raises(UnknownName, match="lbr-iiwa-14-r820"):
        visual_parts("kr-1000")
