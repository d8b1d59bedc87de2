"""Inputs, outputs and transformations as they were recorded: our controller lists the same, and takes what was sent."""

from pathlib import Path

import pytest

from hil.core.settings import FriSettings
from hil.values.fri import IODirection, IOType, OverlayKind, SessionState
from hil.values.fri_messages import CommandMessage, MonitoringMessage
from hil.values.signals import Signal
from tests.support.captures import FOLDER, datagrams, release_of
from tests.support.virtual import PEER, Bench
from transport.fri import FriCodec

SIGNALS = (
    Signal("FRI.Out_Analog_Deci_Seconds", IOType.ANALOG, IODirection.OUTPUT, 0.3),
    Signal("FRI.Out_Integer_Seconds", IOType.DIGITAL, IODirection.OUTPUT, 7),
    Signal("FRI.In_Bool_Clock_Enabled", IOType.BOOLEAN, IODirection.INPUT, True),
)


def recorded(path: Path) -> tuple[list[MonitoringMessage], list[CommandMessage]]:
    codec = FriCodec(release_of(path))
    both = list(datagrams(path))
    return (
        [codec.decode_monitoring(payload) for from_controller, payload in both if from_controller],
        [codec.decode_command(payload) for from_controller, payload in both if not from_controller],
    )


def served(path: Path, commands: list[CommandMessage]) -> Bench:
    """Serve a client that sends the recorded commands, with new counters, one for each message."""
    with_transformations = "trafo" in path.name
    settings = FriSettings(
        peer=PEER,
        send_period_ms=10,
        overlay=OverlayKind.NONE,
        transformations=("PBase",) if with_transformations else (),
    )
    bench = Bench(release_of(path), fri=settings, signals=() if with_transformations else SIGNALS)
    bench.keep_messages = True
    left = iter(commands)

    def sent(command: CommandMessage, message: MonitoringMessage) -> CommandMessage:
        assert message.monitor is not None
        data = next(left).command
        if data is not None and data.transformations:
            # The recorded clients reflect the time stamp of the message.
            fresh = tuple(one._replace(at=message.monitor.at) for one in data.transformations)
            data = data._replace(transformations=fresh)
        return command._replace(command=data)

    bench.client.change = sent
    bench.run(0.01 * (len(commands) - 1))
    return bench


@pytest.mark.parametrize("name", ["fri-1.15-io-10ms", "fri-2.5-io-10ms", "fri-2.7-io-10ms"])
def test_inputs_and_outputs_are_listed_as_recorded_and_set_by_what_was_sent(name: str) -> None:
    path = FOLDER / f"{name}.pcapng"
    theirs, commands = recorded(path)
    bench = served(path, commands)
    assert theirs[0].monitor is not None
    assert bench.monitoring[0].monitor is not None
    assert bench.monitoring[0].monitor.inputs_outputs == theirs[0].monitor.inputs_outputs
    set_at_all = any(command.command is not None for command in commands)
    value = bench.controller.signals.report()["FRI.Out_Analog_Deci_Seconds"]["value"]
    assert value == (0.4 if set_at_all else 0.3)
    fri = bench.controller.fri
    assert fri is not None
    assert not any(fri.counters.by_outcome.values())
    assert bench.state is SessionState.MONITORING_READY


@pytest.mark.parametrize("name", ["fri-1.15-trafo-10ms", "fri-2.5-trafo-10ms", "fri-2.7-trafo-10ms"])
def test_transformations_are_asked_for_as_recorded_and_taken_as_sent(name: str) -> None:
    path = FOLDER / f"{name}.pcapng"
    theirs, commands = recorded(path)
    bench = served(path, commands)
    assert {message.requested_transformations for message in theirs} == {bench.monitoring[0].requested_transformations}
    fri = bench.controller.fri
    assert fri is not None
    assert not any(fri.counters.by_outcome.values())
    given = fri.transformations.provided["PBase"]
    assert given is not None
    # The last one is still under way.
    assert given.pose.position_m == pytest.approx((0.047, 0.180, 0.230), abs=1e-12)
    assert fri.transformations.updates["PBase"] == len(commands) - 1
