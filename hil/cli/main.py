"""Entry point: one typer application; errors of the tree end in one sentence and exit code 2."""

import contextlib
import os
import sys
from typing import Annotated

import typer

from hil.arithmetic import fix_arithmetic
from hil.cli import pad
from hil.values.errors import HilError
from hil.version import SOFTWARE

app = typer.Typer(
    name="hil",
    help="The open controller emulator for KUKA's light-weight arms: serves unmodified FRI clients over UDP.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)


@app.callback(invoke_without_command=True)
def options(version: Annotated[bool, typer.Option("--version", help="Print the version and end.")] = False) -> None:
    """The open controller emulator for KUKA's light-weight arms: serves unmodified FRI clients over UDP."""
    if version:
        typer.echo(SOFTWARE)
        raise typer.Exit


def _add_commands(first: str) -> None:
    """Add the commands; a pad, whose keys should work at once, does not wait for what only the others import."""
    if first != "pad":
        from hil.cli import (
            backends,
            bench,
            campaign,
            can_drives,
            capture,
            config,
            conformance,
            demo,
            dissector,
            doctor,
            impair,
            rendering,
            replay,
            report,
            run,
            shadow,
            snapshot,
            stand_in,
            step_response,
            top,
            view,
        )

        app.command("run")(run.run)
        app.command("backends")(backends.backends)
        app.command("campaign")(campaign.campaign)
        app.command("demo")(demo.demo)
        app.command("dissector")(dissector.dissector)
        app.command("impair")(impair.impair)
        app.command("rendering")(rendering.rendering)
        app.command("replay")(replay.replay)
        app.command("shadow")(shadow.shadow)
        app.command("snapshot")(snapshot.snapshot)
        app.command("step-response")(step_response.step_response)
        app.command("can-drives")(can_drives.can_drives)
        app.command("conformance")(conformance.conformance)
        app.command("report")(report.report)
        app.command("top")(top.top)
        app.command("view")(view.view)
        app.add_typer(bench.app, name="bench")
        app.add_typer(capture.app, name="capture")
        app.add_typer(config.app, name="config")
        app.add_typer(doctor.app, name="doctor")
        app.add_typer(stand_in.app, name="stand-in")
    app.add_typer(pad.app, name="pad")


def main() -> None:
    """Run the command line."""
    fix_arithmetic()
    _add_commands(sys.argv[1] if len(sys.argv) > 1 else "")
    try:
        app()
    except HilError as error:
        sys.stderr.write(f"hil: {error}\n")
        sys.exit(2)
    except OSError as error:
        # Not a bug of ours: a full disk, a closed terminal. What could be written was written before.
        with contextlib.suppress(OSError):
            sys.stderr.write(f"hil: {error}\n")
        os._exit(1)


if __name__ == "__main__":
    main()
