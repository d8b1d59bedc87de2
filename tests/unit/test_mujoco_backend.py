"""The MuJoCo arm's torques and brakes: sign, size, saturation, noise; and the same seed is the same arm."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from backends.mujoco import MujocoBackend
from backends.mujoco.torque_sensors import TorqueSensors
from backends.robots import load_description, load_mujoco, robot_names
from hil.values.arm import ArmState, JointCommand, seven
from hil.values.fri import DriveState
from hil.values.robot import Seven
from tests.unit.robots_support import Array, facts_of

STILL: Seven = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NAME = "lbr-iiwa-14-r820"
STRETCHED: Seven = (0.0, math.pi / 2.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Forward and level: gravity pulls at A2 as hard as it can."""
AXES = [f"A{number}" for number in range(1, 8)]


def run(cycles: int, *, seed: int = 0, position: Seven | None = None) -> ArmState:
    description = load_description(NAME)
    backend = MujocoBackend(description, seed=seed)
    backend.open(period_ns=1_000_000)
    for _ in range(cycles):
        backend.write(JointCommand(position or description.initial_position_rad, STILL))
        backend.step()
    state = backend.read()
    backend.close()
    return state


def test_measured_torque_is_minus_gravity_and_positive_when_leaning_forward() -> None:
    model = load_mujoco(NAME)
    data = mujoco.MjData(model)
    data.qpos[:] = load_description(NAME).initial_position_rad
    mujoco.mj_forward(model, data)
    state = run(2000)
    assert state.torque_nm == pytest.approx(tuple(-data.qfrc_bias), abs=0.35)  # Coulomb friction holds the rest
    assert state.torque_nm[1] > 20.0
    assert state.commanded_torque_nm[1] == pytest.approx(state.torque_nm[1], abs=0.2)
    assert state.external_torque_nm == pytest.approx(STILL, abs=0.1)


def test_measured_torque_is_never_the_commanded_one_to_the_bit() -> None:
    state = run(500)
    assert len(set(state.torque_nm) & set(state.commanded_torque_nm) - {0.0}) == 0
    assert state.torque_nm != state.commanded_torque_nm


def test_the_seed_decides_the_noise_and_nothing_else() -> None:
    assert run(100, seed=3) == run(100, seed=3)
    one, other = run(100, seed=3), run(100, seed=4)
    assert one.position_rad == other.position_rad
    assert one.torque_nm != other.torque_nm


def test_torque_never_exceeds_the_drives_whatever_is_commanded() -> None:
    far: Seven = (2.0, 1.5, 2.0, 1.5, 2.0, 1.5, 2.0)
    limits = load_description(NAME).limits
    for cycles in (2, 5, 50):
        state = run(cycles, position=far)
        assert abs(state.commanded_torque_nm[0]) > 2.0 * limits.torque_nm[0]
        for axis in range(7):
            assert abs(state.torque_nm[axis]) <= limits.torque_nm[axis]


def test_noise_and_quantum_are_the_measured_ones() -> None:
    sensors = TorqueSensors(seed=1)
    measured = np.array([sensors.sense(np.zeros(7)) for _ in range(5000)])
    assert measured.std(axis=0) == pytest.approx([0.0041, 0.026, 0.0028, 0.0085, 0.0028, 0.0013, 0.0014], rel=0.1)
    steps = measured[:, 0] / 1.344e-3
    assert np.abs(steps - np.rint(steps)).max() < 1e-6


def moving_axis(name: str, axis: int, *, start: Seven, speed_rad_s: float, acceleration_rad_s2: float) -> MujocoBackend:
    """An arm of which one axis has just reached its speed, half of speed² / acceleration away from ``start``."""
    backend = MujocoBackend(replace(load_description(name), initial_position_rad=start))
    backend.open(period_ns=1_000_000)
    sign = math.copysign(1.0, speed_rad_s)
    for cycle in range(1, math.ceil(1e3 * abs(speed_rad_s) / acceleration_rad_s2) + 1):
        time = min(cycle * 1e-3, abs(speed_rad_s) / acceleration_rad_s2)
        position, rate, change = list(start), list(STILL), list(STILL)
        position[axis] += sign * 0.5 * acceleration_rad_s2 * time * time
        rate[axis] = sign * acceleration_rad_s2 * time
        change[axis] = sign * acceleration_rad_s2
        backend.write(JointCommand(seven(position), seven(rate), seven(change)))
        backend.step()
    assert backend.read().velocity_rad_s[axis] == pytest.approx(speed_rad_s, abs=0.05)
    return backend


def steps_until_still(backend: MujocoBackend) -> int:
    for step in range(1, 1001):
        backend.step()
        if max(map(abs, backend.read().velocity_rad_s)) < 1e-3:
            return step
    raise AssertionError("the arm does not stop")


@pytest.mark.parametrize("name", robot_names())
def test_brakes_catch_a_stretched_arm_that_moves_down_and_hold_it_for_ten_seconds(name: str) -> None:
    start: Seven = (0.0, math.pi / 2.0 - 0.25, 0.0, 0.0, 0.0, 0.0, 0.0)
    backend = moving_axis(name, 1, start=start, speed_rad_s=1.0, acceleration_rad_s2=2.0)
    before = backend.read().position_rad
    backend.switch_drives(on=False)
    assert 10 <= steps_until_still(backend) <= 80
    caught = backend.read().position_rad
    assert 0.005 <= caught[1] - before[1] <= 0.04
    for _ in range(10_000):
        backend.step()
    assert backend.read().position_rad == pytest.approx(caught, abs=2e-5)


