"""The arm's look as triangles: where it is, that it is closed and faces outwards, and that it is cheap to draw."""

import numpy as np
import pytest
from numpy.typing import NDArray

from backends.robots.visual import VisualPart, visual_parts
from hil.values.errors import UnknownName
from tests.unit.robots_support import NAMES, facts_of

MOST_PARTS = 30
MOST_TRIANGLES = 15_000

parts_of_all = pytest.mark.parametrize("name", NAMES)


def corners(part: VisualPart) -> NDArray[np.float64]:
    """Triangles as M×3×3 positions, m."""
    return part.vertices[part.faces].astype(np.float64)


@parts_of_all
def test_parts_are_few_and_every_body_has_one(name: str) -> None:
    parts = visual_parts(name)
    assert [part.body for part in parts] == sorted(part.body for part in parts)
    assert {part.body for part in parts} == set(range(8))
    assert len({(part.body, part.colour) for part in parts}) == len(parts) <= MOST_PARTS
    assert sum(len(part.faces) for part in parts) <= MOST_TRIANGLES
    for part in parts:
        assert part.vertices.dtype == np.float32
        assert part.vertices.shape[1] == part.faces.shape[1] == 3
        assert all(0.0 <= value <= 1.0 for value in part.colour)
        assert part.faces.min() == 0
        assert part.faces.max() < len(part.vertices)
        assert not part.vertices.flags.writeable


@parts_of_all
def test_the_stretched_arm_ends_at_the_flange_and_stands_on_the_floor(name: str) -> None:
    facts = facts_of(name)
    heights = (0.0, *facts.joint_heights_m)
    tops = [(heights[part.body] + float(part.vertices[:, 2].max()), part.body) for part in visual_parts(name)]
    lows = [heights[part.body] + float(part.vertices[:, 2].min()) for part in visual_parts(name)]
    highest, body = max(tops)
    assert body == 7
    assert highest == pytest.approx(facts.flange_height_m, abs=1e-4)
    assert min(lows) == pytest.approx(0.0, abs=1e-4)
    assert all(np.abs(part.vertices[:, :2]).max() < 0.2 for part in visual_parts(name))


@parts_of_all
def test_surfaces_are_closed_and_face_outwards(name: str) -> None:
    for part in visual_parts(name):
        _, places = np.unique(np.round(part.vertices, 6), axis=0, return_inverse=True)
        faces = places.reshape(-1)[part.faces]
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        edges = edges[edges[:, 0] != edges[:, 1]]
        forwards = np.sort(edges[:, 0] * len(places) + edges[:, 1])
        backwards = np.sort(edges[:, 1] * len(places) + edges[:, 0])
        np.testing.assert_array_equal(forwards, backwards)
        a, b, c = np.moveaxis(corners(part), 1, 0)
        assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0 > 0.0


def test_a_robot_that_is_not_known_is_refused() -> None:
    with pytest.raises(UnknownName):
        visual_parts("lbr-iiwa-15")
