"""Recorded traffic of six client releases: what we decode encodes to the same bytes, both directions."""

from pathlib import Path

import pytest

from hil.values.fri import Release, SessionState
from hil.values.fri_messages import MonitoringMessage
from tests.support.captures import datagrams, files, release_of
from transport.fri import FriCodec

DATAGRAMS = 29_021


def test_all_captures_are_there() -> None:
    assert {release_of(path) for path in files()} == set(Release)
    assert sum(1 for path in files() for _ in datagrams(path)) == DATAGRAMS


@pytest.mark.parametrize("path", files(), ids=lambda path: path.stem)
def test_every_packet_encodes_to_its_own_bytes(path: Path) -> None:
    codec = FriCodec(release_of(path))
    for index, (from_controller, payload) in enumerate(datagrams(path)):
        if from_controller:
            again = codec.encode_monitoring(codec.decode_monitoring(payload))
        else:
            again = codec.encode_command(codec.decode_command(payload))
        assert again == payload, f"packet {index} of {path.name}"


@pytest.mark.parametrize("path", files(), ids=lambda path: path.stem)
def test_recorded_sessions_read_as_sessions(path: Path) -> None:
    codec = FriCodec(release_of(path))
    messages = [codec.decode_monitoring(payload) for from_controller, payload in datagrams(path) if from_controller]
    states = _states(messages)
    assert states[0] is SessionState.MONITORING_WAIT
    assert SessionState.COMMANDING_ACTIVE in states
    counters = [message.sequence_counter for message in messages]
    assert counters == list(range(counters[0], counters[0] + len(counters)))


def _states(messages: list[MonitoringMessage]) -> list[SessionState]:
    states: list[SessionState] = []
    for message in messages:
        assert message.connection is not None
        state = SessionState(message.connection.session_state)
        if not states or states[-1] is not state:
            states.append(state)
    return states
