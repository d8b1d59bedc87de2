"""The MuJoCo arm's torques: sign, size, saturation, noise; and the same seed is the same arm."""

import mujoco
import numpy as np
import pytest

from backends.mujoco import MujocoBackend
from backends.mujoco.torque_sensors import TorqueSensors
from backends.robots import load_description, load_mujoco
from hil.values.arm import ArmState, JointCommand
from hil.values.robot import Seven

STILL: Seven = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NAME = "lbr-iiwa-14-r820"


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


def test_torque_never_exceeds_the_drives() -> None:
    far: Seven = (2.0, 1.5, 2.0, 1.5, 2.0, 1.5, 2.0)
    limits = load_description(NAME).limits
    for cycles in (1, 5, 50):
        state = run(cycles, position=far)
        for axis in range(7):
            assert abs(state.commanded_torque_nm[axis]) <= limits.torque_nm[axis] + 1e-9


def test_noise_and_quantum_are_the_measured_ones() -> None:
    sensors = TorqueSensors(seed=1)
    shown = np.array([sensors.sense(np.zeros(7), np.zeros(7)) for _ in range(5000)])
    measured, external = shown[:, 0], shown[:, 1]
    assert measured.std(axis=0) == pytest.approx([0.0041, 0.026, 0.0028, 0.0085, 0.0028, 0.0013, 0.0014], rel=0.1)
    assert external.std(axis=0) == pytest.approx([0.0006, 0.014, 0.0004, 0.004, 0.0003, 0.0003, 0.0001], rel=0.1)
    steps = measured[:, 0] / 1.344e-3
    assert np.abs(steps - np.rint(steps)).max() < 1e-6
