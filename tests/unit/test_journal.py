"""Entries of a recording's journal: what is written is read back, and what is damaged is named."""

import json
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.runtime.pad_requests import PadRequest, read_request, write_action
from hil.values.arm import Push
from hil.values.fri import OperationMode
from hil.values.operator import OperatorAction, PadKey, Press, SelectMode, SetInput, SetOverride
from transport.capture.journal import (
    MAX_TEXT_BYTES,
    ActionEntry,
    CloseEntry,
    EndEntry,
    Entry,
    FailedEntry,
    LostEntry,
    TickEntry,
    encode_entry,
    inputs_crc32,
    read_entries,
    tick_entry,
)

times = st.integers(-(1 << 63), (1 << 63) - 1)
robots = st.integers(0, 255)
texts = st.text(max_size=50)
entries = st.one_of(
    st.builds(TickEntry, robots, times, times, times, st.integers(0, (1 << 32) - 1)),
    st.builds(ActionEntry, robots, times, texts),
    st.builds(CloseEntry, robots, times),
    st.builds(FailedEntry, robots, times, texts),
    st.builds(LostEntry, st.integers(0, (1 << 64) - 1)),
    st.just(EndEntry()),
)


@given(st.lists(entries))
def test_what_is_written_is_read(written: list[Entry]) -> None:
    assert list(read_entries(b"".join(map(encode_entry, written)))) == written


def test_the_tick_of_the_control_path_is_a_tick() -> None:
    told = tick_entry(2, due_ns=5, lateness_ns=6, departed_ns=7, inputs_crc32=8)
    assert list(read_entries(told)) == [TickEntry(2, 5, 6, 7, 8)]


def test_kinds_of_later_versions_are_passed_over() -> None:
    later = bytes([200, 0, 3, 0]) + b"abc"
    assert list(read_entries(encode_entry(EndEntry()) + later + encode_entry(LostEntry(1)))) == [
        EndEntry(),
        LostEntry(1),
    ]


@given(st.binary(max_size=60))
def test_any_bytes_are_entries_or_a_value_error(data: bytes) -> None:
    with suppress(ValueError):
        assert all(isinstance(one, tuple) for one in read_entries(data))


def test_a_cut_entry_is_named() -> None:
    whole = encode_entry(CloseEntry(0, 1))
    for size in (2, 7):
        with pytest.raises(ValueError, match=r"head of an entry|has only"):
            list(read_entries(whole[:size]))


def test_texts_are_cut_at_a_whole_character() -> None:
    [entry] = read_entries(encode_entry(FailedEntry(0, 0, "µ" * MAX_TEXT_BYTES)))
    assert entry == FailedEntry(0, 0, "µ" * (MAX_TEXT_BYTES // 2))


@given(st.lists(st.tuples(st.binary(max_size=20), times), min_size=1, max_size=4), st.data())
def test_the_crc_of_inputs_depends_on_every_bit_and_on_their_order(
    inputs: list[tuple[bytes, int]], data: st.DataObject
) -> None:
    def crc(told: list[tuple[bytes, int]]) -> int:
        whole = 0
        for payload, at_ns in told:
            whole = inputs_crc32(payload, at_ns, whole)
        return whole

    at = data.draw(st.integers(0, len(inputs) - 1))
    payload, at_ns = inputs[at]
    changed = [*inputs[:at], (payload, at_ns ^ 1), *inputs[at + 1 :]]
    assert crc(changed) != crc(inputs)
    if payload:
        byte = data.draw(st.integers(0, len(payload) - 1))
        flipped = payload[:byte] + bytes([payload[byte] ^ 4]) + payload[byte + 1 :]
        assert crc([*inputs[:at], (flipped, at_ns), *inputs[at + 1 :]]) != crc(inputs)


@pytest.mark.parametrize(
    "action",
    [
        *map(Press, PadKey),
        *map(SelectMode, OperationMode),
        SetOverride(33.5),
        SetInput("Group.Name", True),  # the value of a boolean input
        SetInput("Group.Level", 0.1),
        SetInput("Group.Count", 1 << 63),
        Push(3, (1.0, -2.5, 1e-3), (0.0, 0.1, 0.0), 0.25),
    ],
)
def test_an_action_of_the_operator_comes_back_from_its_text(action: OperatorAction) -> None:

    assert read_request(json.dumps(write_action(action)).encode()) == PadRequest(action)
