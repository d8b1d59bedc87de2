"""What all benchmarks show alike: progress, figures, the machine, bounds."""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table

if TYPE_CHECKING:
    from tools.bench.bounds import Bound


@contextmanager
def progress_bar(what: str, total: float) -> Iterator[tuple[Progress, TaskID]]:
    """Show on standard error how far it is, and nothing once it is done."""
    with Progress(console=Console(stderr=True), transient=True) as bar:
        yield bar, bar.add_task(what, total=total)


def numbers(figures: dict[str, Any]) -> list[str]:
    """Return the cells of a row; a figure that there is not is a dash."""
    return ["-" if figure is None else f"{figure:.1f}" for figure in figures.values()]


def console_for(found: dict[str, Any], *, as_json: bool, bounds: "Sequence[Bound] | None" = None) -> Console | None:
    """Print what was found as JSON, machine included, and return None; else print the machine, and return a console.

    ``bounds`` are those that ``found`` does not have yet.
    """
    from tools.bench.machine import machine

    if as_json:
        if bounds is not None:
            found = {**found, "bounds": [bound._asdict() for bound in bounds]}
        typer.echo(json.dumps({"machine": machine(), **found}, indent=2))
        return None
    console = Console()
    print_machine(console, machine())
    return console


def print_machine(console: Console, facts: dict[str, str], *, of: str = "") -> None:
    """Print what the figures below were measured on, or those ``of`` somebody else."""
    said = ", ".join(f"{name} {value}" for name, value in facts.items())
    console.print(of + said, style="dim", highlight=False)


def print_bounds(console: Console, bounds: "list[Bound]") -> None:
    """Print each bound beside what was measured, and whether it was kept."""
    table = Table("figure", "measured", "bound", "")
    for bound in bounds:
        verdict = "[green]kept[/green]" if bound.kept else "[red]MISSED[/red]"
        table.add_row(bound.name, f"{bound.figure:g} {bound.unit}", bound.bound, verdict)
    console.print(table)
