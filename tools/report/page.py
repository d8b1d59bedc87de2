"""The page: one file that asks nobody for anything when it is opened.

Its policy forbids every connection, and every script but the two whose digests it names, so that not even a mistake of
ours would let a text of a recording run. The drawing library travels compressed: 2 MB instead of 4.8.
"""

import base64
import gzip
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element

from hil.values.robot import JOINT_NAMES
from tools.report import tables
from tools.report.markup import json_text, node, to_html
from tools.report.panels import drawn
from tools.report.record import RobotRecord
from tools.report.verdict import Verdict, findings_of

_LEVEL: Final = 6
_UNDRAWN: Final = "The plots could not be drawn: this browser is too old for them. All tables are there."
_ZOOM: Final = "Point at a bar for its reason; drag across any panel to zoom, double click to go back."


@dataclass(frozen=True, slots=True)
class PageText:
    """What stands above the robots."""

    title: str
    verdict: Verdict
    source: Sequence[str]
    """Where it comes from, a line each."""
    alarms: Sequence[str] = ()
    """What makes the page less than it should be: it is said first."""
    notes: Sequence[str] = ()
    run: dict[str, object] = field(default_factory=dict)
    """Software and machine of the recorder."""


def build_page(text: PageText, robots: Sequence[RobotRecord]) -> bytes:
    """Return the page as UTF-8."""
    library, script = _library(), _part("page.js")
    data = json_text({"robots": [drawn(robot) for robot in robots]})
    head = node(
        "head",
        node("meta", charset="utf-8"),
        node("meta", http_equiv="Content-Security-Policy", content=_policy(_digest(script), library.digest)),
        node("meta", name="viewport", content="width=device-width, initial-scale=1"),
        node("meta", name="referrer", content="no-referrer"),
        node("title", text.title),
        node("style", _part("page.css")),
    )
    body = node(
        "body",
        node("main", *_top(text), *map(_robot, robots), *_run(text), _foot()),
        node("script", data, id="data", type="application/json"),
        node("script", library.packed, id="library", type="application/octet-stream"),
        node("script", script),
    )
    page = "<!DOCTYPE html>\n" + to_html(node("html", head, body, lang="en")) + "\n"
    return page.encode("utf-8", "replace")


class _Library(NamedTuple):
    """The drawing library."""

    packed: str
    digest: str


@cache
def _library() -> _Library:
    from plotly.offline import get_plotlyjs

    text = get_plotlyjs()
    return _Library(base64.b64encode(gzip.compress(text.encode(), _LEVEL, mtime=0)).decode(), _digest(text))


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def _policy(*digests: str) -> str:
    allowed = " ".join(f"'sha256-{digest}'" for digest in digests)
    # Plotly makes its style sheet, and its pictures, in the page itself.
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; "
        f"form-action 'none'"
    )


def _part(name: str) -> str:
    return (resources.files("tools.report") / name).read_text(encoding="utf-8")


def _top(text: PageText) -> list[Element]:
    return [
        node("header", node("h1", text.title), *(node("p", line, class_="quiet") for line in text.source)),
        *(node("p", alarm, class_="alarm", role="alert") for alarm in text.alarms),
        node("p", text.verdict.sentence, class_=f"verdict {_level(text.verdict)}", id="verdict"),
        *(node("p", f"Note: {note}", class_="quiet") for note in text.notes),
        node("p", _UNDRAWN, class_="alarm", id="undrawn", hidden="hidden"),
        node("noscript", node("p", "The plots need JavaScript; all tables are there without it.", class_="alarm")),
    ]


def _level(verdict: Verdict) -> str:
    name = verdict.severity.name.lower()
    return "bad" if name == "fault" else name


def _robot(robot: RobotRecord) -> Element:
    heading = node("h2", robot.name, " ", node("small", robot.model))
    notes = [node("p", f"Note: {note}", class_="quiet") for note in robot.notes]
    findings = _card("Findings", tables.findings(robot))
    found = bool(findings_of(robot))
    told = "All the controller told of itself" if robot.inside_known else "Counts"
    return node(
        "section",
        heading,
        *notes,
        tables.pairs(robot.figures),
        findings if found else None,
        node("div", *_plots(robot), node("div", class_="cursor screen"), class_="plots"),
        _card("Margins", tables.margins(robot)),
        _card("Where the time of the answers went", *parts) if (parts := list(tables.evidence(robot))) else None,
        _accounting(robot),
        None if found else findings,
        _card("Dropped packets", tables.dropped(robot)),
        _details(f"What happened, in order ({robot.events})", tables.happened(robot)),
        _details("Configuration", tables.settings(robot.configuration)),
        _details(told, tables.settings(robot.report)),
        class_="robot",
    )


def _accounting(robot: RobotRecord) -> Element | None:
    parts = list(tables.accounting(robot))
    return _card("What the controller counted", *parts) if parts else None


def _plots(robot: RobotRecord) -> list[Element | None]:
    lost = sum(lane.not_kept for lane in robot.lanes.values()) + robot.marks_not_kept
    more = f" {lost} later changes are not drawn." if lost else ""
    names = (node("button", name, type="button", aria_pressed="false") for name in JOINT_NAMES)
    buttons = node("span", *names, class_="axes screen", role="group", aria_label="axis")
    thinned = robot.arm.thinned
    drawn_of = f" Of each {thinned} samples the smallest and the largest are drawn." if thinned > 1 else ""
    return [
        _card("Timeline", _caption(f"{_ZOOM}{more}"), _plot("timeline")),
        _answers(robot),
        node(
            "div",
            node("div", node("h3", "Commanded and measured positions"), buttons, class_="top"),
            _caption(f"commanded is {robot.commanded_is}.{drawn_of}"),
            _plot("positions"),
            _plot("difference"),
            class_="card",
        ),
        _card("Flange speed", _caption(f"{robot.speed_is}; the line is the limit of T1"), _plot("speed")),
    ]


def _answers(robot: RobotRecord) -> Element | None:
    times = robot.latencies
    if not times.count or not robot.budget_ms:
        return None
    return node(
        "div",
        _card("Answer latency", _caption("from the message's departure to the answer's arrival"), _plot("latency")),
        _card("How often", _caption(f"{times.count} answers; both scales are logarithmic"), _plot("histogram")),
        class_="beside",
    )


def _run(text: PageText) -> list[Element]:
    return [_details("Software and machine of the recording", tables.settings(text.run))] if text.run else []


def _foot() -> Element:
    return node("footer", "Made by hil report. The page holds all it shows and opens no connection.")


def _card(title: str, *parts: Element | None) -> Element:
    return node("div", node("h3", title), *parts, class_="card")


def _caption(text: str) -> Element:
    return node("p", text[:1].upper() + text[1:], class_="quiet")


def _plot(panel: str) -> Element:
    return node("div", class_="plot", data_panel=panel)


def _details(title: str, part: Element) -> Element:
    return node("details", node("summary", title), part)
