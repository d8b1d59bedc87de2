"""The superposed force oscillation: what it is at which time, and that a change of it does not jump."""

import itertools
import math
from dataclasses import replace

import pytest

from hil.core.control.oscillation import Oscillation
from hil.values.control import CartesianPlane, ForceOscillation, create_spiral_pattern
from hil.values.robot import Six

STILL: Six = (0.0,) * 6
SINE = ForceOscillation(
    amplitude=(0.0, 20.0, 0.0, 0.0, 0.0, 0.0),
    frequency_hz=(0.0, 2.0, 0.0, 0.0, 0.0, 0.0),
    phase_deg=(0.0, 30.0, 0.0, 0.0, 0.0, 0.0),
    bias=(0.0, 5.0, 0.0, 1.0, 0.0, 0.0),
)
MS = 1_000_000
START = 7_000 * MS


def forces(oscillation: Oscillation, cycles: int, *, begin: int = 0) -> list[float]:
    """Return Y of so many cycles."""
    return [oscillation.force(STILL, now_ns=START + (begin + cycle) * MS)[1] for cycle in range(cycles)]


def test_it_is_bias_plus_sine_from_its_first_cycle_on() -> None:
    for cycle, force in enumerate(forces(Oscillation(SINE), 1200)):
        expected = 5.0 + 20.0 * math.sin(2.0 * math.pi * 2.0 * cycle * 1e-3 + math.radians(30.0))
        assert force == pytest.approx(expected, abs=1e-9), cycle


def test_it_fades_in_holds_and_fades_out() -> None:
    oscillation = Oscillation(
        ForceOscillation(bias=(0.0, 10.0, 0.0, 0.0, 0.0, 0.0), rise_time_s=0.1, hold_time_s=0.2, fall_time_s=0.1)
    )
    run = forces(oscillation, 401)
    assert run[0] == 0.0
    assert run[50] == pytest.approx(5.0)
    assert run[100:300] == pytest.approx([10.0] * 200)
    assert run[350] == pytest.approx(5.0)
    assert run[400] == pytest.approx(0.0, abs=1e-9)
    assert oscillation.over
    assert max(abs(after - before) for before, after in itertools.pairwise(run)) < 0.1 + 1e-9


def test_without_hold_time_it_goes_on_for_ever() -> None:
    oscillation = Oscillation(SINE)
    oscillation.force(STILL, now_ns=0)
    oscillation.force(STILL, now_ns=3_600_000 * MS)
    assert not oscillation.over


def test_the_force_limit_cuts_the_sum_off() -> None:
    run = forces(Oscillation(replace(SINE, force_limit=(1e6, 12.0, 1e6, 1e6, 1e6, 1e6))), 500)
    assert max(run) == 12.0
    assert min(run) == -12.0


def test_beyond_the_position_limit_it_only_pushes_back() -> None:
    oscillation = Oscillation(replace(SINE, position_limit=(1e6, 3.0, 1e6, 1e6, 1e6, 1e6)))
    there: Six = (0.0, 3.1, 0.0, 0.0, 0.0, 0.0)
    run = [oscillation.force(there, now_ns=START + cycle * MS)[1] for cycle in range(500)]
    assert max(run) == 0.0
    assert min(run) < -14.0
    assert oscillation.force(STILL, now_ns=START + 500 * MS)[3] == 1.0


def test_another_frequency_changes_no_force() -> None:
    oscillation = Oscillation(SINE)
    before = forces(oscillation, 237)[-1]
    oscillation.change(replace(SINE, frequency_hz=(0.0, 9.0, 0.0, 0.0, 0.0, 0.0)))
    assert oscillation.force(STILL, now_ns=START + 236 * MS)[1] == pytest.approx(before, abs=1e-9)
    after = forces(oscillation, 2, begin=236)[-1]
    assert abs(after - before) < 20.0 * 2.0 * math.pi * 9.0 * 1e-3


def test_another_amplitude_changes_the_force_by_its_share() -> None:
    oscillation = Oscillation(SINE)
    before = forces(oscillation, 100)[-1]
    oscillation.change(replace(SINE, amplitude=(0.0, 40.0, 0.0, 0.0, 0.0, 0.0)))
    after = oscillation.force(STILL, now_ns=START + 99 * MS)[1]
    assert after - 5.0 == pytest.approx(2.0 * (before - 5.0), abs=1e-9)


def test_a_spiral_is_a_circle_that_grows_and_shrinks() -> None:
    oscillation = Oscillation(create_spiral_pattern(CartesianPlane.XY, 4.0, 10.0, 500.0, 2.0).oscillation)
    for cycle in range(2001):
        x, y, *rest = oscillation.force(STILL, now_ns=cycle * MS)
        share = 1.0 - abs(cycle * 1e-3 - 1.0)
        assert math.hypot(x, y) == pytest.approx(10.0 * share, abs=1e-6)
        assert rest == [0.0] * 4
    assert oscillation.over
