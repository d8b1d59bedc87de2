"""Words of the diagnosis of a connection: who the two sides are, amounts, and what helps."""

from typing import Final, NamedTuple

from hil.core.statistics import Histogram
from hil.values.finding import Whose

GONE_REMEDIES: Final = (
    "look at what the client's process did then: it ended, was stopped in a debugger, or waited for something",
    "look at the network between, if it is another machine",
)
WATCHDOG_REMEDY: Final = "a longer watchdog (watchdog_ms in the station file) only hides a pause of that length"


class Sides(NamedTuple):
    """Who the two are, in words."""

    controller: str = "this controller"
    other: str = "peer or wire"
    other_whose: Whose = Whose.PEER_OR_WIRE
    moment: str = "cycle"
    """What is counted where things happen."""
    controller_remedy: str = (
        "let this process have the machine: hil run --realtime, less load beside it, or a longer send period"
    )


def remedies(whose: Whose, sides: Sides, latency: Histogram, budget_ns: int) -> tuple[str, ...]:
    """Return what helps against late answers, by whose fault they are, the most effective first."""
    mine, yours = (
        sides.controller_remedy,
        "make the client's answer faster: nothing but the answer in its loop",
    )
    usual_ns = latency.quantile(0.999)
    needed_ms = 0 if usual_ns is None else -(-usual_ns // 1_000_000)
    longer = (
        f"send period x receive multiplier of {needed_ms} ms would have held 99.9 % of the answers"
        if budget_ns < needed_ms * 1_000_000 <= 100_000_000
        else "a longer send period or a larger receive multiplier allows it more time"
    )
    if whose is Whose.CONTROLLER:
        return (mine,)
    if whose is Whose.BOTH:
        return mine, yours, longer
    return yours, longer, "without a change of the client: look at its machine's load and at the network between"


def median(latency: Histogram, allowed: str = "") -> str:
    """Return the median of the answers, and what is allowed, in brackets."""
    median_ns = latency.quantile(0.5)
    words = [] if median_ns is None else [f"median {median_ns / 1e6:.2g} ms"]
    words += [f"{allowed} are allowed"] if allowed else []
    return f"({', '.join(words)})" if words else "(the first answer)"


def milliseconds(value_ns: float) -> str:
    """Return a time in milliseconds."""
    value_ms = value_ns / 1e6
    return f"{value_ms:.3g} ms" if abs(value_ms) < 100 else f"{value_ms:.0f} ms"


def amount(value_ns: float) -> str:
    """Return a time in the unit that fits."""
    return f"{value_ns / 1e3:.0f} us" if abs(value_ns) < 1_000_000 else milliseconds(value_ns)


def signed(value_ns: float) -> str:
    """Return a time with its sign."""
    return f"{'+' if value_ns >= 0 else '-'}{amount(abs(value_ns))}"
