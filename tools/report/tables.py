"""The parts of the page that are words and figures."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final
from xml.etree.ElementTree import Element

from hil.values.finding import Severity
from tools.report.markup import node, table
from tools.report.record import RobotRecord
from tools.report.verdict import findings_of, severity_of

_SHOWN_ELSEWHERE: Final = frozenset(
    {
        *("findings", "stops", "margins", "slowest_answers", "session.history", "session.refused"),
        *("initial_position", "measured_position", "commanded_position"),
    }
)
_TITLES: Final = {"servo.motions": "Set points, motion by motion"}
_MOST_ROWS: Final = 400
_MOST_COLUMNS: Final = 9
_SIDE_BY_SIDE: Final = 5
_MOST_DEPTH: Final = 8
_NEAR: Final = 0.9
_NOTHING: Final = "Nothing was diagnosed."


def findings(robot: RobotRecord) -> Element:
    """What was diagnosed: sentence, evidence and what helps."""
    found = findings_of(robot)
    if not found:
        return node("p", _NOTHING, class_="quiet")
    first, *others = map(_finding, found)
    count = f"{len(others)} more finding{'s' if len(others) > 1 else ''}"
    more = node("details", node("summary", count), *others, class_="more") if others else None
    return node("div", first, more)


def margins(robot: RobotRecord) -> Element:
    """How much of each limit was used, the closest first."""
    told = robot.report.get("margins")
    if not isinstance(told, Mapping) or not told:
        return node("p", "Margins are inside the controller: packets do not show them.", class_="quiet")
    limits = sorted(told.items(), key=lambda one: -_number(one[1], "used"))
    bars = (_margin(str(name), margin) for name, margin in limits)
    return node("div", node("p", "How much of each limit was used, the closest first", class_="quiet"), *bars)


def dropped(robot: RobotRecord) -> Element:
    """Packets that were not taken, by reason."""
    rows: dict[str, int] = {}
    for link in ("packets", "servo.packets"):
        for reason, count in mapping(_at(robot.report, f"{link}.dropped")).items():
            if isinstance(count, int) and count:
                rows[reason] = rows.get(reason, 0) + count
    for reason, (count, _, _) in robot.drops.items():
        rows.setdefault(reason, count)
    if not rows:
        return node("p", "None.", class_="quiet")
    cells = []
    for reason, count in sorted(rows.items(), key=lambda one: -one[1]):
        _, at_s, detail = robot.drops.get(reason, (0, 0.0, ""))
        cells.append((reason.replace("_", " "), f"{count}", f"{at_s:.3f} s: {detail}" if detail else ""))
    return table(("reason", "packets", "the last that was told"), cells, numbers=(1,))


def accounting(robot: RobotRecord) -> Iterator[Element]:
    """Every list of records that the controller's report holds, as a table of its own."""
    for path, records in _lists(robot.report, ""):
        yield node("h4", _TITLES.get(path, _words(path)))
        shown = [dict(_leaves(record, "")) for record in records[:_MOST_ROWS]]
        columns = list(dict.fromkeys(key for record in shown for key in record))
        if len(columns) <= _MOST_COLUMNS:
            yield _records(columns, shown)
        else:
            for begin in range(0, len(shown), _SIDE_BY_SIDE):
                yield _records_upright(columns, shown[begin : begin + _SIDE_BY_SIDE])
        if len(records) > _MOST_ROWS:
            yield node("p", f"{len(records) - _MOST_ROWS} more are not shown.", class_="quiet")


def evidence(robot: RobotRecord) -> Iterator[Element]:
    """Tables of a diagnosis; those without rows are left out."""
    for one in robot.evidence:
        if one.rows:
            yield node("h4", one.title)
            yield table(one.columns, one.rows, numbers=range(1, len(one.columns)))


def happened(robot: RobotRecord) -> Element:
    """What happened, in order."""
    rows = [(f"{at_s:.3f}", text) for at_s, text in robot.first_events]
    missing = robot.events - len(robot.first_events) - len(robot.last_events)
    if missing:
        rows.append(("", f"... {missing} more ..."))
    rows += [(f"{at_s:.3f}", text) for at_s, text in robot.last_events]
    return table(("time [s]", "what"), rows, numbers=(0,))


def settings(value: Mapping[str, object]) -> Element:
    """A configuration or a report: names and values."""
    rows = [(name, _cell(one)) for name, one in _leaves(value, "")]
    return table(("", "value"), rows)


