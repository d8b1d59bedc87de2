"""Control modes as values: defaults and ranges of the facts, and a sentence with name, value and range outside them."""

import math
from dataclasses import replace
from typing import Any

import pytest

from hil.values.control import (
    CartesianDof,
    CartesianImpedanceControlMode,
    CartesianPlane,
    ForceOscillation,
    JointImpedanceControlMode,
    by_translation,
    create_desired_force,
    create_lissajous_pattern,
    create_sine_pattern,
    create_spiral_pattern,
    six,
)
from hil.values.errors import ConfigurationError, OutOfRange
from hil.values.load import Load

PLAIN = CartesianImpedanceControlMode()


def test_the_defaults_are_those_of_the_facts() -> None:
    assert PLAIN.stiffness == (2000.0, 2000.0, 2000.0, 200.0, 200.0, 200.0)
    assert PLAIN.damping == (0.7,) * 6
    assert (PLAIN.null_space_stiffness_nm_rad, PLAIN.null_space_damping) == (100.0, 0.7)
    assert PLAIN.max_control_force == PLAIN.max_path_deviation == PLAIN.max_cartesian_velocity == (1e6,) * 6
    assert not PLAIN.stop_on_max_control_force
    assert JointImpedanceControlMode().damping == (0.7,) * 7


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"stiffness": by_translation(5001.0, 100.0)}, r"translational stiffness X 5001 .* 0 \.\.\. 5000 N/m"),
        ({"stiffness": (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)}, "translational stiffness Z -1 "),
        ({"stiffness": by_translation(0.0, 301.0)}, r"rotational stiffness A 301 .* 0 \.\.\. 300 Nm/rad"),
        ({"damping": (0.1, 0.1, 0.1, 0.1, 0.1, 1.1)}, r"damping C 1\.1 .* 0\.1 \.\.\. 1"),
        ({"damping": six(0.09)}, "damping X 0.09"),
        ({"null_space_stiffness_nm_rad": -1.0}, "null space stiffness -1 .* >= 0 Nm/rad"),
        ({"null_space_damping": 0.2}, "null space damping 0.2"),
        ({"additional_control_force": six(math.nan)}, "additional control force X nan"),
        ({"max_control_force": (1.0, 0.0, 1.0, 1.0, 1.0, 1.0)}, "max control force Y 0 .* > 0"),
        ({"max_path_deviation": six(-1.0)}, "max path deviation X -1"),
        ({"max_cartesian_velocity": six(math.inf)}, "max Cartesian velocity X inf"),
    ],
)
def test_cartesian_values_out_of_range_are_refused_by_name(change: dict[str, Any], words: str) -> None:
    with pytest.raises(OutOfRange, match=words):
        replace(PLAIN, **change)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"amplitude": six(-1.0)}, "amplitude X -1"),
        ({"frequency_hz": six(15.1)}, r"frequency X 15\.1 .* 0 \.\.\. 15 Hz"),
        ({"phase_deg": six(math.inf)}, "phase X inf"),
        ({"force_limit": six(0.0)}, "force limit X 0"),
        ({"position_limit": six(0.0)}, "position limit X 0"),
        ({"rise_time_s": -0.1}, "rise time -0.1"),
        ({"hold_time_s": -0.1}, "hold time -0.1"),
        ({"hold_time_s": math.nan}, "hold time nan"),
        ({"fall_time_s": math.inf}, "fall time inf"),
    ],
)
def test_oscillation_values_out_of_range_are_refused_by_name(change: dict[str, Any], words: str) -> None:
    with pytest.raises(OutOfRange, match=words):
        replace(ForceOscillation(), **change)


def test_joint_values_out_of_range_are_refused_by_axis() -> None:
    stiffness = JointImpedanceControlMode().stiffness_nm_rad
    with pytest.raises(OutOfRange, match=r"joint stiffness A7 -1 .* >= 0 Nm/rad"):
        JointImpedanceControlMode(stiffness_nm_rad=(*stiffness[:6], -1.0))
    with pytest.raises(OutOfRange, match=r"joint damping A1 1\.01"):
        JointImpedanceControlMode(damping=(1.01, *stiffness[1:]))


def test_another_count_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="5 values given"):
        replace(PLAIN, damping=(0.7,) * 5)  # type: ignore[arg-type]  # the mistake that is tested
    with pytest.raises(ConfigurationError, match="3 values given"):
        six((1.0, 2.0, 3.0))


def test_a_load_no_body_can_be_is_refused() -> None:
    with pytest.raises(OutOfRange, match="load mass -1"):
        Load(mass_kg=-1.0)
    with pytest.raises(ConfigurationError, match="larger than the sum"):
        Load(mass_kg=1.0, moments_kg_m2=(0.1, 0.01, 0.01))
    with pytest.raises(ConfigurationError, match="three finite"):
        Load(mass_kg=1.0, centre_m=(0.0, 0.0, math.nan))


def test_patterns_are_combinations_of_sines() -> None:
    sine = create_sine_pattern(CartesianDof.Z, 2.0, 15.0, 500.0)
    assert sine.impedance.stiffness == (2000.0, 2000.0, 500.0, 200.0, 200.0, 200.0)
    assert sine.oscillation.amplitude == (0.0, 0.0, 15.0, 0.0, 0.0, 0.0)
    assert create_desired_force(CartesianDof.A, 2.0, 50.0).oscillation.bias == (0.0, 0.0, 0.0, 2.0, 0.0, 0.0)
    figure = create_lissajous_pattern(CartesianPlane.YZ, 5.0, 20.0, 300.0)
    assert figure.oscillation.frequency_hz == (0.0, 5.0, 2.0, 0.0, 0.0, 0.0)
    assert figure.impedance.stiffness[:3] == (2000.0, 300.0, 300.0)
    spiral = create_spiral_pattern(CartesianPlane.XZ, 3.0, 10.0, 800.0, 6.0).oscillation
    assert (spiral.rise_time_s, spiral.hold_time_s, spiral.fall_time_s) == (3.0, 0.0, 3.0)
    assert (spiral.phase_deg[0], spiral.phase_deg[2]) == (0.0, 90.0)
    with pytest.raises(OutOfRange, match="frequency Y"):
        create_sine_pattern(CartesianDof.Y, 16.0, 1.0, 100.0)
    with pytest.raises(OutOfRange, match="total time"):
        create_spiral_pattern(CartesianPlane.XY, 1.0, 1.0, 1.0, -1.0)
