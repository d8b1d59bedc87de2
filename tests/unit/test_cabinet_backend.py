"""The link to a Cabinet, message by message: what is believed, what is answered, what it says of itself."""

import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from backends.cabinet import PLUGIN
from backends.cabinet.backend import MIRROR_RAD, CabinetBackend
from backends.cabinet.options import parse_options
from hil.values.arm import JointCommand, OverlayCommand, PeerBackend, seven
from hil.values.control import NO_WRENCH
from hil.values.errors import BackendError, ConfigurationError
from hil.values.fri import (
    TRAITS,
    ClientCommandMode,
    DriveState,
    OperationMode,
    Quality,
    Release,
    SafetyState,
    SessionState,
)
from hil.values.link import Address
from tests.support.cabinet_link import ACTIVE, CABINET, COMMANDED, HERE, MS, STILL, STRANGER, Link


@pytest.fixture(params=list(Release))
def link(request: pytest.FixtureRequest) -> Link:
    return Link(request.param)


def test_it_is_a_network_peer_that_paces_the_cycle(link: Link) -> None:
    assert isinstance(link.backend, PeerBackend)
    assert link.backend.capabilities.paces_the_cycle
    assert link.backend.capabilities.has_own_operator
    assert not link.backend.capabilities.takes_torque


def test_nothing_is_measured_before_the_first_message(link: Link) -> None:
    assert "does its robot application run" in link.backend.not_ready()
    with pytest.raises(BackendError, match="no message of a Cabinet came"):
        link.backend.read()
    assert link.say()
    assert not link.backend.not_ready()
    assert link.backend.read().position_rad == HERE


def test_in_monitoring_it_answers_as_a_client_that_does_not_command(link: Link) -> None:
    one = TRAITS[link.release].commanded_position
    for state in (SessionState.MONITORING_WAIT, SessionState.MONITORING_READY):
        link.say(state)
        assert link.position(STILL) == (COMMANDED if one else None)
        assert not link.condition().takes_commands
    assert "start the motion with an overlay in the robot application there" in link.condition().reason


def test_commanding_begins_where_the_set_point_mirrors_the_interpolator(link: Link) -> None:
    off = seven([*HERE[:3], HERE[3] + 10 * MIRROR_RAD, *HERE[4:]])
    link.say(SessionState.COMMANDING_WAIT)
    assert link.condition().held_position_rad == HERE
    assert link.position(off) is None
    assert "the set point of A4 is +0.00100 rad off its interpolator" in link.condition().reason
    link.say(SessionState.COMMANDING_WAIT)
    assert link.position(HERE) == HERE
    assert not link.condition().takes_commands
    link.say(SessionState.COMMANDING_ACTIVE)
    assert link.condition().takes_commands
    assert link.condition().held_position_rad is None
    assert link.position(off) == off


def test_an_interpolator_that_jumps_at_the_last_moment_is_not_commanded_from(link: Link) -> None:
    elsewhere = seven([value + 0.5 for value in HERE])
    link.say(SessionState.COMMANDING_WAIT)
    link.answer(HERE)
    link.say(SessionState.COMMANDING_ACTIVE, interpolator=elsewhere)
    assert not link.condition().takes_commands
    assert link.position(HERE) is None


def test_the_condition_is_one_object_while_nothing_changes(link: Link) -> None:
    for state in (SessionState.MONITORING_READY, SessionState.COMMANDING_WAIT, SessionState.COMMANDING_ACTIVE):
        link.say(state)
        link.answer(HERE)
        first = link.condition()
        for _ in range(3):
            link.say(state)
            if state is SessionState.COMMANDING_ACTIVE:
                link.answer(HERE)
                assert link.condition() is first


def test_velocity_is_of_the_time_between_two_messages_that_came() -> None:
    link = Link(cycle_ms=2)
    link.say()
    assert link.backend.read().velocity_rad_s == STILL
    link.say(position=seven([value + 0.002 for value in HERE]), periods=1)
    assert link.backend.read().velocity_rad_s == pytest.approx((1.0,) * 7)
    link.say(position=seven([value + 0.008 for value in HERE]), periods=3)
    assert link.backend.read().velocity_rad_s == pytest.approx((1.0,) * 7)
    assert link.count("lost") == 2


