"""``hil conformance A B``: the same command stream to two robot sides, and where they differ."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress, TaskID
from rich.table import Table

from hil.cli.json_output import JsonOutput
from hil.core.settings import CYCLE_CHOICES_MS
from hil.values.errors import ConfigurationError, OutOfRange

if TYPE_CHECKING:
    from tools.conformance.compare import Comparison

_ROBOT: Final = "lbr-iiwa-14-r820"


def conformance(  # noqa: PLR0917  # typer makes the options of the parameters
    a: Annotated[str, typer.Argument(metavar="A", help="Backend, such as ideal, mujoco:seed=1, cabinet:arm=mujoco.")],
    b: Annotated[str, typer.Argument(metavar="B", help="The one that is compared with it.")],
    robot: Annotated[
        str | None, typer.Option(help="Robot model; lbr-iiwa-14-r820 is the default.", show_default=False)
    ] = None,
    stream: Annotated[
        Path | None,
        typer.Option(metavar="FILE.pcapng", help="Set points of a recording of ours, instead of a mix of motions."),
    ] = None,
    cycle_ms: Annotated[
        int | None, typer.Option("--cycle", metavar="MS", help="Control cycle; the shortest that both hold.")
    ] = None,
    tolerance_rad: Annotated[
        float, typer.Option(help="How far the positions may be apart, latency taken away; else exit code 1.")
    ] = 5e-3,
    plot: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw the axis that differs most.")] = None,
    json_file: Annotated[str | None, typer.Option("--json", metavar="FILE|-", help="Write it as JSON.")] = None,
) -> None:
    """Give two robot sides the same command stream, in virtual time, and print where they differ."""
    from hil.runtime.lifetime import check_result_file
    from tools.conformance.compare import compare, run_stream
    from tools.conformance.rigs import make_rig, parse_side
    from tools.conformance.stream import captured_stream, planned_stream, with_actions

    if not 0.0 < tolerance_rad <= 1.0:
        raise OutOfRange("tolerance, rad", tolerance_rad, "> 0 and <= 1")
    output = JsonOutput(json_file)
    check_result_file(plot)
    if stream is not None and not (robot is None and cycle_ms is None):
        raise ConfigurationError(f"--robot and --cycle are those of the recording {stream}, and are not given with it")
    sides = parse_side(a), parse_side(b)
    robot = _ROBOT if robot is None else robot
    cycle = max(side.cycle_ms for side in sides) if cycle_ms is None else cycle_ms
    if cycle not in CYCLE_CHOICES_MS:
        raise ConfigurationError(f"a control cycle of {cycle} ms; valid: {', '.join(map(str, CYCLE_CHOICES_MS))} ms")
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("planning", total=None)
        if stream is not None:
            robot, cycle, moments = captured_stream(stream)
        rigs = [make_rig(side, robot=robot, cycle_ms=cycle) for side in sides]
        if stream is None:
            can = [rig.backend.capabilities for rig in rigs]
            drives, push = all(side.switches_drives for side in can), all(side.can_be_pushed for side in can)
            moments = with_actions(
                planned_stream(robot=robot, cycle_ms=cycle), cycle_ms=cycle, drives=drives, push=push
            )
        bar.update(task, total=2 * len(moments))
        courses = []
        for number, (rig, side) in enumerate(zip(rigs, sides, strict=True)):
            bar.update(task, description=side.text)
            progress = partial(_advance, bar, task, number * len(moments))
            courses.append(run_stream(rig, moments, name=side.text, cycle_ms=cycle, progress=progress))
        found = compare(courses[0], courses[1], moments, robot=robot, cycle_ms=cycle)
    _write(found, tolerance_rad, output, plot)
    if abs(found.worst_position.worst) > tolerance_rad * 1e3:
        raise typer.Exit(1)


def _advance(bar: Progress, task: TaskID, before: int, done: int) -> None:
    bar.update(task, completed=before + done)


def _write(found: "Comparison", tolerance_rad: float, output: JsonOutput, plot: Path | None) -> None:
    if plot is not None:
        from tools.conformance.drawing import draw

        draw(found, plot)
    output.write({"verdict": found.verdict(tolerance_rad), "tolerance_rad": tolerance_rad, **found.as_dict()})
    if not output.alone:
        _show(found, tolerance_rad)
        if plot is not None:
            typer.echo(f"picture: {plot}")


def _show(found: "Comparison", tolerance_rad: float) -> None:
    console = Console(highlight=False)
    console.print(escape(found.verdict(tolerance_rad)), style="bold", soft_wrap=True)
    seconds = len(found.parts) * found.cycle_ms * 1e-3
    console.print(
        f"{found.robot}, {len(found.parts)} cycles of {found.cycle_ms} ms, {seconds:.1f} s; B minus A", style="dim"
    )
    table = Table("", "axis", "rms", "worst", "at", "in", "as it was", title="differences, latency taken away")
    last = ""
    for one in found.differences:
        if last not in {"", one.quantity}:
            table.add_section()
        name = "" if one.quantity == last else f"{one.quantity}, {one.unit}"
        last = one.quantity
        figures = (f"{one.rms:.3g}", f"{one.worst:+.3g}", f"{one.at_s:.2f} s", one.part, f"{one.as_it_was:.3g}")
        table.add_row(name, one.axis, *figures)
    console.print(table)
    unlike = found.unlike()
    ours, theirs = found.drive_sequences()
    if ours != theirs:
        unlike.append(("drives went through", ours, theirs))
    if unlike:
        other = Table("not alike", escape(found.a.name), escape(found.b.name))
        for row in unlike:
            other.add_row(*map(escape, row))
        console.print(other)
