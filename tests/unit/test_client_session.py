"""The client session: what it answers, counts and refuses, without a socket."""

import math
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.client.fri import (
    ClientSession,
    Command,
    CommandShape,
    FriHandler,
    FriState,
    NotAvailable,
    Outcome,
    Release,
    SessionState,
    Transformation,
    UsageError,
    WrongSignal,
    make_transformation,
)
from hil.values.errors import ConfigurationError, UnknownName
from hil.values.fri import ClientCommandMode
from hil.values.fri_messages import CommandData, IOValue, MonitoringMessage, Redundancy
from tests.unit.test_client_support import COMMANDED, INTERPOLATED, POSE, datagram, message, read
from transport.fri import FriCodec

ONE = [release for release in Release if release.startswith("1")]
TWO = [release for release in Release if release.startswith("2")]
MONITORING = (SessionState.MONITORING_WAIT, SessionState.MONITORING_READY)
COMMANDING = (SessionState.COMMANDING_WAIT, SessionState.COMMANDING_ACTIVE)
WAIT, ACTIVE = COMMANDING
ELSEWHERE = (9.0,) * 7


class Fixed(FriHandler):
    """Returns the same command everywhere, and notes the calls."""

    def __init__(self, command: Command | None = None) -> None:
        self.returned = command
        self.calls: list[str] = []
        self.changes: list[tuple[SessionState, SessionState, SessionState]] = []

    def on_state_change(self, old: SessionState, new: SessionState) -> None:
        self.changes.append((old, new, self.robot_state.session_state))

    def monitor(self, state: FriState) -> Command | None:
        self.calls.append("monitor")
        return self.returned

    def wait_for_command(self, state: FriState) -> Command | None:
        self.calls.append("wait_for_command")
        return self.returned

    def command(self, state: FriState) -> Command | None:
        self.calls.append("command")
        return self.returned


def answer_data(
    release: Release,
    state: SessionState,
    command: Command | None = None,
    mode: ClientCommandMode = ClientCommandMode.JOINT_POSITION,
) -> CommandData | None:
    """Return what the session answers to one message."""
    session = ClientSession(release, Fixed(command))
    return read(release, session.receive(datagram(release, state, mode=mode))).command


@pytest.mark.parametrize("state", MONITORING)
def test_monitoring_answers_with_the_commanded_position_in_1x_and_a_header_in_2x(state: SessionState) -> None:
    assert {answer_data(release, state) for release in ONE} == {CommandData(position=COMMANDED)}
    assert {answer_data(release, state) for release in TWO} == {None}


@pytest.mark.parametrize("release", Release)
@pytest.mark.parametrize("state", COMMANDING)
def test_commanding_mirrors_what_the_mode_needs(release: Release, state: SessionState) -> None:
    def mirrored(mode: ClientCommandMode) -> CommandData | None:
        return answer_data(release, state, mode=mode)

    assert mirrored(ClientCommandMode.JOINT_POSITION) == CommandData(position=INTERPOLATED)
    assert mirrored(ClientCommandMode.TORQUE) == CommandData(position=INTERPOLATED, torque=(0.0,) * 7)
    assert mirrored(ClientCommandMode.WRENCH) == CommandData(position=INTERPOLATED, wrench=(0.0,) * 6)


@pytest.mark.parametrize("release", TWO)
def test_pose_mode_mirrors_and_takes_the_pose(release: Release) -> None:
    mode = ClientCommandMode.CARTESIAN_POSE
    mirrored = CommandData(pose=Transformation("tool", POSE), redundancy=Redundancy(0, 0.25))
    assert answer_data(release, WAIT, mode=mode) == mirrored
    there = (501.0, *POSE[1:])
    assert answer_data(release, ACTIVE, Command(pose=there, e1_rad=0.5), mode) == CommandData(
        pose=Transformation("tool", there), redundancy=Redundancy(0, 0.5)
    )


