"""The table a run ends with."""

from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from hil.values.motion import MotionKind

_LAST_STOPS = 3
_LAST_CHANGES = 12
_LAST_MOTIONS = 5


def print_summary(status: dict[str, Any]) -> None:
    """Print the figures of a status file as a table, one column a robot."""
    robots: dict[str, Any] = status["robots"]
    console = Console()
    table = Table("", *map(escape, robots), title="fri-hil run")
    rows = {name: _figures(robot) for name, robot in robots.items()}
    for label in next(iter(rows.values()), {}):
        table.add_row(label, *(figures.get(label, "-") for figures in rows.values()))
    console.print(table)
    for name, robot in robots.items():
        _print_history(console, name, robot)
    for name, robot in robots.items():
        _print_set_points(console, name, robot)
    for name, robot in robots.items():
        _print_findings(console, name, robot)
    for name, robot in robots.items():
        if robot["operator"]["permissive"]:
            counts = ", ".join(f"{monitor} {count}" for monitor, count in robot["would_have_stopped"].items())
            console.print(
                f"[bold red]{escape(name)}: PERMISSIVE: the monitors only reported; cycles they would have stopped "
                f"the arm in: {escape(counts) or 'none'}[/bold red]"
            )
    if (capture := status["capture"]) is not None:
        removed = f", {capture['removed']} in files the ring removed" if capture["removed"] else ""
        console.print(
            f"capture {escape(capture['path'])}: {capture['written']} packets, {capture['dropped']} dropped{removed}",
            soft_wrap=True,
        )
        if capture["error"]:
            console.print(f"[red]capture: {escape(capture['error'])}[/red]", soft_wrap=True)
    _print_probe(console, status["tcp_probe"])
    if status["fault"]:
        console.print(f"[red]fault: {escape(status['fault'])}[/red]", soft_wrap=True)


def _print_probe(console: Console, probe: dict[str, Any] | None) -> None:
    """Print what the TCP responder served, and what did not end as a doctor ends it."""
    if probe is None:
        return
    if probe["fault"]:
        console.print(f"[red]tcp probe {probe['address']}: {escape(probe['fault'])}[/red]", soft_wrap=True)
        return
    odd = {"turned away": probe["turned_away"], **probe["ended"]}
    del odd["closed by the other side"]
    served = [
        f"{probe['accepted']} connections, {probe['answered']} messages answered",
        *(f"{what} {count}" for what, count in odd.items() if count),
    ]
    console.print(f"tcp probe {probe['address']}: {', '.join(served)}", soft_wrap=True)


def _figures(robot: dict[str, Any]) -> dict[str, str]:
    figures = {
        "robot": f"{robot['model']} ({robot['backend']}, {robot['mode']})",
        "rate": "-" if robot["rate_hz"] is None else f"{robot['rate_hz']:.3f} Hz",
        "cycles": f"{robot['ticks']}, {robot['missed_cycles']} missed",
        "lateness": _distribution(robot["lateness_us"]),
        "cycle": _distribution(robot["cycle_us"]),
        "max flange speed": f"{robot['max_flange_speed_mm_s']:.1f} mm/s",
        "operator": _operator(robot["operator"]),
        "closest margin": robot["closest"].removeprefix("closest to ") or "-",
        "stops": _stops(robot["stops"]),
    }
    if robot["session"] is not None:
        packets = robot["packets"]
        drops = ", ".join(f"{reason} {count}" for reason, count in packets["dropped"].items() if count)
        figures |= {
            "session": f"{robot['session']['state']}, quality {robot['session']['quality']}",
            "our send lateness": _distribution(robot["answer_path_us"]["send_lateness"]),
            "answer latency": _distribution(robot["answer_latency_us"]),
            "our use lateness": _distribution(robot["answer_path_us"]["use_lateness"]),
            "late or missing": _at_fault(robot["answers_at_fault"]),
            "packets": f"{packets['sent']} sent, {packets['received']} received, {packets['accepted']} accepted",
            "dropped": drops or "none",
        }
    if robot["servo"] is not None:
        figures |= _servo_figures(robot["servo"])
    if robot.get("kst") is not None:
        figures["KST programs"] = _kst_figures(robot["kst"])
    return figures


def _kst_figures(kst: dict[str, Any]) -> str:
    if kst["fault"] is not None or "sessions" not in kst:
        return f"not served: {kst['fault'] or 'no report came'}"
    refused = ", ".join(f"{reason} {count}" for reason, count in kst["refused"].items())
    set_points = kst["counters"].get("set_points", 0)
    return f"{kst['sessions']} sessions, {set_points} set-points; refused: {refused or 'none'}"


