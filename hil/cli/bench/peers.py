"""``hil bench peers``: what it asks for and what it prints."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hil.cli.bench.options import AsJson
from hil.cli.bench.shown import console_for, print_machine
from hil.values.fri import Release

if TYPE_CHECKING:
    from tools.bench.peers.compare import PeersReport


def peers(  # noqa: PLR0917  # typer makes the options of the parameters
    robot: Annotated[str, typer.Option(help="Robot model of ours.")] = "lbr-iiwa-14-r820",
    fri_version: Annotated[Release, typer.Option(help="FRI release of our client.")] = Release.V1_15,
    cycles: Annotated[int, typer.Option(min=100, help="Cycles of each repeat.")] = 10_000,
    seconds: Annotated[float, typer.Option(min=2.0, help="Length of each state stream.")] = 15.0,
    repeats: Annotated[int, typer.Option(min=1, max=50, help="Of everything, in turn with the peer's.")] = 3,
    folder: Annotated[
        Path | None,
        typer.Option(
            "--environments", metavar="FOLDER", help="Environments of the peers; .venv-peers of this project."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Beside franky-sim and franka-sim, same work: a cycle with a MuJoCo arm, state stream at 1 kHz, virtual time."""
    from tools.bench.peers.compare import bench_peers, steps
    from tools.bench.peers.environment import FOLDER, environments

    theirs = environments(FOLDER if folder is None else folder)
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=steps(repeats))
        report = bench_peers(
            environments=theirs,
            robot=robot,
            release=fri_version,
            cycles=cycles,
            seconds=seconds,
            repeats=repeats,
            progress=lambda done, what: bar.update(task, completed=done, description=what),
        )
    if (console := console_for(report.as_dict(), as_json=as_json)) is None:
        return
    for name, found in report.peer_versions.items():
        print_machine(console, found, of=f"{name}: ")
    one, five, fifteen = report.load_average
    console.print(f"load average before: {one:.2f}, {five:.2f}, {fifteen:.2f}", style="dim", highlight=False)
    _print(console, report, robot=robot)


def _print(console: Console, report: "PeersReport", *, robot: str) -> None:
    from tools.bench.peers.table import DIFFERENCES, complaints, rows

    table = Table(
        f"{report.repeats} x {report.cycles} cycles, {report.repeats} x {report.seconds:g} s",
        *report.simulators,
        title=f"{robot} and FR3, MuJoCo: median of the repeats (smallest .. largest)",
    )
    for row in rows(report):
        if not row.cells:
            table.add_section()
            table.add_row(f"[bold]{row.label}[/bold]")
        else:
            table.add_row(row.label, *row.cells)
    console.print(table)
    for sentence in complaints(report):
        console.print(sentence, style="red", highlight=False)
    for sentence in DIFFERENCES:
        console.print(sentence, highlight=False)
