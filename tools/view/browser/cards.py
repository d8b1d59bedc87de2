"""What the pad in the page shows, as HTML: figures with their limits, never the words of a peer unescaped."""

import math
from collections.abc import Sequence
from html import escape
from typing import Final

from hil.client.pad import RobotState
from hil.core.settings import T1_SPEED_LIMIT_MM_S
from hil.values.fri import OperationMode
from hil.values.operator import ProgramState
from hil.values.pose import Pose
from hil.values.robot import JOINT_NAMES, JointLimits
from hil.values.servo import Snapshot
from tools.view.connection import Row
from tools.view.drawing import ArmNow
from tools.view.watch import Message

_GOOD, _NEAR, _BAD, _PLAIN = "#2f9e44", "#f08c00", "#e03131", "#868e96"
_NEAR_SHARE: Final = 0.8
_NEAR_END_DEG: Final = 10.0
_SHOWN_MESSAGES: Final = 12
_PROGRAM_COLOURS: Final = {
    ProgramState.RUNNING: _GOOD,
    ProgramState.PAUSED: _NEAR,
    ProgramState.STOPPED: _BAD,
    ProgramState.EMERGENCY_STOP: _BAD,
}
_QUALITY_COLOURS: Final = {"EXCELLENT": _GOOD, "GOOD": _GOOD, "FAIR": _NEAR, "POOR": _BAD}


def status_card(robot: str, now: ArmNow, pad: RobotState | None) -> str:
    """Return mode, program, enabling switch, session, and why nothing moves."""
    if now.lost:
        return _steady(_badge("LOST", _BAD) + _line(f"{robot}: {now.lost}"))
    if now.snapshot is None:
        return _steady(_line(f"{robot}: nothing came yet"))
    view = now.snapshot.operator
    badges = [
        _badge(view.mode.name, "#1971c2"),
        _badge(view.program.name.replace("_", " "), _PROGRAM_COLOURS[view.program]),
        _badge(f"{view.override_percent:g} %", _PLAIN),
    ]
    if view.mode is not OperationMode.AUT:
        badges.insert(2, _badge("enabled" if view.enabling else "not enabled", _GOOD if view.enabling else _PLAIN))
    if view.permissive:
        badges.append(_badge("PERMISSIVE", _BAD))
    lines = [_line(view.reason, _BAD)] if view.reason else []
    if pad is not None and (session := pad["session"]) is not None:
        quality = session["quality"]
        badges.append(_badge(session["state"].replace("_", " "), "#5f3dc4"))
        badges.append(_badge(quality, _QUALITY_COLOURS.get(quality, _PLAIN)))
    if now.snapshot.commander:
        lines.append(_line(f"commanded by {now.snapshot.commander}"))
    return _steady(f"<b data-hil='robot'>{escape(robot)}</b> " + "".join(badges) + "".join(lines))


def axes_card(snapshot: Snapshot, limits: JointLimits) -> str:
    """Return the axis positions between their ends, in degrees, with torques and external torques in Nm."""
    rows = []
    for axis, name in enumerate(JOINT_NAMES):
        low, high = math.degrees(limits.position_min_rad[axis]), math.degrees(limits.position_max_rad[axis])
        value = math.degrees(snapshot.measured_position[axis])
        near = min(value - low, high - value)
        colour = _BAD if near < 0.0 else _NEAR if near < _NEAR_END_DEG else "#1971c2"
        rows.append(
            f"<tr><td><b>{name}</b></td><td style='width:45%'>{_mark((value - low) / (high - low), colour)}</td>"
            f"<td style='text-align:right' data-hil='{name}'>{value:z.2f}°</td>"
            f"<td style='text-align:right'>{snapshot.measured_torque[axis]:z.1f}</td>"
            f"<td style='text-align:right'>{snapshot.external_torque[axis]:z.1f}</td></tr>"
        )
    head = "<tr><th></th><th>between its ends</th><th>position</th><th>Nm</th><th>ext. Nm</th></tr>"
    return _box(f"<table style='width:100%;font-size:0.8em'>{head}{''.join(rows)}</table>")


def pose_card(title: str, pose: Pose) -> str:
    """Return a Cartesian position in mm and degrees."""
    x, y, z = (1e3 * part for part in pose.position_m)
    a, b, c = pose.abc_deg()
    cells = "".join(
        f"<td style='text-align:right'><b>{name}</b> <span data-hil='{name}'>{value:z.1f}</span>&nbsp;mm</td>"
        for name, value in (("X", x), ("Y", y), ("Z", z))
    )
    turns = "".join(
        f"<td style='text-align:right'><b>{name}</b> <span data-hil='{name}'>{value:z.2f}</span>°</td>"
        for name, value in (("A", a), ("B", b), ("C", c))
    )
    return _box(f"{_small(title)}<table style='width:100%;font-size:0.85em'><tr>{cells}</tr><tr>{turns}</tr></table>")


