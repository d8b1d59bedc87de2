"""What one answer of the inverse kinematics costs, over random poses of one robot."""

import random
from typing import Any, Final, NamedTuple

from backends.robots import load_description, load_pinocchio
from hil.clock import elapsed_ns
from hil.core.kinematics.redundancy import nearest
from hil.core.kinematics.srs import SrsKinematics
from hil.core.statistics import Histogram
from hil.values.arm import seven
from hil.values.robot import Seven
from tools.bench.bounds import Bound, at_most

STEP_RAD: Final = 0.01
"""How far an axis moves between two destinations of a servo motion, at most."""


class KinematicsReport(NamedTuple):
    """Figures of one robot."""

    robot: str
    poses: int
    inverse: Histogram
    """One pose, one E1, one branch."""
    nearest: Histogram
    """A destination near the arm, as servo motions ask for it: the nearest axis positions, E1 and branch chosen."""
    far: Histogram
    """A destination anywhere: most of these need a search over E1."""

    def as_dict(self) -> dict[str, Any]:
        """Return the figures as plain values."""
        names = ("inverse", "nearest", "far")
        return {
            "robot": self.robot,
            "poses": self.poses,
            **{f"{name}_us": getattr(self, name).summary_us() for name in names},
        }

    def bounds(self) -> list[Bound]:
        """Return the bound of the issue: one answer under 30 us, median."""
        return [
            at_most("one inverse, median", self.inverse.summary_us()["p50"] or 0.0, 30.0, "us"),
            at_most("one destination of a servo motion, median", self.nearest.summary_us()["p50"] or 0.0, 30.0, "us"),
        ]


def bench_kinematics(robot: str, *, poses: int, seed: int = 0) -> KinematicsReport:
    """Measure ``poses`` random poses, seeded."""
    limits = load_description(robot).limits
    arm = SrsKinematics(load_pinocchio(robot), limits)
    chance = random.Random(seed)  # noqa: S311  # poses, not secrets

    def anywhere() -> Seven:
        return seven(
            [
                chance.uniform(low, high)
                for low, high in zip(limits.position_min_rad, limits.position_max_rad, strict=True)
            ]
        )

    report = KinematicsReport(robot, poses, Histogram(), Histogram(), Histogram())
    before = anywhere()
    for _ in range(poses):
        position = anywhere()
        pose, status = arm.forward(position), arm.status_of(position)
        began_ns = elapsed_ns()
        arm.inverse(pose, position[2], status)
        report.inverse.add(elapsed_ns() - began_ns)
        beside = seven([value + chance.uniform(-STEP_RAD, STEP_RAD) for value in position])
        began_ns = elapsed_ns()
        nearest(arm, pose, beside)
        report.nearest.add(elapsed_ns() - began_ns)
        began_ns = elapsed_ns()
        nearest(arm, pose, before)
        report.far.add(elapsed_ns() - began_ns)
        before = position
    return report
