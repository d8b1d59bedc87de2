"""Visual servoing, the manual's example of the feedback effect (7.11): ``python -m apps.visual_servoing``.

A camera on the arm is to keep a target in the middle of its picture. Picture taking, image processing and the arm are
dead times of whole steps, the tracking controller is a gain k, so that the error in the picture is that of the target
through G(z) = 1 / (1 + k z^-3) with one step each: stable below k = 1, critical at 1, unstable above. As the controller
has nothing but gain, an error of 1 / (1 + k) stays.

The camera is a sum here, not a picture: it sees the target's angle minus the measured axis position, plus noise. The
arm is the controller's. It is no ideal dead time: a step has to be long enough for its reaction time and its way. So
the arm stands before each destination, and ``hil run`` tells the seconds hand effect beside the feedback effect.
"""

import json
import math
import random
import sys
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from apps._servo_sample import START_DEG, Runtime, run_app, save_figure
from hil.client.servo import PTP, DirectServo, ServoClient, SmartServo, StatisticTimer, load_key

DEG_PER_PIXEL: Final = 0.01
ARM_STEPS: Final = 1
SETTLING_PERIODS: Final = 4
"""Of the swing; what was seen is read from the last so many."""
SWING_MIN_DEG: Final = 0.02
"""A smaller swing is noise."""


class Motion(StrEnum):
    """What carries the destinations."""

    DIRECT_SERVO = "direct-servo"
    SMART_SERVO = "smart-servo"

    def make(self) -> SmartServo | DirectServo:
        """Return a motion that is quick; SmartServo with the parameters of the manual's step responses (7.12)."""
        if self is Motion.DIRECT_SERVO:
            return DirectServo().set_minimum_trajectory_execution_time(0.0)
        return (
            SmartServo().set_joint_jerk(500).override_joint_acceleration(20).set_minimum_trajectory_execution_time(0.0)
        )


@dataclass(frozen=True, slots=True)
class Loop:
    """The loop; angles in degrees."""

    gain: float
    axis: int
    """1-based."""
    period_s: float
    camera_steps: int
    processing_steps: int
    target_deg: float
    noise_pixels: float
    limit_deg: float
    seed: int

    @property
    def steps(self) -> int:
        """Dead time around the loop, in steps."""
        return self.camera_steps + self.processing_steps + ARM_STEPS

    @property
    def swing_s(self) -> float:
        """Period of the swing at the border of stability: twice the dead time."""
        return 2 * self.steps * self.period_s


@dataclass(slots=True)
class Run:
    """What was seen, on the controller's time axis; degrees from the start pose."""

    at_s: list[float] = field(default_factory=list)
    measured_deg: list[float] = field(default_factory=list)
    commanded_deg: list[float] = field(default_factory=list)
    stopped: bool = False
    """Whether the swing left the limit."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the run shows."""

    swing_deg: float
    """Half the distance of peak and valley in the last period."""
    period_s: float | None
    """Of the swing; None where there is none."""
    growth: float | None
    """Of the swing, from one period to the next."""
    error_deg: float
    """Mean error in the picture over the last period."""


def track(runtime: Runtime, loop: Loop, *, seconds: float, timing: StatisticTimer) -> Run:
    """Run the loop; end early where the arm is to go farther than the limit."""
    noise = random.Random(loop.seed)  # noqa: S311  # pixels, not secrets
    run = Run()
    runtime.update_with_realtime_system()
    start_rad = runtime.get_axis_q_msr_on_controller()
    began_ns = runtime.get_time_stamp_of_update()
    seen: deque[float] = deque([0.0] * (loop.steps - ARM_STEPS), maxlen=loop.steps)
    axis, step = loop.axis - 1, 0
    while step * loop.period_s < seconds:
        with timing.new_time_step():
            at_s = (runtime.get_time_stamp_of_update() - began_ns) * 1e-9
            measured_deg = math.degrees(runtime.get_axis_q_msr_on_controller()[axis] - start_rad[axis])
            blur_deg = noise.gauss(0.0, loop.noise_pixels) * DEG_PER_PIXEL
            seen.append(loop.target_deg - measured_deg + blur_deg)
            commanded_deg = loop.gain * seen.popleft()
            run.at_s.append(at_s)
            run.measured_deg.append(measured_deg)
            run.commanded_deg.append(commanded_deg)
            if abs(commanded_deg) > loop.limit_deg:
                run.stopped = True
                return run
            position_rad = list(start_rad)
            position_rad[axis] += math.radians(commanded_deg)
            runtime.set_destination(position_rad)
            step += 1
            while (runtime.get_time_stamp_of_update() - began_ns) * 1e-9 < step * loop.period_s:
                runtime.update_with_realtime_system()
    return run


