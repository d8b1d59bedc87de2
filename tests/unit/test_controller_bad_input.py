"""Bad input never raises out of the core, never moves the arm, and has a counter of its own."""

import math
from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hil.core.controller import FRI_LINK
from hil.core.events import PacketDropped
from hil.core.settings import FriSettings
from hil.values.fri import MAX_DATAGRAM_BYTES, OverlayKind, Release, SessionState
from hil.values.fri_messages import CommandData, CommandMessage, IOValue, MonitoringMessage, Vector
from hil.values.link import Address, Source
from hil.values.outcomes import Outcome
from tests.support.cases import cases
from tests.support.virtual import PEER, SOURCE, Bench, RecordingBackend
from transport.fri import FriCodec

Change = Callable[[Vector], Vector | None]


def shifted(axis: int, by_rad: float) -> Change:
    return lambda position: tuple(value + by_rad * (index == axis) for index, value in enumerate(position))


def active(release: Release = Release.V1_15) -> Bench:
    bench = Bench(release)
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(0.2)
    return bench


def next_command(bench: Bench, change: Change = lambda position: position, *, ahead: int = 0) -> bytes:
    """A fresh answer to the last message, position changed."""
    assert bench.controller.fri is not None
    commanded = bench.report()["commanded_position"]
    assert isinstance(commanded, list)
    position = change(tuple(commanded))
    message = CommandMessage(
        bench.client.sequence + ahead, bench.client.received - 1 + ahead, CommandData(position=position)
    )
    return bench.codec.encode_command(message)


def inject_instead(bench: Bench, payload: bytes) -> None:
    """Hand the core ``payload`` in place of the client's next answer."""
    received = bench.client.received + 1
    answers = bench.client.answers
    bench.client.answers = lambda count: count != received and answers(count)
    bench.cycle()
    bench.client.answers = answers
    bench.now_ns += 100_000
    bench.inject(payload)
    bench.now_ns -= 100_000


@pytest.mark.parametrize(
    ("payload", "outcome"),
    [
        (b"", Outcome.TOO_SHORT),
        (b"\x0a", Outcome.TOO_SHORT),
        (bytes(MAX_DATAGRAM_BYTES + 1), Outcome.TOO_LONG),
        (b"\xff" * 60, Outcome.UNDECODABLE),
        (bytes(60), Outcome.UNDECODABLE),
    ],
)
def test_garbage_is_dropped_by_name(payload: bytes, outcome: Outcome) -> None:
    bench = active()
    before = bench.report()["commanded_position"]
    bench.inject(payload)
    assert bench.dropped(outcome) == 1
    assert bench.report()["commanded_position"] == before
    bench.run(0.1)
    assert bench.state is SessionState.COMMANDING_ACTIVE


@pytest.mark.parametrize(("ours", "theirs"), [(Release.V2_7, Release.V1_15), (Release.V1_15, Release.V2_7)])
def test_another_releases_packets_are_named_as_such(ours: Release, theirs: Release) -> None:
    bench = active(ours)
    bench.inject(FriCodec(theirs).encode_command(CommandMessage(0, bench.client.received - 1)))
    assert bench.dropped(Outcome.OTHER_RELEASE) == 1
    bench.events += bench.controller.events()
    told = [event for event in bench.events if isinstance(event, PacketDropped)]
    assert "2.7" in told[-1].detail


def test_a_broken_frame_of_2_7_is_framing() -> None:
    bench = active(Release.V2_7)
    good = next_command(bench)
    for broken in (good[:-1], good + b"\0", good[:-1] + bytes([good[-1] ^ 1]), b"\x01" + good[1:]):
        bench.inject(broken)
    assert bench.dropped(Outcome.FRAMING) == 4


def test_a_stranger_gets_nothing() -> None:
    bench = active()
    payload = next_command(bench, lambda position: (*position[:3], position[3] + 0.001, *position[4:]))
    sent = len(bench.controller.outgoing())
    for address in (Address("127.0.0.1", 4711), Address("127.0.0.9", PEER.port)):
        bench.inject(payload, Source(FRI_LINK, address))
    assert bench.dropped(Outcome.STRANGER) == 2
    assert len(bench.controller.outgoing()) == sent
    bench.run(0.1)
    assert bench.state is SessionState.COMMANDING_ACTIVE


