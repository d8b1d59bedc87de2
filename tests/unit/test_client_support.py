"""Monitoring messages for the tests of the FRI client, and the test that they are what they claim to be."""

import pytest

from hil.values.fri import TRAITS, ClientCommandMode, OverlayType, Quality, Release, SessionState
from hil.values.fri_messages import (
    CommandMessage,
    ConnectionInfo,
    IOValue,
    IpoData,
    MonitorData,
    MonitoringMessage,
    Redundancy,
    RobotInfo,
    TimeStamp,
    Transformation,
)
from transport.fri import FriCodec

MEASURED = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
COMMANDED = (1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7)
INTERPOLATED = (2.1, 2.2, 2.3, 2.4, 2.5, 2.6, 2.7)
POSE = (500.0, 1.0, 600.0, 1.0, 0.0, 0.0, 0.0)
OUTPUTS = (
    IOValue("FRI.Speed", 2, 1, analog=0.5),
    IOValue("FRI.Count", 1, 1, digital=7),
    IOValue("FRI.Lamp", 0, 1, digital=0),
    IOValue("FRI.Key", 0, 0, digital=1),
)


def message(
    release: Release,
    state: SessionState,
    *,
    sequence: int = 0,
    mode: ClientCommandMode = ClientCommandMode.JOINT_POSITION,
    period_ms: int = 5,
    multiplier: int = 1,
) -> MonitoringMessage:
    """Return a complete monitoring message of ``release``."""
    traits = TRAITS[release]
    commanding = state >= SessionState.COMMANDING_WAIT
    cartesian = mode is ClientCommandMode.CARTESIAN_POSE
    ipo = IpoData(
        position=None if cartesian else INTERPOLATED,
        pose=Transformation("tool", POSE) if cartesian else None,
        redundancy=Redundancy(0, 0.25) if cartesian else None,
        client_command_mode=mode,
        overlay_type=OverlayType.CARTESIAN if cartesian else OverlayType.JOINT,
        tracking_performance=1.0 if state is SessionState.COMMANDING_ACTIVE else 0.0,
    )
    monitor = MonitorData(
        measured_position=MEASURED,
        measured_torque=(1.0,) * 7,
        commanded_position=COMMANDED if traits.commanded_position else None,
        commanded_torque=(2.0,) * 7,
        external_torque=(3.0,) * 7,
        external_force=(4.0,) * 6 if traits.external_force else None,
        inputs_outputs=OUTPUTS if traits.inputs_outputs else (),
        measured_pose=Transformation("", POSE) if traits.pose else None,
        redundancy=Redundancy(0, 0.3) if traits.pose else None,
        at=TimeStamp(1_795_322_363, 5),
    )
    quality = Quality.GOOD if state >= SessionState.MONITORING_READY else Quality.POOR
    return MonitoringMessage(
        sequence,
        0,
        RobotInfo(7, 0, (2,) * 7, 2, 0),
        monitor,
        ConnectionInfo(state, quality, period_ms, multiplier),
        ipo if commanding else None,
        (Transformation("PBase", POSE if traits.pose else (1.0, 0.0, 0.0, 0.0) * 3),),
    )


def datagram(
    release: Release,
    state: SessionState,
    *,
    sequence: int = 0,
    mode: ClientCommandMode = ClientCommandMode.JOINT_POSITION,
    multiplier: int = 1,
) -> bytes:
    """Return the datagram of :func:`message`."""
    return FriCodec(release).encode_monitoring(
        message(release, state, sequence=sequence, mode=mode, multiplier=multiplier)
    )


def read(release: Release, answer: bytes | None) -> CommandMessage:
    """Return the command message in ``answer``, which must be there."""
    assert answer is not None
    return FriCodec(release).decode_command(answer)


@pytest.mark.parametrize("release", Release)
@pytest.mark.parametrize("state", SessionState)
def test_made_messages_are_messages(release: Release, state: SessionState) -> None:
    made = message(release, state, sequence=3)
    assert FriCodec(release).decode_monitoring(datagram(release, state, sequence=3)) == made
