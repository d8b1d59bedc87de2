"""The one sentence a report begins with: the worst that was found, or that nothing was."""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from hil.values.finding import Severity
from tools.report.record import RobotRecord

_SEVERITIES: Final = {one.name.lower(): one for one in Severity}


class Verdict(NamedTuple):
    """How bad it is, and the sentence."""

    severity: Severity
    sentence: str


def verdict_of(robots: Sequence[RobotRecord], *, own: bool) -> Verdict:
    """Return the worst of all robots; of two that are as bad, the one that is told first."""
    found = [
        Verdict(one.severity, f"{robot.name}: {one.sentence}" if len(robots) > 1 else one.sentence)
        for robot in robots
        for one in _found(robot)
    ]
    worst = max(found, key=lambda one: one.severity.value, default=None)
    if worst is not None and worst.severity.value > Severity.NOTE.value:
        return worst
    return Verdict(Severity.GOOD, _nothing_found(robots, own=own))


def findings_of(robot: RobotRecord) -> list[dict[str, object]]:
    """Return what the controller diagnosed, the worst first."""
    found = robot.report.get("findings")
    return [one for one in found if isinstance(one, dict)] if isinstance(found, list) else []


def severity_of(finding: dict[str, object]) -> Severity:
    """Return how bad a finding of a report is."""
    return _SEVERITIES.get(str(finding.get("severity")), Severity.NOTE)


def _found(robot: RobotRecord) -> Iterator[Verdict]:
    for finding in findings_of(robot):
        yield Verdict(severity_of(finding), str(finding.get("sentence")))
    if robot.stops:
        at_s, text = robot.stops[0]
        often = "once" if robot.stop_count == 1 else f"{robot.stop_count} times, first"
        yield Verdict(Severity.WARNING, f"the arm was stopped {often} at {at_s:.3f} s: {text}")
    if robot.quality_falls:
        at_s, text = robot.quality_falls[0]
        count = len(robot.quality_falls)
        often = "once" if count == 1 else f"{count} times, first"
        yield Verdict(Severity.WARNING, f"the connection became worse than GOOD {often} at {at_s:.3f} s: {text}")
    times = robot.latencies
    if times.late and robot.budget_ms:
        yield Verdict(
            Severity.WARNING,
            f"{times.late} of {times.count} answers came later than the budget of {robot.budget_ms:g} ms; the latest "
            f"took {times.largest_ms:.3g} ms at {times.largest_at_s:.3f} s",
        )


def _nothing_found(robots: Sequence[RobotRecord], *, own: bool) -> str:
    length_s = max((robot.end_s for robot in robots), default=0.0)
    facts = [f"no stop in {length_s:.3f} s"]
    timed = [robot for robot in robots if robot.latencies.count]
    if timed:
        slowest = max(timed, key=lambda robot: robot.latencies.largest_ms / (robot.budget_ms or 1.0))
        count = sum(robot.latencies.count for robot in timed)
        facts.append(
            f"all {count} answers within their budget, the latest with {slowest.latencies.largest_ms:.3g} of "
            f"{slowest.budget_ms or 0:g} ms"
        )
    closest = max((robot.report.get("closest") or "" for robot in robots), key=lambda one: _share(str(one)), default="")
    if closest:
        facts.append(str(closest))
    where = "" if own else ", as far as the packets show"
    return f"nothing found: {'; '.join(facts)}{where}"


def _share(closest: str) -> float:
    """Return the per cent in such words."""
    number = closest.rpartition("%")[0].rpartition(" ")[2]
    return float(number) if number.replace(".", "", 1).isdigit() else 0.0