@pytest.mark.parametrize("axis", range(7), ids=AXES)
@pytest.mark.parametrize("name", robot_names())
def test_brakes_stop_every_axis_from_full_speed(name: str, axis: int) -> None:
    """18 ms to 110 ms, for A1 of the Med 14 and A6 of the 7: a brake as strong as the motor, against the inertia."""
    description = load_description(name)
    start, limits = description.initial_position_rad, description.limits
    speed = -math.copysign(limits.velocity_rad_s[axis], start[axis])
    acceleration = 0.4 * limits.acceleration_rad_s2[axis]
    backend = moving_axis(name, axis, start=start, speed_rad_s=speed, acceleration_rad_s2=acceleration)
    before = backend.read().position_rad
    backend.switch_drives(on=False)
    steps = steps_until_still(backend)
    travel = backend.read().position_rad[axis] - before[axis]
    assert 12 <= steps <= 125
    assert travel == pytest.approx(speed * steps * 1e-3 / 2.0, rel=0.2)


@pytest.mark.parametrize("name", robot_names())
def test_the_sensors_show_the_same_gravity_whether_drives_or_brakes_hold_it(name: str) -> None:
    """The brake sits on the motor's side of the sensor; how much the joint's own friction carries may change."""
    description = replace(load_description(name), initial_position_rad=STRETCHED)
    backend = MujocoBackend(description)
    backend.open(period_ns=1_000_000)

    def mean_torque() -> Array:
        shown = []
        for _ in range(200):
            backend.write(JointCommand(STRETCHED, STILL))
            backend.step()
            shown.append(backend.read().torque_nm)
        mean: Array = np.array(shown).mean(axis=0)
        return mean

    with_drives = mean_torque()
    backend.switch_drives(on=False)
    with_brakes = mean_torque()
    assert backend.read().drive_states == (DriveState.OFF,) * 7
    friction = np.array(facts_of(name).coulomb_nm)
    assert np.all(np.abs(with_brakes - with_drives) <= friction + 0.005)
    assert with_brakes[1] > 60.0


def test_the_first_sample_of_drives_that_are_back_still_shows_the_brakes() -> None:
    backend = MujocoBackend(replace(load_description(NAME), initial_position_rad=STRETCHED))
    backend.open(period_ns=1_000_000)
    backend.switch_drives(on=False)
    backend.switch_drives(on=True)
    for number in range(1, 311):
        backend.write(JointCommand(STRETCHED, STILL))
        backend.step()
        state = backend.read()
        assert state.drive_states[1] == (DriveState.TRANSITIONING if number < 300 else DriveState.ACTIVE)
        assert state.torque_nm[1] == pytest.approx(80.6, abs=0.5)
        assert state.commanded_torque_nm[1] == pytest.approx(0.0 if number <= 300 else 80.6, abs=0.5)


def test_what_is_commanded_moves_the_arm_as_long_as_no_motor_is_at_its_limit() -> None:
    """Then the sensors show what is commanded, less the rotor's share: they would not if the wish was another."""
    armature = facts_of(NAME).armature_kg_m2[1]
    acceleration = 2.0
    backend = moving_axis(NAME, 1, start=STILL, speed_rad_s=0.5, acceleration_rad_s2=acceleration)
    state = backend.read()
    assert state.commanded_torque_nm[1] < -5.0
    rotor = state.torque_nm[1] - state.commanded_torque_nm[1]
    assert rotor == pytest.approx(armature * acceleration, rel=0.05)


def test_the_arm_moves_as_before_once_its_drives_are_back() -> None:
    """Brakes leave nothing behind in the model: the same motion, also where it turns and friction decides."""
    description = load_description(NAME)
    switched, never = MujocoBackend(description), MujocoBackend(description)
    for backend in (switched, never):
        backend.open(period_ns=1_000_000)
    switched.switch_drives(on=False)
    switched.step()
    switched.switch_drives(on=True)
    for _ in range(301):
        switched.write(JointCommand(description.initial_position_rad, STILL))
        switched.step()
    for cycle in range(1, 1001):
        offset = 0.2 * (1.0 - math.cos(cycle * 4e-3))
        rate = 0.8 * math.sin(cycle * 4e-3)
        command = JointCommand(seven([value + offset for value in description.initial_position_rad]), (rate,) * 7)
        for backend in (switched, never):
            backend.write(command)
            backend.step()
        assert switched.read().position_rad == pytest.approx(never.read().position_rad, abs=2e-7)


def test_brakes_are_deterministic() -> None:
    def once() -> list[ArmState]:
        backend = moving_axis(NAME, 1, start=STILL, speed_rad_s=0.5, acceleration_rad_s2=2.0)
        states = []
        for cycle in range(900):
            if cycle in (0, 400):
                backend.switch_drives(on=cycle > 0)
            backend.step()
            states.append(backend.read())
        return states

    assert once() == once()
