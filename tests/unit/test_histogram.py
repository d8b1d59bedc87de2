"""Histogram laws against numpy on random data."""

import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.core.statistics import Histogram


@given(st.lists(st.integers(min_value=0, max_value=2**62), min_size=1, max_size=200))
def test_quantiles_are_within_a_bucket_of_the_sorted_list(values: list[int]) -> None:
    histogram = Histogram()
    for value in values:
        histogram.add(value)
    ordered = sorted(values)
    for fraction in (0.01, 0.5, 0.9, 0.99, 1.0):
        exact = ordered[max(0, int(np.ceil(len(values) * fraction)) - 1)]
        found = histogram.quantile(fraction)
        assert found is not None
        assert exact <= found <= max(exact + exact // 32 + 1, exact)
    assert histogram.maximum == max(values)
    assert histogram.count == len(values)


def test_empty_histogram_has_no_figures() -> None:
    assert Histogram().summary_us() == {"p50": None, "p99": None, "p99_9": None, "max": None}


def test_negative_values_count_as_zero() -> None:
    histogram = Histogram()
    histogram.add(-5)
    assert (histogram.count, histogram.maximum, histogram.quantile(0.5)) == (1, 0, 0)


def test_summary_is_in_microseconds() -> None:
    histogram = Histogram()
    for _ in range(100):
        histogram.add(60_000)
    assert histogram.summary_us()["p50"] == pytest.approx(60.0, rel=0.02)
    assert histogram.summary_us()["max"] == 60.0


@given(st.lists(st.integers(min_value=-5, max_value=2**62), min_size=1, max_size=200))
def test_minimum_mean_and_standard_deviation_are_exact(values: list[int]) -> None:
    histogram = Histogram()
    for value in values:
        histogram.add(value)
    counted = [max(0, value) for value in values]
    assert histogram.minimum == min(counted)
    assert histogram.mean == pytest.approx(statistics.fmean(counted), rel=1e-12)
    assert histogram.standard_deviation == pytest.approx(statistics.pstdev(counted), rel=1e-9, abs=1e-9)


def test_a_small_deviation_on_a_large_mean_is_not_lost() -> None:
    histogram = Histogram()
    for value in (10**17, 10**17 + 2) * 1000:
        histogram.add(value)
    assert histogram.standard_deviation == 1.0


def test_an_empty_histogram_has_no_mean() -> None:
    histogram = Histogram()
    assert (histogram.count, histogram.minimum, histogram.mean, histogram.standard_deviation) == (0, None, None, None)