def test_duplicate_reordered_replayed_unsent() -> None:
    bench = active()
    recorded = bench.client.said
    encode = bench.codec.encode_command
    skipped = bench.client.received + 3
    bench.client.answers = lambda count: count != skipped
    bench.run(0.02)
    bench.client.answers = lambda _: True
    before = bench.controller.report()["packets"]
    bench.inject(recorded[-2])  # recorded[-1] is still on its way
    bench.inject(recorded[-5])
    bench.inject(encode(CommandMessage(0, bench.client.received + 5)))
    missing = CommandMessage(bench.client.sequence, skipped - 1, CommandData(position=(0.0,) * 7))
    bench.inject(encode(missing))
    assert [
        bench.dropped(outcome)
        for outcome in (Outcome.DUPLICATE, Outcome.REPLAYED, Outcome.UNSENT_SEQUENCE, Outcome.REORDERED)
    ] == [1, 1, 1, 1]
    assert before != bench.controller.report()["packets"]
    bench.run(0.1)
    assert bench.state is SessionState.COMMANDING_ACTIVE


def test_an_old_recording_replayed_whole_moves_nothing() -> None:
    bench = active()
    bench.client.said.clear()
    bench.run(0.5)
    recording = list(bench.client.said)
    bench.client.answers = lambda _: False
    bench.run(1.0)
    resting = bench.report()["commanded_position"]
    for payload in recording:
        bench.inject(payload)
        bench.cycle()
    assert bench.report()["commanded_position"] == resting
    assert bench.dropped(Outcome.REPLAYED) + bench.dropped(Outcome.DUPLICATE) >= len(recording) - 1


def test_late_answers_are_dropped_with_age_and_budget() -> None:
    bench = active()
    bench.client.delay_ns = 1_400_000
    bench.run(0.02)
    assert bench.dropped(Outcome.LATE) >= 15
    told = [event for event in bench.events if isinstance(event, PacketDropped) and event.outcome is Outcome.LATE]
    assert "came after 1.40 ms, 0.40 ms over the budget of 1 ms" in told[0].detail
    bench.run(0.5)
    assert bench.state is SessionState.MONITORING_WAIT


@pytest.mark.parametrize(
    ("change", "outcome", "words"),
    [
        (lambda _: (math.nan,) * 7, Outcome.NOT_FINITE, "A1 is nan"),
        (lambda position: (*position[:6], math.inf), Outcome.NOT_FINITE, "A7 is inf"),
        (lambda position: position[:6], Outcome.SHAPE, "6 joint positions, 7 are needed"),
        (lambda position: (*position, 0.0), Outcome.SHAPE, "8 joint positions"),
        (lambda _: (), Outcome.SHAPE, "0 joint positions"),
        (lambda position: (9.0, *position[1:]), Outcome.AXIS_LIMIT, "A1 to 9.0000 rad, its range is -2.9671..2.9671"),
        (shifted(3, 0.5), Outcome.AXIS_VELOCITY, "A4 steps +0.4"),
        (shifted(0, -0.01), Outcome.AXIS_VELOCITY, "its limit is 1.484 rad/s"),
    ],
)
def test_commands_out_of_bounds_brake_the_arm_and_return_to_monitoring(
    change: Change, outcome: Outcome, words: str
) -> None:
    bench = active()
    inject_instead(bench, next_command(bench, change, ahead=1))
    assert bench.dropped(outcome) == 1
    assert any(words in reason for reason in bench.reasons()), bench.reasons()
    assert bench.state is SessionState.MONITORING_READY
    bench.run(0.5)
    assert_commands_are_legal(bench)


def test_a_command_that_could_not_stop_in_range_is_refused() -> None:
    bench = Bench()
    limits = bench.description.limits
    speed = 1.2

    cycles = 0
    offset = 0.0

    def rush(command: CommandMessage, message: MonitoringMessage) -> CommandMessage:
        nonlocal cycles, offset
        assert message.connection is not None
        if message.connection.session_state != SessionState.COMMANDING_ACTIVE:
            return command
        cycles += 1
        offset += min(cycles * 5e-6, speed * 1e-3)
        return command._replace(command=CommandData(shifted(3, offset)(bench.description.initial_position_rad)))

    bench.client.change = rush
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    for _ in range(4000):
        bench.cycle()
        if bench.controller.stops:
            break
    assert "could not stop before" in bench.reasons()[0]
    assert bench.dropped(Outcome.AXIS_LIMIT) == 1
    bench.run(0.5)
    assert_commands_are_legal(bench)
    assert isinstance(bench.backend, RecordingBackend)
    assert max(command.position_rad[3] for command in bench.backend.commands) <= limits.position_max_rad[3]


