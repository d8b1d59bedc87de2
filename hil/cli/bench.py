"""``hil bench``: figures with machine and versions, as a table or as JSON."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table

from hil.config.station import FriConfig, RobotConfig
from hil.values.fri import Release

if TYPE_CHECKING:
    from tools.bench.bounds import Bound

app = typer.Typer(help="Measure: what a cycle costs, how well it is paced.", no_args_is_help=True)

Robot = Annotated[str, typer.Option(help="Robot model.")]
Backend = Annotated[str, typer.Option(help="Robot side.")]
FriVersion = Annotated[Release, typer.Option(help="FRI release of the client.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]


@app.command()
def cycle(
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    fri_version: FriVersion = Release.V1_15,
    cycles: Annotated[int, typer.Option(min=100, help="Cycles to measure.")] = 20_000,
    as_json: AsJson = False,
) -> None:
    """Cost of one control cycle, whole and by stage, in virtual time with an FRI client at 1 ms."""
    from tools.bench.cycle import as_dict, bench_cycle
    from tools.bench.machine import machine

    config = RobotConfig(model=robot, backend=backend, fri=FriConfig(release=fri_version))
    with _progress("cycles", 2 * cycles) as (bar, task):
        report = bench_cycle(config, cycles=cycles, progress=lambda done: bar.update(task, completed=done))
    found = {"machine": machine(), **as_dict(report)}
    if as_json:
        typer.echo(json.dumps(found, indent=2))
        return
    console = Console()
    _print_machine(console, found["machine"])
    table = Table("stage", "p50 us", "p99 us", "max us", title=f"one cycle: {robot}, {backend}, FRI {fri_version}")
    for name, figures in found["stages_us"].items():
        table.add_row(name, *_numbers(figures))
    table.add_section()
    table.add_row("whole cycle, measured without the stages", *_numbers(found["cycle_us"]))
    console.print(table)
    _print_bounds(console, report.bounds())


@app.command()
def rate(  # noqa: PLR0917  # typer makes the options of the parameters
    robot: Robot = "lbr-iiwa-14-r820",
    backend: Backend = "mujoco",
    fri_version: FriVersion = Release.V1_15,
    seconds: Annotated[float, typer.Option(min=2.0, help="Length of the run.")] = 60.0,
    capture: Annotated[bool, typer.Option("--capture", help="Record all packets meanwhile.")] = False,
    realtime: Annotated[bool, typer.Option("--realtime", help="Ask for real-time scheduling.")] = False,
    as_json: AsJson = False,
) -> None:
    """Pacing, missed cycles and answers of the real process against a client process over UDP at 1 ms."""
    from tools.bench.machine import machine
    from tools.bench.rate import bench_rate

    with _progress("seconds", seconds) as (bar, task):
        report = bench_rate(
            robot=robot,
            backend=backend,
            release=fri_version,
            seconds=seconds,
            capture=capture,
            realtime=realtime,
            progress=lambda done: bar.update(task, completed=done),
        )
    figures = report.robot
    if as_json:
        bounds = [bound._asdict() for bound in report.bounds()]
        typer.echo(json.dumps({"machine": machine(), "robot": figures, "client": report.client, "bounds": bounds}))
        return
    console = Console()
    _print_machine(console, machine())
    table = Table("", "p50 us", "p99 us", "p99.9 us", "max us", title=f"{seconds:g} s: {robot}, {backend}, 1 ms")
    for label, name in (("lateness", "lateness_us"), ("cycle", "cycle_us"), ("answer latency", "answer_latency_us")):
        table.add_row(label, *_numbers(figures[name]))
    console.print(table)
    session = figures["session"]
    packets = figures["packets"]
    console.print(
        f"{figures['rate_hz']} Hz, {figures['ticks']} cycles, {figures['missed_cycles']} missed; "
        f"{packets['received']} answers of {packets['sent']}, {packets['dropped']['late']} late; "
        f"{session['changes']} changes of state, last quality {session['quality']}"
    )
    _print_bounds(console, report.bounds())


@contextmanager
def _progress(what: str, total: float) -> Iterator[tuple[Progress, TaskID]]:
    with Progress(console=Console(stderr=True), transient=True) as bar:
        yield bar, bar.add_task(what, total=total)


def _numbers(figures: dict[str, Any]) -> list[str]:
    return ["-" if figure is None else f"{figure:.1f}" for figure in figures.values()]


def _print_machine(console: Console, facts: dict[str, str]) -> None:
    console.print(", ".join(f"{name} {value}" for name, value in facts.items()), style="dim")


def _print_bounds(console: Console, bounds: "list[Bound]") -> None:
    table = Table("figure", "measured", "bound", "")
    for bound in bounds:
        verdict = "[green]kept[/green]" if bound.kept else "[red]MISSED[/red]"
        table.add_row(bound.name, f"{bound.figure:g} {bound.unit}", bound.bound, verdict)
    console.print(table)