@pytest.mark.parametrize("release", Release)
def test_a_command_replaces_only_what_it_gives(release: Release) -> None:
    mode = ClientCommandMode.TORQUE
    assert answer_data(release, ACTIVE, Command(joint_position_rad=ELSEWHERE)) == CommandData(position=ELSEWHERE)
    assert answer_data(release, ACTIVE, Command(torque_nm=(5.0,) * 7), mode) == CommandData(
        position=INTERPOLATED, torque=(5.0,) * 7
    )
    assert answer_data(release, WAIT, Command(joint_position_rad=ELSEWHERE), mode) == CommandData(
        position=ELSEWHERE, torque=(0.0,) * 7
    )
    assert answer_data(release, ACTIVE, Command(wrench=(6.0,) * 6), ClientCommandMode.WRENCH) == CommandData(
        position=INTERPOLATED, wrench=(6.0,) * 6
    )


@pytest.mark.parametrize("release", [release for release in Release if release is not Release.V1_11])
def test_outputs_are_sent_by_name_with_the_type_the_controller_listed(release: Release) -> None:
    command = Command(outputs={"FRI.Speed": 1, "FRI.Count": 9, "FRI.Lamp": True})
    data = answer_data(release, SessionState.MONITORING_READY, command)
    assert data is not None
    assert data.inputs_outputs == (
        IOValue("FRI.Speed", 2, 1, analog=1.0),
        IOValue("FRI.Count", 1, 1, digital=9),
        IOValue("FRI.Lamp", 0, 1, digital=1),
    )
    with pytest.raises(UnknownName, match=r"unknown output 'FRI.Door'; valid: FRI.Speed, FRI.Count, FRI.Lamp"):
        answer_data(release, SessionState.MONITORING_READY, Command(outputs={"FRI.Door": True}))


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        (
            "FRI.Key",
            True,
            "FRI.Key: it is an input, which a client cannot set; outputs: FRI.Speed, FRI.Count, FRI.Lamp",
        ),
        ("FRI.Speed", True, "FRI.Speed: it is analog and cannot be True; valid: a finite number"),
        ("FRI.Speed", math.nan, "FRI.Speed: it is analog and cannot be nan; valid: a finite number"),
        ("FRI.Count", 1.5, "FRI.Count: it is digital and cannot be 1.5; valid: a whole number 0 ... 2^64 - 1"),
        ("FRI.Count", -1, "FRI.Count: it is digital and cannot be -1; valid: a whole number"),
        ("FRI.Count", 1 << 64, "FRI.Count: it is digital and cannot be 18446744073709551616; valid: a whole number"),
        ("FRI.Lamp", 2, "FRI.Lamp: it is boolean and cannot be 2; valid: true or false"),
    ],
)
def test_an_output_that_cannot_be_set_so_is_refused_in_words(name: str, value: float, sentence: str) -> None:
    with pytest.raises(WrongSignal) as caught:
        answer_data(Release.V1_15, SessionState.MONITORING_READY, Command(outputs={name: value}))
    assert sentence in str(caught.value)


@pytest.mark.parametrize("state", [SessionState.MONITORING_READY, WAIT, ACTIVE])
def test_a_command_without_a_mirror_holds_what_it_gives_and_nothing_else(state: SessionState) -> None:
    assert answer_data(Release.V1_15, state, Command(mirror=False)) is None
    told = answer_data(Release.V1_15, state, Command(outputs={"FRI.Count": 1}, mirror=False))
    assert told == CommandData(inputs_outputs=(IOValue("FRI.Count", 1, 1, digital=1),))


@pytest.mark.parametrize("release", Release)
def test_a_transformation_is_made_as_the_release_has_it(release: Release) -> None:
    heard = datagram(release, ACTIVE)
    session = ClientSession(release, FriHandler())
    session.receive(heard)
    assert session.state is not None
    made = make_transformation(session.state, "PBase", (1.0, 2.0, 3.0), (2.0, 0.0, 0.0, 2.0))
    half = math.sqrt(0.5)
    quarter = (0.0, -1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 3.0)
    assert made.values == pytest.approx(quarter if release in ONE else (1.0, 2.0, 3.0, half, 0.0, 0.0, half))
    assert made.at == session.state.time_stamp
    with pytest.raises(ConfigurationError, match="finite"):
        make_transformation(session.state, "PBase", (math.nan, 0.0, 0.0))


