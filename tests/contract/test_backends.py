"""What the arms that live in this process do beyond the contract of all robot sides (test_contract.py)."""

from collections.abc import Iterator

import pytest

from backends.base import BRAKE_RELEASE_NS, InProcessBackend
from backends.ideal import IdealBackend
from backends.mujoco import MujocoBackend
from backends.robots import load_description, robot_names
from hil.values.arm import ArmState, Backend, JointCommand, Push, seven
from hil.values.errors import BackendError
from hil.values.fri import DriveState
from hil.values.robot import RobotDescription, Seven

STILL: Seven = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
PERIOD_NS = 1_000_000
ACTIVE = (DriveState.ACTIVE,) * 7
TRANSITIONING = (DriveState.TRANSITIONING,) * 7
OFF = (DriveState.OFF,) * 7
SPEED_RAD_S = 0.3


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


def shifted(position: Seven, by_rad: float) -> Seven:
    return seven([value + by_rad for value in position])


def ramp(backend: Backend, start: Seven, *, cycle_ms: int, cycles: int) -> ArmState:
    """Move all axes at once at ``SPEED_RAD_S`` and return the state at the end, still moving."""
    for cycle in range(1, cycles + 1):
        position = shifted(start, SPEED_RAD_S * cycle * cycle_ms * 1e-3)
        backend.write(JointCommand(position, (SPEED_RAD_S,) * 7))
        backend.step()
    return backend.read()


def drive_states_of_steps(backend: Backend, steps: int) -> list[tuple[DriveState, ...]]:
    states = []
    for _ in range(steps):
        backend.step()
        states.append(backend.read().drive_states)
    return states


def test_it_tells_what_it_can_do(backend: InProcessBackend) -> None:
    capabilities = backend.capabilities
    assert capabilities.joint_count == 7
    assert not capabilities.paces_the_cycle
    assert not capabilities.moves_real_drives
    assert capabilities.switches_drives


def test_open_is_idempotent_and_does_not_move(backend: InProcessBackend, description: RobotDescription) -> None:
    backend.open(period_ns=PERIOD_NS)
    first = backend.read()
    backend.open(period_ns=PERIOD_NS)
    assert backend.read().position_rad == first.position_rad == description.initial_position_rad
    assert first.velocity_rad_s == STILL
    assert first.drive_states == ACTIVE


