"""What the two joint motion samples share: the loop that sets destinations, its statistics, and the plot."""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import typer

from hil.client.servo import (
    PTP,
    DirectServo,
    DirectServoRuntime,
    HilError,
    ProgramState,
    ServoClient,
    SmartServo,
    SmartServoRuntime,
    StatisticTimer,
    load_key,
)

START_DEG: Final = (0.0, 30.0, 0.0, 40.0, 0.0, 90.0, 0.0)
"""The pose of the manual's step responses (7.12)."""


@dataclass(slots=True)
class Sine:
    """A sine on one axis; ``axis`` is 1-based: 4 is A4."""

    axis: int
    amplitude_rad: float
    frequency_hz: float

    def position_rad(self, start_rad: tuple[float, ...], at_s: float) -> tuple[float, ...]:
        """Return where the axes are to be after ``at_s`` seconds; the sine begins at ``start_rad``, at rest."""
        swing = self.amplitude_rad * 0.5 * (1.0 - math.cos(2.0 * math.pi * self.frequency_hz * at_s))
        return tuple(value + swing if axis == self.axis else value for axis, value in enumerate(start_rad, start=1))


@dataclass(slots=True)
class Recording:
    """What a run saw, on the controller's time axis."""

    at_s: list[float] = field(default_factory=list)
    destination_rad: list[tuple[float, ...]] = field(default_factory=list)
    commanded_rad: list[tuple[float, ...]] = field(default_factory=list)
    measured_rad: list[tuple[float, ...]] = field(default_factory=list)

    def peak_rad(self, axis: int) -> float:
        """Return the largest distance of a measured axis from where it began."""
        path = [position[axis - 1] for position in self.measured_rad]
        return max((abs(value - path[0]) for value in path), default=0.0)


def run_sample(
    motion: SmartServo | DirectServo,
    sine: Sine,
    *,
    controller: str,
    key_file: Path | None,
    seconds: float,
    period_s: float,
    say: Callable[[str], None],
) -> tuple[Recording, dict[str, Any]]:
    """Go to the start pose, let ``motion`` follow the sine for ``seconds``, print the statistics of the manual."""
    key = None if key_file is None else load_key(key_file)
    timing = StatisticTimer()
    with ServoClient(controller, name=type(motion).__name__, key=key, state_period_ms=2) as robot:
        say(f"connected to {controller}; PTP to the start pose")
        operator = robot.operator
        if operator.program is not ProgramState.RUNNING:
            say(f"nothing moves yet, the program is {operator.program.name}: {operator.reason}")
        robot.move(PTP(tuple(map(math.radians, START_DEG))))
        robot.move_async(motion)
        runtime = motion.get_runtime()
        recording = _follow(runtime, sine, seconds=seconds, period_s=period_s, timing=timing)
        say(f"Statistic Timing of Overall Loop {timing}")
        runtime.set_detailed_output(2)
        runtime.update_with_realtime_system()
        say(str(runtime))
        runtime.stop_motion()
    result = {
        "destinations": timing.count,
        "loop_ms": {"min": timing.min_ms, "mean": timing.mean_ms, "max": timing.max_ms},
        "peak_rad": recording.peak_rad(sine.axis),
        "controller_time_s": recording.at_s[-1] if recording.at_s else 0.0,
    }
    return recording, result


def _follow(
    runtime: SmartServoRuntime | DirectServoRuntime,
    sine: Sine,
    *,
    seconds: float,
    period_s: float,
    timing: StatisticTimer,
) -> Recording:
    """Set a destination every ``period_s`` of the controller's time; 0: as often as the controller answers."""
    recording = Recording()
    runtime.update_with_realtime_system()
    start_rad = runtime.get_command_result_of_interpolation()
    began_ns = runtime.get_time_stamp_of_update()
    at_s = 0.0
    while at_s < seconds:
        with timing.new_time_step():
            destination = sine.position_rad(start_rad, at_s)
            runtime.set_destination(destination)
            due_s = at_s + period_s
            at_s = (runtime.get_time_stamp_of_update() - began_ns) * 1e-9
            while at_s < due_s:
                runtime.update_with_realtime_system()
                at_s = (runtime.get_time_stamp_of_update() - began_ns) * 1e-9
        recording.at_s.append(at_s)
        recording.destination_rad.append(destination)
        recording.commanded_rad.append(runtime.get_command_result_of_interpolation())
        recording.measured_rad.append(runtime.get_axis_q_msr_on_controller())
    return recording


def finish(
    recording: Recording,
    result: dict[str, Any],
    sine: Sine,
    *,
    title: str,
    plot: Path | None,
    json_file: Path | None,
    say: Callable[[str], None],
) -> None:
    """Say what moved, and write the picture and the figures where they were asked for."""
    say(f"A{sine.axis} moved by {result['peak_rad']:.4f} rad with {result['destinations']} destinations")
    if plot is not None:
        _plot(recording, sine.axis, title, plot)
        say(f"wrote {plot}")
    if json_file is not None:
        json_file.write_text(json.dumps(result) + "\n", encoding="utf-8")


def run_app(name: str, action: Callable[[], None]) -> None:
    """Run a sample; an error of ours ends in one sentence (and its figures) and exit code 2."""
    try:
        action()
    except KeyboardInterrupt:
        typer.echo("interrupted", err=True)
        raise typer.Exit(1) from None
    except HilError as error:
        typer.echo(f"{name}: {error}", err=True)
        for note in getattr(error, "__notes__", ()):
            typer.echo(f"  {note}", err=True)
        raise typer.Exit(2) from None


def _plot(recording: Recording, axis: int, title: str, picture: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    degrees = [
        [math.degrees(position[axis - 1]) for position in path]
        for path in (recording.destination_rad, recording.commanded_rad, recording.measured_rad)
    ]
    figure, (motion, lag) = plt.subplots(
        2, 1, figsize=(10, 6), sharex=True, layout="constrained", height_ratios=(3, 1.3)
    )
    figure.suptitle(title)
    motion.step(recording.at_s, degrees[0], where="post", label=f"A{axis} destination", color="#b0bec5", linewidth=1.4)
    motion.plot(recording.at_s, degrees[1], label="set point of the interpolator", color="#7aa6d1", linewidth=2.2)
    motion.plot(recording.at_s, degrees[2], label="measured", color="#12304f", linewidth=1.0)
    motion.set_ylabel(f"A{axis}, degrees")
    motion.legend(frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    lag.plot(recording.at_s, _difference(degrees[0], degrees[2]), color="#8a3324", linewidth=0.9, label="destination")
    lag.plot(recording.at_s, _difference(degrees[1], degrees[2]), color="#7aa6d1", linewidth=0.9, label="set point")
    lag.set_ylabel("minus measured,\ndegrees")
    lag.legend(frameon=False, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 0.97), fontsize="small")
    lag.set_xlabel("time of the controller, s")
    for panel in (motion, lag):
        panel.grid(alpha=0.3)
        panel.margins(x=0.005)
    figure.savefig(picture, dpi=110)
    plt.close(figure)


def _difference(first: list[float], second: list[float]) -> list[float]:
    return [one - other for one, other in zip(first, second, strict=True)]
