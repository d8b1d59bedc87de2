"""``hil campaign FILE.toml``: thousands of scenarios in virtual time, and the worst of them."""

import os
import shlex
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Column, Table

from hil.cli.json_output import JsonOutput
from hil.values.errors import UnknownName, UsageError

if TYPE_CHECKING:
    from tools.campaign.plan import Plan
    from tools.campaign.scenario import Row, Scenario
    from tools.campaign.store import Store
    from tools.campaign.summary import Axis

_INTERRUPTED: Final = 130
_NAMES_TOLD: Final = 5


def campaign(  # noqa: PLR0917  # typer makes the options of the parameters
    file: Annotated[Path, typer.Argument(metavar="FILE.toml", help="What is combined with what: docs/campaigns.md.")],
    workers: Annotated[
        int | None, typer.Option(min=1, max=256, help="Worker processes; one for each core.", show_default=False)
    ] = None,
    dask: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="Play on the Dask cluster of this scheduler instead.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where results are kept; FILE-results.", show_default=False)
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget what an earlier run has found in DIR.")] = False,
    scenario: Annotated[
        str | None, typer.Option(metavar="NAME", help="Play this one here, and tell everything that happens in it.")
    ] = None,
    capture: Annotated[
        Path | None, typer.Option(metavar="FILE.pcapng", help="With --scenario: record all its packets.")
    ] = None,
    json_file: Annotated[
        str | None, typer.Option("--json", metavar="FILE|-", help="Write the summary as JSON.")
    ] = None,
) -> None:
    """Play every combination of applications, networks, gains, loads and seeds in virtual time; show the worst.

    The same command goes on where an interrupted campaign was. Exit code 1 where a scenario did not pass.
    """
    from tools.campaign.plan import load_plan

    plan = load_plan(file)
    if capture is not None and scenario is None:
        raise UsageError("--capture records one scenario: name it with --scenario")
    if scenario is not None:
        _play_one(plan, scenario, capture)
        return
    _play_all(plan, file, workers, dask, out or Path(f"{file.stem}-results"), JsonOutput(json_file), fresh=fresh)


def _play_one(plan: "Plan", name: str, capture: Path | None) -> None:
    from hil.runtime.lifetime import check_result_file
    from tools.campaign.play import play

    found = next((one for one in plan.scenarios if one.name == name), None)
    if found is None:
        close = [one.name for one in plan.scenarios if set(name.split("/")) & set(one.name.split("/"))]
        shown = (close or [one.name for one in plan.scenarios])[:_NAMES_TOLD]
        raise UnknownName("scenario", name, [*shown, f"... ({len(plan.scenarios)} in all)"])
    check_result_file(capture)
    console = Console(highlight=False)
    happened: list[str] = []
    console.print(f"playing {name}, however long it takes; Ctrl-C ends it", markup=False)
    row = play(
        found, capture=capture, say=lambda line: console.print(f"| {line}", markup=False), events=happened.append
    )
    for line in happened:
        console.print(line, markup=False)
    table = Table("", escape(found.name), show_edge=False)
    for column, value in row.items():
        if value not in {None, ""}:
            table.add_row(column, escape(str(value)))
    console.print(table)
    if capture is not None:
        console.print(f"wrote {capture}; hil doctor capture {capture} says whose fault it was", markup=False)
    raise typer.Exit(0 if row["outcome"] == "passed" else 1)


def _play_all(  # noqa: PLR0917
    plan: "Plan", file: Path, workers: int | None, dask: str | None, out: Path, output: JsonOutput, *, fresh: bool
) -> None:
    from tools.campaign.store import Store

    console = Console(stderr=output.alone)
    interrupted = False
    with Store(out, fresh=fresh) as store:
        patience_s = plan.campaign.patience_s
        left = [one for one in plan.scenarios if not store.has(one, patience_s=patience_s)]
        done = len(plan.scenarios) - len(left)
        if done:
            console.print(f"{done} of {len(plan.scenarios)} scenarios are in {out} already", markup=False)
        try:
            _fill(plan, left, store, workers, dask)
        except KeyboardInterrupt:
            interrupted = True
        rows = [store.rows[one.key] for one in plan.scenarios if one.key in store.rows]
        if rows:
            _write_results(console, rows, out, title=f"{file.name}: {len(rows)} of {len(plan.scenarios)} scenarios")
    if interrupted:
        console.print(f"interrupted: {len(rows)} of {len(plan.scenarios)} are done; the same command goes on")
    _print_summary(console, rows, file, planned=len(plan.scenarios))
    output.write(_as_dict(rows, len(plan.scenarios), file))
    if interrupted:
        raise typer.Exit(_INTERRUPTED)
    raise typer.Exit(0 if all(row["outcome"] == "passed" for row in rows) else 1)


def _fill(plan: "Plan", left: "Sequence[Scenario]", store: "Store", workers: int | None, dask: str | None) -> None:
    if not left:
        return
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[told]}"),
        TimeElapsedColumn(), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("scenarios", total=len(left), told="")
        failures = 0
        rows = _rows(plan, left, workers, dask)
        try:
            for row in rows:
                store.add(row)
                failures += row["outcome"] != "passed"
                told = f"{failures} did not pass" if failures else ""
                bar.update(task, advance=1, told=told)
        finally:
            rows.close()