def outcome(run: Run, loop: Loop) -> Outcome:
    """Read period and growth from the swings of the last periods."""
    length = 2 * loop.steps
    commanded = run.commanded_deg
    periods = [commanded[end - length : end] for end in range(len(commanded), length - 1, -length)][:SETTLING_PERIODS]
    swings = [(max(part) - min(part)) / 2 for part in periods]
    error_deg = loop.target_deg - sum(run.measured_deg[-length:]) / len(run.measured_deg[-length:])
    large = [swing for swing in swings if swing >= SWING_MIN_DEG]
    if len(large) < 2 or len(large) < len(swings) - 1:
        return Outcome(swings[0] if swings else 0.0, None, None, error_deg)
    growth = (large[0] / large[-1]) ** (1.0 / (len(large) - 1))
    used = commanded[-length * len(large) :]
    middle = sum(used[-length:]) / length
    above = [value > middle for value in used]
    crossings = [place for place in range(1, len(above)) if above[place] != above[place - 1]]
    halves = len(crossings) - 1
    period_s = None if halves < 1 else 2 * loop.period_s * (crossings[-1] - crossings[0]) / halves
    return Outcome(swings[0], period_s, growth, error_deg)


def sentence(run: Run, loop: Loop, seen: Outcome, *, seconds: float) -> str:
    """Say what came of it."""
    swing = "no swing worth the name"
    if seen.growth is not None and seen.period_s is not None:
        swing = (
            f"a swing of {seen.period_s:.2f} s, {seen.growth:.2f} times as large each period, "
            f"{seen.swing_deg:.2f} degrees at the end"
        )
    if run.stopped:
        return (
            f"stopped: the loop is unstable with the gain {loop.gain:g}, where below 1 is stable (manual 7.11): "
            f"{swing}; after {run.at_s[-1]:.1f} s A{loop.axis} was to go beyond {loop.limit_deg:g} degrees"
        )
    stays = loop.target_deg / (1.0 + loop.gain)
    return (
        f"kept within {loop.limit_deg:g} degrees for {seconds:g} s: {swing}; "
        f"the error in the picture is {seen.error_deg:+.3f} degrees, 1 / (1 + k) of the target's is {stays:+.3f}"
    )


def _tell(run: Run, loop: Loop, seen: Outcome, say: Callable[[str], None]) -> None:
    say(f"{'gain k':<34}{loop.gain:>10.3g}")
    say(f"{'dead time of the loop, steps':<34}{loop.steps:>10}")
    say(f"{'one step, ms':<34}{1e3 * loop.period_s:>10.4g}")
    say(f"{'period at the border, s':<34}{loop.swing_s:>10.3g}")
    say(f"{'period seen, s':<34}{_or_dash(seen.period_s):>10}")
    say(f"{'growth a period at k (k squared)':<34}{loop.gain**2:>10.3g}")
    say(f"{'growth a period seen':<34}{_or_dash(seen.growth):>10}")
    say(f"{'swing at the end, degrees':<34}{seen.swing_deg:>10.3g}")
    say(f"{'error in the picture, degrees':<34}{seen.error_deg:>10.3g}")
    say(f"{'steps':<34}{len(run.at_s):>10}")


