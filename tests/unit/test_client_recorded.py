"""The Python client against recorded traffic: fed what the vendor's clients were sent, it answers the same bytes."""

from collections.abc import Iterator
from typing import NamedTuple

import pytest

from apps.fri_io import Clock
from apps.fri_joint_sine import JointSine
from apps.fri_torque_sine import TorqueSine
from apps.fri_transformation_provider import Provider
from apps.fri_wrench_sine import WrenchSine
from hil.client.fri import ClientSession, Command, FriHandler, FriState, Release, SessionState
from tests.support.captures import FOLDER, datagrams, release_of
from transport.fri import FriCodec

JOINT_SINE = [
    "fri-1.11-joint-sine-5ms",
    "fri-1.14-joint-sine-5ms",
    "fri-1.15-joint-sine-1ms",
    "fri-1.15-joint-sine-5ms",
    "fri-1.16-joint-sine-5ms",
    "fri-2.5-joint-sine-5ms",
    "fri-2.7-joint-sine-2ms-multiplier3",
    "fri-2.7-joint-sine-5ms",
]
OTHER_MODES = [
    "fri-1.15-torque-sine-2ms",
    "fri-1.15-wrench-sine-2ms",
    "fri-2.5-torque-sine-2ms",
    "fri-2.5-wrench-sine-2ms",
    "fri-2.7-cartesian-5ms",
    "fri-2.7-torque-sine-2ms",
    "fri-2.7-wrench-sine-2ms",
]


class Answer(NamedTuple):
    """What both clients answered to one monitoring message."""

    state: SessionState
    vendor: bytes | None
    ours: bytes | None


def answers(name: str, handler: FriHandler) -> Iterator[Answer]:
    """Feed the monitoring messages of a capture to a session and yield both clients' answers, message by message."""
    path = FOLDER / f"{name}.pcapng"
    session = ClientSession(release_of(path), handler)
    vendor: dict[int, bytes] = {}
    codec = FriCodec(release_of(path))
    recorded = list(datagrams(path))
    for item in recorded:
        if not item.from_controller:
            vendor[codec.decode_command(item.payload).reflected_sequence_counter] = item.payload
    for item in recorded:
        if item.from_controller:
            ours = session.receive(item.payload)
            assert session.state is not None
            yield Answer(session.state.session_state, vendor.pop(session.state.sequence_counter, None), ours)
    assert not vendor
    assert not session.malformed
    assert session.ended


@pytest.mark.parametrize("name", JOINT_SINE + OTHER_MODES)
def test_default_handler_answers_as_the_vendor_does_until_commanding_is_active(name: str) -> None:
    compared = dict.fromkeys(SessionState, 0)
    for answer in answers(name, FriHandler()):
        assert (answer.ours is None) == (answer.vendor is None)
        if answer.state is not SessionState.COMMANDING_ACTIVE:
            assert answer.ours == answer.vendor
            compared[answer.state] += 1
    assert min(count for state, count in compared.items() if state is not SessionState.COMMANDING_ACTIVE) >= 1


@pytest.mark.parametrize("name", JOINT_SINE)
def test_joint_sine_answers_every_message_as_the_vendor_does(name: str) -> None:
    handler = JointSine()
    for answer in answers(name, handler):
        assert answer.ours == answer.vendor
    assert handler.states["COMMANDING_ACTIVE"] > 200
    assert handler.peak_excursion_rad[3] > 0.015
    assert not any(handler.peak_excursion_rad[:3] + handler.peak_excursion_rad[4:])


def test_answered_every_third_message_the_sine_advances_with_every_message() -> None:
    seen = [answer for answer in answers("fri-2.7-joint-sine-2ms-multiplier3", JointSine()) if answer.ours is not None]
    assert len(seen) == 400
    codec = FriCodec(Release.V2_7)
    assert [codec.decode_command(answer.ours or b"").sequence_counter for answer in seen] == list(range(400))


@pytest.mark.parametrize("name", ["fri-2.5-io-10ms", "fri-2.7-io-10ms"])
def test_the_io_client_answers_every_message_as_the_vendor_does(name: str) -> None:
    handler = Clock()
    for answer in answers(name, handler):
        assert answer.ours == answer.vendor
    assert handler.ticks == 24


class Silent(FriHandler):
    """Answers with a header alone in every state."""

    def monitor(self, state: FriState) -> Command:
        return Command(mirror=False)

    wait_for_command = command = monitor


def test_the_1_15_io_client_set_nothing_in_what_was_recorded() -> None:
    assert sum(answer.ours == answer.vendor for answer in answers("fri-1.15-io-10ms", Silent())) == 241


@pytest.mark.parametrize("name", ["fri-1.15-trafo-10ms", "fri-2.5-trafo-10ms", "fri-2.7-trafo-10ms"])
def test_the_transformation_provider_answers_every_message_as_the_vendor_does(name: str) -> None:
    handler = Provider()
    for answer in answers(name, handler):
        assert answer.ours == answer.vendor
    assert handler.requested == ("PBase",)
    assert handler.states.total() == 240


@pytest.mark.parametrize("name", [name for name in OTHER_MODES if "torque" in name])
def test_torque_sine_answers_every_message_as_the_vendor_does(name: str) -> None:
    handler = TorqueSine()
    for answer in answers(name, handler):
        assert answer.ours == answer.vendor
    assert handler.states["COMMANDING_ACTIVE"] > 200


@pytest.mark.parametrize("name", [name for name in OTHER_MODES if "wrench" in name])
def test_wrench_sine_answers_every_message_as_the_vendor_does(name: str) -> None:
    handler = WrenchSine()
    for answer in answers(name, handler):
        assert answer.ours == answer.vendor
    assert handler.states["COMMANDING_ACTIVE"] > 200
