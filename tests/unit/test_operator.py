"""The operator's table: what each key does in each state, what is refused, and what the pad shows of it."""

import itertools

import pytest

from hil.core.safety import operator
from hil.core.safety.operator import EMERGENCY_STOP, Operator, Trigger
from hil.values.errors import OutOfRange
from hil.values.fri import OperationMode, SafetyState
from hil.values.motion import Fault
from hil.values.operator import PadKey, ProgramState, SetOverride, StopCategory

K = PadKey
FAULT = Fault("tracking error", "A2 is +0.1 rad off")
MODES = list(OperationMode)


# Calls, because mypy believes that a property stays what it was.
def runs(pad: Operator) -> bool:
    return pad.may_move


def drops(pad: Operator) -> StopCategory | None:
    return pad.drops_drives


def program(pad: Operator) -> ProgramState:
    return pad.view.program


def enabled(mode: OperationMode) -> Operator:
    return Operator(mode=mode, enabled=True)


@pytest.mark.parametrize("mode", MODES)
def test_only_aut_begins_by_itself(mode: OperationMode) -> None:
    assert Operator(mode=mode, enabled=False).may_move is (mode is OperationMode.AUT)
    assert enabled(mode).may_move


@pytest.mark.parametrize("mode", [OperationMode.T1, OperationMode.T2])
def test_in_t1_and_t2_the_enabling_switch_comes_before_the_start_key(mode: OperationMode) -> None:
    pad = Operator(mode=mode, enabled=False)
    assert drops(pad) is StopCategory.BRAKE_AND_DROP
    assert pad.view.safety_state is SafetyState.SAFETY_STOP_LEVEL_1
    assert "hil pad enable" in pad.view.reason
    assert pad.press(K.START) == f"{mode.name}: the enabling switch is not held; hold it first (hil pad enable)"
    assert pad.press(K.ENABLE) == ""
    assert not runs(pad)
    assert drops(pad) is None
    assert pad.view.reason == "the program is paused: press start (hil pad start)"
    assert pad.press(K.START) == ""
    assert runs(pad)
    assert pad.view.reason == ""


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("key", [K.PAUSE, K.RELEASE])
def test_a_released_key_pauses_and_nothing_resumes_by_itself(mode: OperationMode, key: PadKey) -> None:
    pad = enabled(mode)
    pad.press(key)
    paused = key is K.PAUSE or mode is not OperationMode.AUT
    assert runs(pad) is not paused
    pad.press(K.ENABLE)
    assert runs(pad) is not paused
    pad.press(K.START)
    assert runs(pad)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("category", list(StopCategory))
def test_a_stop_needs_an_acknowledgement_and_a_fresh_start(mode: OperationMode, category: StopCategory) -> None:
    pad = enabled(mode)
    assert pad.stopped(category, FAULT)
    assert not runs(pad)
    assert program(pad) is ProgramState.STOPPED
    assert pad.view.safety_state is category.safety_state
    assert str(FAULT) in pad.view.reason
    assert drops(pad) is (None if category is StopCategory.BRAKE_AND_HOLD else category)
    assert "acknowledge the stop (hil pad reset) first" in pad.press(K.START)
    for key in (K.ENABLE, K.PAUSE, K.RELEASE, K.ENABLE):
        assert pad.press(key) == ""
        assert program(pad) is ProgramState.STOPPED
    assert pad.press(K.RESET) == ""
    assert program(pad) is ProgramState.PAUSED
    assert drops(pad) is None
    assert pad.press(K.START) == ""
    assert runs(pad)


def test_nothing_to_acknowledge_is_said() -> None:
    assert enabled(OperationMode.AUT).press(K.RESET) == "there is no stop to acknowledge"


@pytest.mark.parametrize(("first", "second"), [*itertools.product(StopCategory, StopCategory)])
def test_of_two_stops_the_more_severe_counts(first: StopCategory, second: StopCategory) -> None:
    pad = enabled(OperationMode.AUT)
    pad.stopped(first, Fault("first"))
    assert pad.stopped(second, Fault("second")) is (second < first)
    assert pad.stop is not None
    assert pad.stop.category is min(first, second)
    assert pad.stop.reason == ("second" if second < first else "first")


@pytest.mark.parametrize("mode", MODES)
def test_the_emergency_stop_counts_in_every_state(mode: OperationMode) -> None:
    for before in ((), (K.PAUSE,), (K.EMERGENCY_STOP,), (K.EMERGENCY_STOP, K.RESET)):
        pad = enabled(mode)
        for key in (*before, K.EMERGENCY_STOP):
            assert pad.press(key) == ""
        assert program(pad) is ProgramState.EMERGENCY_STOP
        assert drops(pad) is StopCategory.BRAKE_AND_DROP
        assert EMERGENCY_STOP in pad.view.reason
    pad = enabled(mode)
    pad.stopped(StopCategory.BRAKE_AND_HOLD, FAULT)
    pad.press(K.EMERGENCY_STOP)
    assert program(pad) is ProgramState.EMERGENCY_STOP
    assert drops(pad) is StopCategory.BRAKE_AND_DROP
    pad.stopped(StopCategory.DROP, FAULT)
    assert program(pad) is ProgramState.EMERGENCY_STOP
    assert drops(pad) is StopCategory.DROP


@pytest.mark.parametrize(("old", "new"), [*itertools.product(MODES, MODES)])
@pytest.mark.parametrize("moving", [False, True])
def test_another_mode_pauses_or_stops(old: OperationMode, new: OperationMode, moving: bool) -> None:
    pad = enabled(old)
    fault = pad.select(new, moving=moving)
    if new is old:
        assert fault is None
        assert runs(pad)
        return
    assert not runs(pad)
    assert pad.view.mode is new
    assert (fault is not None) is moving
    assert program(pad) is (ProgramState.STOPPED if moving else ProgramState.PAUSED)
    if fault is not None:
        assert str(fault) == f"the operation mode was changed: {old.name} -> {new.name}"
        assert pad.press(K.RESET) == ""
    pad.press(K.START)
    assert runs(pad)


def test_every_state_and_trigger_is_in_the_table_or_refused() -> None:
    missing = {
        (state.name, trigger.name)
        for state, trigger in itertools.product(ProgramState, Trigger)
        if (state, trigger) not in operator.TABLE
    }
    stopped = {"START", "PAUSE", "RELEASE", "SELECT", "STOP"}
    assert missing == {
        *(("RUNNING", name) for name in ("RESET",)),
        *(("PAUSED", name) for name in ("RESET",)),
        *(("STOPPED", name) for name in stopped),
        *(("EMERGENCY_STOP", name) for name in stopped | {"EMERGENCY_STOP"}),
    }


def test_actions_in_words_and_their_bounds() -> None:
    for percent in (-0.1, 100.1, float("nan"), float("inf")):
        with pytest.raises(OutOfRange, match=r"program override .* is outside its range 0 ... 100 %"):
            SetOverride(percent).check()
        assert "0 ... 100 %" in operator.checked(SetOverride(percent))
    assert operator.checked(SetOverride(0.0)) == operator.checked(SetOverride(100.0)) == ""
    assert operator.describe(SetOverride(12.5)) == "pad: override 12.5 %"
