"""The robots' names, descriptions and files, and what each library reads from the files."""

import dataclasses
import math
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest

from backends.robots import load_description, load_mujoco, load_pinocchio, mjcf_path, robot_names
from backends.robots.facts import ROBOTS, RobotFacts
from backends.robots.mjcf import mjcf_text
from hil.values.errors import UnknownName
from hil.values.robot import JOINT_NAMES, Seven
from tests.unit.robots_support import NAMES, facts_of
from tools import make_robots

TOTAL_LINK_MASS_KG = {
    "lbr-iiwa-7-r800": 19.04,
    "lbr-iiwa-14-r820": 25.61,
    "lbr-med-7": 18.36,
    "lbr-med-14": 24.15,
}
"""Facts 3.1, A1 to A7."""

VELOCITY_7_RAD_S: Seven = (1.7104, 1.7104, 1.7453, 2.2689, 2.4435, 3.1416, 3.1416)
VELOCITY_14_RAD_S: Seven = (1.4835, 1.4835, 1.7453, 1.3090, 2.2689, 2.3562, 2.3562)
ACCELERATION_7_RAD_S2: Seven = (8.65, 5.44, 5.69, 11.01, 11.78, 13.76, 13.17)
ACCELERATION_14_RAD_S2: Seven = (8.57, 8.57, 8.74, 11.36, 12.23, 15.72, 15.72)
TORQUE_7_NM: Seven = (176, 176, 110, 110, 110, 40, 40)
TORQUE_14_NM: Seven = (320, 320, 176, 176, 110, 40, 40)
"""Facts 2.1, in the columns already converted to SI."""


def numbers(value: object) -> list[float]:
    """Every number within nested dataclasses and tuples."""
    if dataclasses.is_dataclass(value):
        return [n for field in dataclasses.fields(value) for n in numbers(getattr(value, field.name))]
    if isinstance(value, tuple):
        return [n for item in value for n in numbers(item)]
    return [value] if isinstance(value, float) else []


def test_the_four_robots_are_known() -> None:
    assert robot_names() == NAMES


@pytest.mark.parametrize("load", [load_description, mjcf_path, load_mujoco, load_pinocchio])
def test_an_unknown_name_is_refused_with_the_valid_ones(load: Callable[[str], object]) -> None:
    with pytest.raises(UnknownName) as caught:
        load("lbr-iiwa-15")
    assert caught.value.valid == NAMES
    assert str(caught.value) == f"unknown robot 'lbr-iiwa-15'; valid: {', '.join(NAMES)}"


@pytest.mark.parametrize("facts", ROBOTS, ids=NAMES)
def test_every_figure_is_finite(facts: RobotFacts) -> None:
    figures = numbers(facts)
    assert len(figures) == 164
    assert all(math.isfinite(figure) for figure in figures)


@pytest.mark.parametrize("facts", ROBOTS, ids=NAMES)
def test_the_committed_file_is_what_the_tool_writes(facts: RobotFacts) -> None:
    assert mjcf_path(facts.description.name).read_text(encoding="utf-8") == mjcf_text(facts)