def test_outputs_do_not_exist_in_1_11() -> None:
    with pytest.raises(NotAvailable, match=r"no input or output in FRI 1\.11 in session state COMMANDING_ACTIVE"):
        answer_data(Release.V1_11, ACTIVE, Command(outputs={"FRI.Lamp": True}))


@pytest.mark.parametrize("release", Release)
def test_transformations_are_sent_when_asked_for_and_of_the_right_size(release: Release) -> None:
    values = (1.0, 2.0, 3.0, 4.0) * 3 if release in ONE else POSE
    wanted = Transformation("PBase", values)
    data = answer_data(release, SessionState.MONITORING_WAIT, Command(transformations=(wanted,)))
    assert data is not None
    assert data.transformations == (wanted,)
    with pytest.raises(UnknownName, match="unknown requested transformation 'Other'; valid: PBase"):
        answer_data(release, ACTIVE, Command(transformations=(Transformation("Other", values),)))
    with pytest.raises(CommandShape, match="has 3 elements"):
        answer_data(release, ACTIVE, Command(transformations=(Transformation("PBase", (1.0, 2.0, 3.0)),)))


@pytest.mark.parametrize("release", ONE)
@pytest.mark.parametrize("command", [Command(pose=POSE), Command(e1_rad=0.1)])
def test_a_pose_is_refused_in_1x(release: Release, command: Command) -> None:
    with pytest.raises(NotAvailable, match=f"no pose command in FRI {release.value} in session state"):
        answer_data(release, ACTIVE, command)


@pytest.mark.parametrize(("field", "want"), [("joint_position_rad", 7), ("torque_nm", 7), ("wrench", 6), ("pose", 7)])
def test_a_command_of_the_wrong_shape_is_refused_where_it_is_made(field: str, want: int) -> None:
    wrong: dict[str, Any] = {field: (0.0,) * 5}
    with pytest.raises(CommandShape, match=f"{field} of a command has 5 elements, {want} are needed") as caught:
        Command(**wrong)
    assert isinstance(caught.value, UsageError)


@pytest.mark.parametrize("release", Release)
def test_a_session_from_idle_to_idle(release: Release) -> None:
    handler = Fixed()
    session = ClientSession(release, handler)
    order = [SessionState.IDLE, *MONITORING, *COMMANDING, SessionState.MONITORING_READY, SessionState.IDLE]
    for sequence, state in enumerate(order):
        assert not session.ended
        answer = session.receive(datagram(release, state, sequence=sequence))
        assert (answer is None) == (state is SessionState.IDLE)
        if answer is not None:
            assert read(release, answer)[:2] == (sequence - 1, sequence)
        assert session.state is not None
        assert session.state.session_state is state
    assert session.ended
    assert (session.received, session.answered, dict(session.malformed)) == (7, 5, {})
    assert handler.calls == ["monitor", "monitor", "wait_for_command", "command", "monitor"]
    assert handler.changes == [(old, new, new) for old, new in pairwise(order)]
    session.receive(datagram(release, SessionState.MONITORING_WAIT))
    assert not session.ended


def test_every_nth_message_is_answered_and_every_one_reaches_the_handler() -> None:
    handler = Fixed()
    session = ClientSession(Release.V1_15, handler)
    reflected = []
    for sequence in range(10):
        answer = session.receive(datagram(Release.V1_15, ACTIVE, sequence=sequence, multiplier=4))
        if answer is not None:
            reflected.append(read(Release.V1_15, answer)[:2])
    assert reflected == [(0, 3), (1, 7)]
    assert handler.calls == ["command"] * 10


