"""What the samples share: the loop that sets destinations, its statistics, and the plot."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol, TypeAlias

import typer

from hil.client.servo import (
    PTP,
    DirectServo,
    DirectServoRuntime,
    HilError,
    Pose,
    ProgramState,
    ServoClient,
    SmartServo,
    SmartServoRuntime,
    StatisticTimer,
    UsageError,
    load_key,
)

START_DEG: Final = (0.0, 30.0, 0.0, 40.0, 0.0, 90.0, 0.0)
"""The pose of the manual's step responses (7.12)."""


Runtime: TypeAlias = SmartServoRuntime | DirectServoRuntime
COORDINATES: Final = "xyz"


class Course(Protocol):
    """What a sample moves: one number of axis positions or of a pose, and how to say where it is to go."""

    unit: str
    scale: float
    """From the number's own unit to ``unit``, for people."""
    frame: str
    """What is moved."""

    @property
    def name(self) -> str:
        """Of the number."""

    def begin(self, runtime: Runtime) -> None:
        """Begin where the arm is now."""

    def go(self, runtime: Runtime, at_s: float) -> float:
        """Set the destination for ``at_s`` seconds after the beginning; return its number."""

    def set_point(self, runtime: Runtime) -> float | None:
        """Return the interpolator's number, where it has one."""

    def measured(self, runtime: Runtime) -> float:
        """Return the measured number."""


@dataclass(slots=True)
class Sine:
    """A sine on one axis, in rad; ``axis`` is 1-based: 4 is A4."""

    axis: int
    amplitude_rad: float
    frequency_hz: float
    unit: str = "degrees"
    scale: float = math.degrees(1.0)
    frame: str = "flange"
    _start_rad: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        """Of the axis."""
        return f"A{self.axis}"

    def begin(self, runtime: Runtime) -> None:
        """Begin at the set point."""
        self._start_rad = runtime.get_command_result_of_interpolation()

    def go(self, runtime: Runtime, at_s: float) -> float:
        """Set axis positions; the sine begins at rest."""
        position_rad = list(self._start_rad)
        position_rad[self.axis - 1] += self.amplitude_rad * rest_to_rest(self.frequency_hz, at_s)
        runtime.set_destination(position_rad)
        return position_rad[self.axis - 1]

    def set_point(self, runtime: Runtime) -> float | None:
        """Return the set point of the axis."""
        return runtime.get_command_result_of_interpolation()[self.axis - 1]

    def measured(self, runtime: Runtime) -> float:
        """Return the measured position of the axis."""
        return runtime.get_axis_q_msr_on_controller()[self.axis - 1]


@dataclass(slots=True)
class CartesianSine:
    """A sine of ``frame`` along x, y or z of ``reference``, in m; its orientation stays."""

    along: str
    amplitude_m: float
    frequency_hz: float
    frame: str = "flange"
    reference: str = "base"
    unit: str = "mm"
    scale: float = 1e3
    _start: Pose = field(default_factory=lambda: Pose(0.0, 0.0, 0.0))

    @property
    def name(self) -> str:
        """Of the coordinate."""
        return f"{self.along} of {self.frame} in {self.reference}"

    def begin(self, runtime: Runtime) -> None:
        """Begin at the measured pose."""
        self._start = runtime.get_current_cartesian_position(self.frame, self.reference)

    def go(self, runtime: Runtime, at_s: float) -> float:
        """Set a pose; the sine begins at rest."""
        position_m = list(self._start.position_m)
        place = COORDINATES.index(self.along)
        position_m[place] += self.amplitude_m * rest_to_rest(self.frequency_hz, at_s)
        x_m, y_m, z_m = position_m
        runtime.set_destination(self._start._replace(x_m=x_m, y_m=y_m, z_m=z_m), self.reference)
        return position_m[place]

    def set_point(self, runtime: Runtime) -> float | None:  # noqa: ARG002  # other courses need it
        """Return None: the manual has a set point in axis positions only."""
        return None

    def measured(self, runtime: Runtime) -> float:
        """Return the measured coordinate."""
        pose = runtime.get_current_cartesian_position(self.frame, self.reference)
        return pose.position_m[COORDINATES.index(self.along)]


def rest_to_rest(frequency_hz: float, at_s: float) -> float:
    """Return a sine between 0 and 1 that begins at 0, at rest."""
    return 0.5 * (1.0 - math.cos(2.0 * math.pi * frequency_hz * at_s))


@dataclass(slots=True)
class Recording:
    """What a run saw of its course, on the controller's time axis."""

    at_s: list[float] = field(default_factory=list)
    destination: list[float] = field(default_factory=list)
    set_point: list[float] = field(default_factory=list)
    """Empty where the course has none."""
    measured: list[float] = field(default_factory=list)

    def peak(self) -> float:
        """Return the largest distance of what was measured from where it began."""
        return max((abs(value - self.measured[0]) for value in self.measured), default=0.0)


