"""``hil backends``: the robot sides that are installed, and what they can do."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from hil.cli.json_output import JsonOutput
from hil.cli.plain import plain
from hil.values.arm import Capabilities
from hil.values.backend import BACKEND_GROUP

if TYPE_CHECKING:
    from backends.installed import InstalledBackend

_WIDTH_IN_A_FILE = 140


def backends(
    name: Annotated[str | None, typer.Argument(help="One backend, with its options.")] = None,
    json_file: Annotated[
        str | None, typer.Option("--json", metavar="FILE|-", help="Write it as JSON; - prints it and nothing else.")
    ] = None,
) -> None:
    """Show the robot sides that are installed: ours, and those of other packages. See: hil run --backend."""
    from backends.installed import installed_backend, installed_backends

    output = JsonOutput(json_file)
    found = installed_backends() if name is None else (installed_backend(name),)
    output.write({one.name: _as_dict(one) for one in found})
    if output.alone:
        return
    console = Console(highlight=False)
    # In a file there is room for all of it.
    wide = console if console.is_terminal else Console(highlight=False, width=_WIDTH_IN_A_FILE)
    if name is None:
        wide.print(_overview(found))
        console.print(
            f"From the entry points {BACKEND_GROUP!r}. Options of one: hil backends NAME", style="dim", soft_wrap=True
        )
        return
    wide.print(_card(found[0]))
    if found[0].plugin is not None and found[0].plugin.options_help:
        options = Table("option", r"\[robot.options] of a station file, or hil run --option NAME=VALUE")
        for option, text in found[0].plugin.options_help.items():
            options.add_row(plain(str(option)), plain(str(text)))
        wide.print(options)


def _overview(found: tuple["InstalledBackend", ...]) -> Table:
    table = Table("backend", "what it is", "can do", "cycle", "from", title="backends", show_lines=True)
    for one in found:
        capabilities, plugin = one.capabilities, one.plugin
        summary = [plain(str(plugin.summary))] if plugin is not None else []
        if one.problem:
            summary.append(f"[red]{plain(one.problem)}[/red]")
        table.add_row(
            plain(one.name),
            "\n".join(summary),
            "-" if capabilities is None or plugin is None else ", ".join(_abilities(capabilities, plugin.replays)),
            "-" if capabilities is None else _cycle(capabilities),
            plain(one.origin),
        )
    return table


def _abilities(capabilities: Capabilities, replays: bool) -> Iterator[str]:
    yield "positions"
    if capabilities.takes_torque:
        yield "torques"
    if capabilities.passes_overlays:
        yield f"overlays ({_overlays(capabilities)})"
    if capabilities.torque_sigma_nm is not None:
        yield "torque sensors"
    if capabilities.can_be_pushed:
        yield "push"
    if capabilities.switches_drives:
        yield "drops its drives"
    if capabilities.has_own_operator:
        yield "own operator"
    if capabilities.paces_the_cycle:
        yield "paces the cycle"
    if capabilities.moves_real_drives:
        yield "[bold]real drives[/bold]"
    if replays:
        yield "replays"


def _card(one: "InstalledBackend") -> Table:
    table = Table("", plain(one.name))
    table.add_row("from", plain(one.origin))
    if one.problem:
        table.add_row("cannot be used", f"[red]{plain(one.problem)}[/red]")
    if one.plugin is not None:
        table.add_row("what it is", plain(str(one.plugin.summary)))
        table.add_row("a recording of it replays", _yes(one.plugin.replays))
    if one.capabilities is not None:
        for label, text in _rows(one.capabilities):
            table.add_row(label, text)
    return table


def _rows(capabilities: Capabilities) -> Iterator[tuple[str, str]]:
    sigma = capabilities.torque_sigma_nm
    yield "joints", str(capabilities.joint_count)
    yield "takes torques", _yes(capabilities.takes_torque)
    yield "overlays it runs itself", _overlays(capabilities) or "none"
    yield "torque sensors", "no" if sigma is None else "noise " + ", ".join(f"{one:g}" for one in sigma) + " Nm"
    yield "can be pushed", _yes(capabilities.can_be_pushed)
    yield "drives can be dropped from here", _yes(capabilities.switches_drives)
    yield "mode selector and enabling are there", _yes(capabilities.has_own_operator)
    yield "control cycle", _cycle(capabilities)
    yield "its messages pace the cycle", _yes(capabilities.paces_the_cycle)
    yield "moves real drives", _yes(capabilities.moves_real_drives)


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def _overlays(capabilities: Capabilities) -> str:
    return ", ".join(sorted(map(str, capabilities.passes_overlays)))


def _cycle(capabilities: Capabilities) -> str:
    return f"{capabilities.shortest_period_ns / 1e6:g} ... {capabilities.longest_period_ns / 1e6:g} ms"


def _as_dict(one: "InstalledBackend") -> dict[str, object]:
    plugin, capabilities = one.plugin, one.capabilities
    return {
        "from": one.origin,
        "problem": one.problem,
        "summary": None if plugin is None else str(plugin.summary),
        "replays": None if plugin is None else bool(plugin.replays),
        "options": None if plugin is None else {str(name): str(text) for name, text in plugin.options_help.items()},
        "capabilities": None if capabilities is None else _capabilities_as_dict(capabilities),
    }


def _capabilities_as_dict(capabilities: Capabilities) -> dict[str, object]:
    sigma = capabilities.torque_sigma_nm
    return {
        "joint_count": capabilities.joint_count,
        "takes_torque": capabilities.takes_torque,
        "torque_sigma_nm": None if sigma is None else list(sigma),
        "passes_overlays": sorted(map(str, capabilities.passes_overlays)),
        "can_be_pushed": capabilities.can_be_pushed,
        "switches_drives": capabilities.switches_drives,
        "has_own_operator": capabilities.has_own_operator,
        "shortest_period_ns": capabilities.shortest_period_ns,
        "longest_period_ns": capabilities.longest_period_ns,
        "paces_the_cycle": capabilities.paces_the_cycle,
        "moves_real_drives": capabilities.moves_real_drives,
    }
