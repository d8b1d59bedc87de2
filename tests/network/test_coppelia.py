"""CoppeliaSim as a renderer, by the unmodified client package, against a stand-in that speaks the simulator's protocol.

The simulator itself was not available.
"""

import socket
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from backends.robots.facts import ROBOTS
from hil.clock import VirtualClock, stopwatch_ns, using
from hil.values.errors import ConfigurationError, EndpointError, UnknownName
from hil.values.frames import Frame, FrameKind, FrameTree
from hil.values.pose import NOWHERE, Pose
from tests.support.coppelia import (
    DUMMY,
    DYNAMIC,
    GREY_AND_ORANGE,
    JOINT,
    KINEMATIC,
    PRISMATIC,
    SHAPE,
    WORLD,
    Scene,
    StandIn,
    Thing,
    add_arm,
    turned,
)
from tests.support.processes import own_host
from tests.support.snapshots import snapshot_at
from tools.view.choices import COPPELIASIM
from tools.view.connection import RenderingConnection, State
from tools.view.coppelia import CoppeliaSim
from tools.view.coppelia.dummies import GROUP
from tools.view.coppelia.link import CallRefused, SimulatorLost
from tools.view.drawing import ArmNow, DrawnRobot, Renderer

IIWA_7, IIWA_14 = "lbr-iiwa-7-r800", "lbr-iiwa-14-r820"
BESIDE = Pose.from_abc_deg((1.0, -0.5, 0.8), 90.0, 0.0, 180.0)
"""Where the second arm hangs: upside down from above."""
POSITION = (0.1, -0.2, 0.3, -0.4, 0.5, -0.6, 0.7)
LOST = "the controller was silent for 3 s"
IMPATIENT_S = 0.2
IN_TIME_NS = 5_000_000_000
"""Far more than that, and far less than for ever, on a machine that has much to do."""


def cell() -> Scene:
    """A 14 that stands and a 7 that hangs, a rail and a gripper, none of them an arm."""
    scene = Scene()
    add_arm(scene, IIWA_14, alias="standing")
    add_arm(scene, IIWA_7, alias="hanging", base=BESIDE)
    rail = scene.add(Thing(SHAPE, "rail", WORLD, NOWHERE, model=True))
    scene.add(Thing(JOINT, "slide", rail, NOWHERE, subtype=PRISMATIC))
    return scene


def two_joints() -> Scene:
    scene = Scene()
    add_arm(scene, IIWA_14, alias="UR5", joints=6)
    add_arm(scene, IIWA_14, alias="pan", joints=2)
    return scene


def with_gripper() -> Scene:
    """An arm whose last link carries a hand with two fingers, as a model of its own."""
    scene = Scene()
    flange = scene.children(add_arm(scene, IIWA_14, alias="armed")[-1])["link7_resp"]
    hand = scene.add(Thing(SHAPE, "hand", flange, NOWHERE, model=True))
    for finger in ("left", "right"):
        scene.add(Thing(JOINT, finger, hand, NOWHERE))
    return scene


SCENES = {
    "cell.ttt": cell,
    "two.ttt": two_joints,
    "empty.ttt": Scene,
    "gripper.ttt": with_gripper,
    "other_way.ttt": lambda: _with(turns_other_way=(1, 4)),
    "long.ttt": lambda: _with(upper_arm_m=0.5),
}


def _with(**how: object) -> Scene:
    scene = Scene()
    add_arm(scene, IIWA_14, alias="standing", **how)  # type: ignore[arg-type]
    return scene


def robots(**frames: FrameTree) -> list[DrawnRobot]:
    nothing = FrameTree()
    return [
        DrawnRobot("left", IIWA_14, frames.get("left", nothing)),
        DrawnRobot("right", IIWA_7, frames.get("right", nothing)),
    ]


