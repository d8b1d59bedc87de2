"""From what was measured to one sentence that names the side: a function of the figures alone.

Nagle's algorithm (RFC 896) holds a small second part back until the first one is acknowledged. An acknowledgement is
delayed (RFC 1122) in the hope that it can travel with a reply: about 40 ms on Linux, about 200 ms on Windows. Each is
harmless alone. One write a message, or the other side's answer between the writes, and nothing is ever held.
"""

from hil.values.finding import Diagnosis, EvidenceTable, Figure, Finding, Severity, Whose
from tools.doctor.tcp.cases import (
    ONE_NAGLE,
    ONE_NO_DELAY,
    REPLY_NAGLE,
    TWO_NAGLE,
    TWO_NAGLE_LATE,
    TWO_NO_DELAY,
    Case,
    CaseResult,
    Held,
    Measured,
)
from tools.doctor.tcp.remedies import System, acknowledger_remedies, fixed_side_remedy, nagle_remedies, sender_remedies

ALLOWED_MEAN_MS = 5.0
"""Manual 11.1: what an update of the real-time data may require on average."""
HERE = "this side"


def diagnose(measured: Measured) -> Diagnosis:
    """Return the verdict, what else was found, and the tables."""
    results = {result.case: result for result in measured.results}
    as_is = [result for case, result in results.items() if not case.asked]
    faults = [
        finding
        for finding in (
            _nagle_here(measured, results),
            _nagle_there(measured, as_is),
            _held_by_network(measured, as_is),
            _slow_program(measured, as_is),
            _slow_network(measured, results),
        )
        if finding is not None
    ]
    faults.sort(key=lambda finding: -_figure(finding, "mean_ms"))
    if not faults:
        faults = [_slow_altogether(measured, as_is) or _healthy(measured, as_is)]
    notes = [note for note in (_late_here(measured, results), _late_there(measured, results)) if note is not None]
    told = {finding.kind for finding in faults}
    notes = [note for note in notes if _TELLS_MORE[note.kind] not in told]
    if measured.left_out:
        notes.append(_left_out(measured))
    return Diagnosis((*faults, *notes), _tables(measured))


_TELLS_MORE = {"late-acknowledgement-here": "nagle-there", "late-acknowledgement-there": "nagle-here"}
"""Notes that a fault makes needless."""


def delay_words(delay_ms: float) -> str:
    """Return how late an acknowledgement is, and which system is known for that."""
    if 25.0 <= delay_ms < 80.0:
        return f"about {delay_ms:.0f} ms late, as Linux does (40 ms)"
    if 150.0 <= delay_ms < 280.0:
        return f"about {delay_ms:.0f} ms late, as Windows does (200 ms)"
    if delay_ms >= 100.0:
        return f"about {delay_ms:.0f} ms late (the manual has more than 100 ms for Windows)"
    return f"about {delay_ms:.0f} ms late"


def _nagle_here(measured: Measured, results: dict[Case, CaseResult]) -> Finding | None:
    result, twin = results.get(TWO_NAGLE), results.get(TWO_NO_DELAY)
    # With TCP_NODELAY nothing may be held: what is held all the same, the network held.
    if result is None or not result.held_here.stalled or (twin is not None and twin.held_here.stalled):
        return None
    other = "" if twin is None else f", and {_mean(twin)} in two writes with TCP_NODELAY"
    return Finding(
        kind="nagle-here",
        severity=_severity(result),
        whose=Whose.APPLICATION,
        sentence=(
            f"a message that this side writes in two parts takes {_mean(result)} on average, where {_allowed()}: this "
            f"side's Nagle algorithm holds the second part until {measured.peer} has acknowledged the first, and "
            f"{measured.peer} acknowledges {delay_words(result.held_here.stalls.mean_ms)}"
        ),
        evidence=(
            _line(result),
            f"the second part arrived there {result.held_here.stalls} after the first, in {_share(result.held_here)}",
            f"the same message takes {_mean(results[ONE_NAGLE])} in one write{other}"
            if ONE_NAGLE in results
            else f"it is {result.case.name}{other}",
        ),
        remedies=(
            *nagle_remedies(
                sender=HERE,
                acknowledger=measured.peer,
                sender_system=System.named(measured.here),
                acknowledger_system=_acknowledger(measured.there, result.held_here),
            ),
            fixed_side_remedy(measured.peer, HERE),
        ),
        figures=_figures(result, result.held_here),
    )


