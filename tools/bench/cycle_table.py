"""``hil bench cycle --all``: one cycle under every motion, control mode, release and simulated robot side.

A Cabinet and CiA 402 drives have clocks of their own: ``hil bench chain`` and ``hil bench can402`` measure those.
"""

from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple

from hil.config.control import ControlConfig, ControlName
from hil.config.station import FriConfig, Mode, RobotConfig, ServoConfig
from hil.values.fri import Release
from tools.bench.bounds import BOTH_LINKS_MEDIAN_US, BOTH_LINKS_P99_US, Bound, at_most
from tools.bench.clients import OVERLAY_UNDER, BenchMotion
from tools.bench.cycle import CycleReport, measure_whole

BACKENDS: Final = ("mujoco", "ideal")
BOTH_LINKS: Final = "FRI 1.15, servo link beside it"


class Case(NamedTuple):
    """One row, on each backend."""

    name: str
    motion: BenchMotion
    keys: dict[str, Any]

    def config(self, robot: str, backend: str) -> RobotConfig:
        """Return the robot."""
        return RobotConfig(model=robot, backend=backend, enabled=True, **self.keys)


def _fri(release: Release = Release.V1_15, control: ControlName = ControlName.POSITION, **more: Any) -> dict[str, Any]:
    fri = FriConfig(release=release, overlay=OVERLAY_UNDER[control], control=ControlConfig(mode=control))
    return {"fri": fri, **more}


CASES: Final = (
    Case(BOTH_LINKS, BenchMotion.FRI_OVERLAY, _fri(servo=ServoConfig())),
    Case("FRI 1.15", BenchMotion.FRI_OVERLAY, _fri()),
    Case("FRI 1.15, T1", BenchMotion.FRI_OVERLAY, _fri(mode=Mode.T1)),
    Case("FRI 2.5", BenchMotion.FRI_OVERLAY, _fri(Release.V2_5)),
    Case("FRI 2.7", BenchMotion.FRI_OVERLAY, _fri(Release.V2_7)),
    Case("FRI 1.15, torques, joint impedance", BenchMotion.FRI_OVERLAY, _fri(control=ControlName.JOINT_IMPEDANCE)),
    Case(
        "FRI 1.15, wrench, Cartesian impedance", BenchMotion.FRI_OVERLAY, _fri(control=ControlName.CARTESIAN_IMPEDANCE)
    ),
    Case("SmartServo, retargeted each cycle", BenchMotion.SMART_SERVO, {"servo": ServoConfig()}),
    Case("DirectServo, retargeted each cycle", BenchMotion.DIRECT_SERVO, {"servo": ServoConfig()}),
)


class TableRow(NamedTuple):
    """What a case cost on one backend."""

    case: str
    report: CycleReport


def bench_table(robot: str, *, cycles: int, progress: Callable[[int], None]) -> Iterator[TableRow]:
    """Measure ``cycles`` cycles of each case; the ideal arm has no torques, and knows no impedance."""
    for case in CASES:
        for backend in BACKENDS:
            config = case.config(robot, backend)
            yields = config.fri is not None and config.fri.control.mode is not ControlName.POSITION
            if not (yields and backend == "ideal"):
                yield TableRow(case.name, measure_whole(config, motion=case.motion, cycles=cycles))
            progress(1)


def bounds_of(rows: list[TableRow]) -> list[Bound]:
    """Return the bounds of the case with both links, which is what `hil run` has."""
    found = next(row.report for row in rows if row.case == BOTH_LINKS and row.report.backend == "mujoco")
    return [
        at_most("MuJoCo, FRI link, servo link: median", found.cycle.p50_us, BOTH_LINKS_MEDIAN_US, "us"),
        at_most("MuJoCo, FRI link, servo link: p99", found.cycle.p99_us, BOTH_LINKS_P99_US, "us"),
    ]
