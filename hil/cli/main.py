"""Entry point: one typer application; errors of the tree end in one sentence and exit code 2."""

import sys

import typer

from hil.cli import bench, config, demo, run
from hil.values.errors import HilError

app = typer.Typer(
    name="hil",
    help="The open controller emulator for KUKA's light-weight arms: serves unmodified FRI clients over UDP.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.command("run")(run.run)
app.command("demo")(demo.demo)
app.add_typer(bench.app, name="bench")
app.add_typer(config.app, name="config")


def main() -> None:
    """Run the command line."""
    try:
        app()
    except HilError as error:
        sys.stderr.write(f"hil: {error}\n")
        sys.exit(2)


if __name__ == "__main__":
    main()