@pytest.fixture
def simulator(tmp_path: Path) -> Iterator[StandIn]:
    for name in SCENES:
        (tmp_path / name).write_bytes(b"")
    with StandIn(own_host(), scenes={str(tmp_path / name): make for name, make in SCENES.items()}) as stand_in:
        yield stand_in


@pytest.fixture
def renderer(simulator: StandIn, tmp_path: Path) -> Iterator[CoppeliaSim]:
    one = CoppeliaSim(simulator.address, folder=tmp_path, answer_s=20.0)
    yield one
    one.close()


def live(renderer: CoppeliaSim, scene: str = "cell.ttt") -> None:
    renderer.load_scene(scene, robots())
    renderer.start({"left": "/standing", "right": "/hanging"})


def chain(scene: Scene, alias: str) -> list[int]:
    """The joints of an arm from base to flange."""
    [model] = scene.named(alias)
    found = []
    above = scene.children(model)
    while "joint" in above:
        found.append(above["joint"])
        above = scene.children(scene.children(found[-1])[f"link{len(found)}_resp"])
    return found


def dummies(scene: Scene) -> dict[str, tuple[str, int]]:
    """All dummies by their path from what is no dummy: name of the parent, and handle."""
    found = {}
    for handle, thing in scene.things.items():
        if thing.kind == DUMMY:
            path, above = thing.alias, thing.parent
            while above != WORLD and scene.things[above].kind == DUMMY:
                path, above = f"{scene.things[above].alias}/{path}", scene.things[above].parent
            found[path if above == WORLD else f"@{path}"] = ("", handle)
    return found


def near(pose: Pose, other: Pose) -> bool:
    return pose.distance_m(other) < 1e-9 and pose.angle_rad(other) < 1e-7


def test_it_is_a_renderer(renderer: CoppeliaSim) -> None:
    drawing: Renderer = renderer
    assert drawing.title == "CoppeliaSim"


def test_the_scene_is_loaded_and_its_arms_are_the_models_with_seven_joints(
    simulator: StandIn, renderer: CoppeliaSim, tmp_path: Path
) -> None:
    renderer.load_scene("cell.ttt", robots())
    assert simulator.loaded == [str(tmp_path / "cell.ttt")]
    assert renderer.devices() == ("/hanging", "/standing")
    renderer.load_scene("gripper.ttt", robots())
    assert renderer.devices() == ("/armed",)


def test_joints_are_set_in_the_order_they_hang_in(simulator: StandIn, renderer: CoppeliaSim) -> None:
    live(renderer)
    renderer.show({"left": ArmNow(snapshot_at(POSITION)), "right": ArmNow(snapshot_at(POSITION[::-1]))})
    things = simulator.scene.things
    for alias, position in (("standing", POSITION), ("hanging", POSITION[::-1])):
        joints = chain(simulator.scene, alias)
        assert joints != sorted(joints)
        assert [things[joint].position for joint in joints] == list(position)
        assert all(things[joint].mode == KINEMATIC for joint in joints)
    renderer.stop()
    assert all(thing.mode == DYNAMIC for thing in things.values())


def test_the_drawn_flange_is_where_the_robot_has_it(simulator: StandIn, renderer: CoppeliaSim) -> None:
    """By the stand-in's own kinematics, and by ours from the model's description."""
    import mujoco

    from backends.robots import load_mujoco

    live(renderer)
    renderer.show({"left": ArmNow(snapshot_at(POSITION)), "right": ArmNow(snapshot_at(POSITION))})
    renderer.synchronise_frames()
    for alias, model_name, base in (("standing", IIWA_14, NOWHERE), ("hanging", IIWA_7, BESIDE)):
        model = load_mujoco(model_name, shells=False)
        data = mujoco.MjData(model)
        data.qpos[:] = POSITION
        mujoco.mj_forward(model, data)
        flange = data.site("flange")
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = np.reshape(flange.xmat, (3, 3)), flange.xpos
        stands = base @ Pose.from_homogeneous(matrix)
        group = simulator.scene.children(chain(simulator.scene, alias)[-1])[GROUP]
        drawn = simulator.scene.standing(simulator.scene.children(group)["flange"])
        assert drawn.distance_m(stands) < 1e-6
        assert drawn.angle_rad(stands) < 1e-6