def test_duplicates_and_old_messages_are_no_measurements(link: Link) -> None:
    link.say()
    old = link.message()
    link.say()
    link.answer(STILL)
    sample = link.backend.read().sample
    assert not link.hear(link.message())
    assert not link.hear(old)
    assert link.backend.read().sample == sample
    assert link.answer(STILL) is None
    assert (link.count("duplicate"), link.count("old")) == (1, 1)


def test_counters_wrap(link: Link) -> None:
    link.counter = 2**32 - 2
    assert link.say()
    assert link.say()
    assert link.say()
    assert (link.counter, link.count("messages"), link.count("lost")) == (1, 3, 0)


def test_every_nth_message_is_answered(link: Link) -> None:
    answered = []
    for _ in range(9):
        link.say(multiplier=3)
        answered.append(link.answer(STILL) is not None)
    assert answered == [True, False, False] * 3


def test_an_answer_reflects_the_newest_message_and_counts_itself(link: Link) -> None:
    for number in range(3):
        link.say()
        answer = link.answer(STILL)
        assert answer is not None
        assert (answer.sequence_counter, answer.reflected_sequence_counter) == (number, link.counter)


def test_strangers_are_not_believed() -> None:
    for believed, sender in (("192.168.0.5", STRANGER), ("192.168.0.5:30201", CABINET)):
        link = Link(cabinet=believed)
        assert not link.hear(link.message(), sender=sender)
        assert link.count("strangers") == 1
    link = Link()
    link.say()
    assert not link.hear(link.message(), sender=STRANGER)
    assert link.count("strangers") == 1


def test_a_lost_cabinet_may_come_back_from_another_port_of_its_machine_only() -> None:
    link = Link()
    link.say()
    link.backend.advance(now_ns=100 * MS)
    link.counter += 1
    assert not link.hear(link.message(), sender=STRANGER, periods=200)
    assert link.hear(link.message(), sender=Address(CABINET.host, 30209))


@pytest.mark.parametrize(
    ("ours", "theirs", "told"),
    [
        (Release.V1_15, Release.V2_5, "2.x sends no commanded positions; configured: 1.15; set release = '2.5'"),
        (Release.V2_5, Release.V1_15, "1.x sends commanded positions; configured: 2.5; set release = '1.15'"),
        (Release.V2_7, Release.V2_5, "a message without length and CRC"),
        (Release.V2_5, Release.V2_7, "as release 2.7 sends it, not 2.5; set release = '2.7'"),
    ],
)
def test_a_wrong_release_is_told(ours: Release, theirs: Release, told: str) -> None:
    link, cabinet = Link(ours), Link(theirs)
    datagram = cabinet.codec.encode_monitoring(cabinet.message())
    assert not link.backend.receive(datagram, CABINET, now_ns=0)
    assert told in link.backend.not_ready()
    for _ in range(9):
        link.backend.receive(datagram, CABINET, now_ns=0)
    with pytest.raises(BackendError, match=f"is no message of release {ours}"):
        link.backend.not_ready()


@pytest.mark.parametrize(("period_ms", "told"), [(4, "set cycle_ms = 4"), (10, "let it send every 1, 2, 4 or 5 ms")])
def test_a_wrong_period_is_refused(period_ms: int, told: str) -> None:
    link = Link(cycle_ms=5)
    assert not link.say(period_ms=period_ms)
    with pytest.raises(BackendError, match=f"sends every {period_ms} ms, this station's cycle is 5 ms: {told}"):
        link.backend.not_ready()


def test_a_period_that_changes_on_the_way_is_a_lost_cabinet() -> None:
    link = Link()
    link.command()
    for _ in range(12):
        assert not link.say(SessionState.COMMANDING_ACTIVE, period_ms=2)
        link.backend.advance(now_ns=link.now_ns)
    assert "is lost" in link.condition().failure
    assert "sends every 2 ms, this station's cycle is 1 ms" in link.condition().failure


@pytest.mark.parametrize(
    "changes",
    [
        {"position": HERE[:6]},
        {"position": (*HERE[:6], float("nan"))},
        {"position": None},
        {"drives": ACTIVE[:3]},
        {"period_ms": None},
        {"operation_mode": 7},
        {"safety": 9},
    ],
)
def test_a_message_that_says_too_little_is_not_believed(changes: dict[str, Any]) -> None:
    link = Link()
    link.counter += 1
    message = link.message(**changes)
    assert not link.backend.receive(link.codec.encode_monitoring(message), CABINET, now_ns=0)
    assert link.count("malformed") == 1
    assert link.backend.not_ready()


