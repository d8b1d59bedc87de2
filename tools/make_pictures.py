"""Draws the pictures of robots in README and docs anew: ``python -m tools.make_pictures``."""

from collections.abc import Mapping
from pathlib import Path

from matplotlib import image

from hil.config.frames import PoseConfig
from hil.config.station import RobotConfig, Station, load_station
from tools.snapshot.camera import camera_for, parse_view
from tools.snapshot.drawing import draw
from tools.snapshot.world import PictureWorld, parse_position

_DOCS = Path("docs")
_SCENE = Path("examples/scene/station.toml")
_STANDS = {"front": (0.0, 0.0), "behind": (560.0, 150.0), "bent": (1150.0, 0.0), "reaching": (1700.0, 60.0)}
"""One arm from four sides: y in mm, and A in degrees."""


def main() -> None:
    """Write the pictures into ``docs``."""
    arms = [RobotConfig(name=name, base=PoseConfig(y_mm=y, a_deg=a)) for name, (y, a) in _STANDS.items()]
    positions = {
        "front": "0 0 0 0 0 0 0",
        "behind": "0 0 0 0 0 0 0",
        "bent": "-60 30 0 40 0 90 0",
        "reaching": "30 45 0 -70 20 60 0",
    }
    _make("arm", Station(robot=arms), positions, "8/9", (1500, 760))
    scene = load_station(_SCENE)
    at_table = {"left": "18 20 0 -80 0 80 0", "right": "25 10 0 -75 0 95 0"}
    _make("scene", scene, at_table, "-68/24", (1200, 640))
    at_box = {"left": "19 24 0 -78 0 78 0", "right": "-38 5 0 -92 0 60 0"}
    _make("snapshot", scene, at_box, "118/17", (1400, 720))


def _make(name: str, station: Station, positions_deg: Mapping[str, str], view: str, size: tuple[int, int]) -> None:
    surroundings = station.surroundings()
    positions = dict(parse_position(f"{robot}={text}", surroundings.arms) for robot, text in positions_deg.items())
    world = PictureWorld(surroundings, positions)
    file = _DOCS / f"{name}.png"
    image.imsave(file, draw(world, camera_for(world.points_m(), parse_view(view), *size)), format="png")
    print(file)


if __name__ == "__main__":
    main()
