"""MuJoCo scenes: what is touched is felt, what is free is moved, arms share a world without waiting for each other."""

from dataclasses import replace
from math import hypot
from pathlib import Path

import pytest

from backends.base import InProcessBackend
from backends.contract import DrivesContract
from backends.mujoco.scene_arm import SceneArm as SceneBackend
from backends.plugins import MUJOCO
from backends.rig import InProcessRig, Rig
from backends.robots import load_description
from hil.clock import elapsed_ns
from hil.config.station import parse_station
from hil.values.arm import MIN_CONTACT_N, JointCommand, Push, seven
from hil.values.backend import BackendRequest
from hil.values.control import CartesianImpedanceControlMode
from hil.values.errors import ConfigurationError
from hil.values.motion import MotionKind, MotionParameters
from hil.values.pose import Pose
from hil.values.robot import RobotDescription, Seven
from hil.values.servo import SetDestination, StartMotion, ValidateLoad
from hil.values.surroundings import SceneArm, SceneObject, Shape, Surroundings
from tests.support.servo_virtual import Application, ServoBench

ROBOT = "lbr-iiwa-7-r800"
DESCRIPTION = load_description(ROBOT)
STILL = (0.0,) * 7
MS = 1_000_000


def arm_in(surroundings: Surroundings, name: str = "arm", **options: object) -> SceneBackend:
    described = next((arm for arm in surroundings.arms if arm.name == name), SceneArm(name, ROBOT, "mujoco", options))
    if described not in surroundings.arms:
        surroundings = replace(surroundings, arms=(*surroundings.arms, described))
    made = MUJOCO.make(
        BackendRequest(
            name,
            DESCRIPTION,
            MS,
            options=options,
            torque_noise=False,
            base_in_world=described.base_in_world,
            surroundings=surroundings,
        )
    )
    assert isinstance(made, SceneBackend)
    return made


def hold(
    backend: InProcessBackend, seconds: float, position: tuple[float, ...] = DESCRIPTION.initial_position_rad
) -> None:
    for _ in range(round(seconds * 1e3)):
        backend.write(JointCommand(seven(position), STILL))
        backend.step()


def wall(face_y_m: float) -> SceneObject:
    return SceneObject("wall", Shape.BOX, (2.0, 0.2, 3.0), Pose(0.0, face_y_m + 0.1, 0.0))


class TestScene(DrivesContract):
    """An arm in a scene keeps the contract of all robot sides."""

    elapsed_ns = staticmethod(elapsed_ns)

    def make_rig(self) -> Rig:
        return InProcessRig(arm_in(Surroundings(objects=(wall(1.5),))))


def test_a_wall_is_felt_with_the_force_of_the_spring_that_presses_on_it() -> None:
    stiffness_n_m = 1000.0

    x, y, z = place_m((0.0, 0.0, ROD_M))
    block = SceneObject("block", Shape.BOX, (0.1, 0.02, 0.1), Pose(x, y + 0.035, z))
    tool = SceneArm("arm", ROBOT, "mujoco", {}, touches_m=((0.0, 0.0, ROD_M),))

    def arm(_description: RobotDescription) -> InProcessBackend:
        return arm_in(Surroundings(objects=(block,), arms=(tool,)))

    bench = ServoBench(robot=ROBOT, backend=arm)
    application = Application(bench, state_period_ms=10)
    application.join()
    application.run(0.1)

    application.ask(lambda number: ValidateLoad(number, "flange"))
    mode = CartesianImpedanceControlMode(stiffness=(stiffness_n_m,) * 3 + (200.0,) * 3)
    [done] = application.ask(
        lambda number: StartMotion(number, MotionKind.SMART_SERVO, MotionParameters(), None, mode=mode)
    )
    assert not done.error, done
    application.run(0.05)
    assert application.states[-1].snapshot.contacts == ()
    there = application.states[-1].snapshot.flange_in_base
    wanted = Pose.from_quaternion((there.x_m, there.y_m + 0.04, there.z_m), there.quaternion_wxyz())
    [done] = application.ask(lambda number: SetDestination(number, done.request, None, None, wanted))
    assert not done.error, done
    application.run(2.0)
    snapshot = application.states[-1].snapshot
    pressed_m = wanted.y_m - snapshot.flange_in_base.y_m
    assert pressed_m > 0.01, "the wall was not reached"
    # What pushes the arm is the wall, towards minus.
    assert snapshot.flange_force[1] == pytest.approx(-stiffness_n_m * pressed_m, rel=0.1)
    assert abs(snapshot.flange_force[0]) < 0.3 * abs(snapshot.flange_force[1])
    assert snapshot.contacts
    assert sum(contact.force_n[1] for contact in snapshot.contacts) == pytest.approx(
        -stiffness_n_m * pressed_m, rel=0.1
    )
    for contact in snapshot.contacts:
        assert contact.point_m[1] == pytest.approx(y + 0.025, abs=1e-3)
    # The way there was seen, and it rests.
    speeds = [state.snapshot.flange_speed_mm_s for state in application.states]
    assert max(speeds) > 10.0
    assert speeds[-1] < 0.5


