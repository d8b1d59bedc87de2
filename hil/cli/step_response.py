"""``hil step-response``: the manual's section 7.12 on our arm: pictures, a table, and the manual's statements."""

import math
import sys
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

from hil.config.station import Reaction, ReactionConfig, RobotConfig, ServoConfig
from hil.runtime.lifetime import result_text
from hil.values.errors import ConfigurationError, UnknownName
from hil.values.robot import JOINT_NAMES

if TYPE_CHECKING:
    from tools.step_response.report import StepResponseReport

_TABLE_WIDTH = 120
_COLUMNS_WITHOUT_PEAKS = 7


def step_response(  # noqa: PLR0917  # typer makes the options of the parameters
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Folder for pictures, table and figures.")],
    robot: Annotated[str, typer.Option(help="Robot model.")] = "lbr-iiwa-14-r820",
    backend: Annotated[str, typer.Option(help="Robot side.")] = "mujoco",
    step_deg: Annotated[
        float, typer.Option(help="Step in degrees, for all motions; 5 at most, DirectServo takes no more.")
    ] = 5.0,
    axes: Annotated[str, typer.Option(metavar="A1,A4", help="Axes to step, one after the other.")] = ",".join(
        JOINT_NAMES
    ),
    reaction: Annotated[Reaction, typer.Option(help="Reaction time: cabinet or ideal.")] = Reaction.CABINET,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
) -> None:
    """Step each axis under SmartServo, SmartServo fast and DirectServo, in virtual time (manual 7.12)."""
    from backends.registry import check_backend
    from backends.robots import load_description
    from tools.step_response.drawing import draw, picture_count
    from tools.step_response.measuring import CASES, check_step, measure_steps
    from tools.step_response.report import StepResponseReport

    description = load_description(robot)
    check_backend(backend)
    chosen = _axes(axes)
    check_step(description, step_deg=step_deg, axes=chosen)
    _make_folder(out)
    config = RobotConfig(model=robot, backend=backend, servo=ServoConfig(), reaction=ReactionConfig(profile=reaction))
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("steps", total=len(chosen) * len(CASES))
        steps = measure_steps(
            config, step_deg=step_deg, axes=chosen, progress=lambda done: bar.update(task, completed=done)
        )
        start_deg = tuple(round(math.degrees(value), 9) for value in description.initial_position_rad)
        report = StepResponseReport(robot, backend, config.reaction.settings(), start_deg, step_deg, tuple(steps))
        drawing = bar.add_task("pictures", total=picture_count(report))
        pictures = draw(report, out, progress=lambda done: bar.update(drawing, completed=done))
    result = result_text(report.as_dict())
    (out / "step-response.json").write_text(result, encoding="utf-8")
    (out / "step-response.md").write_text(report.markdown(), encoding="utf-8")
    if as_json:
        sys.stdout.write(result)
        return
    _show(report)
    typer.echo(f"{out}: {len(pictures)} pictures, from {pictures[0].name} on; step-response.json; step-response.md")


def _show(report: "StepResponseReport") -> None:
    from tools.step_response.report import COLUMNS, NOTES

    console = Console(highlight=False)
    # In a file there is room for all of it; where a terminal has none, whole columns go, not parts of numbers.
    wide = console if console.is_terminal else Console(highlight=False, width=_TABLE_WIDTH)
    shown = len(COLUMNS) if wide.width >= _TABLE_WIDTH else _COLUMNS_WITHOUT_PEAKS
    table = Table(title=escape(report.title))
    for name, unit in COLUMNS[:shown]:
        table.add_column(f"{name}\n{unit}" if unit else name, justify="right" if unit else "left", no_wrap=True)
    for axis in report.axes:
        for row in report.rows():
            if row[0] == JOINT_NAMES[axis]:
                table.add_row(*map(escape, row[:shown]))
        table.add_section()
    wide.print(table)
    if shown < len(COLUMNS):
        console.print("Velocity, acceleration and jerk have no room here; step-response.md has them.", style="dim")
    for sentence in report.tripped():
        console.print(f"[red]{escape(sentence)}[/red]", soft_wrap=True)
    for note in NOTES:
        console.print(escape(note), style="dim", soft_wrap=True)
    statements = Table("the manual, 7.12", "measured", "")
    for said in report.statements():
        colour = "red" if said.holds is False else "green" if said.holds else "yellow"
        statements.add_row(escape(said.sentence), escape(said.measured), f"[{colour}]{said.verdict}[/{colour}]")
    wide.print(statements)


def _axes(names: str) -> list[int]:
    """Return the places of the axes that are named, each once, in their own order."""
    chosen = {name.strip().upper() for name in names.split(",") if name.strip()}
    for name in sorted(chosen):
        if name not in JOINT_NAMES:
            raise UnknownName("axis", name, JOINT_NAMES)
    if not chosen:
        raise UnknownName("axis", names, JOINT_NAMES)
    return [place for place, name in enumerate(JOINT_NAMES) if name in chosen]


def _make_folder(folder: Path) -> None:
    """Make the folder, and prove that it can be written into before anything is measured."""
    try:
        if folder.exists() and not folder.is_dir():
            raise ConfigurationError(f"cannot write into {folder}: that is a file, not a folder")
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ConfigurationError(f"cannot write into the folder {folder}: {error.strerror}") from error
