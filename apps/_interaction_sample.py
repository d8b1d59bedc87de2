"""What the two interaction control samples share (manual 8.1.3, 8.2.3): impedance, stiffer by steps, then of joints."""

import json
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from apps._servo_sample import START_DEG, run_app, save_figure
from hil.client.servo import (
    PTP,
    CartesianImpedanceControlMode,
    DirectServo,
    DirectServoRuntime,
    HilError,
    JointImpedanceControlMode,
    Role,
    ServoClient,
    SmartServo,
    SmartServoRuntime,
    StatisticTimer,
    by_translation,
    load_key,
)

STEPS: Final = 4
"""How often the stiffness changes."""
SOFTEST_N_M: Final = 500.0
STIFFEST_N_M: Final = 2000.0
ROTATIONAL_NM_RAD: Final = 150.0
MOST_DEVIATION_MM: Final = 80.0
JOINT_NM_RAD: Final = 800.0

Plot = Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw deflection, stiffness, force.")]
Motion = SmartServo | DirectServo
Runtime = SmartServoRuntime | DirectServoRuntime


@dataclass(slots=True)
class Interaction:
    """What a run saw, on the controller's time axis."""

    at_s: list[float] = field(default_factory=list)
    off_mm: list[float] = field(default_factory=list)
    """The flange along x of the robot base, from where it began."""
    stiffness_n_m: list[float] = field(default_factory=list)
    """Of the springs along x; not a number under joint impedance."""
    force_n: list[float] = field(default_factory=list)
    """What pushes the flange along x, as the controller estimates it."""
    deflection_mm: list[float] = field(default_factory=list)
    """How far the push has moved the flange at the end of each stiffness."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Where to, for how long, and how hard somebody pushes."""

    controller: str
    key_file: Path | None
    frame: str
    seconds: float
    push_n: float


def stiff(stiffness_n_m: float) -> CartesianImpedanceControlMode:
    """Return the mode with this stiffness, and with the deviation that ends the motion."""
    return CartesianImpedanceControlMode(
        stiffness=by_translation(stiffness_n_m, ROTATIONAL_NM_RAD),
        max_path_deviation=by_translation(MOST_DEVIATION_MM, 1.0),
    )


def _run(make: Callable[[], Motion], plan: Plan, say: Callable[[str], None]) -> Interaction:
    """Validate, begin soft, become stiffer by steps while somebody pushes, end under joint impedance."""
    key = None if plan.key_file is None else load_key(plan.key_file)
    with ServoClient(plan.controller, name="interaction control", key=key, state_period_ms=2) as robot:
        say(f"connected to {plan.controller}; PTP to the start pose")
        robot.move(PTP(tuple(map(math.radians, START_DEG))))
        if not robot.validate_for_impedance_mode(plan.frame):
            raise HilError(f"Validation of Torque Model failed: {robot.validation_failure}")
        say(f"the load of {plan.frame!r} is valid for impedance control")
        motion = make().set_mode(stiff(SOFTEST_N_M))
        robot.move_async(motion, plan.frame)
        runtime = motion.get_runtime()
        run = Interaction()
        with ServoClient(plan.controller, name="somebody who pushes", key=key, role=Role.OPERATOR) as somebody:
            if plan.push_n:
                somebody.push((plan.push_n, 0.0, 0.0), duration_s=min(60.0, plan.seconds))
            _become_stiffer(runtime, plan, run, say)
        _transition(robot, motion, make, plan, run, say)
    return run


def _become_stiffer(runtime: Runtime, plan: Plan, run: Interaction, say: Callable[[str], None]) -> None:
    timing = StatisticTimer()
    runtime.update_with_realtime_system()
    began_ns = runtime.get_time_stamp_of_update()
    begin, flange = (runtime.get_current_cartesian_position(frame) for frame in (plan.frame, "flange"))
    for step in range(STEPS):
        stiffness = SOFTEST_N_M + (STIFFEST_N_M - SOFTEST_N_M) * step / (STEPS - 1)
        runtime.change_control_mode_settings(stiff(stiffness))
        ends_ns = began_ns + round(plan.seconds * 1e9 * (step + 1) / STEPS)
        while runtime.get_time_stamp_of_update() < ends_ns:
            with timing.new_time_step():
                runtime.set_destination(begin)
            _note(runtime, run, began_ns, flange.x_m, stiffness)
        run.deflection_mm.append(run.off_mm[-1])
        say(f"stiffness {stiffness:6.0f} N/m: {run.off_mm[-1]:+7.2f} mm, force {run.force_n[-1]:+6.1f} N")
    say(f"Statistic Timing of Overall Loop {timing}")