def test_a_free_box_stands_on_a_table_and_is_pushed_away() -> None:
    table = SceneObject("table", Shape.BOX, (0.6, 0.6, 0.04), Pose(0.9, 0.0, 0.2))
    box = SceneObject("box", Shape.BOX, (0.06, 0.06, 0.06), Pose(0.9, 0.0, 0.25), mass_kg=0.4, friction=0.5)
    backend = arm_in(Surroundings(objects=(table, box)))
    backend.open(period_ns=MS)
    hold(backend, 0.3)
    there = backend._data.body("box").xpos.copy()
    assert there[2] == pytest.approx(0.25, abs=1e-3)
    backend._data.qvel[backend._model.joint("box").dofadr[0]] = 0.5
    hold(backend, 0.5)
    slid = backend._data.body("box").xpos
    # Half a metre a second against friction of 0.5 to 1 (MuJoCo takes the larger one).
    assert 0.008 < slid[0] - there[0] < 0.03
    assert slid[2] == pytest.approx(0.25, abs=1e-3)
    backend.close()


def test_an_arm_pushes_a_free_box_and_feels_it() -> None:
    x, y, z = place_m((0.0, 0.0, ROD_M))
    table = SceneObject("table", Shape.BOX, (0.4, 0.8, 0.04), Pose(x, y + 0.2, z - 0.07))
    box = SceneObject("box", Shape.BOX, (0.1, 0.1, 0.1), Pose(x, y + 0.08, z), mass_kg=0.4)
    tool = SceneArm("arm", ROBOT, "mujoco", {}, touches_m=((0.0, 0.0, ROD_M),))
    backend = arm_in(Surroundings(objects=(table, box), arms=(tool,)))
    backend.open(period_ns=MS)
    start = DESCRIPTION.initial_position_rad
    felt = []
    pushed_n = []
    for count in range(1000):
        turned = seven([start[0] + 0.15e-3 * count, *start[1:]])
        backend.write(JointCommand(turned, (0.15, *STILL[1:])))
        backend.step()
        felt.append(backend.read().torque_nm[0])
        touching = backend.contacts()
        assert all(hypot(*contact.force_n) >= MIN_CONTACT_N for contact in touching)
        pushed_n.append(sum(contact.force_n[1] for contact in touching))
    assert pushed_n[:100] == [0.0] * 100
    # It slides on: its friction is 1, so it pushes back with its weight.
    assert sum(pushed_n[500:]) / 500 == pytest.approx(-0.4 * 9.81, rel=0.1)
    pushed = backend._data.body("box").xpos
    assert 0.03 < pushed[1] - (y + 0.08) < 0.1
    assert pushed[2] == pytest.approx(z, abs=2e-3)
    assert max(felt) - min(felt) > 3.0
    backend.close()


def test_a_wall_stops_a_motion_and_says_which_axis_gave_way() -> None:
    x, y, z = place_m((0.0, 0.0, ROD_M))
    block = SceneObject("block", Shape.BOX, (0.1, 0.02, 0.3), Pose(x, y + 0.035, z))
    tool = SceneArm("arm", ROBOT, "mujoco", {}, touches_m=((0.0, 0.0, ROD_M),))

    def arm(_description: RobotDescription) -> InProcessBackend:
        return arm_in(Surroundings(objects=(block,), arms=(tool,)))

    bench = ServoBench(robot=ROBOT, backend=arm)
    application = Application(bench, watchdog_ms=1000)
    application.join()
    start = bench.controller.arm.position_rad
    application.start(MotionKind.PTP, (start[0] + 0.4, *start[1:]))
    bench.run(1.0)
    assert bench.controller.stops[0].reason.startswith(("checkAxisTorqueLimit: ", "tracking error"))
    assert bench.controller.arm.position_rad[0] < start[0] + 0.3


def place_m(in_flange_m: tuple[float, float, float]) -> tuple[float, float, float]:
    """Where a point of the flange of an arm is that stands alone, in the world."""
    backend = arm_in(Surroundings(objects=(wall(5.0),)))
    backend.open(period_ns=MS)
    flange = backend._data.site("arm/flange")
    x, y, z = (flange.xpos + flange.xmat.reshape(3, 3) @ in_flange_m).tolist()
    backend.close()
    return x, y, z