def speed_card(snapshot: Snapshot, pad: RobotState | None) -> str:
    """Return the flange's speed against T1's limit, and the most that was used of it in this run."""
    speed = snapshot.flange_speed_mm_s
    share = speed / T1_SPEED_LIMIT_MM_S
    most = 0.0 if pad is None else max(_used(pad, "T1, commanded"), _used(pad, "T1, measured"))
    colour = _BAD if share > 1.0 else _NEAR if share > _NEAR_SHARE else _GOOD
    at = f"position:absolute;left:{100 * min(most, 1.0):.1f}%;top:0;bottom:0;width:2px;background:#212529"
    mark = f"<div style='{at}'></div>" if most else ""
    gauge = (
        "<div style='position:relative;height:14px;background:#e9ecef;border-radius:3px;overflow:hidden'>"
        f"<div style='height:100%;width:{100 * min(share, 1.0):.1f}%;background:{colour}'></div>{mark}</div>"
    )
    margin = f"margin so far {max(0.0, 1.0 - most):.0%}" if most else "nothing moved in T1 yet"
    head = f"flange <b data-hil='speed'>{speed:.0f}</b> mm/s, T1: {T1_SPEED_LIMIT_MM_S:g} mm/s, {margin}"
    return _box(f"<div style='font-size:0.85em'>{head}</div>{gauge}")


def messages_card(messages: Sequence[Message]) -> str:
    """Return what the operator was told, the newest first."""
    if not messages:
        return _box(_line("nothing was said yet"))
    shown = sorted(messages, key=lambda one: one.at_s, reverse=True)[:_SHOWN_MESSAGES]
    lines = "".join(
        f"<div style='padding:2px 0;border-bottom:1px solid #e9ecef'><span style='color:{_PLAIN}'>"
        f"{one.at_s:.2f} s {escape(one.robot)}</span> {escape(one.text)}</div>"
        for one in shown
    )
    return _box(f"<div style='font-size:0.8em'>{lines}</div>")


def signals_card(pad: RobotState | None) -> str:
    """Return all inputs and outputs with their values."""
    if pad is None:
        return _box(_line("inputs and outputs are shown where the controller's pad is on this machine"))
    if not pad["io"]:
        return _box(_line("this robot has no inputs and outputs"))
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{escape(info['direction'])}</td>"
        f"<td style='text-align:right'><b>{escape(_value(info['value']))}</b></td></tr>"
        for name, info in pad["io"].items()
    )
    return _box(f"<table style='width:100%;font-size:0.85em'>{rows}</table>")


def rows_card(state: str, trouble: str, rows: Sequence[Row]) -> str:
    """Return how far a rendering connection is, and its robots, those that are lost in red (manual 6.2)."""
    told = "".join(
        f"<tr style='color:{_BAD if row.lost else 'inherit'}'><td>{escape(row.robot)}</td>"
        f"<td>{escape(row.device or '-')}</td><td>{escape(row.lost or 'connected')}</td></tr>"
        for row in rows
    )
    head = "<tr><th align='left'>robot</th><th align='left'>shown by</th><th align='left'>connection</th></tr>"
    table = f"<table style='width:100%;font-size:0.85em'>{head}{told}</table>"
    return _box(_badge(state, "#1971c2") + (_line(trouble, _BAD) if trouble else "") + table)


def note(text: str) -> str:
    """Return a remark."""
    return _box(_small(text))


def _used(pad: RobotState, monitor: str) -> float:
    margin = pad["margins"].get(monitor)
    return 0.0 if margin is None else margin["used"]


def _value(value: bool | float) -> str:
    return ("on" if value else "off") if isinstance(value, bool) else f"{value:g}"


def _box(content: str) -> str:
    return f"<div style='padding:2px 12px 6px 12px;line-height:1.35'>{content}</div>"


def _steady(content: str) -> str:
    """As high with few words as with many: what stands below must not move away under a mouse that presses it."""
    return _box(f"<div style='height:6em;overflow-y:auto'>{content}</div>")


def _small(text: str) -> str:
    return f"<div style='font-size:0.75em;color:{_PLAIN}'>{escape(text)}</div>"


def _line(text: str, colour: str = "inherit") -> str:
    return f"<div style='font-size:0.85em;color:{colour}'>{escape(text)}</div>"


def _badge(text: str, colour: str) -> str:
    return (
        f"<span style='background:{colour};color:white;border-radius:4px;padding:1px 6px;margin:1px 3px 1px 0;"
        f"font-size:0.78em;font-weight:600;display:inline-block'>{escape(text)}</span>"
    )


def _mark(share: float, colour: str) -> str:
    """Return a bar from end to end with a mark where the axis stands."""
    at = 100.0 * min(max(share, 0.0), 1.0)
    return (
        "<div style='position:relative;height:10px;background:#e9ecef;border-radius:3px'>"
        "<div style='position:absolute;left:50%;top:0;bottom:0;width:1px;background:#adb5bd'></div>"
        f"<div style='position:absolute;left:calc({at:.1f}% - 3px);top:-1px;bottom:-1px;width:6px;"
        f"border-radius:2px;background:{colour}'></div></div>"
    )