def test_mode_safety_and_drives_pass_through(link: Link) -> None:
    off = (DriveState.OFF,) * 7
    link.say(operation_mode=OperationMode.T1, safety=SafetyState.SAFETY_STOP_LEVEL_1, drives=off)
    assert link.condition().operation_mode is OperationMode.T1
    assert link.condition().safety_state is SafetyState.SAFETY_STOP_LEVEL_1
    assert link.backend.read().drive_states == off
    assert "stopped (SAFETY_STOP_LEVEL_1): clear that there first" in link.condition().reason


def test_quality_is_told_where_it_is_why(link: Link) -> None:
    link.say(SessionState.MONITORING_WAIT, quality=Quality.FAIR)
    assert "rates the connection FAIR, GOOD is needed" in link.condition().reason


@pytest.mark.parametrize(
    ("mode", "told"),
    [
        (ClientCommandMode.TORQUE, "takes torques, this station says overlay = joint-position"),
        (ClientCommandMode.CARTESIAN_POSE, "Cartesian poses, which this link does not speak"),
        (ClientCommandMode.NONE, "takes nothing from a client"),
    ],
)
def test_a_motion_that_takes_something_else_is_not_commanded(mode: ClientCommandMode, told: str) -> None:
    link = Link(Release.V2_5)
    for state in (SessionState.COMMANDING_WAIT, SessionState.COMMANDING_ACTIVE):
        link.say(state, mode=mode)
        assert link.position(HERE) is None
        assert told in link.condition().reason


def test_an_overlay_is_zero_until_set_points_count() -> None:
    torque = (0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0)
    wrench = (0.0, 0.0, 7.0, 0.0, 0.0, 0.0)
    for overlay, mode, field, value in (
        ("torque", ClientCommandMode.TORQUE, "torque", torque),
        ("wrench", ClientCommandMode.WRENCH, "wrench", wrench),
    ):
        link = Link(overlay=overlay)
        told = []
        for state in (SessionState.COMMANDING_WAIT, SessionState.COMMANDING_ACTIVE):
            link.say(state, mode=mode)
            for asked in (OverlayCommand(torque, wrench), None):
                answer = link.answer(HERE, overlay=asked)
                if answer is not None:
                    assert answer.command is not None
                    told.append(getattr(answer.command, field))
                link.say(state, mode=mode)
        zero = tuple(0.0 for _ in value)
        assert told == [zero, zero, value, zero]


@pytest.mark.parametrize(
    ("command", "told"),
    [
        (JointCommand(HERE, STILL, torque_nm=STILL), "takes no torque commands"),
        (
            JointCommand(HERE, STILL, overlay=OverlayCommand(STILL, NO_WRENCH)),
            "passes no torques and no wrenches: overlay = joint-position",
        ),
        (JointCommand((*HERE[:6], float("inf")), STILL), "not finite"),
    ],
)
def test_what_it_lacks_is_refused(command: JointCommand, told: str) -> None:
    link = Link()
    link.say()
    with pytest.raises(BackendError, match=told):
        link.backend.write(command)


def test_silence_is_a_failure_until_it_is_acknowledged(link: Link) -> None:
    link.command()
    link.backend.advance(now_ns=link.now_ns + 10 * MS)
    assert not link.condition().failure
    link.backend.advance(now_ns=link.now_ns + 11 * MS)
    assert "is lost: no message for 11.0 ms, 10 ms are allowed; it was in COMMANDING_ACTIVE" in link.condition().failure
    link.backend.resume()
    assert link.condition().failure
    link.say(SessionState.COMMANDING_WAIT, periods=20)
    assert link.position(HERE) is None
    assert not link.condition().takes_commands
    link.backend.resume()
    assert not link.condition().failure
    link.say(SessionState.COMMANDING_WAIT)
    assert link.position(HERE) == HERE


def test_silence_may_be_three_periods_or_what_the_options_say() -> None:
    assert Link(cycle_ms=5).backend.link.silence_ns == 15 * MS
    assert Link(silence_ms=40).backend.link.silence_ns == 40 * MS


def test_a_closed_session_is_a_failure(link: Link) -> None:
    link.command()
    link.say(SessionState.IDLE)
    assert link.answer(HERE) is None
    assert "closed the FRI session" in link.condition().failure
    link.backend.resume()
    assert "closed the FRI session" in link.condition().failure
    link.say(SessionState.MONITORING_WAIT)
    link.backend.resume()
    assert not link.condition().failure