def test_only_joints_that_moved_cost_a_round_trip(simulator: StandIn, renderer: CoppeliaSim) -> None:
    live(renderer)
    still = {"left": ArmNow(snapshot_at(POSITION)), "right": ArmNow(snapshot_at(POSITION))}
    simulator.calls.clear()
    renderer.show(still)
    assert simulator.calls == ["sim.setJointPosition"] * 14
    simulator.calls.clear()
    renderer.show(still)
    assert simulator.calls == []
    renderer.show({**still, "left": ArmNow(snapshot_at((*POSITION[:6], 0.71)))})
    assert simulator.calls == ["sim.setJointPosition"]


@pytest.mark.parametrize(("lua", "calls"), [("taken", 1), ("ignored", 14), ("", 14)])
def test_one_round_trip_sets_all_joints_where_the_simulator_is_seen_to_take_that(
    simulator: StandIn, renderer: CoppeliaSim, lua: str, calls: int
) -> None:
    simulator.lua = lua
    live(renderer)
    simulator.calls.clear()
    renderer.show({"left": ArmNow(snapshot_at(POSITION)), "right": ArmNow(snapshot_at(POSITION[::-1]))})
    assert simulator.calls == ["sim.executeScriptString" if calls == 1 else "sim.setJointPosition"] * calls
    for alias, position in (("standing", POSITION), ("hanging", POSITION[::-1])):
        joints = chain(simulator.scene, alias)
        assert [simulator.scene.things[joint].position for joint in joints] == pytest.approx(position, abs=1e-9)


def test_a_line_of_lua_that_fails_later_is_told(simulator: StandIn, renderer: CoppeliaSim) -> None:
    simulator.lua = "taken"
    live(renderer)
    del simulator.scene.things[chain(simulator.scene, "standing")[-1]]
    with pytest.raises(CallRefused, match=r"did not set the joints: .*an error of Lua"):
        renderer.show({"left": ArmNow(snapshot_at(POSITION))})


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        ("empty.ttt", r"the scene empty\.ttt has no arm: no model with a chain of seven revolute joints$"),
        ("two.ttt", r"the scene two\.ttt has no arm: .*; it has /UR5 with 6, /pan with 2$"),
        ("nowhere.ttt", r"there is no scene file .*nowhere\.ttt$"),
    ],
)
def test_a_scene_without_an_arm_is_refused(renderer: CoppeliaSim, scene: str, said: str) -> None:
    with pytest.raises(ConfigurationError, match=said):
        renderer.load_scene(scene, robots())


def test_what_the_simulator_refuses_is_told_in_its_words(
    simulator: StandIn, renderer: CoppeliaSim, tmp_path: Path
) -> None:
    (tmp_path / "broken.ttt").write_bytes(b"")
    with pytest.raises(CallRefused, match=r"refuses sim\.loadScene: Scene could not be read\. \(in function"):
        renderer.load_scene("broken.ttt", robots())
    simulator.simulation = 17
    with pytest.raises(EndpointError, match=r"a simulation runs in CoppeliaSim at .*; stop it, then load the scene"):
        renderer.load_scene("cell.ttt", robots())


def test_the_wrong_arm_is_named(simulator: StandIn, renderer: CoppeliaSim) -> None:
    renderer.load_scene("cell.ttt", robots())
    with pytest.raises(ConfigurationError) as told:
        renderer.start({"right": "/standing"})
    assert str(told.value) == (
        "'/standing' of the scene is no lbr-iiwa-7-r800, which the robot 'right' is: shoulder to elbow is 420 mm "
        "instead of 400 mm; it is like lbr-iiwa-14-r820 and lbr-med-14"
    )
    assert all(thing.mode == DYNAMIC for thing in simulator.scene.things.values())
    with pytest.raises(UnknownName, match="unknown robot of the scene '/armed'; valid: /hanging, /standing"):
        renderer.start({"right": "/armed"})


