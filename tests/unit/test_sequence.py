"""Sequence counters: every kind of wrong order has its name, and 2^32 is no edge."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.core.fri.sequence import REMEMBERED, SequenceTracker
from hil.values.fri import SEQUENCE_MODULUS
from hil.values.outcomes import Outcome

FIRSTS = (0, 1000, SEQUENCE_MODULUS - 5, SEQUENCE_MODULUS - 1)


def tracker_with(count: int, *, first: int = 0) -> SequenceTracker:
    tracker = SequenceTracker(first_counter=first)
    for index in range(count):
        assert tracker.sent(at_ns=index * 1000) == (first + index) % SEQUENCE_MODULUS
    return tracker


@pytest.mark.parametrize("first", FIRSTS)
def test_outcomes_around_the_wrap(first: int) -> None:
    def at(index: int) -> int:
        return (first + index) % SEQUENCE_MODULUS

    tracker = tracker_with(12, first=first)
    assert tracker.judge(at(7), now_ns=9000) == (Outcome.ACCEPTED, 2000, "")
    tracker.answered(at(7), client_counter=0)
    assert tracker.judge(at(7), now_ns=9000).outcome is Outcome.DUPLICATE
    assert tracker.judge(at(6), now_ns=9000).outcome is Outcome.REORDERED
    assert tracker.judge(at(8), now_ns=9000).outcome is Outcome.ACCEPTED
    tracker.answered(at(8), client_counter=1)
    assert tracker.judge(at(7), now_ns=9000).outcome is Outcome.REPLAYED
    assert tracker.judge(at(12), now_ns=9000).outcome is Outcome.UNSENT_SEQUENCE
    assert tracker.judge(at(-1), now_ns=9000).outcome is not Outcome.ACCEPTED


def test_nothing_was_sent_so_nothing_can_be_answered() -> None:
    assert SequenceTracker().judge(0, now_ns=0).outcome is Outcome.UNSENT_SEQUENCE


def test_what_is_too_old_to_remember_is_a_replay() -> None:
    tracker = tracker_with(REMEMBERED + 10)
    assert tracker.judge(9, now_ns=0).outcome is Outcome.REPLAYED
    assert tracker.judge(10, now_ns=0).outcome is Outcome.ACCEPTED


@pytest.mark.parametrize("start", FIRSTS)
def test_a_restarted_client_is_told_by_its_own_counter(start: int) -> None:
    tracker = tracker_with(10)
    assert not tracker.answered(1, client_counter=start)
    assert not tracker.answered(2, client_counter=(start + 1) % SEQUENCE_MODULUS)
    assert not tracker.answered(3, client_counter=(start + 3) % SEQUENCE_MODULUS)
    assert tracker.answered(4, client_counter=(start + 3) % SEQUENCE_MODULUS)
    assert tracker.answered(5, client_counter=start)


@given(st.integers(0, SEQUENCE_MODULUS - 1), st.lists(st.integers(0, 60), max_size=80))
def test_no_message_is_ever_accepted_twice(first: int, reflected: list[int]) -> None:
    tracker = tracker_with(40, first=first)
    accepted: list[int] = []
    for client_counter, index in enumerate(reflected):
        counter = (first + index) % SEQUENCE_MODULUS
        if tracker.judge(counter, now_ns=10**6).outcome is Outcome.ACCEPTED:
            tracker.answered(counter, client_counter)
            accepted.append(index)
    assert accepted == sorted(set(accepted))
    assert all(index < 40 for index in accepted)


def test_months_without_an_answer_order_nothing_wrongly() -> None:
    tracker = tracker_with(10)
    tracker.answered(9, client_counter=0)
    tracker.next_counter = 2**31 + 100
    for index in range(5):
        tracker.sent(at_ns=index)
    assert tracker.judge(2**31 + 104, now_ns=10).outcome is Outcome.ACCEPTED
    assert tracker.judge(9, now_ns=10).outcome is not Outcome.ACCEPTED
