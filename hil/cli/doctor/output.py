"""How a diagnosis is shown: the verdict first, evidence and remedies below, or JSON."""

from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from hil.cli.json_output import JsonOutput
from hil.cli.plain import plain
from hil.values.finding import Diagnosis, EvidenceTable, Finding, Severity

JsonFile = Annotated[
    str | None, typer.Option("--json", metavar="FILE|-", help="Write what was found; -: to the output, alone.")
]
SOMETHING_WRONG = 1
_COLOURS = {Severity.GOOD: "green", Severity.NOTE: "cyan", Severity.WARNING: "yellow", Severity.FAULT: "red"}


class Output(JsonOutput):
    """Where one diagnosis goes."""

    def tell(self, diagnosis: Diagnosis) -> None:
        """Show it, write it, and end with exit code 1 if something is wrong."""
        if not self.alone:
            show_diagnosis(diagnosis, Console(highlight=False))
        self.write(diagnosis.as_dict())
        if not diagnosis.healthy:
            raise typer.Exit(SOMETHING_WRONG)


def show_diagnosis(diagnosis: Diagnosis, console: Console) -> None:
    """Print the verdict, what else was found, and the tables."""
    for finding in diagnosis.findings:
        show_finding(finding, console)
    for table in diagnosis.tables:
        console.print(_table(table))


def show_finding(finding: Finding, console: Console) -> None:
    """Print one finding: its sentence, its evidence and what helps."""
    colour = _COLOURS[finding.severity]
    # Sentences are not broken where the output is a file: soft_wrap.
    console.print(f"[{colour}]{plain(finding.sentence)}[/{colour}]", soft_wrap=True)
    for line in finding.evidence:
        console.print(f"  - {plain(line)}", soft_wrap=True)
    if finding.remedies:
        console.print("  what helps, the most effective first:")
        for number, remedy in enumerate(finding.remedies, 1):
            console.print(f"  {number}. {plain(remedy)}", soft_wrap=True)


def _table(table: EvidenceTable) -> Table:
    shown = Table(*map(plain, table.columns), title=plain(table.title))
    for row in table.rows:
        shown.add_row(*map(plain, row))
    return shown