def _rows(
    plan: "Plan", left: "Sequence[Scenario]", workers: int | None, dask: str | None
) -> "Generator[Row, None, None]":
    campaign = plan.campaign
    if dask is not None:
        from tools.campaign.cluster import play_on_cluster

        yield from play_on_cluster(left, scheduler=dask, patience_s=campaign.patience_s, retries=campaign.retries)
        return
    from tools.campaign.local import play_locally

    cores = len(os.sched_getaffinity(0))
    yield from play_locally(left, workers=workers or cores, patience_s=campaign.patience_s, retries=campaign.retries)


def _write_results(console: Console, rows: "Sequence[Row]", out: Path, *, title: str) -> None:
    from tools.campaign.store import PARQUET

    try:
        written = _written(rows, out, title=title)
    except OSError as error:
        why = error.strerror or error
        raise UsageError(f"cannot write the results in {out}: {why}; the rows are kept") from error
    if PARQUET not in written:
        console.print("no Parquet, for pyarrow is not installed: pip install 'fri-hil[campaign]'", markup=False)
    console.print(f"wrote {', '.join(written)} in {out}", markup=False)


def _written(rows: "Sequence[Row]", out: Path, *, title: str) -> list[str]:
    """Write table and picture, and return the files' names."""
    from tools.campaign.picture import draw
    from tools.campaign.store import CSV, PARQUET, PICTURE, write_csv, write_parquet

    write_csv(rows, out / CSV)
    parquet = write_parquet(rows, out / PARQUET)
    draw(rows, out / PICTURE, title=title)
    return [CSV, *([PARQUET] if parquet else []), PICTURE]


def _replay_command(file: Path, row: "Row") -> str:
    return f"hil campaign {shlex.quote(str(file))} --scenario {shlex.quote(row['scenario'])}"


def _print_summary(console: Console, rows: "Sequence[Row]", file: Path, *, planned: int) -> None:
    from tools.campaign.summary import ARMS, NETWORKS, first_failure, groups, worst_latencies, worst_margins

    _print_groups(console, rows, NETWORKS)
    if len(groups(rows, ARMS)) > 1:
        _print_groups(console, rows, ARMS)
    _print_worst(console, "worst margins", worst_margins(rows), _margin_told)
    _print_worst(console, "worst latencies", worst_latencies(rows), _latency_told)
    failure = first_failure(rows)
    if failure is not None:
        failed = sum(row["outcome"] != "passed" for row in rows)
        console.print(f"[red]{failed} of {len(rows)} did not pass[/red]; the first: {escape(failure['scenario'])}")
        console.print(f"  {failure['outcome']}: {failure['reason']}", markup=False, highlight=False, soft_wrap=True)
        console.print(f"  {_replay_command(file, failure)}", markup=False, highlight=False, soft_wrap=True)
    elif len(rows) == planned:
        console.print(f"[green]all {planned} scenarios passed[/green]")
    elif rows:
        console.print(f"the {len(rows)} that were played passed; {planned - len(rows)} were not")


def _print_groups(console: Console, rows: "Sequence[Row]", by: "tuple[Axis, Axis]") -> None:
    from tools.campaign.summary import groups

    names = (Column(axis, overflow="fold") for axis in by)
    table = Table(*names, "passed", "commanded, s", "largest use of a limit", "p99 of answers, ms")
    for group in groups(rows, by):
        worst = group.worst_margin
        monitor = f"{worst['margin_used']:.0%} {worst['margin_monitor']} {worst['margin_axis']}".rstrip()
        latency_us = group.worst_latency_us
        color = "green" if group.passed == len(group.rows) else "red"
        table.add_row(
            *map(escape, group.names),
            f"[{color}]{group.passed} of {len(group.rows)}[/{color}]",
            group.commanded_s,
            monitor if worst["margin_used"] else "-",
            "-" if latency_us is None else f"{latency_us * 1e-3:.2f}",
        )
    console.print(table)


def _print_worst(console: Console, title: str, rows: "Sequence[Row]", told: "Callable[[Row], str]") -> None:
    if rows:
        table = Table(title, "", "outcome", show_edge=False)
        for row in rows:
            table.add_row(escape(row["scenario"]), told(row), row["outcome"])
        console.print(table)


def _margin_told(row: "Row") -> str:
    return f"{row['margin_used']:.1%} of {row['margin_monitor']} {row['margin_axis']}".rstrip()


def _latency_told(row: "Row") -> str:
    return f"p99 {(row['answer_latency_p99_us'] or 0.0) * 1e-3:.2f} ms"


def _as_dict(rows: "Sequence[Row]", planned: int, file: Path) -> dict[str, object]:
    from tools.campaign.summary import first_failure, worst_latencies, worst_margins

    failure = first_failure(rows)
    outcomes: dict[str, int] = {}
    for row in rows:
        outcomes[row["outcome"]] = outcomes.get(row["outcome"], 0) + 1
    return {
        "planned": planned,
        "done": len(rows),
        "outcomes": outcomes,
        "first_failure": None if failure is None else {**failure, "command": _replay_command(file, failure)},
        "worst_margins": worst_margins(rows),
        "worst_latencies": worst_latencies(rows),
    }
