"""The picture of a comparison: the axis that differs most, both courses, and what is between them."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.values.robot import JOINT_NAMES
from tools.conformance.compare import QUANTITIES, Comparison

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_A, _B, _BETWEEN = "#7aa6d1", "#12304f", "#8a3324"
_NAMED_S = 0.35
"""Parts that are shorter have no room for their name."""


def draw(comparison: Comparison, picture: Path) -> None:
    """Draw ``comparison`` into ``picture`` (PNG)."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    axis = JOINT_NAMES.index(comparison.worst_position.axis)
    cycle_s = comparison.cycle_ms * 1e-3
    at_s = (np.arange(len(comparison.parts)) + 1) * cycle_s
    shown = [quantity for quantity in QUANTITIES if any(one.quantity == quantity[0] for one in comparison.differences)]
    figure, panels = plt.subplots(
        len(shown) + 1, 1, figsize=(10, 2.1 * (len(shown) + 1)), sharex=True, layout="constrained"
    )
    figure.suptitle(
        f"{comparison.b.name} beside {comparison.a.name}, {comparison.robot}, {JOINT_NAMES[axis]}: "
        f"{round(comparison.latency_ms, 2) + 0.0:+.2f} ms"
    )
    for panel, (name, field, factor, unit) in zip(panels, shown, strict=False):
        for course, colour, width in ((comparison.a, _A, 2.4), (comparison.b, _B, 0.9)):
            panel.plot(at_s, factor * course.of(field)[:, axis], color=colour, linewidth=width, label=course.name)
        panel.set_ylabel(f"{name}, {unit}")
    panels[0].legend(loc="upper right", fontsize="small")
    off = 1e3 * (comparison.b.of("position_rad") - comparison.a.of("position_rad"))[:, axis]
    panels[-1].plot(at_s, off, color=_BETWEEN, linewidth=0.8)
    panels[-1].set_ylabel("B - A as it was,\nmrad")
    panels[-1].set_xlabel("time, s")
    for panel in panels:
        panel.grid(alpha=0.3)
        panel.margins(x=0.005)
    _name_parts(panels[0], comparison.parts, cycle_s)
    figure.savefig(picture, dpi=100)
    plt.close(figure)


def _name_parts(panel: "Axes", parts: tuple[str, ...], cycle_s: float) -> None:
    begin = 0
    for at in range(1, len(parts) + 1):
        if at == len(parts) or parts[at] != parts[begin]:
            if (at - begin) * cycle_s > _NAMED_S:
                middle = 0.5 * (begin + at) * cycle_s, 1.0
                where: dict[str, Any] = {
                    "xycoords": ("data", "axes fraction"),
                    "ha": "center",
                    "va": "bottom",
                    "fontsize": 7,
                }
                panel.annotate(parts[begin], middle, **where)
            begin = at
