"""Inputs, outputs and transformations over FRI, in virtual time: what is listed, taken, refused, told."""

import json
import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.core.events import InputSet, OutputChanged
from hil.core.fri.outputs import ClientOutputs
from hil.core.fri.transformations import MAX_AGE_NS, RequestedTransformations
from hil.core.settings import FriSettings
from hil.core.signals import SignalTable
from hil.values.errors import ConfigurationError
from hil.values.fri import IODirection, IOType, OverlayKind, Release, SessionState
from hil.values.fri_messages import CommandData, CommandMessage, IOValue, MonitoringMessage, TimeStamp, Transformation
from hil.values.operator import SetInput
from hil.values.outcomes import Outcome
from hil.values.pose import Pose
from hil.values.signals import MAX_SIGNALS, Signal, check_signals
from tests.support.cases import cases
from tests.support.virtual import PEER, UNIX_EPOCH_NS, Bench

SIGNALS = (
    Signal("G.Lamp", IOType.BOOLEAN, IODirection.OUTPUT, False),
    Signal("G.Count", IOType.DIGITAL, IODirection.OUTPUT, 7),
    Signal("G.Level", IOType.ANALOG, IODirection.OUTPUT, 0.25),
    Signal("G.Key", IOType.BOOLEAN, IODirection.INPUT, True),
    Signal("G.Limit", IOType.ANALOG, IODirection.INPUT, -1.5),
    Signal("G.Hidden", IOType.DIGITAL, IODirection.OUTPUT, 3, False),
)
LISTED = (
    IOValue("G.Lamp", 0, 1, digital=0),
    IOValue("G.Count", 1, 1, digital=7),
    IOValue("G.Level", 2, 1, analog=0.25),
    IOValue("G.Key", 0, 0, digital=1),
    IOValue("G.Limit", 2, 0, analog=-1.5),
)
MATRIX = (0.0, -1.0, 0.0, 100.0, 1.0, 0.0, 0.0, 200.0, 0.0, 0.0, 1.0, 300.0)
QUATERNION = (100.0, 200.0, 300.0, math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
A_QUARTER = Pose.from_abc_deg((0.1, 0.2, 0.3), 90.0, 0.0, 0.0)
IO_RELEASES = [release for release in Release if release is not Release.V1_11]


def bench(release: Release = Release.V1_15, *names: str, overlay: bool = True) -> Bench:
    fri = FriSettings(
        peer=PEER, overlay=OverlayKind.JOINT_POSITION if overlay else OverlayKind.NONE, transformations=names
    )
    return Bench(release, fri=fri, signals=SIGNALS)


def say_once(one: Bench, change: Callable[[CommandData], CommandData]) -> None:
    """Let the next answer of the client carry what ``change`` makes of it."""
    said = False

    def changed(command: CommandMessage, _: MonitoringMessage) -> CommandMessage:
        nonlocal said
        if said:
            return command
        said = True
        return command._replace(command=change(command.command or CommandData()))

    one.client.change = changed
    one.run(0.01)
    assert said


def outputs(*values: IOValue) -> Callable[[CommandData], CommandData]:
    return lambda data: data._replace(inputs_outputs=values)


def transformations(*values: Transformation) -> Callable[[CommandData], CommandData]:
    return lambda data: data._replace(transformations=values)


def value(one: Bench, name: str) -> object:
    return one.controller.signals.report()[name]["value"]


def listed(one: Bench) -> tuple[IOValue, ...]:
    monitor = one.codec.decode_monitoring(one.client.heard[-1]).monitor
    assert monitor is not None
    return monitor.inputs_outputs


def last_drop(one: Bench) -> str:
    return str([event for event in one.events if type(event).__name__ == "PacketDropped"][-1])


@pytest.mark.parametrize("release", Release)
def test_what_is_listed_is_listed_from_1_14_on(release: Release) -> None:
    one = bench(release)
    one.run(0.1)
    assert listed(one) == (() if release is Release.V1_11 else LISTED)
    assert one.dropped(Outcome.NOT_ALLOWED) == 0


@pytest.mark.parametrize("release", IO_RELEASES)
@pytest.mark.parametrize("state", [state for state in SessionState if state is not SessionState.IDLE])
def test_outputs_are_set_in_every_state(release: Release, state: SessionState) -> None:
    one = bench(release, overlay=state is not SessionState.MONITORING_READY)
    one.run_until(state)
    one.run(0.003 if state is SessionState.COMMANDING_WAIT else 0.05)
    assert one.state is state
    say_once(
        one,
        outputs(
            IOValue("G.Lamp", 0, 1, digital=1),
            IOValue("G.Count", 1, 1, digital=2**64 - 1),
            IOValue("G.Level", 2, 1, analog=-2.0),
        ),
    )
    assert [value(one, name) for name in ("G.Lamp", "G.Count", "G.Level")] == [True, 2**64 - 1, -2.0]
    assert listed(one)[1] == IOValue("G.Count", 1, 1, digital=2**64 - 1)
    assert one.reasons() == []
    told = [str(event) for event in one.events if isinstance(event, OutputChanged)]
    assert told[:2] == ["output G.Lamp: false -> true", "output G.Count: 7 -> 18446744073709551615"]
    assert json.loads(json.dumps(one.report()["io"]))["G.Level"] == {
        "type": "analog",
        "direction": "output",
        "value": -2.0,
        "fri": True,
    }


WRONG = [
    (IOValue("G.Door", 0, 1, digital=1), Outcome.NOT_ALLOWED, "sets 'G.Door', which the controller does not list"),
    (IOValue("G.Door", 0, 1, digital=1), Outcome.NOT_ALLOWED, "outputs: G.Lamp, G.Count, G.Level"),
    (IOValue("G.Hidden", 1, 1, digital=1), Outcome.NOT_ALLOWED, "'G.Hidden', which the controller does not list"),
    (IOValue("G.Key", 0, 1, digital=1), Outcome.NOT_ALLOWED, "sets G.Key, which is an input"),
    (IOValue("G.Lamp", 0, 0, digital=1), Outcome.NOT_ALLOWED, "sets G.Lamp, which is an output, not an input"),
    (IOValue("G.Lamp", 1, 1, digital=1), Outcome.NOT_ALLOWED, "sets G.Lamp as digital; it is boolean"),
    (IOValue("G.Level", 1, 1, digital=1), Outcome.NOT_ALLOWED, "sets G.Level as digital; it is analog"),
    (IOValue("G.Lamp", 0, 1, digital=2), Outcome.SHAPE, "G.Lamp, which is boolean, to 2; valid: true or false"),
    (IOValue("G.Level", 2, 1, analog=math.nan), Outcome.NOT_FINITE, "sets G.Level to nan"),
    (IOValue("G.Level", 2, 1, analog=math.inf), Outcome.NOT_FINITE, "sets G.Level to inf"),
]


@pytest.mark.parametrize(("wrong", "outcome", "sentence"), WRONG)
@pytest.mark.parametrize("state", [SessionState.MONITORING_READY, SessionState.COMMANDING_ACTIVE])
def test_an_output_that_cannot_be_set_is_refused_with_all_that_came_with_it(
    wrong: IOValue, outcome: Outcome, sentence: str, state: SessionState
) -> None:
    one = bench(overlay=state is SessionState.COMMANDING_ACTIVE)
    one.run_until(state)
    one.run(0.05)
    say_once(one, outputs(IOValue("G.Count", 1, 1, digital=99), wrong))
    assert one.dropped(outcome) == 1
    assert sentence in last_drop(one)
    assert (value(one, "G.Count"), value(one, "G.Key")) == (7, True)
    # As with anything else the overlay does not take, the motion ends.
    assert len(one.reasons()) == (state is SessionState.COMMANDING_ACTIVE)
    one.run(3.0)
    assert one.state is state


def test_more_outputs_than_a_message_may_carry_are_refused() -> None:
    one = bench(overlay=False)
    one.run(1.0)
    say_once(one, outputs(*[IOValue("G.Count", 1, 1, digital=index) for index in range(11)]))
    assert one.dropped(Outcome.SHAPE) == 1
    assert value(one, "G.Count") == 7


def test_a_late_answer_sets_nothing() -> None:
    one = bench(overlay=False)
    one.run(1.0)
    one.client.delay_ns = 1_500_000
    say_once(one, outputs(IOValue("G.Count", 1, 1, digital=9)))
    assert one.dropped(Outcome.LATE) >= 1
    assert value(one, "G.Count") == 7


def test_a_client_that_only_sets_outputs_is_heard_while_the_arm_waits_for_positions() -> None:
    one = bench(Release.V2_7)
    one.client.change = lambda command, _: command._replace(
        command=CommandData(inputs_outputs=(IOValue("G.Count", 1, 1, digital=command.sequence_counter),))
    )
    one.run(3.0)
    assert one.state is SessionState.COMMANDING_WAIT
    assert isinstance(count := value(one, "G.Count"), int)
    assert count >= 2990
    assert one.dropped(Outcome.SHAPE) == 0
    # One event a second for each output, whatever the client does.
    told = [event for event in one.events if isinstance(event, OutputChanged)]
    assert 3 <= len(told) <= 4
    assert told[-1].count == pytest.approx(1000, abs=2)


def test_outputs_beside_no_position_hold_a_commanded_arm_no_longer_than_the_watchdog() -> None:
    one = bench()
    one.run_until(SessionState.COMMANDING_ACTIVE)
    one.client.change = lambda command, _: command._replace(
        command=CommandData(inputs_outputs=(IOValue("G.Count", 1, 1, digital=command.sequence_counter),))
    )
    one.run(0.2)
    assert one.state is not SessionState.COMMANDING_ACTIVE
    assert len(one.reasons()) == 1
    assert value(one, "G.Count") != 7


def test_the_operator_sets_inputs_and_nothing_else() -> None:
    one = bench(overlay=False)
    one.run(0.1)
    operate = one.controller.operate
    assert operate(SetInput("G.Key", False), now_ns=one.now_ns) == ""
    assert operate(SetInput("G.Limit", 3), now_ns=one.now_ns) == ""
    one.run(0.002)
    assert listed(one)[3:] == (IOValue("G.Key", 0, 0, digital=0), IOValue("G.Limit", 2, 0, analog=3.0))
    for action, sentence in (
        (SetInput("G.Door", 1), "there is no input 'G.Door'; valid: G.Key, G.Limit"),
        (SetInput("G.Lamp", 1), "G.Lamp is an output, which the FRI client sets; inputs: G.Key, G.Limit"),
        (SetInput("G.Key", 2), "G.Key is boolean, 2 is none of its values; valid: true or false"),
        (SetInput("G.Key", 1.0), "G.Key is boolean, 1.0 is none of its values"),
        (SetInput("G.Limit", True), "G.Limit is analog, True is none of its values; valid: a finite number"),
        (SetInput("G.Limit", math.inf), "G.Limit is analog, inf is none of its values"),
        (SetInput("G.Limit", 10**400), "G.Limit is analog, 1000000000"),
    ):
        assert operate(action, now_ns=one.now_ns).startswith(sentence)
    one.run(0.001)
    told = [str(event) for event in one.events if isinstance(event, InputSet)]
    assert told[:2] == ["pad: input G.Key = false", "pad: input G.Limit = 3"]
    assert len(told) == 9
    assert "input refused: there is no input" in told[2]
    assert value(one, "G.Key") is False


@pytest.mark.parametrize(
    ("signals", "sentence"),
    [
        ((SIGNALS[0], SIGNALS[0]), "two inputs or outputs have the name 'G.Lamp'"),
        ((SIGNALS[0]._replace(name="G." + "x" * 62),), "has 64 bytes; valid: printable text of 1 to 63 bytes"),
        ((SIGNALS[0]._replace(name="G." + "ü" * 31),), "has 64 bytes"),
        ((SIGNALS[0]._replace(name="G.a\nb"),), "printable text"),
        ((SIGNALS[0]._replace(initial=2),), "G.Lamp is boolean and cannot begin with 2; valid: true or false"),
        ((SIGNALS[1]._replace(initial=-1),), "G.Count is digital and cannot begin with -1; valid: a whole number"),
        ((SIGNALS[2]._replace(initial=math.nan),), "G.Level is analog and cannot begin with nan"),
        (tuple(SIGNALS[0]._replace(name=f"G.{n}") for n in range(11)), "FRI shows 11 inputs and outputs, 10 at most"),
        (
            tuple(SIGNALS[0]._replace(name=f"G.{n}", fri=False) for n in range(MAX_SIGNALS + 1)),
            f"{MAX_SIGNALS + 1} inputs and outputs, {MAX_SIGNALS} at most",
        ),
    ],
)
def test_signals_that_cannot_be_are_refused_in_words(signals: tuple[Signal, ...], sentence: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        check_signals(signals)
    assert sentence in str(caught.value)


@pytest.mark.parametrize("release", Release)
def test_transformations_are_asked_for_and_kept(release: Release) -> None:
    one = bench(release, "PBase", "Part")
    one.run_until(SessionState.COMMANDING_ACTIVE)
    asked = one.codec.decode_monitoring(one.client.heard[-1]).requested_transformations
    numbers = MATRIX if release.startswith("1") else QUATERNION
    assert [(each.name, len(each.values), each.at) for each in asked] == [
        ("PBase", len(numbers), None),
        ("Part", len(numbers), None),
    ]
    assert one.report()["transformations"] == {"PBase": None, "Part": None}
    say_once(one, transformations(Transformation("Part", numbers)))
    assert one.controller.fri is not None
    given = one.controller.fri.transformations.provided["Part"]
    assert given is not None
    assert given.pose.distance_m(A_QUARTER) < 1e-12
    assert given.pose.angle_rad(A_QUARTER) < 1e-12
    assert given.at is None
    assert one.now_ns - 10_000_000 <= given.received_ns <= one.now_ns
    report = json.loads(json.dumps(one.report()["transformations"]))
    assert report["PBase"] is None
    assert report["Part"]["position_m"] == pytest.approx([0.1, 0.2, 0.3])
    assert report["Part"]["updates"] == 1
    assert one.reasons() == []


def scaled(factor: float) -> tuple[float, ...]:
    return tuple(number * factor for number in MATRIX)


@pytest.mark.parametrize(
    ("wrong", "outcome", "sentence"),
    [
        (Transformation("Other", MATRIX), Outcome.NOT_ALLOWED, "'Other', which the controller did not ask for"),
        (Transformation("PBase", (*MATRIX[:11], math.nan)), Outcome.NOT_FINITE, "PBase has the number nan"),
        (Transformation("PBase", (math.inf, *MATRIX[1:])), Outcome.NOT_FINITE, "PBase has the number inf"),
        (
            Transformation("PBase", scaled(1.002)),
            Outcome.SHAPE,
            "is no rotation: it is 0.002 off one, 0.001 is allowed",
        ),
        (Transformation("PBase", scaled(1e200)), Outcome.SHAPE, "is no rotation"),
        (Transformation("PBase", (0.0,) * 12), Outcome.SHAPE, "is no rotation: it is 1 off one"),
        (Transformation("PBase", (*MATRIX[:10], -1.0, 0.0)), Outcome.SHAPE, "is no rotation: it is 2 off one"),
        (Transformation("PBase", (0.002, *MATRIX[1:])), Outcome.SHAPE, "is no rotation"),
    ],
)
def test_a_transformation_that_is_none_is_refused(wrong: Transformation, outcome: Outcome, sentence: str) -> None:
    one = bench(Release.V1_15, "PBase", overlay=False)
    one.run(1.0)
    say_once(one, transformations(Transformation("PBase", MATRIX), wrong))
    assert one.dropped(outcome) == 1
    assert sentence in last_drop(one)
    assert one.report()["transformations"] == {"PBase": None}


@pytest.mark.parametrize("length", [1.0 - 2e-3, 1.0 + 2e-3, 0.0])
def test_a_quaternion_has_length_one(length: float) -> None:
    one = bench(Release.V2_7, "PBase", overlay=False)
    one.run(1.0)
    say_once(one, transformations(Transformation("PBase", (0.0, 0.0, 0.0, length, 0.0, 0.0, 0.0))))
    assert one.dropped(Outcome.SHAPE) == 1
    say_once(one, transformations(Transformation("PBase", (0.0, 0.0, 0.0, 1.0 - 5e-4, 0.0, 0.0, 0.0))))
    assert one.dropped(Outcome.SHAPE) == 1
    assert one.report()["transformations"] != {"PBase": None}


@pytest.mark.parametrize(("off_ns", "taken"), [(0, True), (MAX_AGE_NS - 10**8, True), (MAX_AGE_NS + 10**8, False)])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_transformation_is_of_this_second(off_ns: int, taken: bool, sign: int) -> None:
    one = bench(Release.V1_15, "PBase", overlay=False)
    one.run(1.0)
    unix_ns = UNIX_EPOCH_NS + one.now_ns - sign * off_ns
    stamp = TimeStamp(unix_ns // 10**9, unix_ns % 10**9)
    say_once(one, transformations(Transformation("PBase", MATRIX, stamp)))
    assert (one.report()["transformations"] != {"PBase": None}) is taken
    assert one.dropped(Outcome.LATE) == (not taken)
    if not taken:
        assert ("s old by its time stamp" if sign > 0 else "s in the future by its time stamp") in last_drop(one)


@pytest.mark.parametrize("release", Release)
def test_transformations_nobody_asked_for_end_a_commanded_motion(release: Release) -> None:
    one = bench(release)
    one.run_until(SessionState.COMMANDING_ACTIVE)
    numbers = MATRIX if release.startswith("1") else QUATERNION
    say_once(one, transformations(Transformation("PBase", numbers)))
    assert one.dropped(Outcome.NOT_ALLOWED) == 1
    assert "it asks for none" in one.reasons()[0]


@settings(max_examples=cases(120), deadline=None)
@given(
    io=st.builds(
        IOValue,
        st.sampled_from([*(signal.name for signal in SIGNALS), "", "x" * 70]) | st.text(max_size=70),
        st.integers(-2, 4) | st.integers(-(2**31), 2**31 - 1),
        st.integers(-1, 2),
        st.none() | st.integers(0, 2**64 - 1),
        st.none() | st.floats(),
    ),
    numbers=st.lists(st.floats(), max_size=13).map(tuple) | st.tuples(*[st.floats()] * 12),
    at=st.none() | st.builds(TimeStamp, st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1)),
)
def test_no_output_and_no_transformation_raises(io: IOValue, numbers: tuple[float, ...], at: TimeStamp | None) -> None:
    table = SignalTable(SIGNALS)
    client = ClientOutputs(table, emit=lambda _: None)
    if client.refusal((io,)) is None:
        client.take((io,), now_ns=0)
        assert table.report()[io.name]["direction"] == "output"
    for release in (Release.V1_15, Release.V2_7):
        requested = RequestedTransformations(["PBase"], release=release, unix_epoch_ns=UNIX_EPOCH_NS)
        given_values = (Transformation("PBase", numbers, at),)
        if requested.refusal(given_values, now_ns=0) is None:
            requested.take(given_values, now_ns=0)
    json.dumps(table.report(), allow_nan=False)


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (("a", "b", "c", "d", "e", "f"), "6 transformations, 5 at most"),
        (("a", "a"), "two transformations have the name 'a'"),
        (("x" * 64,), "of a transformation has 64 bytes"),
        (("",), "of a transformation has 0 bytes"),
    ],
)
def test_names_that_cannot_be_asked_for(names: tuple[str, ...], sentence: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        FriSettings(peer=PEER, transformations=names)
    assert sentence in str(caught.value)


def test_the_fullest_message_fits_a_datagram() -> None:
    signals = tuple(
        Signal(f"Group.{'x' * 16}{index}", IOType.DIGITAL, IODirection.OUTPUT, 2**64 - 1) for index in range(10)
    )
    names = ("first", "second", "third")
    for release in IO_RELEASES:
        one = Bench(release, fri=FriSettings(peer=PEER, transformations=names), signals=signals)
        one.run_until(SessionState.COMMANDING_ACTIVE)
        assert max(map(len, one.client.heard)) <= 1500
