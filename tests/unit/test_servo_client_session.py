"""The client's session against the stand-in controller, packet by packet."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.client.servo import (
    ConfigurationError,
    ControllerSilent,
    EndpointError,
    IllegalStateException,
    Role,
    SessionRefused,
    SmartServo,
)
from hil.client.servo import _operations as operations
from hil.client.servo._operations import Wait
from hil.client.servo._requests import MAX_OUTSTANDING, MAX_SUPERSEDED
from hil.client.servo.session import MAX_GOALS, PHASES, SessionPhase
from hil.values.motion import FineInterpolatorState
from hil.values.outcomes import Outcome
from hil.values.servo import (
    MAX_REQUESTS_IN_PACKET,
    MAX_VECTOR_NUMBERS,
    PROTOCOL_VERSION,
    Command,
    Ended,
    FromController,
    GoalReached,
    Goodbye,
    Hello,
    MotionEnded,
    Refused,
    RequestDone,
    RequestError,
    SetRuntimeParameters,
    State,
    StopMotion,
    Welcome,
)
from tests.support.servo_client import (
    ADDRESS,
    CODEC,
    NONCE,
    Channel,
    RecordingSession,
    VirtualShell,
    connected,
    destination,
    phase_of,
    sent,
    tell,
)
from tests.support.servo_controller import ROBOT, SOFTWARE, UNIX_EPOCH_NS, StandIn

# The handshake


def test_a_session_says_hello_takes_the_offer_and_runs_with_the_first_state() -> None:
    session = RecordingSession()
    assert session.outgoing() is None
    session.knock()
    first = session.outgoing()
    assert first is not None
    assert CODEC.decode_from_client(first) == Hello(PROTOCOL_VERSION, NONCE, Role.COMMANDER, 300, 5, "a test")
    assert session.outgoing() is None
    tell(session, Welcome(PROTOCOL_VERSION, NONCE, 9, SOFTWARE, ROBOT, 1, UNIX_EPOCH_NS))
    assert sent(session) == Command(9, 1, 0)
    assert phase_of(session) is SessionPhase.JOINING
    tell(session, State(9, 1, 1, 0, StandIn(CODEC).snapshot()))
    assert phase_of(session) is SessionPhase.RUNNING
    assert session.snapshot is not None
    assert session.outcomes == {Outcome.ACCEPTED: 2}


def test_a_session_nobody_answers_is_one_sentence_that_says_what_to_check() -> None:
    shell = VirtualShell(there=Channel(1, loss=1.0))
    with pytest.raises(ControllerSilent) as caught:
        shell.run(operations.connect(shell.session, controller=ADDRESS, timeout_s=0.5))
    assert isinstance(caught.value, EndpointError)
    assert str(caught.value) == (
        "no session with the controller at UDP 127.0.0.1:30300 within 0.5 s; "
        "does a controller with a servo link run at that address, with this key, and no firewall between?"
    )
    assert (shell.ticks, shell.session.sent) == (500, 10)


def test_what_is_no_controllers_packet_is_named_when_nothing_else_came() -> None:
    shell = VirtualShell(there=Channel(1, loss=1.0))
    shell.session.receive(b"no packet")
    with pytest.raises(ControllerSilent, match=r"no controller's packet \(1 \w+\): do both sides have the same key"):
        shell.run(operations.connect(shell.session, controller=ADDRESS, timeout_s=0.1))


def test_an_offer_without_states_is_asked_for_anew_with_another_nonce() -> None:
    shell = VirtualShell()
    shell.controller.answers_commands = False
    with pytest.raises(ControllerSilent, match="offered one and then sent no state"):
        shell.run(operations.connect(shell.session, controller=ADDRESS, timeout_s=1.0))
    nonces = [hello.nonce for hello in shell.controller.hellos]
    assert nonces == sorted(set(nonces))
    assert nonces[:2] == [NONCE, NONCE + 1]


def test_a_refusal_that_time_may_change_is_waited_out() -> None:
    shell = VirtualShell()
    shell.controller.refusal = Refused(PROTOCOL_VERSION, 0, "the arm is commanded by another", try_again=True)
    shell.at[1234] = lambda: setattr(shell.controller, "refusal", None)
    shell.connect()
    assert 1234 < shell.ticks < 1300
    assert shell.session.running
    assert shell.session.refusal is None


@pytest.mark.parametrize("try_again", [False, True])
def test_a_refusal_has_the_controllers_words(try_again: bool) -> None:
    shell = VirtualShell()
    shell.controller.refusal = Refused(PROTOCOL_VERSION, 0, "not today", try_again=try_again)
    with pytest.raises(SessionRefused, match=r"at UDP 127\.0\.0\.1:30300 gives no session: not today") as caught:
        shell.run(operations.connect(shell.session, controller=ADDRESS, timeout_s=1.0))
    assert caught.value.reason == "not today"
    assert (shell.ticks == 1000) is try_again


@pytest.mark.parametrize("version", [PROTOCOL_VERSION - 1, PROTOCOL_VERSION + 1])
def test_a_controller_of_another_version_is_told_in_words(version: int) -> None:
    session = RecordingSession()
    session.knock()
    tell(session, Refused(version, NONCE, "the application speaks another version", try_again=False))
    assert session.refused_for_good
    assert session.refusal is not None
    assert session.refusal.reason == "the application speaks another version"
    session = RecordingSession()
    session.knock()
    tell(session, Welcome(version, NONCE, 9, "fri-hil another", ROBOT, 1, UNIX_EPOCH_NS))
    assert session.refused_for_good
    assert session.refusal is not None
    assert session.refusal.reason == (
        f"the controller (fri-hil another) speaks version {version} of the servo link, this application version "
        f"{PROTOCOL_VERSION}: install the same fri-hil on both sides"
    )
    tell(session, State(9, 1, 1, 0, StandIn(CODEC).snapshot()))
    assert not session.running


# Packets that are not taken


@pytest.mark.parametrize("phase", SessionPhase)
def test_packets_that_are_not_in_the_table_change_nothing(phase: SessionPhase) -> None:
    snapshot = StandIn(CODEC).snapshot()
    packets: list[FromController] = [
        Welcome(PROTOCOL_VERSION, NONCE, 9, SOFTWARE, ROBOT, 1, 0),
        Refused(PROTOCOL_VERSION, NONCE, "no", try_again=False),
        State(0, 1, 1, 0, snapshot),
        Ended(0, "over"),
    ]
    for packet in packets:
        session = RecordingSession()
        session.phase = phase
        tell(session, packet)
        assert session.phase is PHASES.get((phase, type(packet)), phase)
        taken = (phase, type(packet)) in PHASES
        assert session.outcomes == {Outcome.ACCEPTED if taken else Outcome.UNKNOWN_SESSION: 1}


def test_packets_of_another_session_are_counted_and_ignored() -> None:
    session = RecordingSession()
    session.knock()
    tell(session, Welcome(PROTOCOL_VERSION, NONCE + 1, 8, SOFTWARE, ROBOT, 1, 0))
    tell(session, Refused(PROTOCOL_VERSION, NONCE - 1, "no", try_again=False))
    assert phase_of(session) is SessionPhase.GREETING
    tell(session, Welcome(PROTOCOL_VERSION, NONCE, 9, SOFTWARE, ROBOT, 1, 0))
    tell(session, State(8, 1, 1, 0, StandIn(CODEC).snapshot()))
    tell(session, Ended(8, "over"))
    assert phase_of(session) is SessionPhase.JOINING
    assert session.outcomes == {Outcome.UNKNOWN_SESSION: 4, Outcome.ACCEPTED: 1}


def test_older_and_repeated_states_are_counted_and_ignored() -> None:
    shell = connected()
    states = [CODEC.encode_from_controller(shell.controller.state()) for _ in range(3)]
    shell.session.outcomes.clear()
    for state in (states[1], states[1], states[0], states[2]):
        shell.session.receive(state)
    assert shell.session.outcomes == {Outcome.ACCEPTED: 2, Outcome.DUPLICATE: 1, Outcome.REORDERED: 1}


@given(datagram=st.binary(max_size=200))
def test_no_bytes_raise(datagram: bytes) -> None:
    session = RecordingSession()
    session.receive(datagram)
    assert session.outcomes.total() == 1


@given(seed=st.integers(0, 2**32), flips=st.integers(1, 8))
def test_no_damaged_packet_raises(seed: int, flips: int) -> None:
    shell = connected()
    rng = random.Random(seed)
    damaged = bytearray(CODEC.encode_from_controller(shell.controller.state()))
    for _ in range(flips):
        damaged[rng.randrange(len(damaged))] ^= 1 << rng.randrange(8)
    before = shell.session.outcomes.total()
    shell.session.receive(bytes(damaged))
    assert shell.session.outcomes.total() == before + 1


# Requests


def test_requests_travel_oldest_first_until_they_are_done() -> None:
    session = connected().session
    session.outgoing()
    for _ in range(MAX_REQUESTS_IN_PACKET + 2):
        session.ask(lambda number: SetRuntimeParameters(number, 5, 0.1))
    first = sent(session)
    assert [request.number for request in first.requests] == [1, 2, 3, 4, 5, 6]
    assert session.outgoing() is None
    tell(session, State(1001, 50, first.sequence, 4, StandIn(CODEC).snapshot()))
    assert [request.number for request in sent(session).requests] == [5, 6, 7, 8]
    tell(session, State(1001, 51, first.sequence, 8, StandIn(CODEC).snapshot()))
    assert session.outgoing() is None


def test_requests_are_bounded() -> None:
    session = connected().session
    for _ in range(MAX_OUTSTANDING):
        session.ask(lambda number: StopMotion(number, 1))
    with pytest.raises(IllegalStateException, match="64 requests wait for the controller already"):
        session.ask(lambda number: StopMotion(number, 1))
    assert len(session.requests) == MAX_OUTSTANDING


def test_a_superseded_destination_is_not_sent_again_and_shares_the_outcome_of_the_newer_one() -> None:
    session = connected().session
    first, second = session.ask(destination(5, 0.1)), session.ask(destination(5, 0.2))
    other = session.ask(destination(6, 0.3))
    third = session.ask(destination(5, 0.4))
    assert [request.number for request in sent(session).requests] == [3, 4]
    assert session.requests.superseded == 2
    done = RequestDone(1, 4, 123)
    tell(session, State(1001, 50, 9, 4, StandIn(CODEC).snapshot(), (RequestDone(1, 3, 99), done._replace(number=2))))
    assert first.done == second.done == third.done == done._replace(number=2)
    assert other.done == RequestDone(1, 3, 99)


def test_a_superseded_destination_that_arrived_all_the_same_has_its_own_outcome() -> None:
    session = connected().session
    first = session.ask(destination(5, 0.1))
    assert [request.number for request in sent(session).requests] == [1]
    second, third = session.ask(destination(5, 0.2)), session.ask(destination(5, 0.3))
    tell(session, State(1001, 50, 9, 1, StandIn(CODEC).snapshot(), (RequestDone(1, 1, 11),)))
    assert first.done == RequestDone(1, 1, 11)
    assert second.done is third.done is None
    tell(session, State(1001, 51, 9, 3, StandIn(CODEC).snapshot(), (RequestDone(2, 3, 33),)))
    assert first.done == RequestDone(1, 1, 11)
    assert second.done == third.done == RequestDone(2, 3, 33)


def test_superseded_destinations_that_wait_for_an_answer_are_bounded() -> None:
    session = connected().session
    asked = [session.ask(destination(5, 1e-6 * place)) for place in range(MAX_SUPERSEDED + 11)]
    given_up = [pending for pending in asked if pending.done is not None]
    assert given_up == asked[:10]
    assert {pending.done.error for pending in given_up if pending.done} == {RequestError.ILLEGAL_STATE}
    assert given_up[0].done is not None
    assert "1024 newer destinations followed" in given_up[0].done.reason
    assert len(session.requests._unresolved) == MAX_SUPERSEDED + 1
    newest = asked[-1].request.number
    tell(session, State(1001, 50, 9, newest, StandIn(CODEC).snapshot(), (RequestDone(1, newest, 33),)))
    assert {pending.done for pending in asked[10:]} == {RequestDone(1, newest, 33)}
    assert not session.requests._unresolved


def test_a_motion_whose_end_was_lost_is_over_once_nothing_more_is_to_be_told() -> None:
    shell = connected()
    record, session = shell.start().record, shell.session
    assert record is not None
    waiting = session.ask(SmartServo().request).request.number
    nothing_runs, seen = StandIn(CODEC).snapshot(), session.reports_seen
    tell(session, State(1001, 50, 9, 1, nothing_runs))
    assert set(session.motions) == {record.number, waiting}  # no report was lost: that of its end is on its way
    tell(session, State(1001, 51, 9, 1, nothing_runs, (RequestDone(seen + 3, 77, 0),)))
    assert session.reports_lost == 2
    assert set(session.motions) == {record.number, waiting}  # others may be on their way
    tell(session, State(1001, 52, 9, 1, nothing_runs))
    assert record.ended is not None
    assert record.ended.reason == "the controller's report of how this motion ended was lost"
    assert set(session.motions) == {waiting}


def test_goals_that_a_busy_handler_is_not_told_are_bounded_and_counted() -> None:
    shell = connected()
    motion = shell.start()
    assert motion.record is not None
    motion.record.on_goal = lambda _: None
    session, number = shell.session, motion.record.number
    first = session.reports_seen + 1
    for place in range(MAX_GOALS + 5):
        report = GoalReached(first + place, number, place, FineInterpolatorState.RESTING, (0.0,) * 7)
        session._take_report(report)
    assert len(session.goals) == MAX_GOALS
    assert session.goals_lost == 5
    assert session.goals[0].report.at_ns == 5


def test_an_outcome_the_controller_gave_up_is_said_to_be_lost() -> None:
    session = connected().session
    lost, kept = (session.ask(lambda number: StopMotion(number, 1)) for _ in range(2))
    tell(session, State(1001, 50, 9, 2, StandIn(CODEC).snapshot(), (RequestDone(4, 2, 1),)))
    assert kept.done == RequestDone(4, 2, 1)
    assert lost.done is not None
    assert lost.done.reason == "the controller's answer to this request was lost"
    assert session.reports_lost == 3


def test_what_a_call_lets_through_the_codec_can_send() -> None:
    longest = SmartServo([1e308] * MAX_VECTOR_NUMBERS).request(1)
    taken = CODEC.decode_from_client(CODEC.encode_from_client(Command(1, 1, 0, requests=(longest,))))
    assert isinstance(taken, Command)
    assert taken.requests == (longest,)
    too_long = longest._replace(destination=(0.0,) * (MAX_VECTOR_NUMBERS + 1))
    with pytest.raises(ConfigurationError):
        CODEC.encode_from_client(Command(1, 1, 0, requests=(too_long,)))


# When it speaks


def test_it_speaks_when_there_is_something_to_say_and_not_else() -> None:
    shell = connected()
    session = shell.session
    shell.wait(Wait(lambda: False, 0.02))
    assert session.outgoing() is None
    tell(session, State(1001, 50, 1, 0, StandIn(CODEC).snapshot()))
    assert session.outgoing() is None
    session.keep_alive()
    assert not sent(session).requests
    assert session.outgoing() is None
    tell(session, State(1001, 51, 1, 0, StandIn(CODEC).snapshot(), (MotionEnded(1, 5, 1, 2, "", ""),)))  # type: ignore[arg-type]
    assert sent(session).reports_seen == 1
    # The acknowledgement was lost: the report comes again, and is acknowledged again.
    tell(session, State(1001, 52, 1, 0, StandIn(CODEC).snapshot(), (MotionEnded(1, 5, 1, 2, "", ""),)))  # type: ignore[arg-type]
    assert sent(session).reports_seen == 1
    assert len(session.taken) == 1


def test_a_fresh_state_is_asked_for_until_one_comes() -> None:
    session = connected().session
    session.outgoing()
    wanted = session.want_state()
    first = sent(session)
    assert first.wants_state
    assert first.sequence == wanted
    tell(session, State(1001, 50, wanted - 1, 0, StandIn(CODEC).snapshot()))
    assert not session.is_fresh(wanted)
    assert sent(session).wants_state
    tell(session, State(1001, 51, wanted, 0, StandIn(CODEC).snapshot()))
    assert session.is_fresh(wanted)
    assert session.outgoing() is None


def test_goodbye_is_said_in_a_session_only_and_again_each_time() -> None:
    session = RecordingSession()
    assert session.goodbye() is None
    session = connected().session
    said = [CODEC.decode_from_client(session.goodbye() or b"") for _ in range(2)]
    assert said == [Goodbye(1001, session._sequence - 1), Goodbye(1001, session._sequence)]
    session.end("over")
    assert session.goodbye() is None
    session.keep_alive()
    assert session.outgoing() is None