def test_an_arm_that_is_none_of_ours_is_told(renderer: CoppeliaSim) -> None:
    renderer.load_scene("long.ttt", robots())
    with pytest.raises(ConfigurationError, match=r"shoulder to elbow is 500 mm instead of 420 mm$"):
        renderer.start({"left": "/standing"})


def test_axes_that_turn_the_other_way_are_shown_with_their_sign(simulator: StandIn, renderer: CoppeliaSim) -> None:
    renderer.load_scene("other_way.ttt", robots())
    renderer.start({"left": "/standing"})
    assert [note.split(";")[0] for note in renderer.notes] == [
        "A1 of /standing turns the other way than ours",
        "A4 of /standing turns the other way than ours",
    ]
    renderer.show({"left": ArmNow(snapshot_at(POSITION))})
    joints = chain(simulator.scene, "standing")
    assert [simulator.scene.things[one].position for one in joints] == [-0.1, -0.2, 0.3, 0.4, 0.5, -0.6, 0.7]


def test_a_lost_robot_is_red_until_it_is_back(simulator: StandIn, renderer: CoppeliaSim) -> None:
    live(renderer)

    def colours(alias: str) -> set[tuple[float, ...]]:
        return {tuple(one.colours) for one in simulator.scene.things.values() if one.alias == alias}

    before = {"left": ArmNow(snapshot_at(POSITION)), "right": ArmNow(snapshot_at(POSITION))}
    renderer.show({**before, "left": ArmNow(None, LOST)})
    assert colours("standing") == {(1.0, 0.0, 0.0, 1.0, 0.0, 0.0)}
    assert colours("hanging") == {tuple(GREY_AND_ORANGE)}
    assert (1.0, 0.0, 0.0, 1.0, 0.0, 0.0) in colours("link7_resp")
    simulator.calls.clear()
    renderer.show({**before, "left": ArmNow(None, LOST)})
    assert "sim.setShapeColor" not in simulator.calls
    renderer.show(before)
    assert colours("standing") == colours("link7_resp") == {tuple(GREY_AND_ORANGE)}
    renderer.show({**before, "right": ArmNow(None, LOST)})
    renderer.stop()
    assert colours("hanging") == {tuple(GREY_AND_ORANGE)}


TABLE = Frame("table 1", FrameKind.REFERENCE, "base", Pose.from_abc_deg((0.5, 0.1, 0.2), 30.0, 40.0, 50.0))
GRIPPER = Frame("gripper", FrameKind.TOOL, "flange", Pose(0.0, 0.0, 0.1))
TCP = Frame("tcp", FrameKind.TOOL_FRAME, "gripper", Pose.from_abc_deg((0.0, 0.02, 0.05), 0.0, 90.0, 0.0))


def test_frames_are_where_the_scene_has_the_robot(simulator: StandIn, renderer: CoppeliaSim) -> None:
    world = Pose(0.0, 0.0, -0.3)
    tree = FrameTree([TABLE, GRIPPER, TCP], base_in_world=world)
    renderer.load_scene("cell.ttt", robots(right=tree))
    renderer.start({"left": "/standing", "right": "/hanging"})
    renderer.show({"right": ArmNow(snapshot_at((0.0,) * 7))})
    assert renderer.synchronise_frames() == 3 + 6
    scene = simulator.scene
    places = {path: scene.standing(handle) for path, (_, handle) in dummies(scene).items()}
    assert near(places[f"{GROUP}/right/table 1"], BESIDE @ TABLE.in_parent)
    assert near(places[f"{GROUP}/right/base"], BESIDE)
    assert near(places[f"{GROUP}/right/world"], BESIDE @ world.inverse())
    height_m = next(one.flange_height_m for one in ROBOTS if one.description.name == IIWA_7)
    moving = scene.children(scene.children(chain(scene, "hanging")[-1])[GROUP])
    flange = BESIDE @ Pose(0.0, 0.0, height_m)
    assert near(scene.standing(moving["flange"]), flange)
    assert near(scene.standing(moving["tcp"]), flange @ GRIPPER.in_parent @ TCP.in_parent)
    renderer.show({"right": ArmNow(snapshot_at((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)))})
    assert near(scene.standing(moving["tcp"]), flange @ turned(1.0) @ GRIPPER.in_parent @ TCP.in_parent)