def test_silence_in_words_is_silence_too() -> None:
    bench = active()
    bench.client.change = lambda command, _: command._replace(command=None)
    bench.run(0.04)
    states = [bench.state]
    bench.run(0.02)
    states.append(bench.state)
    assert states[0] is SessionState.COMMANDING_ACTIVE
    assert states[1] is not SessionState.COMMANDING_ACTIVE
    assert any("no joint position" in reason for reason in bench.reasons())


def test_a_pause_does_not_buy_a_long_step() -> None:
    bench = active()
    pause = bench.client.received + 40
    target = shifted(0, 0.2)(bench.description.initial_position_rad)

    def leap(command: CommandMessage, _: MonitoringMessage) -> CommandMessage:
        if bench.client.received < pause:
            return command._replace(command=None)
        return command._replace(command=CommandData(position=target))

    bench.client.change = leap
    bench.run(0.06)
    assert bench.dropped(Outcome.AXIS_VELOCITY) == 1
    bench.run(0.5)
    assert_commands_are_legal(bench)


def test_torques_and_wrenches_are_not_taken_by_a_position_overlay() -> None:
    bench = active()
    position = bench.description.initial_position_rad
    kinds = (
        CommandData(position, torque=(0.0,) * 7),
        CommandData(position, wrench=(0.0,) * 6),
        CommandData(torque=(0.0,) * 7),
        CommandData(position, inputs_outputs=(IOValue("Nobody.Listed", 1, 1, 7),)),
    )
    for data in kinds:
        bench.run_until(SessionState.COMMANDING_ACTIVE)
        inject_instead(
            bench,
            bench.codec.encode_command(CommandMessage(bench.client.sequence + 1, bench.client.received, data)),
        )
        bench.run(0.1)
    assert bench.dropped(Outcome.NOT_ALLOWED) == len(kinds)
    assert any("carries torques" in reason for reason in bench.reasons())


def test_not_finite_in_monitoring_is_counted_and_harmless() -> None:
    bench = Bench(fri=FriSettings(peer=PEER, overlay=OverlayKind.NONE))
    bench.run(2.0)
    inject_instead(bench, next_command(bench, lambda _: (math.nan,) * 7, ahead=1))
    assert bench.dropped(Outcome.NOT_FINITE) == 1
    assert bench.reasons() == []
    bench.run(0.1)
    assert bench.state is SessionState.MONITORING_READY


def test_drops_do_not_flood_the_events() -> None:
    bench = active()
    bench.events.clear()
    for _ in range(500):
        bench.inject(b"?")
    bench.run(0.5)
    told = [event for event in bench.events if isinstance(event, PacketDropped)]
    assert len(told) == 1
    assert bench.dropped(Outcome.TOO_SHORT) == 500


@pytest.mark.parametrize("release", list(Release))
@settings(max_examples=cases(15), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_bytes_raise_or_move_the_arm_outside_its_limits(release: Release, data: st.DataObject) -> None:
    """Invariant: whatever bytes arrive from whomever, the core raises nothing and every command stays legal."""
    bench = Bench(release)
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    for _ in range(data.draw(st.integers(1, 12))):
        bench.cycle()
        good = bytearray(next_command(bench, ahead=data.draw(st.integers(-2, 2))))
        kind = data.draw(st.sampled_from(("flip", "cut", "grow", "random", "doubles")))
        if kind == "flip":
            for _ in range(data.draw(st.integers(1, 6))):
                good[data.draw(st.integers(0, len(good) - 1))] ^= 1 << data.draw(st.integers(0, 7))
        elif kind == "cut":
            good = good[: data.draw(st.integers(0, len(good)))]
        elif kind == "grow":
            good += data.draw(st.binary(max_size=40))
        elif kind == "random":
            good = bytearray(data.draw(st.binary(max_size=200)))
        else:
            values = tuple(data.draw(st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=9)))
            good = bytearray(next_command(bench, lambda _, values=values: values, ahead=1))  # type: ignore[misc]
        bench.inject(bytes(good), SOURCE)
    bench.run(0.3)
    assert_commands_are_legal(bench)


def assert_commands_are_legal(bench: Bench) -> None:
    assert isinstance(bench.backend, RecordingBackend)
    limits = bench.description.limits
    before = bench.description.initial_position_rad
    for command in bench.backend.commands:
        for axis in range(7):
            value = command.position_rad[axis]
            assert math.isfinite(value)
            assert limits.position_min_rad[axis] <= value <= limits.position_max_rad[axis]
            step = abs(value - before[axis])
            assert step <= limits.velocity_rad_s[axis] * 1e-3 * (1 + 1e-5)
        before = command.position_rad
