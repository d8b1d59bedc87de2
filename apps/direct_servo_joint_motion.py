"""DirectServo, the simple joint motion sample (manual 8.2.1): ``python -m apps.direct_servo_joint_motion``.

The application plans the path itself and sets the next point of it as often as the controller answers.
"""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from apps._servo_sample import Sine, finish, run_app, run_sample
from hil.client.servo import DirectServo


def main(  # noqa: PLR0917  # typer makes the options of the parameters; nobody calls this with positions
    controller: Annotated[str, typer.Option(metavar="HOST[:PORT]", help="Where hil run serves.")] = "127.0.0.1:30300",
    key: Annotated[Path | None, typer.Option(metavar="FILE", help="Pre-shared key of the servo link.")] = None,
    seconds: Annotated[float, typer.Option(min=0.1, help="Length of the motion.")] = 5.0,
    period_ms: Annotated[float, typer.Option(min=0.0, help="Between destinations; 0: as often as answered.")] = 4.0,
    axis: Annotated[int, typer.Option(min=1, max=7, help="Axis to move.")] = 4,
    amplitude: Annotated[float, typer.Option(metavar="RAD", help="Swing of the sine, peak to peak.")] = 0.3,
    frequency: Annotated[float, typer.Option(metavar="HZ", help="Frequency of the sine.")] = 0.25,
    velocity_rel: Annotated[float, typer.Option(help="Joint velocity rel, 0..1.")] = 1.0,
    plot: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw destination, set point, motion.")] = None,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the figures.")] = None,
) -> None:
    """Let a DirectServo follow a sine on one axis; every destination is within 5 degrees of the measured position."""

    def action() -> None:
        motion = DirectServo().set_joint_velocity_rel(velocity_rel)
        sine = Sine(axis, amplitude, frequency)
        say = partial(print, file=sys.stdout, flush=True)
        recording, result = run_sample(
            motion, sine, controller=controller, key_file=key, seconds=seconds, period_s=period_ms * 1e-3, say=say
        )
        title = f"DirectServo: a destination every {period_ms:g} ms"
        finish(recording, result, sine, title=title, plot=plot, json_file=json_file, say=say)

    run_app("direct_servo_joint_motion", action)


if __name__ == "__main__":
    typer.run(main)
