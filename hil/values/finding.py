"""What a diagnosis says: one sentence that names whose fault it was, the figures behind it, and what helps."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum, StrEnum
from types import MappingProxyType
from typing import NamedTuple

Figure = float | int | str | bool | None
_NO_FIGURES: Mapping[str, Figure] = MappingProxyType({})


class Whose(StrEnum):
    """Where the cause lies."""

    NOBODY = "nobody"
    CONTROLLER = "controller"
    """This emulator or the machine it runs on."""
    HOST = "this host"
    """The machine the diagnosis was made on."""
    PEER = "peer"
    """The program at the other end: FRI client, TCP peer."""
    WIRE = "wire"
    PEER_OR_WIRE = "peer or wire"
    """What was measured cannot tell the two apart."""
    BOTH = "both"
    """This emulator and the other side."""
    APPLICATION = "application"
    """What the program asks for, and when it asks."""
    CONFIGURATION = "configuration"
    """Settings of the two sides that do not fit."""


class Severity(Enum):
    """How bad it is; the value is the order."""

    GOOD = 0
    NOTE = 1
    WARNING = 2
    FAULT = 3


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing found. ``kind`` names it for programs and stays; ``sentence`` is for people."""

    kind: str
    """Words of small letters with hyphens, as ``seconds-hand``."""
    severity: Severity
    whose: Whose
    sentence: str
    evidence: tuple[str, ...] = ()
    """Measured facts, each a sentence or a line."""
    remedies: tuple[str, ...] = ()
    """What helps, the most effective first, with the numbers to set."""
    figures: Mapping[str, Figure] = field(default_factory=lambda: _NO_FIGURES)
    """What was measured, for programs; names carry the unit."""

    def __str__(self) -> str:
        return self.sentence

    @property
    def is_wrong(self) -> bool:
        """Whether it is worse than a note."""
        return self.severity.value > Severity.NOTE.value

    def as_dict(self) -> dict[str, object]:
        """Return it for JSON."""
        return {
            "kind": self.kind,
            "severity": self.severity.name.lower(),
            "whose": self.whose.value,
            "sentence": self.sentence,
            "evidence": list(self.evidence),
            "remedies": list(self.remedies),
            "figures": dict(self.figures),
        }


def worst_first(findings: Iterable[Finding]) -> list[Finding]:
    """Return them by severity; those that are as bad keep their order."""
    return sorted(findings, key=lambda finding: -finding.severity.value)


class EvidenceTable(NamedTuple):
    """Figures to be shown below a verdict; cells are text already."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """What a doctor says: the first finding is the verdict."""

    findings: tuple[Finding, ...]
    tables: tuple[EvidenceTable, ...] = ()

    @property
    def verdict(self) -> Finding:
        """Return the finding that is told first."""
        return self.findings[0]

    @property
    def healthy(self) -> bool:
        """Whether nothing worse than a note was found."""
        return not any(finding.is_wrong for finding in self.findings)

    def as_dict(self) -> dict[str, object]:
        """Return it for JSON."""
        return {
            "verdict": self.verdict.sentence,
            "healthy": self.healthy,
            "findings": [finding.as_dict() for finding in self.findings],
            "tables": [
                {"title": table.title, "columns": list(table.columns), "rows": [list(row) for row in table.rows]}
                for table in self.tables
            ],
        }
