"""A sine on one axis, set-point by set-point, over KST: ``python -m apps.kst_direct_servo_sine --plot sine.png``."""

import gc
import json
import math
from functools import partial
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import typer

from apps._kst_sample import DEFAULT_CONTROLLER, START_RAD, Controller
from apps._servo_sample import run_app, save_figure
from hil.client.kst import Feedback, KstClient

MOVES_RAD: Final = 0.02
STANDS_RAD: Final = 1e-3


class Sample(NamedTuple):
    """One set-point and its reply."""

    at_s: float
    set_rad: float
    measured_rad: float
    round_trip_ms: float


def main(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    controller: Controller = DEFAULT_CONTROLLER,
    axis: Annotated[int, typer.Option(min=1, max=7, help="Axis to move.")] = 1,
    amplitude: Annotated[float, typer.Option(metavar="RAD", min=0.0, max=0.5, help="Of the sine.")] = 0.2,
    frequency: Annotated[float, typer.Option(metavar="HZ", min=0.0, max=2.0, help="Of the sine.")] = 0.25,
    period: Annotated[float, typer.Option(metavar="MS", min=0.0, help="Between two set-points; 0: none.")] = 2.0,
    seconds: Annotated[float, typer.Option(metavar="S", min=0.1, help="How long.")] = 8.0,
    plot: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw set-points, positions, delays.")] = None,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the figures.")] = None,
) -> None:
    """Set joint positions in real time and wait for each to be acknowledged, with the measured positions."""
    run = partial(_run, controller, axis - 1, amplitude, frequency, period, seconds, plot, json_file)
    run_app("kst_direct_servo_sine", run)


def _run(  # noqa: PLR0917
    controller: str,
    axis: int,
    amplitude_rad: float,
    frequency_hz: float,
    period_ms: float,
    seconds: float,
    plot: Path | None,
    json_file: Path | None,
) -> None:
    samples: list[Sample] = []
    with KstClient(controller) as arm:
        arm.move_joints(START_RAD, velocity_rel=0.3)
        arm.start_joint_servo()
        # The collector would look through all that was imported, for 20 ms, while set-points are due.
        gc.freeze()
        for at_s in arm.every(period_ms * 1e-3, seconds=seconds):
            target = list(START_RAD)
            target[axis] += amplitude_rad * math.sin(2.0 * math.pi * frequency_hz * at_s)
            measured = arm.set_joints(target, Feedback.JOINTS)
            samples.append(Sample(at_s, target[axis], measured[axis], arm.round_trip_ms))
        arm.stop()
    figures = _figures(samples)
    typer.echo(
        f"{figures['set_points']:.0f} set-points, {figures['rate_hz']:.0f} a second; set-point to reply: median "
        f"{figures['median_ms']:.3f} ms, p99 {figures['p99_ms']:.3f} ms, most {figures['max_ms']:.3f} ms"
    )
    typer.echo(f"A{axis + 1} was {figures['lag_rad'] * 1e3:.1f} mrad off its set-point at most")
    if _stood(samples[-len(samples) // 4 :]):
        typer.echo(
            "the arm stood still at the end: its mode ended, which KST does not tell; the log of hil run says why"
        )
    if plot is not None:
        _plot(samples, axis, plot)
        typer.echo(f"wrote {plot}")
    if json_file is not None:
        json_file.write_text(json.dumps(figures) + "\n", encoding="utf-8")


def _figures(samples: list[Sample]) -> dict[str, float]:
    taken = sorted(sample.round_trip_ms for sample in samples)
    lasted_s = max(samples[-1].at_s - samples[0].at_s, 1e-9)
    return {
        "set_points": len(samples),
        "rate_hz": (len(samples) - 1) / lasted_s,
        "median_ms": taken[len(taken) // 2],
        "p99_ms": taken[min(len(taken) - 1, len(taken) * 99 // 100)],
        "max_ms": taken[-1],
        "lag_rad": max(abs(sample.set_rad - sample.measured_rad) for sample in samples),
    }


def _stood(samples: list[Sample]) -> bool:
    set_rad, measured_rad = [sample.set_rad for sample in samples], [sample.measured_rad for sample in samples]
    return max(set_rad) - min(set_rad) > MOVES_RAD and max(measured_rad) - min(measured_rad) < STANDS_RAD


def _plot(samples: list[Sample], axis: int, picture: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, (motion, delays) = plt.subplots(2, 1, figsize=(10, 6), layout="constrained", height_ratios=(3, 1.3))
    figure.suptitle("KST DirectServo: a sine, set-point by set-point")
    at_s = [sample.at_s for sample in samples]
    motion.plot(at_s, [math.degrees(sample.set_rad) for sample in samples], label="set-point", color="#b0bec5")
    motion.plot(at_s, [math.degrees(sample.measured_rad) for sample in samples], label="measured", color="#12304f")
    motion.set_ylabel(f"A{axis + 1}, degrees")
    motion.set_xlabel("s")
    motion.legend(frameon=False, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    delays.hist([sample.round_trip_ms for sample in samples], bins=80, color="#7aa6d1", log=True)
    delays.set_xlabel("set-point to reply, ms")
    delays.set_ylabel("set-points")
    save_figure(figure, (motion, delays), picture)


if __name__ == "__main__":
    typer.run(main)