def test_frames_are_moved_and_removed_and_what_a_user_hung_there_stays(
    simulator: StandIn, renderer: CoppeliaSim
) -> None:
    renderer.load_scene("cell.ttt", robots(left=FrameTree([TABLE, GRIPPER])))
    renderer.start({"left": "/standing"})
    assert renderer.synchronise_frames() == 5 + 2
    scene = simulator.scene
    before = dummies(scene)
    users = [
        scene.add(Thing(DUMMY, "mine", before[f"{GROUP}/left/table 1"][1], NOWHERE)),
        scene.add(Thing(DUMMY, "lamp", WORLD, NOWHERE)),
    ]
    moved = TABLE._replace(in_parent=Pose(0.9, 0.0, 0.0))
    renderer.stop()
    renderer.reconfigure(robots(left=FrameTree([moved])))
    renderer.start({"left": "/standing"})
    assert renderer.synchronise_frames() == 4 + 2
    after = dummies(scene)
    assert after[f"{GROUP}/left/table 1"] == before[f"{GROUP}/left/table 1"]
    assert near(scene.standing(after[f"{GROUP}/left/table 1"][1]), moved.in_parent)
    assert f"@{GROUP}/gripper" in before
    assert f"@{GROUP}/gripper" not in after
    renderer.reconfigure(robots()[1:])
    renderer.synchronise_frames()
    assert set(users) <= set(scene.things)
    assert set(dummies(scene)) == {GROUP, f"{GROUP}/right", f"{GROUP}/right/world", f"{GROUP}/right/base"} | {
        path for path, (_, handle) in dummies(scene).items() if handle in users
    }


def test_a_simulator_that_dies_in_mid_view_is_told_in_time_and_refreshed(
    simulator: StandIn, renderer: CoppeliaSim, tmp_path: Path
) -> None:
    station = tmp_path / "cell.toml"
    connection = RenderingConnection(renderer, kind=COPPELIASIM, read_station=lambda _path: robots())
    connection.select_station(station)
    connection.select_scene("cell.ttt")
    connection.load_scene()
    connection.assign("left", "/standing")
    connection.start_live_view()
    connection.show({"left": ArmNow(snapshot_at(POSITION))})
    assert not connection.trouble
    simulator.die()
    renderer.link.answer_s = IMPATIENT_S
    began_ns = stopwatch_ns()
    connection.show({"left": ArmNow(snapshot_at((0.0,) * 7))})
    assert stopwatch_ns() - began_ns < IN_TIME_NS
    assert connection.trouble.startswith(f"nobody answers at {simulator.address} within 0.2 s: is CoppeliaSim running")
    with pytest.raises(SimulatorLost):
        connection.refresh()
    assert connection.state is State.LIVE
    simulator.start()
    renderer.link.answer_s = 20.0
    connection.refresh()
    connection.show({"left": ArmNow(snapshot_at(POSITION))})
    assert (connection.state, connection.trouble) == (State.LIVE, "")
    joints = chain(simulator.scene, "standing")
    assert [simulator.scene.things[one].position for one in joints] == list(POSITION)
    assert len(simulator.loaded) == 2