def _nagle_there(measured: Measured, as_is: list[CaseResult]) -> Finding | None:
    held = [result for result in as_is if result.held_there.stalled and result.nagle_there is not False]
    if not held:
        return None
    result = max(held, key=lambda one: one.total.mean_ms)
    known = "" if result.nagle_there else ", or the network does (an echo server does not say whether its Nagle is on)"
    return Finding(
        kind="nagle-there",
        severity=_severity(result),
        whose=Whose.PEER if result.nagle_there else Whose.PEER_OR_WIRE,
        sentence=(
            f"a round trip takes {_mean(result)} on average, where {_allowed()}: {measured.peer} writes its reply in "
            f"two parts, its Nagle algorithm holds the second until this side has acknowledged the first{known}, and "
            f"this side acknowledges {delay_words(result.held_there.stalls.mean_ms)}"
        ),
        evidence=(
            _line(result),
            (
                f"the second part of the reply came {result.held_there.stalls} after the first, in "
                f"{_share(result.held_there)}"
            ),
            f"it happens with {' and with '.join(one.case.name for one in held)}",
        ),
        remedies=(
            *nagle_remedies(
                sender=measured.peer,
                acknowledger=HERE,
                sender_system=System.named(measured.there),
                acknowledger_system=_acknowledger(measured.here, result.held_there),
            ),
            fixed_side_remedy(measured.peer, HERE),
        ),
        figures=_figures(result, result.held_there),
    )


def _held_by_network(measured: Measured, as_is: list[CaseResult]) -> Finding | None:
    held = [
        result
        for result in as_is
        if (result.case.no_delay and result.held_here.stalled)
        or (result.nagle_there is False and result.held_there.stalled)
    ]
    if not held:
        return None
    result = max(held, key=lambda one: one.total.mean_ms)
    again = sum(one.retransmissions for one in as_is)
    return Finding(
        kind="uneven-network",
        severity=_severity(result),
        whose=Whose.WIRE,
        sentence=(
            f"parts of one message to {measured.peer} arrive up to "
            f"{max(result.held_here.all.max_ms, result.held_there.all.max_ms):.0f} ms apart although TCP_NODELAY lets "
            f"them go at once: the network loses or holds packets ({again} were sent again), neither side's Nagle does"
        ),
        evidence=tuple(_line(one) for one in held),
        remedies=("look for loss and load on the way: ip -s link, a cable instead of wireless, another switch",),
        figures=_figures(result, result.held_here) | {"retransmissions": again},
    )


def _slow_program(measured: Measured, as_is: list[CaseResult]) -> Finding | None:
    slow = [result for result in as_is if result.thought.mean_ms > ALLOWED_MEAN_MS]
    if not slow:
        return None
    result = max(slow, key=lambda one: one.thought.mean_ms)
    return Finding(
        kind="slow-program-there",
        severity=Severity.WARNING,
        whose=Whose.PEER,
        sentence=(
            f"a round trip takes {_mean(result)} on average, where {_allowed()}: the program at {measured.peer} takes "
            f"{result.thought.mean_ms:.1f} ms of it before it replies; TCP is not the cause"
        ),
        evidence=(_line(result), f"from the whole request to the reply, by its own clock: {result.thought}"),
        remedies=("give that program a processor, and look at what it does between receiving and replying",),
        figures={"mean_ms": round(result.total.mean_ms, 3), "thought_ms": round(result.thought.mean_ms, 3)},
    )


def _slow_network(measured: Measured, results: dict[Case, CaseResult]) -> Finding | None:
    result = results.get(ONE_NO_DELAY)
    if result is None or result.network.mean_ms <= ALLOWED_MEAN_MS:
        return None
    whose = "the network or the other side's program" if measured.echo else "the network"
    return Finding(
        kind="slow-network",
        severity=Severity.WARNING,
        whose=Whose.PEER_OR_WIRE if measured.echo else Whose.WIRE,
        sentence=(
            f"a round trip to {measured.peer} takes {_mean(result)} on average even in one write with TCP_NODELAY, "
            f"where {_allowed()}: {whose} takes {result.network.mean_ms:.1f} ms of it, neither side's Nagle does"
        ),
        evidence=(
            _line(result),
            f"{_connected(measured)}; segments sent again: {result.retransmissions}",
        ),
        remedies=("measure the way itself with ping; a wire instead of wireless, fewer hops, no VPN",),
        figures={"mean_ms": round(result.total.mean_ms, 3), "network_ms": round(result.network.mean_ms, 3)},
    )


def _slow_altogether(measured: Measured, as_is: list[CaseResult]) -> Finding | None:
    slow = [result for result in as_is if result.total.mean_ms > ALLOWED_MEAN_MS]
    if not slow:
        return None
    result = max(slow, key=lambda one: one.total.mean_ms)
    return Finding(
        kind="slow",
        severity=Severity.WARNING,
        whose=Whose.PEER_OR_WIRE,
        sentence=(
            f"a round trip to {measured.peer} takes {_mean(result)} on average, where {_allowed()}: network "
            f"{result.network.mean_ms:.1f} ms, its program {result.thought.mean_ms:.1f} ms, held here "
            f"{result.held_here.all.mean_ms:.1f} ms, held there {result.held_there.all.mean_ms:.1f} ms; none alone"
        ),
        evidence=(_line(result),),
        figures={"mean_ms": round(result.total.mean_ms, 3)},
    )


def _healthy(measured: Measured, as_is: list[CaseResult]) -> Finding:
    worst = max(as_is, key=lambda one: one.total.mean_ms)
    seen = (
        "an echo server shows its own Nagle only, not this side's"
        if measured.echo
        else "nothing is held, in one write or in two, with TCP_NODELAY here or without"
    )
    return Finding(
        kind="tcp-healthy",
        severity=Severity.GOOD,
        whose=Whose.NOBODY,
        sentence=(
            f"TCP to {measured.peer} is quick enough: a round trip takes {_mean(worst)} on average at most, where "
            f"{_allowed()}; {seen}"
        ),
        evidence=(_line(worst), _connected(measured)),
        figures={"mean_ms": round(worst.total.mean_ms, 3), "connect_ms": round(measured.connect_ms, 3)},
    )


