"""The sentences for a connection that nothing is wrong with, and for one that never was."""

from collections.abc import Mapping
from typing import Any

from hil.core.statistics import Histogram
from hil.values.finding import Finding, Severity, Whose
from hil.values.fri import TRAITS, Release


def healthy(
    title: str, *, latency: Histogram, budget_ns: int, by_fault: Mapping[str, Any], quality: str, ended: str = ""
) -> Finding:
    """Return it; ``ended`` says what else ended the motion."""
    late, missing = (sum(by_fault.get(what, {}).values()) for what in ("late", "missing"))
    p50_ns, p99_ns = latency.quantile(0.5) or 0, latency.quantile(0.99) or 0
    if late or missing:
        what = f"{latency.count} answers, {late} late and {missing} missing, too few to lower the quality by a level"
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
