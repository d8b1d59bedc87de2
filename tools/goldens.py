"""The recordings of ``tests/data``: what is in them."""

from pathlib import Path
from typing import Any, Final, NamedTuple

from hil.config.station import RobotConfig
from hil.replay.result import ReplayResult
from hil.values.arm import Push
from hil.values.operator import PadKey, Press, SetInput
from tools.bench.clients import BenchMotion, recorded_client
from tools.bench.recording import VirtualRun

_IO: Final = {"name": "Gripper", "signal": [{"name": "Closed", "type": "boolean", "direction": "input"}]}


class Golden(NamedTuple):
    """One recording."""

    name: str
    motion: BenchMotion
    seconds: float
    config: dict[str, Any]


GOLDENS: Final = (
    Golden(
        "fri-1.15-joint-position-5ms",
        BenchMotion.FRI_OVERLAY,
        1.6,
        {"backend": "mujoco", "io": [_IO], "fri": {"send_period_ms": 5}},
    ),
    Golden(
        "fri-2.7-wrench-5ms",
        BenchMotion.FRI_OVERLAY,
        1.6,
        {"backend": "mujoco", "fri": {"release": "2.7", "overlay": "wrench", "send_period_ms": 5}},
    ),
    Golden(
        "fri-2.5-torque-4ms",
        BenchMotion.FRI_OVERLAY,
        1.5,
        {"backend": "mujoco", "cycle_ms": 4, "fri": {"release": "2.5", "overlay": "torque", "send_period_ms": 4}},
    ),
    Golden("smart-servo-2ms", BenchMotion.SMART_SERVO, 0.4, {"backend": "mujoco", "cycle_ms": 2, "servo": {}}),
    Golden("direct-servo-ideal", BenchMotion.DIRECT_SERVO, 0.25, {"backend": "ideal", "servo": {}}),
)


def write_golden(golden: Golden, folder: Path) -> Path:
    """Record one; the operator sets an input, pushes the arm and presses the emergency stop before the end."""
    config = RobotConfig.model_validate(golden.config)
    file = folder / f"{golden.name}.pcapng"
    run = VirtualRun(config, recorded_client(config, golden.motion), file)
    run.run(golden.seconds)
    run.check()
    if config.io:
        run.operate(SetInput("Gripper.Closed", value=True))
    if config.backend == "mujoco":
        run.operate(Push(7, (20.0, 0.0, -5.0), (0.0, 0.0, 0.0), 0.1))
    run.run(0.1)
    run.operate(Press(PadKey.EMERGENCY_STOP))
    run.run(0.1)
    run.close()
    return file


def parting(result: ReplayResult) -> dict[str, Any]:
    """Return where an emulator and a recording from elsewhere part: states to the message, figures to three digits."""
    return {
        "compared": result.compared,
        "states": [[whose, round(t_s, 6), state] for _, whose, t_s, state in result.states],
        "largest": {
            name: float(f"{tally.largest:.3g}")
            for name, tally in sorted(result.fields.items())
            if name.endswith((" measured", " commanded", " interpolator", " measured torque"))
        },
    }
