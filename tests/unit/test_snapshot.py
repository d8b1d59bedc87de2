"""``hil snapshot``: the arm is in the picture where the kinematics say, and bad input gets a sentence."""

import importlib
import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from numpy.typing import NDArray

from hil.config.station import RobotConfig, Station, load_station
from hil.values.errors import ConfigurationError
from tests.support.cli import cli
from tests.support.off_screen import no_picture_here
from tests.support.processes import ROOT
from tools.snapshot import opengl
from tools.snapshot.camera import VIEWS, View, camera_for, parse_view
from tools.snapshot.world import PictureWorld, parse_position

SCENE = ROOT / "examples" / "scene" / "station.toml"
NO_PICTURE = no_picture_here()
SIZE = 240
MEDIA_RADIUS_M, MEDIA_DEPTH_M = 0.0365, 0.006
"""A circle on the dark media flange, around the steel one: this far from its axis, and behind its face."""

draws = pytest.mark.skipif(bool(NO_PICTURE), reason=NO_PICTURE)


def media_flange_m(world: PictureWorld, robot: str) -> list[NDArray[np.float64]]:
    """Points all around a robot's media flange."""
    axes = world.data.site(f"{robot}/flange").xmat.reshape(3, 3)
    circle = np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False)
    return [
        world.flange_m(robot)
        + axes @ (MEDIA_RADIUS_M * math.cos(angle), MEDIA_RADIUS_M * math.sin(angle), -MEDIA_DEPTH_M)
        for angle in circle
    ]


def picture(path: Path, *arguments: object) -> NDArray[np.float64]:
    """Draw a picture and return it: height × width × 4, 0..1."""
    ended = cli("snapshot", "-o", path, *arguments)
    assert ended.code == 0, ended.err
    return np.asarray(imread(str(path)), dtype=np.float64)


@draws
@pytest.mark.parametrize("position", ["0 30 0 40 0 90 0", "25 10 0 -70 0 20 0"])
def test_the_flange_is_where_the_kinematics_say(position: str, tmp_path: Path) -> None:
    arms = Station(robot=[RobotConfig()]).surroundings()
    world = PictureWorld(arms, dict([parse_position(position, arms.arms)]))
    camera = camera_for(world.points_m(), View(10.0, 20.0), SIZE, SIZE)
    arguments = ("--view", "10/20", "--size", f"{SIZE}x{SIZE}", "--transparent")
    drawn = picture(tmp_path / "a.png", "--position", position, *arguments)
    for point in media_flange_m(world, "arm"):
        column, row = map(int, camera.pixel(point))
        assert drawn[row, column, 3] == 1.0
        assert drawn[row, column, :3].max() < 0.4
    # All of the arm is in the picture, and it fills it one way.
    rows, columns = np.nonzero(drawn[..., 3])
    for low, high in ((rows.min(), rows.max()), (columns.min(), columns.max())):
        assert low > 0.03 * SIZE
        assert high < 0.97 * SIZE
    assert max(np.ptp(rows), np.ptp(columns)) > 0.88 * SIZE
    assert drawn[0, 0].tolist() == [0.0, 0.0, 0.0, 0.0]


@draws
def test_robots_and_objects_of_a_station_are_in_one_picture(tmp_path: Path) -> None:
    station = load_station(SCENE).surroundings()
    width, height = 320, 200
    world = PictureWorld(station, dict([parse_position("right=0 60 0 -60 0 60 0", station.arms)]))
    camera = camera_for(world.points_m(), VIEWS["top"], width, height)
    arguments = ("--view", "top", "--size", f"{width}x{height}", "--position", "right=0 60 0 -60 0 60 0")
    drawn = picture(tmp_path / "s.png", SCENE, *arguments)
    assert drawn.shape == (height, width, 4)

    def colour(*point_m: float) -> NDArray[np.float64]:
        column, row = map(int, camera.pixel(np.array(point_m)))
        seen: NDArray[np.float64] = drawn[row, column, :3]
        return seen

    red, green, blue = colour(0.6, 0.2, 0.48)
    assert red > 1.4 * green > 1.4 * blue, "the box is orange"
    assert colour(0.6, -0.3, 0.4)[0] > 1.2 * colour(0.6, -0.3, 0.4)[2], "the table is of wood"
    assert np.ptp(colour(0.1, -0.4, 0.0)) < 0.1, "the floor is grey"
    for robot in ("left", "right"):
        x, y, _ = world.data.body(f"{robot}/link_2").xpos
        assert colour(float(x), float(y), 0.43).min() > 0.5, robot
    assert drawn[..., 3].min() == 1.0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--position", "0 30 0 121 0 90 0"], "A4 of arm 121 is outside its range -120 ... 120 degrees"),
        (["--position", "0 30 0"], "the position '0 30 0' has 3 numbers: seven degrees are, A1 to A7"),
        (["--position", "0 0 0 x 0 0 0"], "is no list of numbers: seven degrees, A1 to A7"),
        (["--position", "left=0 0 0 0 0 0 0"], "unknown robot 'left'; valid: arm"),
        ([SCENE, "--position", "0 0 0 0 0 0 0"], "With several robots write NAME=..., NAME one of left, right"),
        ([SCENE, "--robot", "lbr-med-7"], "--robot is for a picture without a station file"),
        ([SCENE, "--controller", "127.0.0.1"], "--controller is for a picture without a station file"),
        (["--robot", "kr16"], "unknown robot 'kr16'; valid: lbr-iiwa-7-r800"),
        (["--size", "big"], "the size 'big' is not WIDTHxHEIGHT in pixels, such as 1000x800"),
        (["--size", "9000x900"], "the size '9000x900' is outside 16 ... 4096 pixels each way"),
        (
            ["--view", "below"],
            "the view 'below' is none of corner, front, left, back, right, top, nor AZIMUTH/ELEVATION",
        ),
        (["--view", "0/100"], "elevation of the view 100 is outside its range -90 ... 90 degrees"),
    ],
)
def test_bad_input_gets_a_sentence(arguments: list[object], sentence: str, tmp_path: Path) -> None:
    ended = cli("snapshot", "-o", tmp_path / "x.png", *arguments)
    assert ended.code == 2
    assert ended.err.startswith("hil: ")
    assert sentence in ended.err
    assert not (tmp_path / "x.png").exists()


