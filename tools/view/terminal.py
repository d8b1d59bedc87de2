"""What ``hil top`` shows: the figures of the page in a browser, for a terminal of any size.

Every part is made of whole lines that are cut where they are too long, so how high it is, is known before it is drawn:
what matters least gives way first. Texts of peers never reach the terminal as orders to it.
"""

import math
import textwrap
from collections.abc import Sequence
from functools import lru_cache
from itertools import zip_longest
from typing import Final, NamedTuple

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from backends.robots import load_description
from hil.client.pad import RobotState
from hil.core.settings import T1_SPEED_LIMIT_MM_S
from hil.values.operator import ProgramState
from hil.values.robot import JOINT_NAMES, JointLimits
from hil.values.servo import Snapshot
from tools.view.bars import gauge, mark, sparkline
from tools.view.drawing import ArmNow, DrawnRobot
from tools.view.watch import Latency, Message, Watch

NO_PAD: Final = "not known without the controller's pad"
_SIDE_BY_SIDE: Final = 66
"""Columns a robot needs beside another one."""
_FRAME_COLUMNS: Final = 4
_FRAME_LINES: Final = 2
_WIDE, _MIDDLING, _NARROW = 56, 37, 17
"""Columns inside the frame from which on an axis shows its limits, its torques, a bar."""
_MOST_MESSAGES: Final = 8
_MOST_TEXT_LINES: Final = 4
_MOST_SIGNAL_LINES: Final = 7
_NEAR_SHARE: Final = 0.8
_NEAR_END_DEG: Final = 10.0
_PROGRAMS: Final = {
    ProgramState.RUNNING: "bold green",
    ProgramState.PAUSED: "bold yellow",
    ProgramState.STOPPED: "bold red",
    ProgramState.EMERGENCY_STOP: "bold white on red",
}
_QUALITIES: Final = {"EXCELLENT": "green", "GOOD": "green", "FAIR": "yellow", "POOR": "red"}
Lines = list[Text]


class Figures(NamedTuple):
    """All that is shown of one robot."""

    drawn: DrawnRobot
    address: str
    now: ArmNow
    pad: RobotState | None
    messages: tuple[Message, ...]
    latencies: tuple[Latency, ...]


def figures_of(watch: Watch) -> list[Figures]:
    """Return the figures of all robots as they are now."""
    now, pad, messages = watch.now(), watch.pad(), watch.messages()
    return [
        Figures(
            robot,
            watch.source(robot.name).address,
            _readable(now[robot.name]),
            pad.get(robot.name),
            tuple(one for one in messages if one.robot in {robot.name, ""}),
            watch.latencies(robot.name),
        )
        for robot in watch.robots
    ]