ROD_M = 0.25
NEAR_M = 2.0 * place_m((0.0, 0.0, 0.0))[0] + 0.032
"""So far apart are two arms, one before the other, that all but touch."""


def both(surroundings: Surroundings) -> tuple[SceneBackend, SceneBackend]:
    return arm_in(surroundings, "left", world="cell"), arm_in(surroundings, "right", world="cell")


def cell(*, distance_m: float = 1.0, objects: tuple[SceneObject, ...] = ()) -> Surroundings:
    options = {"world": "cell"}
    right = Pose.from_abc_deg((distance_m, 0.0, 0.0), 180.0, 0.0, 0.0)
    arms = (SceneArm("left", ROBOT, "mujoco", options), SceneArm("right", ROBOT, "mujoco", options, right))
    return Surroundings(objects=objects, arms=arms)


def test_two_arms_in_one_world_touch_each_other_and_feel_it() -> None:
    far, near = both(cell(distance_m=2.0)), both(cell(distance_m=NEAR_M))
    start = DESCRIPTION.initial_position_rad
    leaning = seven([start[0], start[1] + 0.02, *start[2:]])
    for left, right in (far, near):
        left.open(period_ns=MS)
        right.open(period_ns=MS)
        for _ in range(200):
            for one, position in ((left, leaning), (right, start)):
                one.write(JointCommand(position, STILL))
                one.step()
    assert far[0]._data.ncon == 0
    assert near[0]._data.ncon > 0
    for place in (0, 1):
        alone, pressed = (pair[place].read().torque_nm[1] for pair in (far, near))
        assert abs(pressed - alone) > 5.0
        assert far[place].contacts() == ()
    # Each sees its own side of the same contact, in its own base, and the bases look at each other.
    sides = list(zip(*(arm.contacts() for arm in near), strict=True))
    assert sides
    for mine, yours in sides:
        assert mine.force_n[0] < -5.0
        assert yours.force_n == pytest.approx((mine.force_n[0], mine.force_n[1], -mine.force_n[2]), abs=1e-9)
        x, y, z = mine.point_m
        assert yours.point_m == pytest.approx((NEAR_M - x, -y, z), abs=1e-9)
    for one in (*far, *near):
        one.close()


def test_the_world_goes_on_when_an_arm_misses_its_cycles_and_stands_for_nobody() -> None:
    left, right = both(cell(distance_m=2.0))
    left.open(period_ns=MS)
    right.open(period_ns=MS)
    first = left.read().sample
    moved = seven([value + 0.05 for value in DESCRIPTION.initial_position_rad])
    for _ in range(300):
        left.write(JointCommand(moved, STILL))
        left.step()
    # Each step but the first let the world go on without the other arm, which holds.
    assert left.read().sample >= first + 299
    assert left.read().position_rad == pytest.approx(moved, abs=1e-3)
    assert right.read().position_rad == pytest.approx(DESCRIPTION.initial_position_rad, abs=1e-3)
    right.close()
    left.step()
    assert left.read().sample >= first + 301
    left.close()


def test_the_same_calls_give_the_same_bytes() -> None:
    def course() -> list[Seven]:
        left, right = both(cell(distance_m=NEAR_M))
        left.open(period_ns=MS)
        right.open(period_ns=MS)
        states = []
        for count in range(100):
            for one in (left, right) if count % 7 else (right, left):
                one.write(JointCommand(DESCRIPTION.initial_position_rad, STILL))
                one.step()
                states.append(one.read().torque_nm)
        return states

    assert course() == course()


def test_robots_of_one_world_need_one_cycle() -> None:
    left, right = both(cell())
    left.open(period_ns=MS)
    with pytest.raises(ConfigurationError, match="right has a control cycle of 2 ms, and the others in its MuJoCo"):
        right.open(period_ns=2 * MS)
    left.close()


def test_what_stands_where_an_arm_begins_is_refused_by_name() -> None:
    backend = arm_in(Surroundings(objects=(wall(0.0),)))
    with pytest.raises(ConfigurationError, match=r"overlap by [\d.]+ mm where arm begins: move one of them") as refused:
        backend.open(period_ns=MS)
    assert "wall" in str(refused.value)


def test_an_arm_that_catches_up_makes_no_time_pass() -> None:
    left, right = both(cell(distance_m=2.0))
    left.open(period_ns=MS)
    right.open(period_ns=MS)
    for _ in range(10):
        left.step()
    for _ in range(10):
        right.step()
    assert left.read().sample == 10
    assert left._data.time == pytest.approx(0.010)
    # One that is a second behind is not waited for.
    for _ in range(1000):
        left.step()
    assert left.read().sample >= 1008
    right.step()
    left.step()
    assert left.read().sample >= 1009
    left.close()
    right.close()


