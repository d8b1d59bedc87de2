"""``make soak``: hours of virtual time under the safety laws, and minutes of real time with real processes."""

import json
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from tests.soak.real import Ordeal
from tests.soak.virtual import VirtualReport, play
from tests.support.processes import own_host


def main(  # noqa: PLR0917
    virtual_hours: Annotated[float, typer.Option(min=0.0, help="Virtual time.")] = 2.0,
    reconnects: Annotated[int, typer.Option(help="Of applications and FRI clients, in the virtual time.")] = 10_000,
    real_minutes: Annotated[float, typer.Option(min=0.0, help="Real time.")] = 5.0,
    workers: Annotated[int, typer.Option(min=1, help="Processes of the virtual soak.")] = 2,
    seed: Annotated[int, typer.Option(help="Of the first shift; the others follow.")] = 0,
    only: Annotated[int | None, typer.Option(help="Play the shift with this seed, and nothing else.")] = None,
    out: Annotated[Path, typer.Option(help="Where the findings and figures are kept.")] = Path("out/soak"),
) -> None:
    """Exit code 1 where an invariant did not hold."""
    console = Console()
    if only is not None:
        console.print(play(only, round(reconnects / max(virtual_hours, 1e-9) / 12.0)))
        return
    out.mkdir(parents=True, exist_ok=True)
    found: VirtualReport | None = None
    ordeals: list[Ordeal] = []
    with Progress(console=Console(stderr=True), transient=True) as bar:
        if virtual_hours:
            from tests.soak import virtual

            task = bar.add_task("virtual hours", total=virtual_hours)
            found = virtual.soak(
                hours=virtual_hours,
                reconnects=reconnects,
                first_seed=seed,
                workers=workers,
                progress=lambda done, findings: bar.update(
                    task, completed=done, description=f"virtual hours, {findings} findings"
                ),
            )
        if real_minutes:
            from tests.soak import real

            ordeal = bar.add_task("real processes", total=None)
            with tempfile.TemporaryDirectory(prefix="hil-soak-") as folder:
                ordeals = real.soak(
                    minutes=real_minutes,
                    folder=Path(folder),
                    host=own_host(),
                    progress=lambda name: bar.update(ordeal, description=name),
                )
    findings = [] if found is None else list(found.findings)
    findings += [f"{one.name}: {one.finding}" for one in ordeals if one.finding]
    if found is not None:
        _print_virtual(console, found)
    if ordeals:
        _print_real(console, ordeals)
    told = {
        # asdict makes nonsense of a Counter in this Python.
        "virtual": None
        if found is None
        else {**vars(found), "done": dict(found.done), "refusals": dict(found.refusals)},
        "real": [asdict(one) for one in ordeals],
        "findings": findings,
    }
    (out / "soak.json").write_text(json.dumps(told, indent=2), encoding="utf-8")
    for finding in findings:
        console.print(f"[red]finding[/red] {finding}", soft_wrap=True)
    console.print(f"{len(findings)} findings; figures in {out / 'soak.json'}", soft_wrap=True)
    raise typer.Exit(1 if findings else 0)


def _print_virtual(console: Console, found: VirtualReport) -> None:
    table = Table("virtual soak", "")
    grown = [f"{sizes[0]:.0f} -> {sizes[-1]:.0f}" for sizes in found.resident_mb.values()]
    for name, value in (
        ("virtual time", f"{found.virtual_s / 3600:.2f} h in {found.wall_s / 60:.1f} min, {found.shifts} shifts"),
        ("commands held against the laws", f"{found.commands}, {found.moved} of them moved the arm"),
        ("reconnects", str(found.reconnects)),
        ("stops of the arm", str(found.stops)),
        ("done", ", ".join(f"{count} {name}" for name, count in found.done.most_common())),
        (
            "errors that clients were given",
            ", ".join(f"{count} {name}" for name, count in found.refusals.most_common()),
        ),
        ("shifts recorded and replayed to the byte", str(found.replayed)),
        ("largest memory of a worker, first to last shift, MB", ", ".join(grown)),
        ("findings", str(len(found.findings))),
    ):
        table.add_row(name, value)
    console.print(table)


def _print_real(console: Console, ordeals: list[Ordeal]) -> None:
    table = Table("real processes", "what was done", "Hz", "missed, %", "lateness p99, us", "resident, MB", "found")
    for one in ordeals:
        done = ", ".join(f"{value:g} {name}" for name, value in one.done.items()) or f"{one.seconds:.0f} s"
        before, after = one.resident_mb
        table.add_row(
            one.name,
            done,
            f"{one.rate_hz:.2f}",
            f"{one.missed_percent:.3f}",
            f"{one.lateness_p99_us:.0f}",
            f"{before:.0f} -> {after:.0f}",
            "[red]yes[/red]" if one.finding else one.not_tried or "-",
        )
    console.print(table)


if __name__ == "__main__":
    typer.run(main)
