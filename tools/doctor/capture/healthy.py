"""The sentence for a connection that nothing is wrong with."""

from collections.abc import Mapping
from typing import Any

from hil.core.statistics import Histogram
from hil.values.finding import Finding, Severity, Whose


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