def _servo_figures(servo: dict[str, Any]) -> dict[str, str]:
    packets = servo["packets"]
    drops = ", ".join(f"{reason} {count}" for reason, count in packets["dropped"].items() if count)
    return {
        "applications": f"{servo['sessions_begun']} sessions, {servo['motions_begun']} motions",
        "requests": f"{servo['requests_taken']} taken, {servo['requests_refused']} refused",
        "servo packets": f"{packets['sent']} sent, {packets['received']} received; dropped: {drops or 'none'}",
    }


def _at_fault(counts: dict[str, Any]) -> str:
    """Return late and missing answers by whose fault."""
    names = {"controller": "this controller", "peer_or_wire": "peer or wire", "both": "both"}
    told = [
        f"{sum(of.values())} {what} ({', '.join(f'{count} {names[whose]}' for whose, count in of.items() if count)})"
        for what in ("late", "missing")
        if any((of := counts[what]).values())
    ]
    return ", ".join(told) or "none"


def _operator(operator: dict[str, Any]) -> str:
    """Return mode, program and override at the end of the run."""
    text = f"{operator['mode']}, {operator['program']}, override {operator['override_percent']:g} %"
    return f"PERMISSIVE, {text}" if operator["permissive"] else text


def _stops(stops: list[dict[str, Any]]) -> str:
    """Return how often the arm braked, and how and why the last times."""
    told = [f"{stop['at_s']:.3f} s: {_category(stop)}{escape(stop['reason'])}" for stop in stops[-_LAST_STOPS:]]
    return "\n".join([str(len(stops)), *told])


def _category(stop: dict[str, Any]) -> str:
    return "" if stop["category"] is None else f"category {stop['category']}, "


def _distribution(summary: dict[str, float | None]) -> str:
    if summary["max"] is None:
        return "-"
    return "  ".join(f"{name.replace('_', '.')} {value:.0f}" for name, value in summary.items()) + " us"


def _print_findings(console: Console, name: str, robot: dict[str, Any]) -> None:
    """Print what was diagnosed while it ran: one sentence each, and what helps."""
    for finding in robot["findings"]:
        often = f" ({finding['count']} times, {finding['first_s']:.3f} to {finding['last_s']:.3f} s)"
        colour = "cyan" if finding["severity"] in {"good", "note"} else "yellow"
        told = escape(f"{name}: {finding['sentence']}{often if finding['count'] > 1 else ''}")
        console.print(f"[{colour}]{told}[/{colour}]", soft_wrap=True)
        for number, remedy in enumerate(finding["remedies"], 1):
            console.print(f"  {number}. {escape(remedy)}", soft_wrap=True)


def _print_set_points(console: Console, name: str, robot: dict[str, Any]) -> None:
    """Print what became of the destinations of the last servo motions."""
    motions = [] if robot["servo"] is None else robot["servo"]["motions"]
    if not motions:
        return
    shown = f", last {_LAST_MOTIONS} motions" if len(motions) > _LAST_MOTIONS else ""
    columns = ("motion", "sent", "re-\nceived", "re-\nfused", "super-\nseded", "exe-\ncuted", "age", "stood\nstill")
    table = Table(*columns, title=f"{escape(name)}: set points{shown}")
    for motion in motions[-_LAST_MOTIONS:]:
        age_us = motion["age_us"]["p50"]
        table.add_row(
            f"{motion['motion']} {MotionKind[motion['kind']].manual_name}",
            *(str(motion[what]) for what in ("sent", "received", "refused", "superseded", "executed")),
            "-" if age_us is None else f"{age_us / 1e3:.1f} ms",
            str(motion["standstills"]),
        )
    console.print(table)
    for motion in motions[-_LAST_MOTIONS:]:
        if (rate := motion["executed_per_s"]) is not None:
            came = f"destinations came {motion['arrival_spacing']}, {rate:.1f}/s executed"
            told = f"{name}: motion {motion['motion']}: {came}"
            console.print(escape(told), soft_wrap=True, highlight=False)


def _print_history(console: Console, name: str, robot: dict[str, Any]) -> None:
    session = robot["session"]
    if session is None or not session["history"]:
        return
    changes = session["history"]
    shown = f", last {_LAST_CHANGES} of {session['changes']} changes" if len(changes) > _LAST_CHANGES else ""
    table = Table("time", "session state", "quality", "reason", title=f"{escape(name)}: session{shown}")
    for change in changes[-_LAST_CHANGES:]:
        table.add_row(f"{change['at_s']:.3f} s", change["to"], change["quality"], escape(change["reason"]))
    console.print(table)
