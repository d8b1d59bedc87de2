"""One contract, every robot side."""

from collections.abc import Iterator

import pytest

from backends.base import InProcessBackend
from backends.ideal import IdealBackend
from backends.mujoco import MujocoBackend
from backends.robots import load_description, robot_names
from hil.values.arm import Backend, JointCommand
from hil.values.errors import BackendError, ConfigurationError
from hil.values.fri import ControlMode, DriveState
from hil.values.robot import RobotDescription, Seven

STILL: Seven = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
PERIOD_NS = 1_000_000


@pytest.fixture(params=robot_names())
def description(request: pytest.FixtureRequest) -> RobotDescription:
    return load_description(request.param)


@pytest.fixture(params=[IdealBackend, MujocoBackend])
def backend(request: pytest.FixtureRequest, description: RobotDescription) -> Iterator[InProcessBackend]:
    made: InProcessBackend = request.param(description)
    yield made
    made.close()


def hold(backend: Backend, position: Seven, cycles: int) -> None:
    for _ in range(cycles):
        backend.write(JointCommand(position, STILL))
        backend.step()


def test_it_tells_what_it_can_do(backend: InProcessBackend) -> None:
    capabilities = backend.capabilities
    assert capabilities.joint_count == 7
    assert capabilities.control_modes == {ControlMode.POSITION}
    assert not capabilities.paces_the_cycle
    assert not capabilities.moves_real_drives


def test_nothing_works_before_open_and_after_close(backend: InProcessBackend) -> None:
    for _ in range(2):
        for call in (backend.read, backend.step, lambda: backend.write(JointCommand(STILL, STILL))):
            with pytest.raises(BackendError, match="that is not open"):
                call()
        backend.open(period_ns=PERIOD_NS)
        backend.read()
        backend.close()
        backend.close()


def test_open_is_idempotent_and_does_not_move(backend: InProcessBackend, description: RobotDescription) -> None:
    backend.open(period_ns=PERIOD_NS)
    first = backend.read()
    backend.open(period_ns=PERIOD_NS)
    assert backend.read().position_rad == first.position_rad == description.initial_position_rad
    assert first.velocity_rad_s == STILL
    assert first.drive_states == (DriveState.ACTIVE,) * 7


def test_a_period_it_cannot_keep_is_refused(backend: InProcessBackend) -> None:
    for period_ns in (500_000, 1_500_000):
        with pytest.raises(ConfigurationError, match="is no multiple of this backend's 1 ms"):
            backend.open(period_ns=period_ns)


def test_it_holds_still_for_a_second(backend: InProcessBackend, description: RobotDescription) -> None:
    backend.open(period_ns=PERIOD_NS)
    hold(backend, description.initial_position_rad, 1000)
    state = backend.read()
    assert state.position_rad == pytest.approx(description.initial_position_rad, abs=1e-4)
    assert state.velocity_rad_s == pytest.approx(STILL, abs=1e-4)


@pytest.mark.parametrize("cycle_ms", [1, 2, 4, 5])
def test_it_follows_a_ramp_in_every_cycle_time(
    backend: InProcessBackend, description: RobotDescription, cycle_ms: int
) -> None:
    backend.open(period_ns=cycle_ms * PERIOD_NS)
    speed = 0.3
    start = description.initial_position_rad
    for cycle in range(1, 400 // cycle_ms + 1):
        offset = speed * cycle * cycle_ms * 1e-3
        position: Seven = tuple(value + offset for value in start)  # type: ignore[assignment]
        backend.write(JointCommand(position, (speed,) * 7))
        backend.step()
    state = backend.read()
    assert state.position_rad == pytest.approx(position, abs=2e-3)
    assert state.velocity_rad_s == pytest.approx((speed,) * 7, abs=0.02)


def test_what_it_returns_is_a_copy(backend: InProcessBackend, description: RobotDescription) -> None:
    backend.open(period_ns=PERIOD_NS)
    before = backend.read()
    kept = before.position_rad
    hold(backend, tuple(value + 1e-3 for value in description.initial_position_rad), 50)  # type: ignore[arg-type]
    assert before.position_rad == kept == description.initial_position_rad
    assert backend.read().position_rad != kept