def test_a_refresh_keeps_what_was_done_to_the_scene(simulator: StandIn, renderer: CoppeliaSim) -> None:
    live(renderer)
    renderer.stop()
    add_arm(simulator.scene, IIWA_7, alias="third")
    renderer.reconfigure(robots())
    assert renderer.devices() == ("/hanging", "/standing", "/third")
    for handle in simulator.scene.named("hanging") + simulator.scene.named("standing"):
        simulator.scene.things[handle].alias += "2"
    renderer.reconfigure(robots())
    assert renderer.devices() == ("/hanging2", "/standing2", "/third")
    simulator.scene = with_gripper()
    renderer.reconfigure(robots())
    assert renderer.devices() == ("/armed",)
    assert len(simulator.loaded) == 1


def test_a_still_live_view_notices_that_the_scene_is_another(simulator: StandIn, tmp_path: Path) -> None:
    clock = VirtualClock()
    with using(clock), closing(CoppeliaSim(simulator.address, folder=tmp_path)) as renderer:
        live(renderer)
        still = {"left": ArmNow(snapshot_at(POSITION)), "right": ArmNow(snapshot_at(POSITION))}
        renderer.show(still)
        simulator.calls.clear()
        clock.advance(1_000_000_000)
        renderer.show(still)
        assert simulator.calls == ["sim.getObjectAlias"] * 2
        simulator.scene = with_gripper()
        renderer.show(still)
        clock.advance(1_000_000_000)
        with pytest.raises(CallRefused, match=r"/standing is not in the scene any more .*; load cell\.ttt again"):
            renderer.show(still)


def test_no_simulator_at_all_is_told_in_time(tmp_path: Path) -> None:
    (tmp_path / "cell.ttt").write_bytes(b"")
    renderer = CoppeliaSim(f"{own_host()}:1", folder=tmp_path, answer_s=IMPATIENT_S)
    began_ns = stopwatch_ns()
    with pytest.raises(SimulatorLost, match=r"nobody answers at .*:1 within 0\.2 s"):
        renderer.load_scene("cell.ttt", robots())
    assert stopwatch_ns() - began_ns < IN_TIME_NS
    renderer.close()
    renderer.close()


def test_something_else_at_that_address_is_told_in_time(tmp_path: Path) -> None:
    (tmp_path / "cell.ttt").write_bytes(b"")
    with socket.create_server((own_host(), 0)) as other:
        host, port = other.getsockname()
        renderer = CoppeliaSim(f"{host}:{port}", folder=tmp_path, answer_s=IMPATIENT_S)
        with pytest.raises(SimulatorLost):
            renderer.load_scene("cell.ttt", robots())


def test_a_simulator_that_is_busy_for_ever_does_not_hold_us(simulator: StandIn, renderer: CoppeliaSim) -> None:
    live(renderer)
    simulator.busy_for_ever = True
    renderer.link.answer_s = IMPATIENT_S
    with pytest.raises(SimulatorLost, match=r"nobody answers"):
        renderer.show({"left": ArmNow(snapshot_at(POSITION))})
    with pytest.raises(SimulatorLost, match="is lost; refresh to connect again"):
        renderer.show({"left": ArmNow(snapshot_at(POSITION))})


@pytest.mark.parametrize("address", ["", ":23000", "host:", "host:0", "host:70000", "host:x"])
def test_what_is_no_address_is_told(address: str) -> None:
    with pytest.raises(ConfigurationError, match=r"is no address of a simulator; valid: HOST\[:PORT\]"):
        CoppeliaSim(address)


def test_the_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "coppeliasim_zmqremoteapi_client", None)
    with pytest.raises(ConfigurationError, match=r"is not installed: pip install 'fri-hil\[coppelia\]'$"):
        CoppeliaSim()


def test_the_main_program_is_left_as_it_was(renderer: CoppeliaSim) -> None:
    renderer.load_scene("cell.ttt", robots())
    assert "require" not in vars(sys.modules["__main__"])
