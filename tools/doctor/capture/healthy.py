"""The sentences for a connection that nothing is wrong with, and for one that never was."""

from collections.abc import Mapping
from typing import Any, Final

from hil.core.statistics import Histogram
from hil.values.finding import Finding, Severity, Whose
from hil.values.fri import TRAITS, Release

_NAMES: Final = {"controller": "by the controller", "peer_or_wire": "by peer or wire", "both": "by both"}


def healthy(
    title: str, *, latency: Histogram, budget_ns: int, by_fault: Mapping[str, Any], quality: str, ended: str = ""
) -> Finding:
    """Return it; ``ended`` says what else ended the motion."""
    late, missing = late_and_missing(by_fault)
    p50_ns, p99_ns = latency.quantile(0.5) or 0, latency.quantile(0.99) or 0
    if late or missing:
        shares = {whose: sum(by_fault[what][whose] for what in ("late", "missing")) for whose in by_fault["late"]}
        told = ", ".join(f"{count} {_NAMES[whose]}" for whose, count in shares.items() if count)
        what = f"{latency.count} answers, {late} late and {missing} missing ({told}), too few to lower the quality"
    else:
        what = f"all {latency.count} answers came in time"
    return Finding(
        "connection-healthy",
        Severity.GOOD,
        Whose.NOBODY,
        f"{title}the connection was healthy: {what}, half of them within {p50_ns / 1e6:.2g} ms, 99 % within "
        f"{p99_ns / 1e6:.2g} ms, the slowest after {latency.maximum / 1e6:.3g} ms of the {budget_ns / 1e6:g} ms "
        f"allowed; quality {quality} at the end{ended}",
        figures={
            "answers": latency.count,
            "late": late,
            "missing": missing,
            "p50_ms": p50_ns / 1e6,
            "p99_ms": p99_ns / 1e6,
            "max_ms": latency.maximum / 1e6,
            "budget_ms": budget_ns / 1e6,
        },
    )


def late_and_missing(by_fault: Mapping[str, Any]) -> tuple[int, int]:
    """Return how many answers were late, and how many never came."""
    late, missing = (sum(by_fault.get(what, {}).values()) for what in ("late", "missing"))
    return late, missing


def silent_client(title: str, *, client: str, release: Release, messages: int, seconds: float) -> Finding:
    """Return the finding for a client that never answered the ``messages`` of a controller of ``release``."""
    framed = TRAITS[release].framed
    speaks = f"{release}, with length and CRC around each message" if framed else f"{release}, without a frame"
    return Finding(
        "client-silent",
        Severity.FAULT,
        Whose.PEER_OR_WIRE,
        f"{title}the client at {client} never answered {messages} messages of {seconds:.1f} s: no client runs there, "
        f"they do not reach it, or it is of another release ({'1.x and 2.5' if framed else '2.7'} clients stay silent "
        f"here)",
        evidence=(f"the controller speaks {speaks}",),
        remedies=(
            "see that the client runs, and on which port it listens (30200 is the library's default)",
            f"see of which release the client's FRI library is: the controller speaks {release}",
            "see that no firewall drops UDP between the two",
        ),
        figures={"messages": messages, "answers": 0},
    )
