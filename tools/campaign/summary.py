"""What a campaign found, in groups: of each application and impairment, of each set of gains and load."""

from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

from tools.campaign.scenario import Row

Axis = Literal["application", "impairment", "gains", "load"]
NETWORKS: Final[tuple[Axis, Axis]] = ("application", "impairment")
ARMS: Final[tuple[Axis, Axis]] = ("gains", "load")


class Group(NamedTuple):
    """Scenarios with the same choices of two axes."""

    names: tuple[str, str]
    rows: tuple[Row, ...]

    @property
    def passed(self) -> int:
        """How many kept what is required."""
        return sum(row["outcome"] == "passed" for row in self.rows)

    @property
    def commanded_s(self) -> str:
        """For how long the arm was commanded: the shortest and the longest."""
        least, most = (f(row["commanded_s"] for row in self.rows) for f in (min, max))
        return f"{least:.1f}" if most - least < 0.1 else f"{least:.1f} .. {most:.1f}"

    @property
    def worst_margin(self) -> Row:
        """The one that came nearest to a limit."""
        return max(self.rows, key=lambda row: row["margin_used"])

    @property
    def worst_latency_us(self) -> float | None:
        """The largest 99 % of answer latency; None where nobody answered."""
        return max((us for row in self.rows if (us := row["answer_latency_p99_us"]) is not None), default=None)


def groups(rows: Sequence[Row], by: tuple[Axis, Axis] = NETWORKS) -> list[Group]:
    """Return the groups, in the order of the plan."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        found.setdefault((row[by[0]], row[by[1]]), []).append(row)
    return [Group(names, tuple(rows)) for names, rows in found.items()]


def worst_margins(rows: Sequence[Row], most: int = 5) -> list[Row]:
    """Return those that came nearest to a limit, the worst first."""
    return sorted((row for row in rows if row["margin_used"] > 0.0), key=lambda row: -row["margin_used"])[:most]


def worst_latencies(rows: Sequence[Row], most: int = 5) -> list[Row]:
    """Return those whose answers took longest, by the 99th percentile, the worst first."""
    answered = [row for row in rows if row["answer_latency_p99_us"] is not None]
    return sorted(answered, key=lambda row: -(row["answer_latency_p99_us"] or 0.0))[:most]


def first_failure(rows: Sequence[Row]) -> Row | None:
    """Return the first scenario of the plan that did not pass."""
    return next((row for row in rows if row["outcome"] != "passed"), None)