@pytest.mark.parametrize(
    ("out", "sentence"),
    [
        ("nowhere/x.png", "there is no folder"),
        ("x.jpg", "does not end in .png"),
        ("folder.png", "that is a folder"),
    ],
)
def test_a_picture_that_cannot_be_written_is_refused(out: str, sentence: str, tmp_path: Path) -> None:
    (tmp_path / "folder.png").mkdir()
    ended = cli("snapshot", "-o", tmp_path / out)
    assert ended.code == 2
    assert sentence in ended.err


def test_a_robot_without_servo_link_cannot_be_asked(tmp_path: Path) -> None:
    station = tmp_path / "station.toml"
    station.write_text('[[robot]]\nname = "a"\n')
    ended = cli("snapshot", station, "--live", "-o", tmp_path / "x.png")
    assert ended.code == 2
    assert "a has no [robot.servo], so nobody can ask where it is; leave out --live" in ended.err


@pytest.mark.parametrize(
    ("there", "environment", "chosen"),
    [
        ({"libEGL.so.1", "libOSMesa.so.8"}, {}, "egl"),
        ({"libOSMesa.so.6"}, {}, "osmesa"),
        ({"libEGL.so.1", "libOSMesa.so.8"}, {"MUJOCO_GL": "OSMesa"}, "osmesa"),
        ({"libEGL.so.1"}, {"MUJOCO_GL": "glfw"}, "egl"),
    ],
)
def test_egl_is_taken_then_osmesa_or_what_is_wanted(
    there: set[str], environment: dict[str, str], chosen: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opengl, "_is_there", there.__contains__)
    assert opengl.choose(environment) == chosen


@pytest.mark.parametrize(
    ("environment", "sentence"),
    [
        ({}, "there is no EGL and no OSMesa here; install libegl1, libgl1 and libgl1-mesa-dri, or libosmesa6"),
        ({"MUJOCO_GL": "egl"}, "there is no egl here; install libegl1"),
        ({"MUJOCO_GL": "vulkan"}, "MUJOCO_GL is 'vulkan'; off screen it is egl or osmesa, or not set"),
    ],
)
def test_where_nothing_can_draw_it_says_what_to_install(
    environment: dict[str, str], sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opengl, "_is_there", set[str]().__contains__)
    with pytest.raises(ConfigurationError, match=sentence):
        opengl.choose(environment)


def test_a_library_that_fails_is_told_with_a_way_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(name: str) -> None:
        raise AttributeError(f"{name} has no device.\nmore")

    monkeypatch.setattr(opengl, "_is_there", lambda library: library.startswith("libEGL"))
    monkeypatch.setattr(importlib, "import_module", fails)
    with pytest.raises(ConfigurationError) as caught, opengl.drawing_surface(16, 16, {}):
        pass
    assert str(caught.value) == (
        "no picture without a screen: egl fails (mujoco.egl has no device); "
        "install libegl1, libgl1 and libgl1-mesa-dri, or libosmesa6 (names of Debian)"
    )


def test_a_camera_has_all_points_in_its_picture_and_no_room_to_spare() -> None:
    points = np.random.default_rng(5).uniform(-1.0, 1.0, (200, 3)) * (1.0, 0.4, 0.7)
    for view in (*VIEWS.values(), parse_view("33/-40")):
        camera = camera_for(points, view, 400, 300)
        pixels = np.array([camera.pixel(point) for point in points])
        shares = np.abs(pixels / (400, 300) - 0.5).max(axis=0)
        assert shares.max() == pytest.approx(0.46, abs=1e-6)
