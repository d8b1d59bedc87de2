"""One side of a recording, played without a network: it says what was recorded, and hears what is not."""

import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from hil.replay.guess import Flow, flow_of
from hil.replay.result import ReplayResult
from hil.replay.stand_in_application import RecordedApplication
from hil.replay.stand_in_client import RecordedClient
from hil.replay.stand_in_controller import RecordedController
from hil.replay.stand_in_servo import RecordedServoController
from hil.values.fri import Release, SessionState
from hil.values.link import Address
from hil.values.servo import Command, Hello, SetDestination, State, Welcome
from tests.support.recordings import packets
from transport.capture.records import Packet
from transport.fri import FriCodec
from transport.servo import ServoCodec

DATA = Path(__file__).parents[1] / "data"
FRI, SERVO = DATA / "fri-1.15-joint-position-5ms.pcapng", DATA / "smart-servo-2ms.pcapng"
CODEC, SERVO_CODEC = FriCodec(Release.V1_15), ServoCodec()
CLIENT, CONTROLLER = Address("127.0.0.1", 30200), Address("127.0.0.1", 30210)
APPLICATION, SERVO_BOUND = Address("127.0.0.1", 40000), Address("127.0.0.1", 30300)
LIVE = Address("127.0.0.1", 50000)
MS = 1_000_000


def flow() -> Flow:
    found = flow_of(packets(FRI)[0], Release.V1_15)
    assert found is not None
    return found


def said_by(file: Path, source: Address) -> list[Packet]:
    return [one for one in packets(file) if one.source == source]


def test_a_recorded_client_answers_its_own_recording_to_the_byte() -> None:
    client = RecordedClient(flow(), iter(packets(FRI)))
    answers = [client.receive(one.payload) for one in said_by(FRI, CONTROLLER)]
    assert [one for one in answers if one is not None] == [one.payload for one in said_by(FRI, CLIENT)]
    assert client.ended
    assert client.repeated == 0
    assert client.states[:4] == list(SessionState)[1:5]


def test_a_live_session_that_takes_longer_gets_the_last_answer_again() -> None:
    client = RecordedClient(flow(), iter(packets(FRI)))
    messages = [CODEC.decode_monitoring(one.payload) for one in said_by(FRI, CONTROLLER)]
    counter = 1000
    for message in messages:
        for _ in range(2):  # every state lasts twice as long
            answer = client.receive(CODEC.encode_monitoring(message._replace(sequence_counter=counter)))
            if answer is not None:
                told = CODEC.decode_command(answer)
                assert told.reflected_sequence_counter == counter
            counter += 1
        if client.ended:
            break
    assert client.repeated > 100
    assert client.states[:4] == list(SessionState)[1:5]


def test_a_live_session_that_skips_states_is_followed() -> None:
    client = RecordedClient(flow(), iter(packets(FRI)))
    active = [
        message
        for message in (CODEC.decode_monitoring(one.payload) for one in said_by(FRI, CONTROLLER))
        if message.connection is not None and message.connection.session_state == SessionState.COMMANDING_ACTIVE
    ]
    answer = client.receive(CODEC.encode_monitoring(active[0]))
    assert answer is not None
    command = CODEC.decode_command(answer).command
    assert command is not None
    assert client.receive(b"garbage") is None
    assert client.malformed == 1


def asked(controller: RecordedController, answers: Iterator[bytes]) -> None:
    """Let a client answer every message but the last ones of a session, which wants no answer."""
    for _ in controller.messages():
        answer = next(answers, None)
        if answer is not None:
            controller.receive(answer)
    controller.finish()


def test_a_recorded_controller_takes_the_recorded_answers_for_what_they_are() -> None:
    result = ReplayResult("x", own=True, other="client")
    controller = RecordedController(flow(), iter(packets(FRI)), result)
    asked(controller, iter([one.payload for one in said_by(FRI, CLIENT)]))
    assert result.equal
    assert result.identical == len(said_by(FRI, CLIENT))


def test_an_answer_that_is_another_one_is_named() -> None:
    result = ReplayResult("x", own=True, other="client")
    answers = [one.payload for one in said_by(FRI, CLIENT)]
    command = CODEC.decode_command(answers[300])
    assert command.command is not None
    assert command.command.position is not None
    position = (*command.command.position[:6], command.command.position[6] + 0.001)
    answers[300] = CODEC.encode_command(command._replace(command=command.command._replace(position=position)))
    asked(RecordedController(flow(), iter(packets(FRI)), result), iter(answers))
    assert result.compared - result.identical == 1
    assert result.first.startswith("A7 commanded +1 mrad (recorded 0.0, client 0.001) at t=1.5")


def test_answers_that_never_come_are_told() -> None:
    result = ReplayResult("x", own=True, other="client")
    answers = [one.payload for one in said_by(FRI, CLIENT)]
    asked(RecordedController(flow(), iter(packets(FRI)), result), iter(answers[:200]))
    assert result.identical == 200
    assert result.extra == len(answers) - 200
    assert result.first.startswith("the client did not answer message 200")


