"""What is found is kept in bounded memory, told when it is new, and shown verdict first."""

from io import StringIO

from rich.console import Console

from hil.cli.doctor.output import show_diagnosis
from hil.core.diagnosis.findings import MAX_SUBJECTS, TELL_EVERY_NS, FindingLog
from hil.core.events import Event
from hil.values.finding import Diagnosis, EvidenceTable, Finding, Severity, Whose


def finding(severity: Severity = Severity.WARNING, sentence: str = "the application is slow") -> Finding:
    return Finding(
        "slow", severity, Whose.APPLICATION, sentence, ("mean 21 ms",), ("set 32 to 42 ms",), {"mean_ms": 21}
    )


def test_a_finding_is_told_when_it_is_new_or_worse_or_long_not_told() -> None:
    told: list[Event] = []
    log = FindingLog(told.append)
    log.add(finding(), now_ns=0)
    log.add(finding(), now_ns=1)
    assert [str(event) for event in told] == ["the application is slow; what helps: set 32 to 42 ms"]
    log.add(finding(Severity.FAULT, "it is worse"), now_ns=2)
    log.add(finding(), now_ns=3)
    log.add(finding(), now_ns=2 + TELL_EVERY_NS)
    assert [event.at_ns for event in told] == [0, 2, 2 + TELL_EVERY_NS]
    (kept,) = log.report()
    assert (kept["count"], kept["sentence"], kept["first_s"]) == (5, "it is worse", 0.0)


def test_findings_of_too_many_things_are_counted_only() -> None:
    told: list[Event] = []
    log = FindingLog(told.append)
    for number in range(MAX_SUBJECTS + 7):
        log.add(finding(), subject=str(number), now_ns=number)
    assert (len(told), len(log.report()), log.not_kept) == (MAX_SUBJECTS, MAX_SUBJECTS, 7)


def test_a_diagnosis_is_shown_verdict_first() -> None:
    table = EvidenceTable("round trips", ("what", "mean"), (("[write] read", "41 ms"),))
    diagnosis = Diagnosis((finding(),), (table,))
    out = StringIO()
    show_diagnosis(diagnosis, Console(file=out, width=80))
    lines = out.getvalue().splitlines()
    assert lines[0] == "the application is slow"
    assert "  - mean 21 ms" in lines
    assert "  1. set 32 to 42 ms" in lines
    assert "[write] read" in out.getvalue()
    assert not diagnosis.healthy
    assert diagnosis.as_dict()["verdict"] == "the application is slow"


def test_what_a_file_says_gives_the_terminal_no_orders() -> None:
    out = StringIO()
    show_diagnosis(Diagnosis((finding(sentence="robot \x1b[2J[red]x"),)), Console(file=out, width=80))
    assert out.getvalue().splitlines()[0] == "robot \N{REPLACEMENT CHARACTER}[2J[red]x"
