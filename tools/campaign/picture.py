"""A campaign in one picture: worst margins, answer latencies, and what did not pass."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from tools.campaign.scenario import Row
from tools.campaign.summary import groups

_OUTCOMES: Final = {
    "passed": "#4c9f70", "failed": "#c8553d", "timeout": "#e0a030", "hung": "#8a5a9c", "worker-died": "#555555",
    "refused": "#9aa0a6",
}  # fmt: skip


def draw(rows: Sequence[Row], file: Path, *, title: str) -> None:
    """Draw ``rows`` to ``file``; raise OSError where it cannot be written."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    applications = list(dict.fromkeys(row["application"] for row in rows))
    impairments = list(dict.fromkeys(row["impairment"] for row in rows))
    height = 1.6 + 0.5 * max(len(applications), 2)
    figure, (left, middle, right) = plt.subplots(
        1, 3, figsize=(6.0 + 2.4 * max(2.0, 0.55 * len(impairments)) * 1.6, 1.4 + height), layout="constrained"
    )
    try:
        figure.suptitle(title)
        _margins(left, rows, applications, impairments)
        _latencies(middle, rows, impairments)
        _outcomes(right, rows, impairments)
        figure.savefig(file, dpi=110)
    finally:
        plt.close(figure)


def _margins(axis: Any, rows: Sequence[Row], applications: list[str], impairments: list[str]) -> None:
    # Where nothing moved there is nothing to be proud of: such a cell is grey.
    worst = {group.names: group.worst_margin["margin_used"] or float("nan") for group in groups(rows)}
    table = [[worst.get((name, impairment), float("nan")) for impairment in impairments] for name in applications]
    axis.set_facecolor("#dddddd")
    axis.imshow(table, cmap="YlOrRd", vmin=0.0, vmax=1.0, aspect="auto")
    for row, numbers in enumerate(table):
        for column, used in enumerate(numbers):
            color = "white" if used > 0.6 else "black"
            axis.text(column, row, "-" if math.isnan(used) else f"{used:.0%}", ha="center", va="center", color=color)
    axis.set_xticks(range(len(impairments)), impairments, rotation=30, ha="right")
    axis.set_yticks(range(len(applications)), applications)
    axis.set_title("largest use of a limit\n(100 %: a monitor tripped, or a command was refused)", fontsize="medium")


def _latencies(axis: Any, rows: Sequence[Row], impairments: list[str]) -> None:
    values = [
        [us * 1e-3 for row in rows if row["impairment"] == name and (us := row["answer_latency_p99_us"]) is not None]
        for name in impairments
    ]
    shown = [place for place, found in enumerate(values) if found]
    if shown:
        axis.boxplot([values[place] for place in shown], positions=shown, widths=0.5, showfliers=True, whis=(0, 100))
    else:
        axis.text(0.5, 0.5, "nobody answered over FRI", ha="center", va="center", transform=axis.transAxes)
    axis.set_xticks(range(len(impairments)), impairments, rotation=30, ha="right")
    axis.set_xlim(-0.6, len(impairments) - 0.4)
    axis.set_ylim(bottom=0.0)
    axis.set_ylabel("ms")
    axis.grid(axis="y", alpha=0.3)
    axis.set_title("answer latency, p99 of each scenario", fontsize="medium")


def _outcomes(axis: Any, rows: Sequence[Row], impairments: list[str]) -> None:
    below = [0] * len(impairments)
    for outcome, color in _OUTCOMES.items():
        counts = [sum(row["outcome"] == outcome and row["impairment"] == name for row in rows) for name in impairments]
        if any(counts):
            axis.bar(range(len(impairments)), counts, bottom=below, color=color, label=outcome, width=0.6)
            below = [before + count for before, count in zip(below, counts, strict=True)]
    axis.set_xticks(range(len(impairments)), impairments, rotation=30, ha="right")
    axis.set_ylabel("scenarios")
    axis.set_ylim(0, 1.2 * max(below))
    axis.legend(frameon=False, fontsize="small", ncols=3, loc="upper center")
    axis.set_title("what became of them", fontsize="medium")