def _late_here(measured: Measured, results: dict[Case, CaseResult]) -> Finding | None:
    result = results.get(REPLY_NAGLE)
    if result is None or not result.held_there.stalled:
        return None
    return Finding(
        kind="late-acknowledgement-here",
        severity=Severity.NOTE,
        whose=Whose.NOBODY,
        sentence=(
            f"asked to reply in two parts with Nagle on, {measured.peer} took {_mean(result)}: this side acknowledges "
            f"{delay_words(result.held_there.stalls.mean_ms)}, so a peer that is written like that would stall"
        ),
        evidence=(_line(result),),
        remedies=acknowledger_remedies(HERE, System.named(measured.here)),
        figures=_figures(result, result.held_there),
    )


def _late_there(measured: Measured, results: dict[Case, CaseResult]) -> Finding | None:
    result = results.get(TWO_NAGLE_LATE)
    if result is None or not result.held_here.stalled:
        return None
    return Finding(
        kind="late-acknowledgement-there",
        severity=Severity.NOTE,
        whose=Whose.NOBODY,
        sentence=(
            f"the responder acknowledges at once because it asks its kernel to; left to itself, {measured.peer} "
            f"acknowledges {delay_words(result.held_here.stalls.mean_ms)}, and a message in two writes from here takes "
            f"{_mean(result)} without TCP_NODELAY"
        ),
        evidence=(_line(result),),
        remedies=sender_remedies(HERE, System.named(measured.here)),
        figures=_figures(result, result.held_here),
    )


def _left_out(measured: Measured) -> Finding:
    return Finding(
        kind="not-measured",
        severity=Severity.NOTE,
        whose=Whose.NOBODY,
        sentence="the time did not suffice for: " + "; ".join(case.name for case in measured.left_out),
    )


def _tables(measured: Measured) -> tuple[EvidenceTable, ...]:
    """Return the figures in the manual's format, and where the time went."""
    there = measured.there or "an echo server"
    times = EvidenceTable(
        f"round trips, {measured.here} here, {there} there",
        ("message", "round trip", "5 ms"),
        tuple(
            (result.case.name, result.not_done or str(result.total), "-" if result.not_done else _words(result))
            for result in measured.results
        ),
    )
    where = EvidenceTable(
        "where the time went, means in ms",
        ("message", "held here", "held there", "program", "network", "sent again"),
        tuple(
            (
                result.case.name,
                f"{result.held_here.all.mean_ms:.2f}",
                f"{result.held_there.all.mean_ms:.2f}",
                "-" if measured.echo else f"{result.thought.mean_ms:.2f}",
                f"{result.network.mean_ms:.2f}",
                str(result.retransmissions),
            )
            for result in measured.results
            if not result.not_done
        ),
    )
    return times, where


def _words(result: CaseResult) -> str:
    if result.held_here.stalled or result.held_there.stalled:
        return "stalls"
    return "kept" if result.total.mean_ms <= ALLOWED_MEAN_MS else "missed"


def _acknowledger(told: str, held: Held) -> System:
    """Return the system to give remedies for; all of them where the delay is not that of the system it says it is."""
    system = System.named(told)
    late_as_windows = held.stalls.mean_ms >= 100.0
    return System.OTHER if late_as_windows and system is System.LINUX else system


def _line(result: CaseResult) -> str:
    return f"{result.case.name}: {result.total}"


def _mean(result: CaseResult) -> str:
    mean_ms = result.total.mean_ms
    return f"{mean_ms:.1f} ms" if mean_ms >= 1.0 else f"{mean_ms:.2f} ms"


def _allowed() -> str:
    return f"{ALLOWED_MEAN_MS:g} ms are allowed (manual 11.1)"


def _connected(measured: Measured) -> str:
    kernel = measured.kernel_round_trip_ms
    known = "" if kernel is None else f"; the kernel here measured a round trip of {kernel:.2f} ms then (TCP_INFO)"
    return f"connecting took {measured.connect_ms:.2f} ms{known}"


def _severity(result: CaseResult) -> Severity:
    return Severity.WARNING if result.total.mean_ms > ALLOWED_MEAN_MS else Severity.NOTE


def _share(held: Held) -> str:
    return f"{held.stalls.count} of {held.all.count} messages"


def _figures(result: CaseResult, held: Held) -> dict[str, Figure]:
    return {
        "mean_ms": round(result.total.mean_ms, 3),
        "max_ms": round(result.total.max_ms, 3),
        "held_ms": round(held.stalls.mean_ms, 3),
        "stalled": held.stalls.count,
        "count": held.all.count,
    }


def _figure(finding: Finding, name: str) -> float:
    value = finding.figures.get(name)
    return float(value) if isinstance(value, int | float) else 0.0