def test_commanding_that_is_left_under_a_moving_arm_is_a_failure_and_at_rest_it_is_none(link: Link) -> None:
    link.command()
    link.say(SessionState.MONITORING_READY)
    assert not link.condition().failure
    assert not link.condition().takes_commands
    link.command()
    link.say(SessionState.COMMANDING_ACTIVE)
    link.answer(HERE, (0.1,) * 7)
    link.say(SessionState.MONITORING_WAIT, quality=Quality.FAIR)
    assert "under a moving arm: it is in MONITORING_WAIT, quality FAIR" in link.condition().failure


def test_counters_that_begin_anew_are_a_new_session() -> None:
    link = Link()
    link.counter = 5000
    link.command()
    link.counter = -1
    assert link.say(SessionState.COMMANDING_ACTIVE, position=seven([value + 0.5 for value in HERE]))
    assert link.backend.read().velocity_rad_s == STILL
    assert link.count("restarts") == 1
    assert "counts its messages anew while it was commanded" in link.condition().failure


def test_a_shadow_never_commands(link: Link) -> None:
    shadow = Link(link.release, shadow=True)
    for state in (SessionState.COMMANDING_WAIT, SessionState.COMMANDING_ACTIVE):
        shadow.say(state)
        assert shadow.position(HERE) is None
        assert shadow.condition().reason == "shadow: this controller only watches the Cabinet"


def test_after_close_nothing_is_sent_or_believed(link: Link) -> None:
    link.command()
    link.say(SessionState.COMMANDING_ACTIVE)
    link.backend.write(JointCommand(HERE, STILL))
    link.backend.step()
    link.backend.close()
    link.backend.close()
    assert not link.backend.outgoing()
    assert not link.say(SessionState.COMMANDING_ACTIVE)
    with pytest.raises(BackendError, match="that is not open"):
        link.backend.step()
    link.backend.open(period_ns=MS)
    assert link.backend.not_ready()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"bnd": "x"}, "there is no 'bnd'; valid: release, bind"),
        ({"release": "3.0"}, "release: "),
        ({"overlay": "cartesian-pose"}, "the link to a Cabinet speaks joint-position, torque, wrench"),
        ({"silence_ms": 0}, "silence_ms: "),
        ({"bind": "127.0.0.1:x"}, "the port 'x' is no number"),
        ({"connect_s": -1}, "connect_s: "),
    ],
)
def test_options_that_cannot_be_are_refused(options: dict[str, object], told: str) -> None:
    with pytest.raises(ConfigurationError, match="options of the backend cabinet") as caught:
        PLUGIN.check_options(options)
    assert told in str(caught.value)


def test_a_cycle_it_cannot_keep_is_refused() -> None:
    backend = CabinetBackend(parse_options({}), cycle_ns=MS)
    for period_ns in (500_000, 6 * MS):
        with pytest.raises(ConfigurationError, match="control cycle"):
            backend.open(period_ns=period_ns)


@given(data=st.data(), release=st.sampled_from(list(Release)))
def test_no_datagram_raises_or_is_answered_with_a_set_point_that_nobody_wrote(
    data: st.DataObject, release: Release
) -> None:
    """Whatever comes instead of a message, an answer commands what was written or nothing."""
    link = Link(release)
    link.say()
    seed = data.draw(st.integers(0, 2**32))
    chance = random.Random(seed)
    states = list(SessionState)
    for _ in range(20):
        link.counter += 1
        datagram = bytearray(link.codec.encode_monitoring(link.message(chance.choice(states))))
        for _ in range(chance.choice((0, 1, 1, 4))):
            datagram[chance.randrange(len(datagram))] = chance.randrange(256)
        cut = chance.choice((len(datagram), len(datagram), chance.randrange(len(datagram))))
        link.now_ns += MS
        link.backend.receive(bytes(datagram[:cut]), CABINET, now_ns=link.now_ns)
        held = link.condition().held_position_rad or link.backend.read().position_rad
        answer = link.answer(held)
        if answer is not None and answer.command is not None and link.count("session") not in {
            "MONITORING_WAIT", "MONITORING_READY"
        }:  # fmt: skip
            assert answer.command.position == held
