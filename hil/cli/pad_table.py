"""What the operator's pad shows, as a table with one column a robot."""

from rich.markup import escape
from rich.table import Table

from hil.client.pad import RobotState


def pad_table(robots: dict[str, RobotState]) -> Table:
    """Return the table."""
    permissive = any(state["permissive"] for state in robots.values())
    table = Table("", *map(escape, robots), title="[bold red]PERMISSIVE[/bold red]" if permissive else "pad")
    columns = [_rows(state) for state in robots.values()]
    for label in columns[0] if columns else ():
        table.add_row(label, *(escape(rows[label]) for rows in columns))
    return table


def stop_text(state: RobotState) -> str:
    """Return the last stop in words."""
    stop = state["last_stop"]
    if stop is None:
        return "none"
    category = "" if stop["category"] is None else f"category {stop['category']}, "
    return f"{stop['at_s']:.3f} s: {category}{stop['reason']}"


def _rows(state: RobotState) -> dict[str, str]:
    session = state["session"]
    return {
        "mode": state["mode"],
        "program": state["program"],
        "enabling": "held" if state["enabling"] else "not held",
        "drives": state["drives"],
        "override": f"{state['override_percent']:g} %",
        "safety state": state["safety_state"],
        "reason": state["reason"] or "-",
        "session": "-" if session is None else f"{session['state']}, quality {session['quality']}",
        "commander": state["commander"] or "-",
        "last stop": stop_text(state),
        "closest margin": state["closest"].removeprefix("closest to ") or "-",
        "monitors": "PERMISSIVE: they only report" if state["permissive"] else "on",
    }
