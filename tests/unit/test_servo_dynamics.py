"""SmartServo's base table keeps the rule it states: full load, arm stretched; and what the unloaded arm can do."""

import itertools
import math

import numpy as np
import pinocchio
import pytest
from numpy.typing import NDArray

from backends.robots import load_description, load_pinocchio

SIZES = [("lbr-iiwa-7-r800", "lbr-med-7"), ("lbr-iiwa-14-r820", "lbr-med-14")]
STEP_RAD = math.radians(5.0)
Array = NDArray[np.float64]


def loaded(name: str) -> "pinocchio.Model":
    """Return the robot with its rated payload as a point at the flange."""
    model = load_pinocchio(name)
    flange = model.frames[model.getFrameId("flange")]
    load = pinocchio.Inertia(load_description(name).payload_kg, np.zeros(3), np.zeros((3, 3)))
    model.appendBodyToJoint(flange.parentJoint, load, flange.placement)
    return model


def mass_and_reserve(name: str, model: "pinocchio.Model", position: Array) -> tuple[Array, Array]:
    """Return the mass matrix, and what gravity leaves of the torques."""
    upper = np.triu(pinocchio.crba(model, model.createData(), position))
    gravity = pinocchio.computeGeneralizedGravity(model, model.createData(), position)
    return upper + np.triu(upper, 1).T, np.array(load_description(name).limits.torque_nm) - np.abs(gravity)


def all_at_once(name: str) -> Array:
    """Half of what full load leaves, in the worst of many poses, when all axes accelerate against each other."""
    model = loaded(name)
    worst = np.full(7, np.inf)
    quarter = math.pi / 2
    poses = [
        *itertools.product(
            (0.0,), (0.0, quarter), (0.0, quarter), (0.0, quarter, -quarter), (0.0, quarter), (0.0, quarter), (0.0,)
        )
    ]
    for pose in poses:
        mass, reserve = mass_and_reserve(name, model, np.array(pose))
        worst = np.minimum(worst, reserve / np.abs(mass).sum(axis=1))
    return 0.5 * worst


def alone_without_load(name: str) -> Array:
    """A twentieth of 90 % of what an axis of the unloaded arm can do by itself in the pose of the step responses."""
    position = np.array(load_description(name).initial_position_rad)
    mass, reserve = mass_and_reserve(name, load_pinocchio(name), position)
    return 0.9 / 20.0 * reserve / np.diag(mass)


@pytest.mark.parametrize("names", SIZES)
def test_the_base_acceleration_is_the_smaller_of_the_two_rounded_down(names: tuple[str, str]) -> None:
    rules = np.min([rule(name) for name in names for rule in (all_at_once, alone_without_load)], axis=0)
    for name in names:
        base = np.array(load_description(name).servo.acceleration_rad_s2)
        assert np.all(base <= rules)
        assert np.all(base >= 0.92 * rules)


@pytest.mark.parametrize("name", [name for names in SIZES for name in names])
def test_the_base_jerk_lets_the_fast_setting_reach_its_acceleration_in_five_degrees(name: str) -> None:
    description = load_description(name)
    fast = 20.0 * np.array(description.servo.acceleration_rad_s2)
    rules = np.minimum(np.sqrt(2.0 * fast**3 / STEP_RAD) / 5.0, description.limits.jerk_rad_s3)
    base = np.array(description.servo.jerk_rad_s3)
    assert np.all(base <= rules)
    assert np.all(base >= 0.92 * rules)
