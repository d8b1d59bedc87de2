"""Reaction, rise, overshoot and settling against responses whose figures are known in closed form."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tools.step_response.figures_of_merit import FiguresOfMerit, crossing, differences, figures_of_merit, peak

CYCLE = 0.001
DEAD = st.integers(0, 60).map(lambda cycles: cycles * CYCLE)
STEPS = st.floats(0.01, 100.0)


def measured(
    response: Callable[[float], float], *, step: float, dead: float, lasts: float, share: float = 1e-6
) -> FiguresOfMerit:
    """Sample ``step`` times a unit response after a dead time, with 20 cycles before."""
    times = [place * CYCLE for place in range(-20, round((dead + lasts) / CYCLE))]
    ways = [step * response(at - dead) if at > dead else 0.0 for at in times]
    return figures_of_merit(times, ways, step=step, threshold=share * step)


@given(st.floats(0.005, 0.05), STEPS, DEAD)
def test_a_first_order_lag(constant: float, step: float, dead: float) -> None:
    found = measured(lambda at: 1.0 - math.exp(-at / constant), step=step, dead=dead, lasts=8.0 * constant)
    assert found.rise == pytest.approx(constant * math.log(9.0), abs=CYCLE / 5)
    assert found.settling == pytest.approx(dead + constant * math.log(50.0), abs=CYCLE / 5)
    assert found.seen == pytest.approx(dead - constant * math.log(0.98), abs=CYCLE)
    assert found.overshoot_percent == 0.0
    assert found.reaction == pytest.approx(dead + CYCLE, abs=1.01 * CYCLE)


@given(st.floats(0.2, 0.9), st.floats(20.0, 150.0), STEPS, DEAD)
def test_an_oscillator_overshoots_by_what_its_damping_says(
    damping: float, frequency: float, step: float, dead: float
) -> None:
    root = math.sqrt(1.0 - damping * damping)

    def response(at: float) -> float:
        phase = frequency * root * at
        return 1.0 - math.exp(-damping * frequency * at) * (math.cos(phase) + damping / root * math.sin(phase))

    found = measured(response, step=step, dead=dead, lasts=6.0 / (damping * frequency))
    # The highest sample may be half a cycle beside the peak.
    beside = 100.0 * (frequency * CYCLE) ** 2
    assert found.overshoot_percent == pytest.approx(100.0 * math.exp(-math.pi * damping / root), abs=beside)
    assert found.settling is not None
    envelope = math.log(1.0 / (0.02 * root)) / (damping * frequency)
    assert found.settling <= dead + envelope + CYCLE
    inside = 1.01 * found.settling - dead
    assert all(abs(response(inside + place * CYCLE) - 1.0) <= 0.0201 for place in range(200))


@given(st.integers(20, 300), STEPS, DEAD)
def test_a_ramp_is_exact(cycles: int, step: float, dead: float) -> None:
    lasts = cycles * CYCLE
    found = measured(lambda at: min(1.0, at / lasts), step=step, dead=dead, lasts=lasts + 0.05)
    assert found.rise == pytest.approx(0.8 * lasts, abs=1e-9)
    assert found.settling == pytest.approx(dead + 0.98 * lasts, abs=1e-9)
    assert found.seen == pytest.approx(dead + 0.02 * lasts, abs=1e-9)


@given(st.floats(1e-3, 1e3))
def test_units_do_not_matter(unit: float) -> None:
    def response(at: float) -> float:
        return 1.0 - math.exp(-at / 0.02)

    one, other = (measured(response, step=step, dead=0.012, lasts=0.2) for step in (1.0, unit))
    for name in ("reaction", "seen", "rise", "settling"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), abs=1e-9)


def test_what_did_not_happen_is_none() -> None:
    still = figures_of_merit([0.0, 1.0, 2.0], [0.0, 0.0, 0.0], step=1.0, threshold=0.1)
    assert still == FiguresOfMerit(reaction=None, seen=None, rise=None, overshoot_percent=0.0, settling=None)
    half_way = figures_of_merit([0.0, 1.0, 2.0], [0.0, 0.3, 0.5], step=1.0, threshold=0.1)
    assert (half_way.reaction, half_way.rise, half_way.settling) == (1.0, None, None)
    assert figures_of_merit([], [], step=1.0, threshold=0.1).settling is None


def test_a_way_that_leaves_the_band_again_has_not_settled() -> None:
    ways = [0.0, 1.0, 1.0, 0.9, 1.0]
    found = figures_of_merit([0.0, 1.0, 2.0, 3.0, 4.0], ways, step=1.0, threshold=0.1)
    assert found.settling == pytest.approx(3.8)
    assert figures_of_merit([0.0, 1.0, 2.0], [0.0, 1.0, 1.1], step=1.0, threshold=0.1).settling is None


def test_moving_the_wrong_way_is_a_reaction_too() -> None:
    assert figures_of_merit([0.0, 1.0, 2.0], [0.0, -0.5, 1.0], step=1.0, threshold=0.1).reaction == 1.0


def test_crossings_differences_and_peaks() -> None:
    assert crossing([0.0, 1.0], [0.0, 4.0], 1.0) == 0.25
    assert crossing([5.0], [4.0], 1.0) == 5.0
    assert differences([1.0, 3.0, 2.0], period=0.5) == [0.0, 4.0, -2.0]
    assert peak([1.0, -3.0, 2.0]) == 3.0
    assert peak([]) == 0.0