def test_the_tool_writes_all_four_files(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path_factory.mktemp("robots")
    monkeypatch.setattr(make_robots, "mjcf_path", lambda name: folder / f"{name}.xml")
    make_robots.main()
    assert {path.stem for path in folder.iterdir()} == set(NAMES)
    assert len(capsys.readouterr().out.splitlines()) == len(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_limits_equal_the_facts(name: str) -> None:
    small = "7" in name.split("-")
    description = load_description(name)
    limits = description.limits
    assert np.degrees(limits.position_max_rad) == pytest.approx([170, 120, 170, 120, 170, 120, 175], abs=1e-12)
    assert limits.position_min_rad == tuple(-high for high in limits.position_max_rad)
    velocity = VELOCITY_7_RAD_S if small else VELOCITY_14_RAD_S
    assert limits.velocity_rad_s == pytest.approx(velocity, abs=5e-5)
    acceleration = ACCELERATION_7_RAD_S2 if small else ACCELERATION_14_RAD_S2
    assert limits.acceleration_rad_s2 == pytest.approx(acceleration, abs=5e-3)
    assert limits.jerk_rad_s3 == pytest.approx([value / 0.05 for value in limits.acceleration_rad_s2])
    assert limits.torque_nm == (TORQUE_7_NM if small else TORQUE_14_NM)
    assert description.payload_kg == (7 if small else 14)
    assert description.reach_mm == (800 if small else 820)
    assert np.degrees(description.initial_position_rad) == pytest.approx([0, 30, 0, 40, 0, 90, 0], abs=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_jerk_lets_every_axis_reach_its_acceleration_before_its_velocity(name: str) -> None:
    limits = load_description(name).limits
    ramp_s = np.divide(limits.acceleration_rad_s2, limits.jerk_rad_s3)
    gained_rad_s = np.multiply(limits.acceleration_rad_s2, ramp_s)
    assert np.all(gained_rad_s < limits.velocity_rad_s)


@pytest.mark.parametrize("name", NAMES)
def test_mujoco_holds_limits_friction_and_armature(name: str) -> None:
    facts, model = facts_of(name), load_mujoco(name)
    limits = facts.description.limits
    assert tuple(model.joint(index).name for index in range(model.njnt)) == JOINT_NAMES
    assert tuple(model.actuator(index).name for index in range(model.nu)) == JOINT_NAMES
    assert model.nq == model.nv == model.nu == 7
    ranges = np.column_stack((limits.position_min_rad, limits.position_max_rad))
    torques = np.column_stack((np.negative(limits.torque_nm), limits.torque_nm))
    np.testing.assert_array_equal(model.jnt_range, ranges)
    np.testing.assert_array_equal(model.jnt_actfrcrange, torques)
    np.testing.assert_array_equal(model.actuator_forcerange, torques)
    assert model.jnt_limited.all()
    assert model.jnt_actfrclimited.all()
    assert model.actuator_forcelimited.all()
    np.testing.assert_array_equal(model.dof_damping.ravel(), facts.viscous_nm_s_rad)
    np.testing.assert_array_equal(model.dof_frictionloss, facts.coulomb_nm)
    np.testing.assert_array_equal(model.dof_armature, facts.armature_kg_m2)
    np.testing.assert_array_equal(model.opt.gravity, (0.0, 0.0, -9.81))
    assert model.opt.timestep == 0.001
    np.testing.assert_array_equal(model.key("initial").qpos, facts.description.initial_position_rad)


@pytest.mark.parametrize("name", NAMES)
def test_pinocchio_holds_limits_friction_and_armature(name: str) -> None:
    facts, model = facts_of(name), load_pinocchio(name)
    limits = facts.description.limits
    assert tuple(model.names)[1:] == JOINT_NAMES
    assert model.nq == model.nv == 7
    np.testing.assert_array_equal(model.lowerPositionLimit, limits.position_min_rad)
    np.testing.assert_array_equal(model.upperPositionLimit, limits.position_max_rad)
    np.testing.assert_array_equal(model.effortLimit, limits.torque_nm)
    np.testing.assert_array_equal(model.damping, facts.viscous_nm_s_rad)
    np.testing.assert_array_equal(model.friction, facts.coulomb_nm)
    np.testing.assert_array_equal(model.armature, facts.armature_kg_m2)


@pytest.mark.parametrize("name", NAMES)
def test_links_weigh_what_the_facts_say_and_nothing_else_does(name: str) -> None:
    in_mujoco = load_mujoco(name).body_mass
    in_pinocchio = [inertia.mass for inertia in load_pinocchio(name).inertias][1:]
    assert in_mujoco[0] == 0.0
    assert in_mujoco[1:] == pytest.approx(in_pinocchio, abs=1e-12)
    assert in_mujoco.sum() == pytest.approx(TOTAL_LINK_MASS_KG[name], abs=0.005)


@pytest.mark.parametrize("name", NAMES)
def test_no_geom_collides(name: str) -> None:
    model = load_mujoco(name)
    assert model.ngeom > 20
    assert not model.geom_contype.any()
    assert not model.geom_conaffinity.any()


@pytest.mark.parametrize("name", NAMES)
def test_the_file_points_at_no_other_file(name: str) -> None:
    assert " file=" not in mjcf_path(name).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("loader", "absent"), [("load_mujoco", "pinocchio"), ("load_pinocchio", "mujoco"), ("load_description", "mujoco")]
)
def test_a_loader_imports_only_its_own_library(loader: str, absent: str) -> None:
    program = f"import sys, backends.robots as r; r.{loader}('lbr-med-7'); sys.exit({absent!r} in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


def test_the_initial_pose_is_within_all_limits() -> None:
    for name in NAMES:
        description = load_description(name)
        start, limits = description.initial_position_rad, description.limits
        assert np.all(np.greater(start, limits.position_min_rad))
        assert np.all(np.less(start, limits.position_max_rad))
