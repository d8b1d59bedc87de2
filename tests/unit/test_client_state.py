"""The state an application reads: every value where the release has it, a clear error where not."""

from dataclasses import FrozenInstanceError, fields

import pytest

import hil.client.fri as public
from hil.client.fri import (
    ClientCommandMode,
    ControlMode,
    DriveState,
    FriState,
    NotAvailable,
    OperationMode,
    OverlayType,
    Quality,
    Redundancy,
    Release,
    SafetyState,
    SessionState,
    TimeStamp,
    UsageError,
    WrongSignal,
)
from hil.values.errors import UnknownName
from hil.values.fri_messages import MonitoringMessage
from tests.unit.test_client_support import COMMANDED, INTERPOLATED, MEASURED, POSE, message

ACTIVE, READY = SessionState.COMMANDING_ACTIVE, SessionState.MONITORING_READY
CARTESIAN = ClientCommandMode.CARTESIAN_POSE


def state_of(made: MonitoringMessage, release: Release) -> FriState:
    """Return the state in ``made``."""
    assert made.connection is not None
    return FriState(release, made, SessionState(made.connection.session_state), Quality(made.connection.quality))


@pytest.mark.parametrize("release", Release)
def test_what_every_release_has(release: Release) -> None:
    state = state_of(message(release, ACTIVE, sequence=41, period_ms=4, multiplier=5), release)
    assert (state.session_state, state.quality, state.sequence_counter) == (ACTIVE, Quality.GOOD, 41)
    assert (state.send_period_ms, state.receive_multiplier) == (4, 5)
    assert (state.sample_time_s, state.answer_period_s) == (0.004, 0.02)
    assert (state.safety_state, state.operation_mode) == (SafetyState.NORMAL_OPERATION, OperationMode.AUT)
    assert (state.control_mode, state.drive_states) == (ControlMode.POSITION, (DriveState.ACTIVE,) * 7)
    assert (state.client_command_mode, state.overlay_type) == (ClientCommandMode.JOINT_POSITION, OverlayType.JOINT)
    assert state.tracking_performance == 1.0
    assert (state.measured_position_rad, state.interpolator_position_rad) == (MEASURED, INTERPOLATED)
    assert (state.measured_torque_nm, state.commanded_torque_nm) == ((1.0,) * 7, (2.0,) * 7)
    assert state.external_torque_nm == (3.0,) * 7
    assert state.time_stamp == TimeStamp(1_795_322_363, 5)
    assert [item.name for item in state.requested_transformations] == ["PBase"]


@pytest.mark.parametrize("release", Release)
def test_before_commanding(release: Release) -> None:
    state = state_of(message(release, READY), release)
    assert (state.client_command_mode, state.overlay_type) == (ClientCommandMode.NONE, OverlayType.NONE)
    assert state.tracking_performance == 0.0
    with pytest.raises(
        NotAvailable,
        match=rf"no interpolator position in FRI {release.value} in session state MONITORING_READY: .*WAIT",
    ) as caught:
        _ = state.interpolator_position_rad
    assert isinstance(caught.value, UsageError)
    assert (caught.value.release, caught.value.state) == (release, READY)


AVAILABLE = {
    "commanded_position_rad": ({Release.V1_11, Release.V1_14, Release.V1_15, Release.V1_16}, COMMANDED),
    "external_force": ({Release.V2_7}, (4.0,) * 6),
    "measured_pose": ({Release.V2_5, Release.V2_7}, POSE),
    "measured_redundancy": ({Release.V2_5, Release.V2_7}, Redundancy(0, 0.3)),
}


@pytest.mark.parametrize("release", Release)
@pytest.mark.parametrize("name", AVAILABLE)
def test_what_only_some_releases_have(release: Release, name: str) -> None:
    state = state_of(message(release, READY), release)
    releases, value = AVAILABLE[name]
    if release in releases:
        assert getattr(state, name) == value
    else:
        with pytest.raises(NotAvailable, match=rf"in FRI {release.value} in session state MONITORING_READY: only"):
            getattr(state, name)


@pytest.mark.parametrize("release", Release)
def test_interpolator_pose(release: Release) -> None:
    cartesian = state_of(message(release, ACTIVE, mode=CARTESIAN), release)
    joints = state_of(message(release, ACTIVE), release)
    if release.startswith("2"):
        assert (cartesian.interpolator_pose, cartesian.interpolator_redundancy) == (POSE, Redundancy(0, 0.25))
        with pytest.raises(NotAvailable, match="overlay is not one of joint positions"):
            _ = cartesian.interpolator_position_rad
        reason = "overlay is not one of poses"
    else:
        reason = "only 2.x has it"
    for name in ("interpolator_pose", "interpolator_redundancy"):
        with pytest.raises(NotAvailable, match=reason):
            getattr(joints, name)


@pytest.mark.parametrize("release", Release)
def test_inputs_and_outputs_exist_from_1_14_on(release: Release) -> None:
    state = state_of(message(release, READY), release)
    if release is Release.V1_11:
        with pytest.raises(NotAvailable, match=r"no input or output in FRI 1\.11 .*from 1\.14 on"):
            state.io_value("FRI.Lamp")
        return
    names = ("FRI.Speed", "FRI.Count", "FRI.Lamp", "FRI.Key")
    assert [state.io_value(name) for name in names] == [0.5, 7, False, True]
    with pytest.raises(UnknownName, match=r"unknown input or output 'FRI.Door'; valid: FRI.Speed"):
        state.io_value("FRI.Door")
    assert (state.analog_io("FRI.Speed"), state.digital_io("FRI.Count"), state.boolean_io("FRI.Key")) == (0.5, 7, True)
    with pytest.raises(WrongSignal, match=r"FRI.Speed: it is analog, not boolean"):
        state.boolean_io("FRI.Speed")
    with pytest.raises(UnknownName, match=r"unknown input or output 'FRI.Door'; valid: FRI.Speed"):
        state.digital_io("FRI.Door")


def test_what_the_controller_left_out() -> None:
    bare = state_of(message(Release.V2_7, READY)._replace(robot=None, monitor=None), Release.V2_7)
    for name in ("safety_state", "drive_states", "measured_position_rad", "time_stamp", "measured_pose"):
        with pytest.raises(NotAvailable, match="the controller did not send it"):
            getattr(bare, name)
    assert bare.inputs_outputs == ()


def test_a_number_that_names_nothing() -> None:
    made = message(Release.V1_15, READY)
    assert made.robot is not None
    state = state_of(made._replace(robot=made.robot._replace(safety_state=9, control_mode=None)), Release.V1_15)
    with pytest.raises(NotAvailable, match=r"no safety state 9 .* names nothing"):
        _ = state.safety_state
    with pytest.raises(NotAvailable, match=r"no control mode .* did not send it"):
        _ = state.control_mode


def test_the_state_is_read_only() -> None:
    state = state_of(message(Release.V1_15, READY), Release.V1_15)
    for field in fields(state):
        with pytest.raises(FrozenInstanceError):
            setattr(state, field.name, None)


def test_exported_names_are_sorted_and_there() -> None:
    assert list(public.__all__) == sorted(public.__all__, key=lambda name: (not name.isupper(), name))
    assert all(hasattr(public, name) for name in public.__all__)
