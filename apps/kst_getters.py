"""Everything a KST server can be asked, once: ``python -m apps.kst_getters``."""

from functools import partial

import typer

from apps._kst_sample import DEFAULT_CONTROLLER, Controller, listed
from apps._servo_sample import run_app
from hil.client.kst import KstClient

INPUTS = (3, 4, 10, 13, 16)


def main(controller: Controller = DEFAULT_CONTROLLER) -> None:
    """Read pose, joints, forces, torques and inputs. Exit code 2 where no server answers."""
    run_app("kst_getters", partial(_read, controller))


def _read(controller: str) -> None:
    with KstClient(controller) as arm:
        for name, read in (
            ("joint positions, rad", arm.joint_positions),
            ("pose of the tool, mm and rad", arm.pose),
            ("force at the tool, N", arm.force),
            ("moment at the tool, Nm", arm.moment),
            ("external torques, Nm", arm.external_torques),
            ("measured torques, Nm", arm.measured_torques),
        ):
            typer.echo(f"{name:<30}{listed(read())}   ({arm.round_trip_ms:.2f} ms)")
        high = [str(pin) for pin in INPUTS if arm.input_is_high(pin)]
        typer.echo(f"{'inputs that are high':<30}{', '.join(high) or 'none'}")


if __name__ == "__main__":
    typer.run(main)
