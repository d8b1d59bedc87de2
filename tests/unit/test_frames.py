"""Frames as one tree: where everything stands, what moves, what is no tree; and the station file that says it."""

import math
from collections.abc import Callable

import pytest

from hil.config.station import RobotConfig, parse_station
from hil.values.errors import ConfigurationError, UnknownName
from hil.values.frames import BASE, FLANGE, MAX_FRAMES, WORLD, Frame, FrameKind, FrameTree
from hil.values.load import Load
from hil.values.pose import Pose

ASIDE = Pose(0.1, 0.0, 0.0)
QUARTER = Pose.from_abc_deg((0.0, 0.0, 0.0), 90.0, 0.0, 0.0)


def reference(name: str, parent: str = BASE, pose: Pose = ASIDE) -> Frame:
    return Frame(name, FrameKind.REFERENCE, parent, pose)


def tool(name: str, parent: str = FLANGE, kind: FrameKind = FrameKind.TOOL) -> Frame:
    return Frame(name, kind, parent, Pose(0.0, 0.0, 0.1))


def close(one: Pose, other: Pose) -> bool:
    return one.distance_m(other) < 1e-12 and one.angle_rad(other) < 1e-9


def test_world_base_and_flange_are_always_there() -> None:
    tree = FrameTree()
    assert list(tree) == [WORLD, BASE, FLANGE]
    assert [tree[name].moves for name in tree] == [False, False, True]
    assert close(tree.in_base(WORLD), Pose(0.0, 0.0, 0.0))


def test_frames_are_found_in_base_and_flange_along_the_tree() -> None:
    base = Pose(1.0, 0.0, 0.5, QUARTER.rotation)
    tree = FrameTree(
        [
            reference("table", WORLD, Pose(1.0, 2.0, 0.5)),
            reference("corner", "table", Pose(0.1, 0.0, 0.0, QUARTER.rotation)),
            tool("gripper"),
            tool("tip", "gripper", FrameKind.TOOL_FRAME),
            tool("nail", "tip", FrameKind.TOOL_FRAME),
        ],
        base_in_world=base,
    )
    assert close(tree.in_flange("nail"), Pose(0.0, 0.0, 0.3))
    # The base is turned by 90 degrees about z: two metres along the world's y are two along its x.
    assert close(tree.in_base("table"), Pose(2.0, 0.0, 0.0, QUARTER.inverse().rotation))
    assert close(base @ tree.in_base("corner"), Pose(1.1, 2.0, 0.5, QUARTER.rotation))


@pytest.mark.parametrize(
    ("frames", "sentence"),
    [
        ([reference("a"), reference("a")], "two frames have the name 'a'"),
        ([reference(WORLD)], "two frames have the name 'world'"),
        ([reference("a", "nowhere")], "hangs below 'nowhere', which is not there, or comes after it"),
        ([reference("a", FLANGE)], r"the frame 'a' \(REFERENCE\) cannot hang below 'flange' \(FLANGE\)"),
        ([tool("a", BASE)], r"the frame 'a' \(TOOL\) cannot hang below 'base' \(BASE\)"),
        ([tool("a", BASE, FrameKind.TOOL_FRAME)], "cannot hang below 'base'"),
        ([Frame("a", FrameKind.BASE, WORLD, Pose(0.0, 0.0, 0.0))], "cannot hang below 'world'"),
        ([reference("")], "is no printable text of 1 to 40 bytes"),
        ([reference("ä" * 21)], "is no printable text"),
        ([reference("a\n")], "is no printable text"),
        ([reference(f"f{number}") for number in range(MAX_FRAMES)], f"more than {MAX_FRAMES} frames"),
    ],
)
def test_what_is_no_tree_is_said(frames: list[Frame], sentence: str) -> None:
    with pytest.raises(ConfigurationError, match=sentence):
        FrameTree(frames)


def test_what_is_not_there_or_moves_is_said() -> None:
    tree = FrameTree([tool("gripper")])
    with pytest.raises(UnknownName, match="unknown frame 'tip'; valid: world, base, flange, gripper"):
        tree["tip"]
    assert "gripper" in tree
    assert "tip" not in tree
    assert tree.get("tip") is None
    with pytest.raises(ConfigurationError, match="the frame 'gripper' moves with the flange"):
        tree.in_base("gripper")
    with pytest.raises(ConfigurationError, match="the frame 'base' does not move with the flange"):
        tree.in_flange(BASE)


def test_a_station_says_it_in_millimetres_and_degrees() -> None:
    robot = parse_station(
        {
            "robot": [
                {
                    "base": {"z_mm": 800.0, "a_deg": 90.0},
                    "tool": [
                        {
                            "name": "gripper",
                            "z_mm": 50.0,
                            "mass_kg": 1.5,
                            "centre_mm": [0.0, 10.0, 60.0],
                            "inertia_kg_m2": [0.01, 0.01, 0.005, 0.0, 0.0, 0.0],
                            "frame": [{"name": "tip", "z_mm": 120.0, "b_deg": 90.0}],
                        }
                    ],
                    "frame": [{"name": "table", "parent": "world", "x_mm": 500.0}],
                }
            ]
        },
        where="test",
    ).robot[0]
    tree = robot.frames()
    assert list(tree) == ["world", "base", "flange", "table", "gripper", "tip"]
    assert tree["gripper"].load == Load(1.5, (0.0, 0.01, 0.06), (0.01, 0.01, 0.005), (0.0, 0.0, 0.0))
    tip = tree.in_flange("tip")
    assert tip.position_m == pytest.approx((0.0, 0.0, 0.17))
    assert tip.abc_deg() == pytest.approx((0.0, 90.0, 0.0))
    assert tree.in_base("table").position_m == pytest.approx((0.0, -0.5, -0.8))
    assert robot.settings(unix_epoch_ns=0, fri_peer=None, servo=None).frames["tip"].name == "tip"


Change = Callable[[dict[str, object]], None]


@pytest.mark.parametrize(
    ("robot", "sentence"),
    [
        ({"frame": [{"name": "a", "parent": "flange"}]}, "cannot hang below 'flange'"),
        ({"frame": [{"name": "a", "x_mm": math.nan}]}, "x_mm"),
        ({"frame": [{"name": "a", "x": 1.0}]}, "no such key"),
        ({"tool": [{"name": "a", "mass_kg": -1.0}]}, "mass_kg"),
        (
            {"tool": [{"name": "a", "inertia_kg_m2": [1.0, 0.1, 0.1, 0.0, 0.0, 0.0]}]},
            "moments .* none may be negative",
        ),
        ({"tool": [{"name": "a", "frame": [{"name": "a"}]}]}, "two frames have the name 'a'"),
    ],
)
def test_what_a_station_cannot_mean_is_said_with_its_place(robot: dict[str, object], sentence: str) -> None:
    with pytest.raises(ConfigurationError, match=sentence):
        parse_station({"robot": [robot]}, where="test")


def test_the_default_robot_has_no_more_than_it_must() -> None:
    assert list(RobotConfig().frames()) == ["world", "base", "flange"]