def pairs(figures: Sequence[tuple[str, str]]) -> Element:
    """Key figures."""
    cells = [node("div", node("dt", name), node("dd", value)) for name, value in figures]
    return node("dl", *cells, class_="figures")


def _finding(finding: dict[str, object]) -> Element:
    severity = severity_of(finding)
    count, first_s, last_s = (finding.get(name) for name in ("count", "first_s", "last_s"))
    when = f"{first_s} s" if count == 1 else f"{count} times, {first_s} to {last_s} s"
    told = f"{finding.get('kind')} · {finding.get('whose')} · {when}"
    evidence = [node("li", str(line)) for line in _list(finding.get("evidence"))]
    remedies = [node("li", str(line)) for line in _list(finding.get("remedies"))]
    return node(
        "article",
        node("p", str(finding.get("sentence")), class_="sentence"),
        node("p", told, class_="quiet"),
        node("ul", *evidence) if evidence else None,
        node("p", "What helps, the most effective first:") if remedies else None,
        node("ol", *remedies) if remedies else None,
        class_=f"finding {'bad' if severity is Severity.FAULT else severity.name.lower()}",
    )


def _margin(name: str, margin: object) -> Element:
    used, at_s = _number(margin, "used"), _number(margin, "at_s")
    axis = mapping(margin).get("axis")
    level = "bad" if used > 1.0 else "warning" if used >= _NEAR else "good"
    share = "< 0.1%" if 0.0 < used < 0.0005 else f"{used:.1%}"
    bar = node("div", node("div", class_=f"fill {level}", style=f"width:{min(used, 1.0):.2%}"), class_="bar")
    where = f"at {at_s:.3f} s" + ("" if axis is None else f", {axis}") if used else "not used"
    return node(
        "div", node("span", name, class_="name"), bar, node("span", share, class_="share"),
        node("span", where, class_="quiet"), class_="margin",
    )  # fmt: skip


def _records(columns: Sequence[str], records: Sequence[Mapping[str, object]]) -> Element:
    """A record is a row."""
    rows = [[_cell(record.get(column)) for column in columns] for record in records]
    numbers = [
        at
        for at, column in enumerate(columns)
        if all(isinstance(record.get(column), int | float | None) for record in records)
    ]
    return table([_words(column) for column in columns], rows, numbers=numbers)


def _records_upright(columns: Sequence[str], records: Sequence[Mapping[str, object]]) -> Element:
    """A record is a column: it has many things to say."""
    head, *rest = columns
    rows = [[_words(column), *(_cell(record.get(column)) for record in records)] for column in rest]
    return table([_words(head), *(_cell(record.get(head)) for record in records)], rows)


def _lists(value: object, path: str, depth: int = 0) -> Iterator[tuple[str, list[dict[str, object]]]]:
    if path in _SHOWN_ELSEWHERE or depth > _MOST_DEPTH:
        return
    if isinstance(value, Mapping):
        for name, one in value.items():
            yield from _lists(one, f"{path}.{name}" if path else str(name), depth + 1)
    elif isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
        yield path, value


def _leaves(value: object, path: str, depth: int = 0) -> Iterator[tuple[str, object]]:
    if path in _SHOWN_ELSEWHERE:
        return
    if isinstance(value, Mapping) and depth <= _MOST_DEPTH:
        for name, one in value.items():
            yield from _leaves(one, f"{path}.{name}" if path else str(name), depth + 1)
    elif not (isinstance(value, list) and value and all(isinstance(one, dict) for one in value)):
        yield path, value


def _cell(value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(map(_cell, value))
    if isinstance(value, Mapping):
        return ", ".join(f"{_words(str(name))} {_cell(one)}" for name, one in value.items())
    return str(value)


def _words(name: str) -> str:
    return name.replace("p99_9", "p99·9").replace("_", " ").replace(".", ": ").replace("·", ".")


def _at(value: object, path: str) -> object:
    for name in path.split("."):
        value = mapping(value).get(name)
    return value


def mapping(value: object) -> Mapping[str, object]:
    """Return a part of a report that should be a mapping; an empty one where it is none."""
    return value if isinstance(value, Mapping) else {}


def _list(value: object) -> list[object]:
    return value if isinstance(value, list) else []


def _number(value: object, name: str) -> float:
    found = mapping(value).get(name)
    return float(found) if isinstance(found, int | float) else 0.0
