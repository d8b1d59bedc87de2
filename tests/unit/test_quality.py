"""Quality: thresholds to the answer, falls at once, rises one level in half a second."""

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.core.fri.quality import QualityMeter
from hil.values.fri import Quality

MS = 1_000_000


def meter_after(answers: Sequence[int | None], *, budget_ms: int = 1) -> QualityMeter:
    """Feed one expected answer a budget: its latency in ns, or None for a missed one."""
    meter = QualityMeter(budget_ns=budget_ms * MS)
    for index, latency_ns in enumerate(answers):
        now_ns = index * budget_ms * MS
        if latency_ns is None:
            meter.missed(now_ns=now_ns)
        else:
            meter.answered(now_ns=now_ns, latency_ns=latency_ns)
    return meter


def test_it_starts_poor_and_rises_one_level_each_half_second() -> None:
    assert meter_after([100] * 500).quality is Quality.POOR
    assert meter_after([100] * 501).quality is Quality.FAIR
    assert meter_after([100] * 1001).quality is Quality.GOOD
    assert meter_after([100] * 1501).quality is Quality.EXCELLENT


@pytest.mark.parametrize(
    ("missed", "expected"),
    [
        (0, Quality.EXCELLENT),
        (10, Quality.EXCELLENT),
        (11, Quality.GOOD),
        (50, Quality.GOOD),
        (51, Quality.FAIR),
        (250, Quality.FAIR),
        (251, Quality.POOR),
    ],
)
def test_it_falls_at_once_at_each_threshold(missed: int, expected: Quality) -> None:
    assert meter_after([100] * 2000 + [None] * missed).quality is expected


def test_slow_answers_are_good_but_not_excellent() -> None:
    half = MS // 2
    assert meter_after([half] * 3000).quality is Quality.GOOD
    assert meter_after([half - 1] * 3000).quality is Quality.EXCELLENT
    assert meter_after(([half - 1] * 19 + [half]) * 200).quality is Quality.EXCELLENT
    assert meter_after(([half - 1] * 18 + [half] * 2) * 200).quality is Quality.GOOD


def test_one_missed_answer_in_ten_is_fair_at_100_ms() -> None:
    meter = meter_after([100] * 20, budget_ms=100)
    qualities = [meter.quality]
    meter.missed(now_ns=2000 * MS)
    qualities.append(meter.quality)
    assert qualities == [Quality.EXCELLENT, Quality.FAIR]


@given(st.lists(st.one_of(st.none(), st.integers(0, MS)), max_size=400), st.sampled_from([1, 5, 20, 100]))
def test_it_never_rises_by_more_than_one_level_and_counts_its_window(answers: list[int | None], budget_ms: int) -> None:
    meter = QualityMeter(budget_ns=budget_ms * MS)
    before = meter.quality
    for index, latency_ns in enumerate(answers):
        now_ns = index * budget_ms * MS
        if latency_ns is None:
            meter.missed(now_ns=now_ns)
        else:
            meter.answered(now_ns=now_ns, latency_ns=latency_ns)
        assert meter.quality <= before + 1
        before = meter.quality
        window = answers[max(0, index + 1 - 1000 // budget_ms) : index + 1]
        assert meter.expected_count == len(window)
        assert meter.answered_count == sum(latency is not None for latency in window)


def test_a_nearly_empty_window_lowers_nothing() -> None:
    meter = meter_after([100] * 2000)
    meter.missed(now_ns=5_000 * MS)
    assert meter.expected_count == 1
    assert meter.quality is Quality.EXCELLENT
    assert meter.missed_in_a_row == 1