def _transition(  # noqa: PLR0917  # what the sample has at hand
    robot: ServoClient,
    first: Motion,
    make: Callable[[], Motion],
    plan: Plan,
    run: Interaction,
    say: Callable[[str], None],
) -> None:
    """Another control type needs another motion (manual 7.10.4): start it, take its runtime, stop the first."""
    second = make().set_mode(JointImpedanceControlMode((JOINT_NM_RAD,) * 7))
    robot.move_async(second, plan.frame)
    runtime = second.get_runtime()
    first.stop_motion()
    runtime.update_with_realtime_system()
    began_ns, origin_mm = runtime.get_time_stamp_of_update(), run.off_mm[-1]
    offset_s = run.at_s[-1]
    x_m = runtime.get_current_cartesian_position("flange").x_m - origin_mm * 1e-3
    while runtime.get_time_stamp_of_update() - began_ns < 0.5e9:
        runtime.update_with_realtime_system()
        _note(runtime, run, began_ns - round(offset_s * 1e9), x_m, math.nan)
    say(f"now under {runtime.get_control_mode().name}; {runtime}")
    second.stop_motion()


def _note(runtime: Runtime, run: Interaction, began_ns: int, x_m: float, stiffness: float) -> None:
    run.at_s.append((runtime.get_time_stamp_of_update() - began_ns) * 1e-9)
    run.off_mm.append(1e3 * (runtime.get_current_cartesian_position("flange").x_m - x_m))
    run.stiffness_n_m.append(stiffness)
    run.force_n.append(runtime.get_ext_force_vector()[0])


def _finish(
    run: Interaction, plan: Plan, *, title: str, plot: Path | None, json_file: Path | None, say: Callable[[str], None]
) -> None:
    """Write the picture and the figures where they were asked for."""
    if plot is not None:
        _plot(run, plan, title, plot)
        say(f"wrote {plot}")
    if json_file is not None:
        figures: dict[str, Any] = {
            "deflection_mm": run.deflection_mm,
            "force_n": run.force_n[-1],
            "updates": len(run.at_s),
        }
        json_file.write_text(json.dumps(figures) + "\n", encoding="utf-8")


def _plot(run: Interaction, plan: Plan, title: str, picture: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, (off, stiffness, force) = plt.subplots(
        3, 1, figsize=(10, 7), sharex=True, layout="constrained", height_ratios=(2, 1, 1.3)
    )
    figure.suptitle(title)
    off.plot(run.at_s, run.off_mm, color="#12304f", linewidth=1.0, label="flange along x, measured")
    should = [1e3 * plan.push_n / value for value in run.stiffness_n_m]
    off.plot(run.at_s, should, color="#7aa6d1", linewidth=2.0, zorder=0, label="force over stiffness")
    off.set_ylabel("mm")
    off.legend(frameon=False, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    stiffness.plot(run.at_s, run.stiffness_n_m, color="#12304f", linewidth=1.2)
    stiffness.set_ylabel("stiffness, N/m")
    force.plot(run.at_s, run.force_n, color="#8a3324", linewidth=0.9)
    force.set_ylabel("estimated\nforce, N")
    force.set_xlabel("time of the controller, s")
    save_figure(figure, (off, stiffness, force), picture)


def interaction_app(name: str, make: type[SmartServo] | type[DirectServo]) -> Callable[..., None]:
    """Return the command line of a sample: ``name`` is its module, ``make`` the kind of its motions."""
    kind = make.__name__

    def main(
        controller: Annotated[str, typer.Option(metavar="HOST[:PORT]", help="Where hil run serves.")] = (
            "127.0.0.1:30300"
        ),
        *,
        key: Annotated[Path | None, typer.Option(metavar="FILE", help="Pre-shared key of the servo link.")] = None,
        frame: Annotated[str, typer.Option(metavar="NAME", help="Frame to move: the flange, or one on it.")] = "flange",
        seconds: Annotated[float, typer.Option(min=0.4, max=60.0, help="Length under Cartesian impedance.")] = 8.0,
        push: Annotated[float, typer.Option(metavar="N", help="Push the simulated flange along x; 0: do not.")] = 15.0,
        plot: Plot = None,
        json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the figures.")] = None,
    ) -> None:
        def action() -> None:
            plan = Plan(controller, key, frame, seconds, push)
            say = partial(print, file=sys.stdout, flush=True)
            run = _run(make, plan, say)
            title = f"{kind} under Cartesian impedance, pushed with {push:g} N"
            _finish(run, plan, title=title, plot=plot, json_file=json_file, say=say)

        run_app(name, action)

    main.__doc__ = f"Let a {kind} give way to a push, less and less."
    return main