def test_a_push_is_told_in_the_base_of_its_robot() -> None:
    felt = []
    for a_deg in (0.0, 90.0):
        arm = SceneArm("arm", ROBOT, "mujoco", {}, Pose.from_abc_deg((0.0, 0.0, 0.0), a_deg, 0.0, 0.0))
        surroundings = Surroundings(objects=(wall(3.0),), arms=(arm,))
        backend = MUJOCO.make(
            BackendRequest(
                "arm", DESCRIPTION, MS, torque_noise=False, base_in_world=arm.base_in_world, surroundings=surroundings
            )
        )
        assert isinstance(backend, SceneBackend)
        backend.open(period_ns=MS)
        backend.push(Push(7, (0.0, 20.0, 0.0), (0.0, 0.0, 0.0), 1.0))
        hold(backend, 0.3)
        felt.append(backend.read().torque_nm[0])
        backend.close()
    assert abs(felt[0]) > 5.0
    assert felt[1] == pytest.approx(felt[0], abs=0.05)


def test_a_base_that_leans_and_another_gravity_are_refused(tmp_path: Path) -> None:
    leaning = SceneArm("arm", ROBOT, "mujoco", {}, Pose.from_abc_deg((0.0, 0.0, 0.0), 0.0, 45.0, 0.0))
    with pytest.raises(ConfigurationError, match="the base of arm leans"):
        arm_in(Surroundings(objects=(wall(3.0),), arms=(leaning,)))
    scene = tmp_path / "scene.xml"
    scene.write_text('<mujoco><option gravity="0 0 -1.6"/></mujoco>')
    with pytest.raises(ConfigurationError, match=r"has the gravity \(0.0, 0.0, -1.6\), and these arms know"):
        arm_in(Surroundings(), scene=str(scene))


def test_an_own_scene_file_is_the_world_the_arm_stands_in(tmp_path: Path) -> None:
    scene = tmp_path / "scene.xml"
    scene.write_text(
        '<mujoco><worldbody><geom name="floor" type="plane" size="2 2 .1"/>'
        '<body name="lamp" pos="0 0 2"><freejoint/><geom size=".05" mass="1"/></body></worldbody></mujoco>'
    )
    backend = arm_in(Surroundings(), scene=str(scene))
    backend.open(period_ns=MS)
    hold(backend, 1.2)
    assert backend._data.body("lamp").xpos[2] < 1.7
    assert backend.read().position_rad == pytest.approx(DESCRIPTION.initial_position_rad, abs=0.02)
    backend.push(Push(7, (0.0, 10.0, 0.0), (0.0, 0.0, 0.0), 0.1))
    backend.close()


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, "there is no scene file"),
        ("<mujoco><worldbody><geom/></worldbody></mujoco>", "MuJoCo does not take the scene"),
        ("nonsense", "is no MJCF"),
    ],
)
def test_a_scene_file_that_cannot_be_is_one_sentence(content: str | None, sentence: str, tmp_path: Path) -> None:
    scene = tmp_path / "scene.xml"
    if content is not None:
        scene.write_text(content)
    with pytest.raises(ConfigurationError) as refused:
        arm_in(Surroundings(), scene=str(scene))
    assert sentence in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("objects", "sentence"),
    [
        ([{"name": "t", "size_mm": [1, 2]}], "a box has 3 sizes, 2 are given"),
        ([{"name": "t", "shape": "plane", "mass_kg": 1}], "a plane stands fast and has no mass"),
        ([{"name": "t", "shape": "sphere", "size_mm": [1]}] * 2, "two objects have the name 't'"),
        ([{"name": "t t", "shape": "plane"}], "name"),
        ([{"name": "t", "shape": "plane", "colour": "red"}], "colour"),
    ],
)
def test_objects_that_cannot_be_are_refused(objects: list[dict[str, object]], sentence: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        parse_station({"object": objects, "robot": [{"servo": {}}]}, where="station")
    assert sentence in str(refused.value)


def test_all_arms_of_a_world_name_the_same_scene(tmp_path: Path) -> None:
    scene = tmp_path / "scene.xml"
    scene.write_text("<mujoco/>")
    surroundings = cell()
    arm_in(surroundings, "left", world="cell")
    with pytest.raises(ConfigurationError, match="all of them name the same"):
        arm_in(surroundings, "right", world="cell", scene=str(scene))
