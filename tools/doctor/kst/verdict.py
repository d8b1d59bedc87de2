"""From what a controller says of its KST links to findings and tables: a function of that alone."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

from hil.values.finding import Diagnosis, EvidenceTable, Figure, Finding, Severity, Whose, worst_first
from tools.doctor.kst.told import Link

_AFTER_FAILURE: Final = "set_points_after_a_failed_mode"
_UNKNOWN: Final = "-"


def diagnose(links: Sequence[Link]) -> Diagnosis:
    """Return the verdict on all links, the worst first, and the tables of each."""
    several = len(links) > 1
    found = []
    for link in links:
        of_link = worst_first(_findings(link))
        if not any(finding.is_wrong for finding in of_link):
            of_link.insert(0, _good(link))
        if several:
            of_link = [replace(one, sentence=f"{link.robot}: {one.sentence}") for one in of_link]
        found.extend(of_link)
    # What is in order is a verdict only where everything is.
    found.sort(key=lambda finding: (-max(finding.severity.value, Severity.NOTE.value), finding.severity.value))
    return Diagnosis(tuple(found), tuple(table for link in links for table in _tables(link)))


def _findings(link: Link) -> Iterator[Finding]:
    if fault := link.text("fault"):
        yield Finding(
            kind="kst-server-ended",
            severity=Severity.FAULT,
            whose=Whose.CONTROLLER,
            sentence=f"nobody serves KST programs at {link.address} any more: {fault}",
            remedies=("start the controller again, and report what its log says",),
        )
    yield from link.findings()
    yield from _refused(link)
    unheard = link.count("counters", _AFTER_FAILURE)
    if unheard:
        yield Finding(
            kind="kst-set-points-unheard",
            severity=Severity.WARNING,
            whose=Whose.APPLICATION,
            sentence=(
                f"{unheard} set-points moved nothing: the real-time mode had ended by itself before, which no KST "
                f"server tells its client; the log of hil run says why"
            ),
            figures={"count": unheard},
        )
    strangers = link.count("second_clients")
    if strangers:
        yield Finding(
            kind="kst-second-client",
            severity=Severity.NOTE,
            whose=Whose.APPLICATION,
            sentence=f"{strangers} more connections were turned away: KST serves one client at a time",
            figures={"count": strangers},
        )
    if link.count("tcp", "reads") and link.table("tcp").get("kernel_tells") is False:
        yield Finding(
            kind="kst-kernel-silent",
            severity=Severity.NOTE,
            whose=Whose.NOBODY,
            sentence="this system does not tell what TCP does (Linux does, from 4.6 on): no stall can be named",
        )


def _refused(link: Link) -> Iterator[Finding]:
    reasons = _reasons(link)
    refused = sum(reasons.values())
    if not refused:
        return
    listed = ", ".join(f"{reason} {count}" for reason, count in reasons.items())
    yield Finding(
        kind="kst-refused",
        severity=Severity.WARNING,
        whose=Whose.APPLICATION,
        sentence=(
            f"{refused} of {link.count('counters', 'lines')} lines were refused: {listed}; a Cabinet's server is "
            f"silent or does worse then, and its client waits for ever"
        ),
        remedies=("the log of hil run has the first of each kind in words: correct the program",),
        figures={"count": refused, **reasons},
    )


def _reasons(link: Link) -> dict[str, int]:
    reasons = {reason: link.count("refused", reason) for reason in link.table("refused")}
    return dict(sorted(reasons.items(), key=lambda item: -item[1]))


def _good(link: Link) -> Finding:
    if not link.count("tcp", "requests") and not link.count("counters", "lines"):
        came = link.count("sessions")
        client = link.text("client")
        who = f"{client} is connected and has asked nothing" if client else f"{came or 'no'} clients came"
        return Finding(
            kind="kst-no-client",
            severity=Severity.GOOD,
            whose=Whose.NOBODY,
            sentence=f"KST programs are served at {link.address}, and there is nothing to judge yet: {who}",
        )
    rate = link.set_points_per_s
    client = link.text("client")
    told = f"its client {client}" if client else "no client now; the last one"
    return Finding(
        kind="kst-healthy",
        severity=Severity.GOOD,
        whose=Whose.NOBODY,
        sentence=(
            f"the KST link at {link.address} is in order ({told}): {link.count('tcp', 'requests')} requests, "
            f"{link.count('counters', 'set_points')} set-points"
            f"{'' if rate is None else f', {rate:.0f} a second now'}, and nothing was held back, lost or refused"
        ),
        figures=_rates(link),
    )


def _rates(link: Link) -> dict[str, Figure]:
    rate = link.set_points_per_s
    return {
        "set_points_per_s": None if rate is None else round(rate, 1),
        "requests_per_s": link.number("tcp", "requests_per_s"),
        "gap_p50_ms": link.number("tcp", "request_gap_ms", "p50"),
        "gap_p99_ms": link.number("tcp", "request_gap_ms", "p99"),
    }


def _tables(link: Link) -> Iterator[EvidenceTable]:
    flags = [word for word in ("strict", "nagle") if link.now.get(word) is True]
    title = f"KST link of {link.robot}, TCP {link.address}{', ' + ', '.join(flags) if flags else ''}"
    rate = link.set_points_per_s
    rows = (
        ("client", link.text("client") or "none"),
        ("sessions", _whole(link, "sessions")),
        ("set-points", _whole(link, "counters", "set_points")),
        ("set-points a second, now", _UNKNOWN if rate is None else f"{rate:.1f}"),
        ("requests of the last client", _whole(link, "tcp", "requests")),
        ("of them without a reply", _whole(link, "tcp", "requests_without_reply")),
        ("replies", _whole(link, "counters", "replies")),
        ("requests a second: last, most", _two(link, ("tcp", "requests_per_s"), ("tcp", "requests_per_s_most"))),
        ("between requests, ms: median, p99", _two(link, ("tcp", "request_gap_ms", "p50"), _P99)),
        ("longest, ms", _ms(link, "tcp", "request_gap_ms", "max")),
        ("client, reply to next request, ms: median", _ms(link, "tcp", "client_pace_ms", "p50")),
        ("round trip, ms: least, smoothed", _two(link, ("tcp", "least_round_trip_ms"), ("tcp", "round_trip_ms"))),
        ("sent again", _whole(link, "tcp", "retransmissions")),
    )
    yield EvidenceTable(title, ("what", "figure"), rows)
    stalls = [
        (
            kind,
            _whole(link, "tcp", "stalls", kind, "count"),
            *(
                _ms(link, "tcp", "stalls", kind, figure) if link.count("tcp", "stalls", kind, "count") else _UNKNOWN
                for figure in ("median_ms", "max_ms")
            ),
            ", ".join(f"{why} {count}" for why, count in link.table("tcp", "stalls", kind, "not_stalls").items())
            or _UNKNOWN,
        )
        for kind in link.table("tcp", "stalls")
    ]
    if stalls:
        columns = "stalls", "count", "median, ms", "longest, ms", "looked like it and were none"
        yield EvidenceTable(f"what waited, {link.robot}", columns, tuple(stalls))
    reasons = _reasons(link)
    if reasons:
        counted = tuple((reason, str(count)) for reason, count in reasons.items())
        yield EvidenceTable(f"refused, {link.robot}", ("reason", "lines"), counted)


_P99: Final = ("tcp", "request_gap_ms", "p99")


def _whole(link: Link, *keys: str) -> str:
    value = link.number(*keys)
    return _UNKNOWN if value is None else f"{value:.0f}"


def _ms(link: Link, *keys: str) -> str:
    value = link.number(*keys)
    return _UNKNOWN if value is None else f"{value:.2f}"


def _two(link: Link, first: tuple[str, ...], second: tuple[str, ...]) -> str:
    return f"{_ms(link, *first)}, {_ms(link, *second)}"