def run_sample(
    motion: SmartServo | DirectServo,
    course: Course,
    *,
    controller: str,
    key_file: Path | None,
    seconds: float,
    period_s: float,
    say: Callable[[str], None],
) -> tuple[Recording, dict[str, Any]]:
    """Go to the start pose, let ``motion`` follow the course for ``seconds``, print the statistics of the manual."""
    key = None if key_file is None else load_key(key_file)
    timing = StatisticTimer()
    with ServoClient(controller, name=type(motion).__name__, key=key, state_period_ms=2) as robot:
        say(f"connected to {controller}; PTP to the start pose")
        operator = robot.operator
        if operator.program is not ProgramState.RUNNING:
            say(f"nothing moves yet, the program is {operator.program.name}: {operator.reason}")
        robot.move(PTP(tuple(map(math.radians, START_DEG))))
        robot.move_async(motion, frame=course.frame)
        runtime = motion.get_runtime()
        recording = _follow(runtime, course, seconds=seconds, period_s=period_s, timing=timing)
        say(f"Statistic Timing of Overall Loop {timing}")
        runtime.set_detailed_output(2)
        runtime.update_with_realtime_system()
        say(str(runtime))
        runtime.stop_motion()
    result = {
        "destinations": timing.count,
        "loop_ms": {"min": timing.min_ms, "mean": timing.mean_ms, "max": timing.max_ms},
        f"peak_{'m' if course.unit == 'mm' else 'rad'}": recording.peak(),
        "controller_time_s": recording.at_s[-1] if recording.at_s else 0.0,
    }
    return recording, result


def _follow(runtime: Runtime, course: Course, *, seconds: float, period_s: float, timing: StatisticTimer) -> Recording:
    """Set a destination every ``period_s`` of the controller's time; 0: as often as the controller answers."""
    recording = Recording()
    runtime.update_with_realtime_system()
    course.begin(runtime)
    began_ns = runtime.get_time_stamp_of_update()
    at_s = 0.0
    while at_s < seconds:
        with timing.new_time_step():
            destination = course.go(runtime, at_s)
            due_s = at_s + period_s
            at_s = (runtime.get_time_stamp_of_update() - began_ns) * 1e-9
            while at_s < due_s:
                runtime.update_with_realtime_system()
                at_s = (runtime.get_time_stamp_of_update() - began_ns) * 1e-9
        recording.at_s.append(at_s)
        recording.destination.append(destination)
        set_point = course.set_point(runtime)
        if set_point is not None:
            recording.set_point.append(set_point)
        recording.measured.append(course.measured(runtime))
    return recording


def finish(
    recording: Recording,
    result: dict[str, Any],
    course: Course,
    *,
    title: str,
    plot: Path | None,
    json_file: Path | None,
    say: Callable[[str], None],
) -> None:
    """Say what moved, and write the picture and the figures where they were asked for."""
    moved = f"{recording.peak() * course.scale:.1f} mm" if course.unit == "mm" else f"{recording.peak():.4f} rad"
    say(f"{course.name} moved by {moved} with {result['destinations']} destinations")
    if plot is not None:
        _plot(recording, course, title, plot)
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
    except OSError as error:
        if error.filename is None:
            raise
        typer.echo(f"{name}: cannot write {error.filename}: {error.strerror}", err=True)
        raise typer.Exit(2) from None


def _plot(recording: Recording, course: Course, title: str, picture: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    destination, set_point, measured = (
        [value * course.scale for value in path]
        for path in (recording.destination, recording.set_point, recording.measured)
    )
    figure, (motion, lag) = plt.subplots(
        2, 1, figsize=(10, 6), sharex=True, layout="constrained", height_ratios=(3, 1.3)
    )
    figure.suptitle(title)
    label = f"{course.name} destination"
    motion.step(recording.at_s, destination, where="post", label=label, color="#b0bec5", linewidth=1.4)
    if set_point:
        motion.plot(recording.at_s, set_point, label="set point of the interpolator", color="#7aa6d1", linewidth=2.2)
    motion.plot(recording.at_s, measured, label="measured", color="#12304f", linewidth=1.0)
    motion.set_ylabel(f"{course.name}, {course.unit}")
    motion.legend(frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    late = _difference(destination, measured)
    lag.plot(recording.at_s, late, color="#8a3324", linewidth=0.9, label="destination")
    if set_point:
        off = _difference(set_point, measured)
        lag.plot(recording.at_s, off, color="#7aa6d1", linewidth=0.9, label="set point")
    lag.set_ylabel(f"minus measured,\n{course.unit}")
    lag.legend(frameon=False, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 0.97), fontsize="small")
    lag.set_xlabel("time of the controller, s")
    save_figure(figure, (motion, lag), picture)


def save_figure(figure: Any, panels: Sequence[Any], picture: Path) -> None:
    """Give the panels of a matplotlib figure their grid, write it, and close it; raise where its kind is unknown."""
    from matplotlib import pyplot as plt

    for panel in panels:
        panel.grid(alpha=0.3)
        panel.margins(x=0.005)
    try:
        figure.savefig(picture, dpi=110)
    except ValueError as error:
        raise UsageError(f"cannot write {picture}: {error}") from None
    finally:
        plt.close(figure)


def _difference(first: list[float], second: list[float]) -> list[float]:
    return [one - other for one, other in zip(first, second, strict=True)]