def screen(robots: Sequence[Figures], *, width: int, height: int | None) -> RenderableType:
    """Return all robots on ``width`` columns, side by side where there is room; in ``height`` lines, None: any."""
    columns = max(1, min(len(robots), width // _SIDE_BY_SIDE))
    rows = math.ceil(len(robots) / columns)
    table = Table.grid(expand=True)
    for _ in range(columns):
        table.add_column(ratio=1)
    lines = None if height is None else max(height // max(rows, 1), _FRAME_LINES + 1)
    panels = [_panel(robot, width=width // columns, height=lines) for robot in robots]
    for row in range(rows):
        table.add_row(*panels[row * columns : (row + 1) * columns])
    return table


def one_line(robot: Figures) -> str:
    """Return a robot in one line, for what is no terminal."""
    name, snapshot = clean(robot.drawn.name), robot.now.snapshot
    if snapshot is None:
        return f"{name}: LOST: {clean(robot.now.lost)}"
    view, pose = snapshot.operator, snapshot.flange_in_base
    enabling = "enabled" if view.enabling else "not enabled"
    parts = [
        f"[{snapshot.now_ns / 1e9:9.3f} s] {name}: {view.mode.name} {view.program.name}",
        f"{enabling}, override {view.override_percent:g} %",
    ]
    if robot.now.lost:
        parts.append(f"LOST: {clean(robot.now.lost)}")
    if robot.pad is not None and (session := robot.pad["session"]) is not None:
        parts.append(f"FRI {session['state']} {session['quality']}")
    if snapshot.commander:
        parts.append(f"commanded by {clean(snapshot.commander)}")
    axes = " ".join(f"{math.degrees(angle):z.2f}" for angle in snapshot.measured_position)
    x, y, z = (1e3 * part for part in pose.position_m)
    parts.append(f"axes {axes} deg")
    parts.append(
        f"flange {x:z.1f} {y:z.1f} {z:z.1f} mm, {' '.join(f'{angle:z.2f}' for angle in pose.abc_deg())} deg, "
        f"{snapshot.flange_speed_mm_s:.0f} mm/s"
    )
    if view.reason:
        parts.append(clean(view.reason))
    return " | ".join(parts)


def clean(text: str) -> str:
    """Return what a peer says without anything that a terminal would obey."""
    return "".join(one if one.isprintable() else "\N{REPLACEMENT CHARACTER}" for one in text)


def _readable(now: ArmNow) -> ArmNow:
    """Return it without a state that is of no arm with seven axes, which the codec lets through."""
    snapshot = now.snapshot
    if snapshot is None:
        return now
    vectors = (snapshot.measured_position, snapshot.measured_torque, snapshot.external_torque)
    if all(len(vector) == len(JOINT_NAMES) for vector in vectors):
        return now
    return ArmNow(None, f"its states are not those of {len(JOINT_NAMES)} axes")


def _panel(robot: Figures, *, width: int, height: int | None) -> Panel:
    inner = max(width - _FRAME_COLUMNS, 1)
    parts: list[tuple[int, Lines]] = [(0, _status(robot, inner))]
    snapshot = robot.now.snapshot
    if snapshot is not None:
        limits = _limits(robot.drawn.model)
        parts += [
            (8, [_axes_head(inner)]),
            (2, [_axis(axis, snapshot, limits, inner) for axis in range(len(JOINT_NAMES))]),
            (3, _pose(snapshot)),
            (1, _speed(snapshot, robot.pad, inner)),
            (4, _contacts(snapshot)),
        ]
    parts += [
        (5, _latency(robot, inner)),
        (6, _signals(robot.pad, inner)),
        (7, _messages(robot.messages, inner)),
    ]
    lines = _fitting(parts, None if height is None else height - _FRAME_LINES)
    title = f"{clean(robot.drawn.name)} {clean(robot.drawn.model)} {clean(robot.address)}"
    style = "red" if robot.now.lost else "cyan"
    return Panel(
        Group(*lines),
        title=Text(title, style=f"bold {style}", no_wrap=True, overflow="ellipsis"),
        border_style=style,
        height=height,
        width=width,
    )


def _fitting(parts: Sequence[tuple[int, Lines]], room: int | None) -> Lines:
    """Return the lines of ``parts`` in their order; parts with small numbers get their room first."""
    if room is not None:
        left, kept = room, dict[int, Lines]()
        for number, lines in sorted(parts, key=lambda part: part[0]):
            kept[number] = lines[:left]
            left -= len(kept[number])
        parts = [(number, kept[number]) for number, _ in parts]
    return [line for _, lines in parts for line in lines]


def _status(robot: Figures, width: int) -> Lines:
    lost, snapshot, pad = robot.now.lost, robot.now.snapshot, robot.pad
    lines = _wrapped("LOST: ", lost, width, style="bold red") if lost else []
    if snapshot is None:
        return lines
    view = snapshot.operator
    lines.append(
        _line(
            (f" {view.mode.name} ", "bold white on blue"),
            (f" {view.program.name.replace('_', ' ')} ", _PROGRAMS[view.program]),
            (" enabled ", "green") if view.enabling else (" not enabled ", "dim"),
            (f" override {view.override_percent:g} % ", ""),
            (f" {snapshot.now_ns / 1e9:.2f} s", "dim"),
            *([(" PERMISSIVE: the monitors only report", "bold red")] if view.permissive else []),
        )
    )
    session = None if pad is None else pad["session"]
    if session is not None:
        quality = session["quality"]
        lines.append(
            _line(("FRI ", "dim"), (clean(session["state"]), ""), (f" {clean(quality)}", _QUALITIES.get(quality, "")))
        )
    elif pad is None and not lost:
        lines.append(_line(("FRI ", "dim"), (NO_PAD, "dim")))
    control = snapshot.control_mode.name.replace("_", " ").lower()
    drives = "" if pad is None else f", drives {clean(pad['drives'])}"
    lines.append(
        _line(("commander ", "dim"), (clean(snapshot.commander) or "-", ""), (f"  control {control}{drives}", "dim"))
    )
    if view.reason:
        lines += _wrapped("", view.reason, width, style="red")
    return lines


def _axes_head(width: int) -> Text:
    if width < _MIDDLING:
        return _line(("axes, deg", "dim"))
    return _line((f"{'axes':<{width - 25}}{'deg':>8} {'Nm':>7} {'ext. Nm':>8}", "dim"))


def _axis(axis: int, snapshot: Snapshot, limits: JointLimits, width: int) -> Text:
    low, high = math.degrees(limits.position_min_rad[axis]), math.degrees(limits.position_max_rad[axis])
    angle = math.degrees(snapshot.measured_position[axis])
    near = min(angle - low, high - angle)
    style = "bold red" if near < 0.0 else "yellow" if near < _NEAR_END_DEG else "cyan"
    share = (angle - low) / (high - low)
    name, position = f"{JOINT_NAMES[axis]} ", (f"{angle:>z8.2f}", "bold")
    if width < _NARROW:
        return _line((name, "bold"), position)
    if width < _MIDDLING:
        return _line((name, "bold"), (mark(share, width - 12), style), (" ", ""), position)
    torque, most = snapshot.measured_torque[axis], limits.torque_nm[axis]
    used = abs(torque) / most
    torques = (
        (f" {torque:>z7.1f}", "bold red" if used > 1.0 else "yellow" if used > _NEAR_SHARE else ""),
        (f" {snapshot.external_torque[axis]:>z8.1f}", ""),
    )
    if width < _WIDE:
        return _line((name, "bold"), (mark(share, width - 29), style), (" ", ""), position, *torques)
    return _line(
        (name, "bold"),
        (f"{low:>5.0f} ", "dim"),
        (mark(share, width - 40), style),
        (f" {high:<4.0f}", "dim"),
        (" ", ""),
        position,
        *torques,
    )


def _pose(snapshot: Snapshot) -> Lines:
    pose = snapshot.flange_in_base
    x, y, z = (1e3 * part for part in pose.position_m)
    a, b, c = pose.abc_deg()
    return [
        _line(("flange ", "dim"), (f"X {x:>z8.1f}  Y {y:>z8.1f}  Z {z:>z8.1f}", ""), (" mm", "dim")),
        _line(("       ", "dim"), (f"A {a:>z8.2f}  B {b:>z8.2f}  C {c:>z8.2f}", ""), (" deg", "dim")),
    ]


def _speed(snapshot: Snapshot, pad: RobotState | None, width: int) -> Lines:
    speed, in_t1 = snapshot.flange_speed_mm_s, snapshot.operator.mode.name == "T1"
    share = speed / T1_SPEED_LIMIT_MM_S
    most = 0.0 if pad is None else max(_used(pad, "T1, commanded"), _used(pad, "T1, measured"))
    style = "cyan"
    if in_t1:
        style = "bold red" if share > 1.0 else "yellow" if share > _NEAR_SHARE else "green"
    told = f"{speed:>5.0f} mm/s"
    run = f"  most used in T1 {most:.0%}, margin {max(0.0, 1.0 - most):.0%}" if most else ""
    label = "speed, T1 250 "
    return [
        _line((label, "dim"), (gauge(share, width - len(label) - len(told), most=most), style), (told, "bold")),
        *([_line((run.strip(), "dim"))] if run else []),
    ]


def _contacts(snapshot: Snapshot) -> Lines:
    if not snapshot.contacts:
        return []
    strongest = snapshot.contacts[0]
    x, y, z = (1e3 * part for part in strongest.point_m)
    return [
        _line(
            ("touched ", "dim"),
            (f"at {len(snapshot.contacts)}: {math.hypot(*strongest.force_n):.1f} N", "bold magenta"),
            (f" at X {x:z.0f} Y {y:z.0f} Z {z:z.0f} mm", ""),
        )
    ]


def _latency(robot: Figures, width: int) -> Lines:
    if robot.pad is None:
        return [_line(("latency ", "dim"), (NO_PAD, "dim"))]
    answers = [one.answer_ms for one in robot.latencies if one.answer_ms is not None]
    what, values = ("answer", answers) if answers else ("cycle late", [one.cycle_ms for one in robot.latencies])
    if not values:
        return []
    told = f"{what} {values[-1]:.2f} ms, worst {max(values):.2f} "
    return [_line((told, "dim"), (sparkline(values, width - len(told)), "green"))]


def _signals(pad: RobotState | None, width: int) -> Lines:
    if pad is None or not pad["io"]:
        return []
    lines: Lines = [_line(("I/O", "dim"))]
    for name, info in pad["io"].items():
        arrow = "<-" if info["direction"] == "input" else "->"
        told = Text(f" {arrow} {clean(name)} ", style="")
        told.append(_value(info["value"]), style="bold")
        if len(lines) > 1 and len(lines[-1]) + len(told) <= width:
            lines[-1].append_text(told)
        else:
            lines.append(_line(told))
    return lines[:_MOST_SIGNAL_LINES]


def _messages(messages: Sequence[Message], width: int) -> Lines:
    # What is said again and again is said once, and when that was last.
    told = [one for one, later in zip_longest(messages, messages[1:]) if _said(one) != _said(later)]
    newest = told[-_MOST_MESSAGES:][::-1]
    return [line for one in newest for line in _wrapped(f"{one.at_s:>8.2f} s ", one.text, width)]


def _said(message: Message | None) -> tuple[str, str] | None:
    return None if message is None else (message.robot, message.text)


def _wrapped(head: str, text: str, width: int, *, style: str = "") -> Lines:
    """Return a text on a few lines, of which only the last one is cut."""
    lines = textwrap.wrap(clean(text), max(width - len(head), 1), max_lines=_MOST_TEXT_LINES, placeholder="…")
    return [
        _line((head if number == 0 else " " * len(head), style or "dim"), (line, style))
        for number, line in enumerate(lines)
    ]


def _line(*parts: tuple[str, str] | Text) -> Text:
    line = Text(no_wrap=True, overflow="ellipsis")
    for part in parts:
        if isinstance(part, Text):
            line.append_text(part)
        else:
            line.append(*part)
    return line


def _used(pad: RobotState, monitor: str) -> float:
    margin = pad["margins"].get(monitor)
    return 0.0 if margin is None else margin["used"]


def _value(value: bool | float) -> str:
    return ("on" if value else "off") if isinstance(value, bool) else f"{value:g}"


@lru_cache(maxsize=16)
def _limits(model: str) -> JointLimits:
    return load_description(model).limits
