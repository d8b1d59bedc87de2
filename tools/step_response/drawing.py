"""The pictures: one of all axes, and two for each axis. The colours are the manual's (7.12.1)."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tools.bench import reaction
from tools.step_response.figures_of_merit import SEEN_FROM, peak
from tools.step_response.measuring import CASES, DIRECT, FAST, SMART, Course, Step
from tools.step_response.report import StepResponseReport

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STEP_COLOUR: Final = "#1f3fbf"
COLOURS: Final = {SMART.name: "#2e9e4f", FAST.name: "#59b4e8", DIRECT.name: "#d0312d"}
LABELS: Final = {case.name: label for case, (label, *_) in zip(CASES, reaction.CASES, strict=True)}
_BEFORE_MS: Final = -20.0
_FIRST_MS: Final = 60.0
_DPI: Final = 100

Lines = tuple[tuple[str, Callable[[Course], Sequence[float]], Callable[[Course], Sequence[float]] | None], ...]
_DERIVATIVES: Final[Lines] = (
    ("velocity, deg/s", lambda course: course.velocity_deg_s, lambda course: course.measured_velocity_deg_s),
    (
        "acceleration, deg/s²",
        lambda course: course.acceleration_deg_s2,
        lambda course: course.measured_acceleration_deg_s2,
    ),
    ("jerk, 1000 deg/s³", lambda course: [1e-3 * jerk for jerk in course.jerk_deg_s3], None),
)
"""What stands at the panel, what was commanded, what was measured."""


def picture_count(report: StepResponseReport) -> int:
    """Return how many pictures :func:`draw` makes."""
    return 1 + 2 * len(report.axes)


def draw(report: StepResponseReport, folder: Path, *, progress: Callable[[int], None]) -> list[Path]:
    """Draw all pictures into ``folder``; ``progress`` is told how many are done."""
    import matplotlib as mpl

    mpl.use("Agg")
    drawn: list[Path] = []

    def finished(picture: Path) -> None:
        drawn.append(picture)
        progress(len(drawn))

    finished(draw_overview(report, folder / "step-response.png"))
    for axis in report.axes:
        steps = report.of_axis(axis)
        name = f"step-response-{steps[0].joint}"
        finished(draw_position(report, steps, folder / f"{name}.png"))
        finished(draw_derivatives(report, steps, folder / f"{name}-advanced.png"))
    return drawn


def draw_overview(report: StepResponseReport, picture: Path) -> Path:
    """Draw the measured position of every axis."""
    columns = min(4, len(report.axes) + 1)
    rows = math.ceil((len(report.axes) + 1) / columns)
    figure, panels = _panels(rows, columns, figsize=(3.2 * columns, 2.7 * rows), sharex=True, sharey=True)
    flat = panels.flat
    for axis, panel in zip(report.axes, flat, strict=False):
        steps = report.of_axis(axis)
        _position(panel, steps)
        panel.set_title(steps[0].joint)
        panel.tick_params(labelbottom=True)
    for panel in panels[:, 0]:
        panel.set_ylabel("from the start, deg")
    for panel in list(flat):
        panel.set_axis_off()
    panels.flat[0].set_xlim(_BEFORE_MS, _end_ms(report.steps))
    for place, panel in enumerate(panels.flat):
        if len(report.axes) - columns <= place < len(report.axes):
            panel.set_xlabel("after the step, ms")
        if place == len(report.axes):
            panel.legend(*panels.flat[0].get_legend_handles_labels(), loc="center", frameon=False)
    figure.suptitle(f"measured position, {report.title}")
    return _finish(figure, picture)


def draw_position(report: StepResponseReport, steps: Sequence[Step], picture: Path) -> Path:
    """Draw the measured position of one axis, and its first 60 ms larger."""
    figure, panels = _panels(1, 1, figsize=(8.5, 4.6))
    panel = panels[0, 0]
    _position(panel, steps)
    panel.set(
        title=f"{steps[0].joint}, {report.title}", xlabel="after the step, ms", ylabel="measured, deg from the start"
    )
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize="small")
    begin = panel.inset_axes((0.6, 0.14, 0.37, 0.36))
    _position(begin, steps)
    seen = SEEN_FROM * steps[0].step_deg
    begin.set(xlim=(-5.0, _FIRST_MS), ylim=sorted((-0.1 * seen, 1.5 * seen)))
    told = report.reaction
    begin.set_title(
        f"its first {_FIRST_MS:g} ms; dotted: {told.direct_servo_ms:g} and {told.smart_servo_ms:g} ms", fontsize="small"
    )
    begin.tick_params(labelsize="small")
    for told_ms in (told.direct_servo_ms, told.smart_servo_ms):
        begin.axvline(told_ms, color="#808080", linewidth=0.8, linestyle=":")
    _tidy(begin)
    return _finish(figure, picture)


def draw_derivatives(report: StepResponseReport, steps: Sequence[Step], picture: Path) -> Path:
    """Draw position, velocity, acceleration and jerk of one axis."""
    figure, panels = _panels(4, 1, figsize=(8.5, 9.5), sharex=True)
    position, *others = panels[:, 0]
    _position(position, steps)
    position.set(title=f"{steps[0].joint}, {report.title}", ylabel="measured position,\ndeg from the start")
    position.legend(loc="lower right", frameon=False, fontsize="small")
    for panel, (label, commanded, measured) in zip(others, _DERIVATIVES, strict=True):
        for step in steps:
            at_ms, colour = step.course.at_ms, COLOURS[step.case.name]
            panel.step(at_ms, commanded(step.course), where="post", color=colour, linewidth=1.4)
            if measured is not None:
                panel.plot(at_ms, measured(step.course), color="#303030", linewidth=0.7, linestyle=(0, (4, 2)))
        panel.set_ylabel(label)
    others[0].plot([], [], color="#303030", linewidth=0.7, linestyle=(0, (4, 2)), label="measured by the arm")
    others[0].plot([], [], color="#808080", linewidth=1.4, label="commanded by the interpolator (colours as above)")
    others[0].legend(loc="upper right", frameon=False, fontsize="small")
    _cut_jerk(others[-1], steps)
    others[-1].set_xlabel("after the step, ms")
    return _finish(figure, picture)


def _position(panel: "Axes", steps: Sequence[Step]) -> None:
    end_ms = _end_ms(steps)
    panel.step(
        [_BEFORE_MS, 0.0, end_ms],
        [0.0, steps[0].step_deg, steps[0].step_deg],
        where="post",
        color=STEP_COLOUR,
        linewidth=1.4,
        label="tgt",
    )
    for step in steps:
        tripped = ", TRIPPED" if step.tripped else ""
        label = f"{LABELS[step.case.name]}{tripped}"
        panel.plot(
            step.course.at_ms, step.course.measured_deg, color=COLOURS[step.case.name], linewidth=1.6, label=label
        )
    panel.set_xlim(_BEFORE_MS, end_ms)


def _end_ms(steps: Sequence[Step]) -> float:
    """A little after the last of them has settled; everything where one has not."""
    settled = [None if step.tripped else step.figures().settling for step in steps]
    longest = max((step.course.at_ms[-1] for step in steps), default=0.0)
    known = [time for time in settled if time is not None]
    return min(longest, 1.2 * max(known)) if len(known) == len(steps) else longest


def _cut_jerk(panel: "Axes", steps: Sequence[Step]) -> None:
    """Show the limited jerks; one that is not limited is so much larger that nothing else could be seen beside it."""
    limited = max((step.jerk_limit_deg_s3 or 0.0 for step in steps), default=0.0) * 1e-3
    beyond = [
        f"{LABELS[step.case.name]} goes to {peak(step.course.jerk_deg_s3) * 1e-3:,.0f}"
        for step in steps
        if peak(step.course.jerk_deg_s3) * 1e-3 > 2.0 * limited
    ]
    if limited and beyond:
        panel.set_ylim(-1.6 * limited, 1.6 * limited)
        panel.text(0.99, 0.94, f"cut off: {'; '.join(beyond)}", ha="right", va="top", transform=panel.transAxes)


def _panels(rows: int, columns: int, **arguments: Any) -> tuple[Any, Any]:
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(rows, columns, layout="constrained", squeeze=False, **arguments)
    return figure, panels


def _tidy(panel: "Axes") -> None:
    panel.grid(color="#e6eaef", linewidth=0.8)
    panel.spines[["top", "right"]].set_visible(False)


def _finish(figure: Any, picture: Path) -> Path:
    from matplotlib import pyplot as plt

    for panel in figure.axes:
        _tidy(panel)
    figure.savefig(picture, dpi=_DPI)
    plt.close(figure)
    return picture