def _or_dash(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _plot(run: Run, loop: Loop, title: str, picture: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, (motion, error) = plt.subplots(
        2, 1, figsize=(10, 6), sharex=True, layout="constrained", height_ratios=(3, 1.3)
    )
    figure.suptitle(title)
    motion.axhline(loop.target_deg, color="#4f8a5b", linewidth=1.2, label="target")
    motion.step(run.at_s, run.commanded_deg, where="post", color="#7aa6d1", linewidth=1.4, label="commanded")
    motion.plot(run.at_s, run.measured_deg, color="#12304f", marker=".", linewidth=1.0, label="measured")
    # Beside a swing that settles the limits would leave nothing to be seen.
    for edge in (-loop.limit_deg, loop.limit_deg) if run.stopped else ():
        motion.axhline(edge, color="#8a3324", linewidth=0.8, linestyle="--")
    motion.set_ylabel(f"A{loop.axis} from the start pose,\ndegrees")
    motion.legend(frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    error.plot(run.at_s, [loop.target_deg - value for value in run.measured_deg], color="#8a3324", linewidth=0.9)
    error.set_ylabel("error in the\npicture, degrees")
    error.set_xlabel("time of the controller, s")
    save_figure(figure, (motion, error), picture)


def main(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    controller: Annotated[str, typer.Option(metavar="HOST[:PORT]", help="Where hil run serves.")] = "127.0.0.1:30300",
    key: Annotated[Path | None, typer.Option(metavar="FILE", help="Pre-shared key of the servo link.")] = None,
    gain: Annotated[float, typer.Option(min=0.0, help="Gain k of the tracking controller.")] = 0.6,
    seconds: Annotated[float, typer.Option(min=0.1, help="Length of the motion.")] = 10.0,
    period_ms: Annotated[float, typer.Option(min=5.0, help="One step: between pictures, and destinations.")] = 100.0,
    camera_dead_steps: Annotated[int, typer.Option(min=0, max=50, help="Dead time of the camera.")] = 1,
    processing_dead_steps: Annotated[int, typer.Option(min=0, max=50, help="Dead time of the processing.")] = 1,
    pixel_noise: Annotated[float, typer.Option(min=0.0, metavar="PIXELS", help="Deviation; 1: 0.01 degrees.")] = 0.5,
    seed: Annotated[int, typer.Option(help="Of the noise.")] = 1,
    axis: Annotated[int, typer.Option(min=1, max=7, help="Axis that turns the camera.")] = 1,
    target: Annotated[float, typer.Option(min=-2.0, max=2.0, metavar="DEG", help="Where the target is.")] = 0.1,
    limit: Annotated[float, typer.Option(min=0.1, max=2.4, metavar="DEG", help="End beyond this.")] = 2.4,
    motion: Annotated[
        Motion, typer.Option(help="What carries the destinations; direct-servo takes all the torque of the drives.")
    ] = Motion.SMART_SERVO,
    plot: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw target, command, motion.")] = None,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the figures.")] = None,
) -> None:
    """Keep a target in the middle of a camera's picture, with a gain that is stable or not."""

    def action() -> None:
        say = partial(print, file=sys.stdout, flush=True)
        loop = Loop(
            gain=gain,
            axis=axis,
            period_s=period_ms * 1e-3,
            camera_steps=camera_dead_steps,
            processing_steps=processing_dead_steps,
            target_deg=target,
            noise_pixels=pixel_noise,
            limit_deg=limit,
            seed=seed,
        )
        secret = None if key is None else load_key(key)
        timing = StatisticTimer()
        carries = motion.make()
        with ServoClient(controller, name="visual servoing", key=secret, state_period_ms=2) as robot:
            say(f"connected to {controller}; PTP to the start pose")
            robot.move(PTP(tuple(map(math.radians, START_DEG))))
            robot.move_async(carries)
            runtime = carries.get_runtime()
            run = track(runtime, loop, seconds=seconds, timing=timing)
            carries.stop_motion()
        say(f"Statistic Timing of Overall Loop {timing}")
        seen = outcome(run, loop)
        _tell(run, loop, seen, say)
        if plot is not None:
            _plot(
                run, loop, f"visual servoing, gain {gain:g}, dead time of {loop.steps} steps of {period_ms:g} ms", plot
            )
            say(f"wrote {plot}")
        if json_file is not None:
            figures: dict[str, Any] = {"stopped": run.stopped, "steps": len(run.at_s), **asdict(seen)}
            json_file.write_text(json.dumps(figures) + "\n", encoding="utf-8")
        say(sentence(run, loop, seen, seconds=seconds))

    run_app("visual_servoing", action)


if __name__ == "__main__":
    typer.run(main)
