"""What ``hil bench rate --view`` and ``hil bench view`` print."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from tools.bench.rate_view import RateViewReport
    from tools.bench.view import ViewReport

_KINDS: Final = {
    "without": "without the view",
    "view": "hil view, nobody looks",
    "view and browser, nothing drawn": "and a browser, nothing drawn",
    "view and browser": "and a browser",
}
_DIGITS: Final = {"us": 0, "%": 3, "Hz": 3}
_ROWS: Final[tuple[tuple[str, Callable[[dict[str, Any]], str]], ...]] = (
    ("pictures a second: median, slowest", lambda run: _both(run["pictures_per_s"])),
    ("those in which an arm moved", lambda run: _both(run["moved_per_s"])),
    ("the same where nothing is drawn", lambda run: _both(run["moved_per_s_nothing_drawn"])),
    ("longest time between two of them", lambda run: f"{run['longest_gap_ms']:.0f} ms"),
    ("drawn pixels to one of the window", lambda run: f"{run['pixel_ratio']:g}"),
    ("draw calls, triangles of a picture", lambda run: f"{run['draw_calls']:.0f}, {run['triangles']:.0f}"),
    ("view's process, of one core", lambda run: _percent(run["view_process_cores"])),
    ("browser: draws, of one core", lambda run: _percent(run["browser_cores"].get("gpu-process"))),
    ("browser: all of it", lambda run: _percent(run["browser_all_cores"])),
    ("to the browser", lambda run: f"{run['kilobytes_per_s']:.0f} kB/s"),
)


def print_rate_view(console: Console, report: "RateViewReport", *, title: str) -> None:
    """Print the figures side by side, median and spread of each kind of run, and what that says."""
    from tools.bench.rate_view import FIGURES, Watching
    from tools.view.chromium import NO_CHROMIUM

    kinds = list(report.runs)
    table = Table("median (smallest .. largest)", *(_KINDS[kind] for kind in kinds), title=title)
    for figure in FIGURES:
        cells = []
        for kind in kinds:
            low, middle, high = report.spread(figure, kind)
            digits = _DIGITS[figure.unit]
            cells.append(f"{middle:.{digits}f} ({low:.{digits}f} .. {high:.{digits}f})")
        table.add_row(f"{figure.name}, {figure.unit}", *cells)
    console.print(table)
    for sentence in report.sentences():
        console.print(sentence, highlight=False)
    if Watching.BROWSER in report.runs:
        console.print(
            "The browser ran on this machine, and drew with the processor: it takes what it gets of every core. "
            "Without that drawing it is nearer to a browser with a GPU.",
            highlight=False,
        )
    else:
        console.print(f"No page was open: {NO_CHROMIUM}.", highlight=False)


def print_view(console: Console, report: "ViewReport", *, robot: str) -> None:
    """Print what the page reached with each number of arms."""
    console.print(
        f"{report.browser}, {'software' if report.software else 'GPU'}: {report.renderer}", style="dim", highlight=False
    )
    runs = report.as_dict()["runs"]
    table = Table("", *(_arms(run["arms"]) for run in runs), title=f"the page of hil view: {robot}")
    for label, text in _ROWS:
        table.add_row(label, *(text(run) for run in runs))
    console.print(table)


def _arms(number: int) -> str:
    return f"{number} arm{'s' if number > 1 else ''}"


def _both(counted: dict[str, float]) -> str:
    return f"{counted['median']:g}, {counted['slowest']:g}"


def _percent(cores: float | None) -> str:
    return "-" if cores is None else f"{100.0 * cores:.0f} %"
