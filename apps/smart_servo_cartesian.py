"""SmartServo, the simple Cartesian sample (manual 8.1.2): ``python -m apps.smart_servo_cartesian``.

Starts a SmartServo, sets a new pose of a frame every few milliseconds, and prints the statistics of the manual.
"""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from apps._servo_sample import COORDINATES, CartesianSine, finish, run_app, run_sample
from hil.client.servo import SmartServo


def main(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    controller: Annotated[str, typer.Option(metavar="HOST[:PORT]", help="Where hil run serves.")] = "127.0.0.1:30300",
    key: Annotated[Path | None, typer.Option(metavar="FILE", help="Pre-shared key of the servo link.")] = None,
    seconds: Annotated[float, typer.Option(min=0.1, help="Length of the motion.")] = 5.0,
    period_ms: Annotated[float, typer.Option(min=0.0, help="Between destinations; 0: as often as answered.")] = 20.0,
    frame: Annotated[str, typer.Option(metavar="NAME", help="Frame to move: the flange, or one on it.")] = "flange",
    reference: Annotated[str, typer.Option(metavar="NAME", help="Frame that destinations are in.")] = "base",
    along: Annotated[str, typer.Option(metavar="x|y|z", help="Coordinate to move.")] = "z",
    amplitude_mm: Annotated[float, typer.Option(metavar="MM", help="Swing of the sine, peak to peak.")] = 40.0,
    frequency: Annotated[float, typer.Option(metavar="HZ", help="Frequency of the sine.")] = 0.25,
    velocity_rel: Annotated[float, typer.Option(help="Joint velocity rel, 0..1.")] = 1.0,
    acceleration_rel: Annotated[float, typer.Option(help="Joint acceleration rel, 0..1.")] = 1.0,
    minimum_time_ms: Annotated[float, typer.Option(help="Minimum trajectory execution time.")] = 20.0,
    fast: Annotated[bool, typer.Option("--fast", help="Jerk 500 %, acceleration override 20 (manual 7.12).")] = False,
    plot: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw destination and motion.")] = None,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the figures.")] = None,
) -> None:
    """Let a SmartServo move a frame along a sine, by Cartesian destinations."""
    if along not in tuple(COORDINATES):
        raise typer.BadParameter(f"{along!r} is no coordinate; valid: x, y, z", param_hint="--along")

    def action() -> None:
        motion = SmartServo()
        motion.set_joint_velocity_rel(velocity_rel).set_joint_acceleration_rel(acceleration_rel)
        motion.set_minimum_trajectory_execution_time(minimum_time_ms * 1e-3)
        if fast:
            motion.set_joint_jerk(500).override_joint_acceleration(20)
        sine = CartesianSine(along, amplitude_mm * 1e-3, frequency, frame, reference)
        say = partial(print, file=sys.stdout, flush=True)
        recording, result = run_sample(
            motion, sine, controller=controller, key_file=key, seconds=seconds, period_s=period_ms * 1e-3, say=say
        )
        title = (
            f"SmartServo{', jerk 500 %, override 20' if fast else ''}: a Cartesian destination every {period_ms:g} ms"
        )
        finish(recording, result, sine, title=title, plot=plot, json_file=json_file, say=say)

    run_app("smart_servo_cartesian", action)


if __name__ == "__main__":
    typer.run(main)