@pytest.mark.parametrize("cycle_ms", [1, 2, 4, 5])
def test_it_follows_a_ramp_in_every_cycle_time(
    backend: InProcessBackend, description: RobotDescription, cycle_ms: int
) -> None:
    backend.open(period_ns=cycle_ms * PERIOD_NS)
    state = ramp(backend, description.initial_position_rad, cycle_ms=cycle_ms, cycles=400 // cycle_ms)
    assert state.position_rad == pytest.approx(shifted(description.initial_position_rad, SPEED_RAD_S * 0.4), abs=2e-3)
    assert state.velocity_rad_s == pytest.approx((SPEED_RAD_S,) * 7, abs=0.02)


def test_the_sample_grows_by_one_with_every_step(backend: InProcessBackend) -> None:
    backend.open(period_ns=2 * PERIOD_NS)
    first = backend.read().sample
    for steps in range(1, 20):
        backend.step()
        backend.switch_drives(on=steps % 3 == 0)
        assert backend.read().sample == first + steps


def test_without_a_step_nothing_new_is_measured(backend: InProcessBackend, description: RobotDescription) -> None:
    backend.open(period_ns=PERIOD_NS)
    moving = ramp(backend, description.initial_position_rad, cycle_ms=1, cycles=400)
    assert backend.read() == moving
    backend.switch_drives(on=False)
    dropped = backend.read()
    assert dropped == moving._replace(drive_states=OFF, commanded_torque_nm=STILL)
    backend.switch_drives(on=True)
    assert backend.read() == dropped._replace(drive_states=TRANSITIONING)


@pytest.mark.parametrize("cycle_ms", [1, 2, 4, 5])
def test_the_drives_come_back_after_300_ms(backend: InProcessBackend, cycle_ms: int) -> None:
    backend.open(period_ns=cycle_ms * PERIOD_NS)
    backend.switch_drives(on=False)
    assert backend.read().drive_states == OFF
    assert drive_states_of_steps(backend, 500 // cycle_ms) == [OFF] * (500 // cycle_ms)
    backend.switch_drives(on=True)
    assert backend.read().drive_states == TRANSITIONING
    steps = 300 // cycle_ms
    assert BRAKE_RELEASE_NS == 300 * 1_000_000
    assert drive_states_of_steps(backend, steps + 5) == [TRANSITIONING] * (steps - 1) + [ACTIVE] * 6


def test_switching_drives_is_idempotent(backend: InProcessBackend) -> None:
    backend.open(period_ns=PERIOD_NS)
    backend.switch_drives(on=True)
    assert backend.read().drive_states == ACTIVE
    for _ in range(2):
        backend.switch_drives(on=False)
        assert drive_states_of_steps(backend, 3) == [OFF] * 3
    for _ in range(3):
        backend.switch_drives(on=True)
        backend.step()
    assert drive_states_of_steps(backend, 297) == [TRANSITIONING] * 296 + [ACTIVE]


def test_dropping_drives_on_their_way_starts_the_way_anew(backend: InProcessBackend) -> None:
    backend.open(period_ns=PERIOD_NS)
    backend.switch_drives(on=False)
    backend.switch_drives(on=True)
    drive_states_of_steps(backend, 299)
    backend.switch_drives(on=False)
    assert backend.read().drive_states == OFF
    assert drive_states_of_steps(backend, 400) == [OFF] * 400
    backend.switch_drives(on=True)
    assert drive_states_of_steps(backend, 300) == [TRANSITIONING] * 299 + [ACTIVE]


@pytest.mark.parametrize("cycle_ms", [1, 4])
def test_dropped_drives_stop_a_moving_arm_and_commands_do_not_move_it(
    backend: InProcessBackend, description: RobotDescription, cycle_ms: int
) -> None:
    """The slowest brake takes 20 ms from this speed (measured, A6 of the iiwa 7); commands go on as if nothing was."""
    backend.open(period_ns=cycle_ms * PERIOD_NS)
    moving = ramp(backend, description.initial_position_rad, cycle_ms=cycle_ms, cycles=400 // cycle_ms)
    backend.switch_drives(on=False)
    stopped = ramp(backend, moving.position_rad, cycle_ms=cycle_ms, cycles=24 // cycle_ms)
    assert stopped.velocity_rad_s == pytest.approx(STILL, abs=1e-4)
    for before, after in zip(moving.position_rad, stopped.position_rad, strict=True):
        assert -1e-6 <= after - before <= SPEED_RAD_S * 0.020
    for on in (False, True):
        backend.switch_drives(on=on)
        rest = ramp(backend, moving.position_rad, cycle_ms=cycle_ms, cycles=296 // cycle_ms)
        assert rest.drive_states == (TRANSITIONING if on else OFF)
        assert rest.position_rad == pytest.approx(stopped.position_rad, abs=1e-5)
        assert rest.velocity_rad_s == pytest.approx(STILL, abs=1e-5)
        assert rest.commanded_torque_nm == STILL


@pytest.mark.parametrize("commanded_while_off", [True, False])
@pytest.mark.parametrize("cycle_ms", [1, 2, 4, 5])
def test_drives_that_come_back_hold_the_arm_without_a_jump(
    backend: InProcessBackend, description: RobotDescription, cycle_ms: int, commanded_while_off: bool
) -> None:
    """Whether commands came while the drives were off, or the first one comes when they are on again."""
    backend.open(period_ns=cycle_ms * PERIOD_NS)
    ramp(backend, description.initial_position_rad, cycle_ms=cycle_ms, cycles=400 // cycle_ms)
    backend.switch_drives(on=False)
    drive_states_of_steps(backend, 100 // cycle_ms)
    rest = backend.read().position_rad
    backend.switch_drives(on=True)
    for _ in range(300 // cycle_ms):
        if commanded_while_off:
            backend.write(JointCommand(rest, STILL))
        backend.step()
    assert backend.read().drive_states == ACTIVE
    for _ in range(1000 // cycle_ms):
        backend.write(JointCommand(rest, STILL))
        backend.step()
        state = backend.read()
        assert state.position_rad == pytest.approx(rest, abs=1e-5)
        assert state.velocity_rad_s == pytest.approx(STILL, abs=1e-4)


def test_drives_that_come_back_go_to_the_newest_command(
    backend: InProcessBackend, description: RobotDescription
) -> None:
    backend.open(period_ns=PERIOD_NS)
    start = description.initial_position_rad
    backend.switch_drives(on=False)
    hold(backend, shifted(start, 0.5), 10)
    hold(backend, shifted(start, 1e-3), 10)
    backend.switch_drives(on=True)
    drive_states_of_steps(backend, 300)
    assert backend.read().position_rad == pytest.approx(start, abs=1e-6)
    drive_states_of_steps(backend, 200)
    assert backend.read().position_rad == pytest.approx(shifted(start, 1e-3), abs=1e-4)


@pytest.mark.parametrize("cycle_ms", [1, 5])
def test_a_command_from_before_the_drop_is_a_place_to_hold_and_no_speed(
    backend: InProcessBackend, description: RobotDescription, cycle_ms: int
) -> None:
    backend.open(period_ns=cycle_ms * PERIOD_NS)
    ramp(backend, description.initial_position_rad, cycle_ms=cycle_ms, cycles=400 // cycle_ms)
    newest = shifted(description.initial_position_rad, SPEED_RAD_S * 0.4)
    backend.switch_drives(on=False)
    backend.switch_drives(on=True)
    drive_states_of_steps(backend, 500 // cycle_ms)
    state = backend.read()
    assert state.drive_states == ACTIVE
    assert state.position_rad == pytest.approx(newest, abs=1e-4)
    assert state.velocity_rad_s == pytest.approx(STILL, abs=1e-4)


@pytest.mark.parametrize("switch_on", [False, True])
def test_an_arm_opened_again_stands_where_it_was_with_its_drives_on(
    backend: InProcessBackend, description: RobotDescription, switch_on: bool
) -> None:
    backend.open(period_ns=PERIOD_NS)
    ramp(backend, description.initial_position_rad, cycle_ms=1, cycles=400)
    backend.switch_drives(on=False)
    ramp(backend, description.initial_position_rad, cycle_ms=1, cycles=50)
    backend.switch_drives(on=switch_on)
    before = backend.read()
    backend.close()
    backend.open(period_ns=PERIOD_NS)
    opened = backend.read()
    assert opened.drive_states == ACTIVE
    assert opened.position_rad == before.position_rad
    assert opened.velocity_rad_s == STILL
    assert opened.sample == before.sample + 1
    drive_states_of_steps(backend, 500)
    assert backend.read().position_rad == pytest.approx(before.position_rad, abs=1e-4)
    hold(backend, shifted(before.position_rad, 1e-3), 200)
    assert backend.read().position_rad == pytest.approx(shifted(before.position_rad, 1e-3), abs=1e-4)


def test_a_torque_is_given_or_refused(backend: InProcessBackend, description: RobotDescription) -> None:
    backend.open(period_ns=PERIOD_NS)
    still = JointCommand(description.initial_position_rad, STILL, STILL, STILL)
    if not backend.capabilities.takes_torque:
        with pytest.raises(BackendError, match="takes no torque commands"):
            backend.write(still)
        return
    # Motors that give nothing let the arm fall.
    for _ in range(300):
        backend.write(still)
        backend.step()
    fallen = backend.read()
    assert fallen.commanded_torque_nm == pytest.approx(STILL)
    assert fallen.position_rad[1] - description.initial_position_rad[1] > 0.02
    # A position that is commanded next is reached from wherever the arm is.
    hold(backend, fallen.position_rad, 500)
    caught = backend.read()
    assert caught.position_rad == pytest.approx(fallen.position_rad, abs=1e-3)
    assert max(map(abs, caught.velocity_rad_s)) < 1e-3


def test_drives_that_come_back_after_torques_hold_the_arm_where_it_is(backend: InProcessBackend) -> None:
    backend.open(period_ns=PERIOD_NS)
    torque = STILL if backend.capabilities.takes_torque else None
    for _ in range(100):
        backend.write(JointCommand(backend.read().position_rad, STILL, STILL, torque))
        backend.step()
    backend.switch_drives(on=False)
    for _ in range(500):
        backend.step()
    rested = backend.read().position_rad
    backend.switch_drives(on=True)
    for _ in range(BRAKE_RELEASE_NS // PERIOD_NS + 500):
        backend.step()
    # It still moved when the brakes gripped.
    assert backend.read().position_rad == pytest.approx(rested, abs=5e-3)


@pytest.mark.parametrize("link", range(1, 8))
def test_a_push_is_felt_or_refused(backend: InProcessBackend, description: RobotDescription, link: int) -> None:
    backend.open(period_ns=PERIOD_NS)
    push = Push(link, (0.0, 30.0, 0.0), (0.0, 0.0, 5.0), 0.3)
    if not backend.capabilities.can_be_pushed:
        with pytest.raises(BackendError, match="cannot be pushed"):
            backend.push(push)
        return
    start = description.initial_position_rad
    hold(backend, start, 100)
    before = backend.read().torque_nm[0]
    backend.push(push)
    hold(backend, start, 290)
    # About A1: the moment, and the force with its lever, which no link makes negative in this pose.
    felt = before - backend.read().torque_nm[0]
    assert felt < -3.0 or felt > 3.0
    hold(backend, start, 300)
    assert backend.read().torque_nm[0] == pytest.approx(before, abs=1.0)
