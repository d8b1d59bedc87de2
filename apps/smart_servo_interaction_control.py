"""SmartServo under impedance control (manual 8.1.3): ``python -m apps.smart_servo_interaction_control``.

Validates the load, begins under soft Cartesian impedance, becomes stiffer while it runs and somebody pushes, and ends
under joint impedance, which needs a motion of its own.
"""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from apps._interaction_sample import Plan, finish_interaction, run_interaction
from apps._servo_sample import run_app
from hil.client.servo import SmartServo


def main(
    controller: Annotated[str, typer.Option(metavar="HOST[:PORT]", help="Where hil run serves.")] = "127.0.0.1:30300",
    *,
    key: Annotated[Path | None, typer.Option(metavar="FILE", help="Pre-shared key of the servo link.")] = None,
    frame: Annotated[str, typer.Option(metavar="NAME", help="Frame to move: the flange, or one on it.")] = "flange",
    seconds: Annotated[float, typer.Option(min=0.4, max=60.0, help="Length under Cartesian impedance.")] = 8.0,
    push: Annotated[float, typer.Option(metavar="N", help="Push the simulated flange along x; 0: do not.")] = 15.0,
    plot: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw deflection, stiffness, force.")] = None,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the figures.")] = None,
) -> None:
    """Let a SmartServo give way to a push, less and less."""

    def action() -> None:
        plan = Plan(controller, key, frame, seconds, push)
        say = partial(print, file=sys.stdout, flush=True)
        run = run_interaction(SmartServo, plan, say)
        title = f"SmartServo under Cartesian impedance, pushed with {push:g} N"
        finish_interaction(run, plan, title=title, plot=plot, json_file=json_file, say=say)

    run_app("smart_servo_interaction_control", action)


if __name__ == "__main__":
    typer.run(main)
