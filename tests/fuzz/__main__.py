"""``make fuzz SECONDS=n``: every target for its share of the time, two at once; a table, and the inputs that failed.

What it finds is kept in ``out/fuzz/findings``: make a test of it. What it learned is kept in ``out/fuzz/corpus``.
"""

import re
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hil.clock import elapsed_ns
from tests.fuzz.target import Target
from tests.fuzz.targets import TARGETS

AT_ONCE: Final = 2
SLOWEST_INPUT_S: Final = 30
MEMORY_MB: Final = 2048
_DONE: Final = re.compile(r"#(\d+)\s+DONE\s+cov: (\d+) ft: (\d+) corp: (\d+)")
_REASON: Final = re.compile(
    r"^(?:[\w.]*(?:Error|Exception|Warning): .*|AssertionError.*|==\d+== ?ERROR: .*)$", re.MULTILINE
)


class Outcome(NamedTuple):
    """What became of a target."""

    target: Target
    runs: int
    edges: int
    corpus: int
    seconds: float
    finding: str
    """File of the input that failed, and why; empty: none."""


def main(
    seconds: Annotated[float, typer.Option(min=1.0, help="Of all targets together.")] = 120.0,
    target: Annotated[list[str] | None, typer.Option(help="Only these; all.")] = None,
    out: Annotated[Path, typer.Option(help="Where corpus and findings are kept.")] = Path("out/fuzz"),
) -> None:
    """Feed every target with bytes, led by coverage. Exit code 1 where an invariant did not hold."""
    unknown = set(target or ()) - set(TARGETS)
    if unknown:
        raise typer.BadParameter(f"unknown target {min(unknown)!r}; valid: {', '.join(TARGETS)}")
    chosen = [TARGETS[name] for name in target or TARGETS]
    share_s = max(1.0, seconds * AT_ONCE / len(chosen))
    with Progress(console=Console(stderr=True), transient=True) as bar, ThreadPoolExecutor(AT_ONCE) as pool:
        task = bar.add_task("fuzzing", total=len(chosen))
        outcomes = []
        for outcome in pool.map(partial(fuzz, share_s=share_s, out=out), chosen):
            outcomes.append(outcome)
            bar.update(task, advance=1, description=outcome.target.name)
    _print(outcomes)
    if any(outcome.finding for outcome in outcomes):
        raise typer.Exit(1)


def fuzz(target: Target, *, share_s: float, out: Path) -> Outcome:
    """Run one target in a process of its own for so long, or until an input fails."""
    corpus, findings = out / "corpus" / target.name, out / "findings"
    for folder in (corpus, findings):
        folder.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(target.seeds()):
        (corpus / f"seed-{number:03}").write_bytes(seed[: target.longest_bytes])
    prefix = findings / f"{target.name}-"
    before, began_ns = set(findings.iterdir()), elapsed_ns()
    done = subprocess.run(
        [
            *(sys.executable, "-m", "tests.fuzz.one", target.name),
            *(f"-max_total_time={int(share_s)}", f"-max_len={target.longest_bytes}", f"-timeout={SLOWEST_INPUT_S}"),
            *(f"-rss_limit_mb={MEMORY_MB}", f"-artifact_prefix={prefix}", "-print_final_stats=0", str(corpus)),
        ],
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    said = done.stdout + done.stderr
    new = sorted(set(findings.iterdir()) - before)
    finding = ""
    if done.returncode:
        reasons = _REASON.findall(said)
        why = reasons[0] if reasons else said.strip().rpartition("\n")[2]
        finding = f"{new[0] if new else 'no input kept'}: {why}"
    counted = _DONE.search(said)
    runs, edges, _, kept = map(int, counted.groups()) if counted else (0, 0, 0, 0)
    return Outcome(target, runs, edges, kept, (elapsed_ns() - began_ns) * 1e-9, finding)


def _print(outcomes: Sequence[Outcome]) -> None:
    console = Console()
    table = Table("target", "invariant", "inputs", "edges", "corpus", "s", "found", title="fuzzing")
    for outcome in outcomes:
        table.add_row(
            outcome.target.name,
            outcome.target.invariant,
            *(str(number) for number in (outcome.runs, outcome.edges, outcome.corpus)),
            f"{outcome.seconds:.0f}",
            "[red]yes[/red]" if outcome.finding else "-",
        )
    console.print(table)
    for outcome in outcomes:
        if outcome.finding:
            console.print(f"[red]{outcome.target.name}[/red]: {outcome.finding}", soft_wrap=True, markup=True)


if __name__ == "__main__":
    typer.run(main)