def test_counters_wrap() -> None:
    session = ClientSession(Release.V2_7, FriHandler())
    session._sequence = (1 << 32) - 1
    last = (1 << 32) - 1
    headers = [
        read(Release.V2_7, session.receive(datagram(Release.V2_7, ACTIVE, sequence=sequence)))[:2]
        for sequence in (last, 0, 1)
    ]
    assert headers == [(last, last), (0, 0), (1, 1)]


@pytest.mark.parametrize("release", Release)
def test_malformed_datagrams_are_counted_by_outcome_and_change_nothing(release: Release) -> None:
    handler = Fixed()
    session = ClientSession(release, handler)
    other = Release.V1_15 if release is Release.V2_7 else Release.V2_7
    whole = datagram(release, ACTIVE)
    for bad in (b"", bytes(1501), datagram(other, ACTIVE), bytes([0xFF]) * 40, whole[:-1]):
        assert session.receive(bad) is None
    broken = Outcome.FRAMING if release is Release.V2_7 else Outcome.UNDECODABLE
    assert session.malformed == {
        Outcome.TOO_SHORT: 1,
        Outcome.TOO_LONG: 1,
        Outcome.OTHER_RELEASE: 1,
        broken: 2,
    }
    assert (session.received, session.answered, session.state, handler.calls) == (0, 0, None, [])


def incomplete(release: Release) -> list[MonitoringMessage]:
    """Return messages that decode but cannot be mirrored."""
    whole = message(release, ACTIVE)
    assert whole.connection is not None
    assert whole.ipo is not None
    assert whole.monitor is not None
    return [
        whole._replace(connection=None),
        whole._replace(connection=whole.connection._replace(session_state=9)),
        whole._replace(connection=whole.connection._replace(quality=9)),
        whole._replace(ipo=None),
        whole._replace(ipo=whole.ipo._replace(position=None)),
        whole._replace(ipo=whole.ipo._replace(position=(0.0,) * 6)),
        whole._replace(ipo=whole.ipo._replace(client_command_mode=9)),
        whole._replace(ipo=whole.ipo._replace(client_command_mode=ClientCommandMode.CARTESIAN_POSE)),
        whole._replace(monitor=whole.monitor._replace(measured_position=(0.0,) * 8)),
    ]


@pytest.mark.parametrize("release", Release)
def test_messages_that_cannot_be_mirrored_are_counted_as_shape(release: Release) -> None:
    session = ClientSession(release, FriHandler())
    bad = incomplete(release)
    for message_ in bad:
        assert session.receive(FriCodec(release).encode_monitoring(message_)) is None
    assert session.malformed == {Outcome.SHAPE: len(bad)}
    assert session.received == 0


def test_1x_monitoring_without_a_commanded_position_is_counted_as_shape() -> None:
    whole = message(Release.V1_11, SessionState.MONITORING_READY)
    session = ClientSession(Release.V1_11, FriHandler())
    assert session.receive(FriCodec(Release.V1_11).encode_monitoring(whole._replace(monitor=None))) is None
    assert session.malformed == {Outcome.SHAPE: 1}


@given(release=st.sampled_from(Release), noise=st.binary(max_size=60), at=st.integers(0, 600))
def test_no_datagram_raises(release: Release, noise: bytes, at: int) -> None:
    whole = datagram(release, ACTIVE)
    session = ClientSession(release, FriHandler())
    for bad in (noise, whole[:at] + noise + whole[at:], whole[:at] + noise):
        session.receive(bad)
    assert session.received + session.malformed.total() == 3


def test_a_vector_may_be_an_array() -> None:
    numpy = pytest.importorskip("numpy")
    command = Command(joint_position_rad=numpy.full(7, 0.5))
    assert answer_data(Release.V2_5, ACTIVE, command) == CommandData(position=(0.5,) * 7)


def test_an_error_of_the_handler_is_the_callers() -> None:
    class Failing(FriHandler):
        def command(self, state: FriState) -> Command:
            raise RuntimeError("mine")

    with pytest.raises(RuntimeError, match="mine"):
        ClientSession(Release.V1_16, Failing()).receive(datagram(Release.V1_16, ACTIVE))