def test_a_client_that_was_started_before_is_compared_by_how_its_counter_grows() -> None:
    result = ReplayResult("x", own=True, other="client")
    answers = (CODEC.decode_command(one.payload) for one in said_by(FRI, CLIENT))
    shifted = (CODEC.encode_command(one._replace(sequence_counter=one.sequence_counter + 77)) for one in answers)
    asked(RecordedController(flow(), iter(packets(FRI)), result), shifted)
    assert result.equal


def recorded_application() -> RecordedApplication:
    return RecordedApplication(iter(packets(SERVO)), client=APPLICATION, controller=SERVO_BOUND, codec=SERVO_CODEC)


def test_a_recorded_application_says_what_it_said_in_the_live_session() -> None:
    application = recorded_application()
    [hello] = application.due(now_ns=0)
    assert isinstance(SERVO_CODEC.decode_from_client(hello), Hello)
    assert application.due(now_ns=10 * MS) == []
    assert len(application.due(now_ns=60 * MS)) == 1  # nobody answered: again
    [offered] = [one.payload for one in said_by(SERVO, SERVO_BOUND)][:1]
    welcome = SERVO_CODEC.decode_from_controller(offered)
    assert isinstance(welcome, Welcome)
    application.receive(SERVO_CODEC.encode_from_controller(welcome._replace(token=99)), now_ns=70 * MS)
    told: list[Command] = []
    now_ns = 70 * MS
    while not application.over:
        due_ns = application.next_due_ns()
        assert due_ns is not None
        now_ns = max(now_ns, due_ns)
        for datagram in application.due(now_ns=now_ns):
            packet = SERVO_CODEC.decode_from_client(datagram)
            assert isinstance(packet, Command)
            told.append(packet)
    assert {one.token for one in told} == {99}
    assert [one.sequence for one in told] == list(range(1, len(told) + 1))
    recorded = [SERVO_CODEC.decode_from_client(one.payload) for one in said_by(SERVO, APPLICATION)]
    assert [one.requests for one in told] == [one.requests for one in recorded if isinstance(one, Command)]


def test_a_recorded_servo_controller_compares_requests_and_waits_for_them() -> None:
    result = ReplayResult("x", own=True, other="application")
    controller = RecordedServoController(
        iter(packets(SERVO)), client=APPLICATION, controller=SERVO_BOUND, codec=SERVO_CODEC, result=result
    )
    assert controller.next_due_ns() is None
    chooser, now_ns = random.Random(3), 0
    heard: list[State] = []
    for one in said_by(SERVO, APPLICATION):
        packet = SERVO_CODEC.decode_from_client(one.payload)
        if isinstance(packet, Hello):
            packet = packet._replace(nonce=1234)
        if isinstance(packet, Command) and len(heard) > 20 and packet.requests:
            [request] = packet.requests
            if isinstance(request, SetDestination) and request.number == 40:
                assert request.position is not None
                packet = packet._replace(requests=(request._replace(position=(0.5, *request.position[1:])),))
        answer = controller.receive(SERVO_CODEC.encode_from_client(packet), LIVE, now_ns=now_ns)
        if answer is not None:
            welcome = SERVO_CODEC.decode_from_controller(answer)
            assert isinstance(welcome, Welcome)
            assert welcome.nonce == 1234
        now_ns += chooser.randrange(2 * MS, 4 * MS)  # slower than the recorded one
        states = [SERVO_CODEC.decode_from_controller(datagram) for datagram in controller.due(now_ns=now_ns)]
        heard += [state for state in states if isinstance(state, State)]
    assert controller.receive(b"garbage", LIVE, now_ns=now_ns) is None
    assert controller.peer == LIVE
    controller.finish()
    assert result.compared - result.identical == 1
    assert "A1 position" in result.first or "A1 destination" in result.first, result.first
    assert result.missing == 0
    assert [one.sequence for one in heard] == sorted(one.sequence for one in heard)


@pytest.mark.parametrize("file", [FRI, SERVO])
def test_a_stranger_changes_nothing(file: Path) -> None:
    result = ReplayResult("x", own=True)
    controller = RecordedServoController(
        iter(packets(SERVO)), client=APPLICATION, controller=SERVO_BOUND, codec=SERVO_CODEC, result=result
    )
    for one in packets(file)[:50]:
        if not isinstance(_decoded(one), Hello):
            controller.receive(one.payload, Address("10.0.0.1", 1), now_ns=0)
    assert controller.peer is None
    assert result.inputs == 0


def _decoded(packet: Packet) -> object:
    try:
        return SERVO_CODEC.decode_from_client(packet.payload)
    except Exception:  # noqa: BLE001  # what it is does not matter, only that it is no hello
        return None
