"""``hil backends [NAME]``: which robot sides are installed, and what each can do."""

from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from hil.cli.json_output import JsonOutput
from hil.values.errors import ConfigurationError

if TYPE_CHECKING:
    from hil.values.arm import Capabilities
    from hil.values.backend import BackendPlugin


class Offer(NamedTuple):
    """One backend; ``problem`` is why it cannot be used here, empty where it can."""

    name: str
    origin: str
    problem: str
    plugin: "BackendPlugin | None"
    capabilities: "Capabilities | None"


def backends(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Tell all of this one, its options too.")] = None,
    json_file: Annotated[str | None, typer.Option("--json", metavar="FILE|-", help="Write it as JSON.")] = None,
) -> None:
    """List the installed robot sides, ours and everybody's, with what they can do."""
    from backends.registry import backend_names, load_plugin

    output = JsonOutput(json_file)
    if name is not None:
        load_plugin(name)
    offers = [_offer(one) for one in (backend_names() if name is None else (name,))]
    output.write({offer.name: _as_dict(offer) for offer in offers})
    if output.alone:
        return
    console = Console(highlight=False)
    if name is None:
        _list(console, offers)
    else:
        _tell(console, offers[0])


def _offer(name: str) -> Offer:
    from backends.registry import load_plugin, missing_of, origin_of

    try:
        plugin = load_plugin(name)
        capabilities = plugin.capabilities()
    except ConfigurationError as error:
        return Offer(name, origin_of(name), str(error), None, None)
    except Exception as error:  # noqa: BLE001  # somebody else's code: whatever it raises is a line of the table
        return Offer(name, origin_of(name), f"{type(error).__name__}: {error}", None, None)
    missing = missing_of(plugin)
    return Offer(name, origin_of(name), f"needs: {missing}" if missing else "", plugin, capabilities)


def _facts(capabilities: "Capabilities", plugin: "BackendPlugin") -> dict[str, Any]:
    return {
        "takes": ", ".join(["positions", *(["torques"] if capabilities.takes_torque else [])]),
        "overlays passed on": ", ".join(sorted(capabilities.passes_overlays)) or "none",
        "torque sensors": capabilities.torque_sigma_nm is not None,
        "can be pushed": capabilities.can_be_pushed,
        "drives dropped from here": capabilities.switches_drives,
        "mode and enabling are there": capabilities.has_own_operator,
        "cycle, ms": f"{capabilities.shortest_period_ns / 1e6:g} ... {capabilities.longest_period_ns / 1e6:g}",
        "paces the cycle": capabilities.paces_the_cycle,
        "moves real drives": capabilities.moves_real_drives,
        "recordings replay": plugin.replays,
    }


def _as_dict(offer: Offer) -> dict[str, object]:
    about: dict[str, object] = {"origin": offer.origin, "problem": offer.problem}
    if offer.plugin is not None and offer.capabilities is not None:
        about |= {
            "summary": offer.plugin.summary,
            "capabilities": _facts(offer.capabilities, offer.plugin),
            "options": dict(offer.plugin.options_help),
        }
    return about


def _list(console: Console, offers: list[Offer]) -> None:
    table = Table("", *(escape(offer.name) for offer in offers), title="backends")
    facts = [
        _facts(offer.capabilities, offer.plugin) if offer.capabilities is not None and offer.plugin is not None else {}
        for offer in offers
    ]
    for what in next(filter(None, facts), {}):
        table.add_row(what, *(_told(one.get(what, "-")) for one in facts))
    console.print(table)
    for offer in offers:
        summary = "" if offer.plugin is None else offer.plugin.summary
        problem = f"  [red]{escape(offer.problem)}[/red]" if offer.problem else ""
        origin = f"  [dim]{escape(offer.origin)}[/dim]"
        console.print(f"[bold]{escape(offer.name)}[/bold]  {escape(summary)}{problem}{origin}", soft_wrap=True)
    console.print("hil backends NAME lists the options of one", style="dim")


def _tell(console: Console, offer: Offer) -> None:
    console.print(f"[bold]{escape(offer.name)}[/bold]  from {escape(offer.origin)}")
    if offer.problem:
        console.print(f"[red]{escape(offer.problem)}[/red]", soft_wrap=True)
    if offer.plugin is None or offer.capabilities is None:
        return
    console.print(escape(offer.plugin.summary), soft_wrap=True)
    table = Table("capability", "")
    for what, value in _facts(offer.capabilities, offer.plugin).items():
        table.add_row(what, _told(value))
    console.print(table)
    if not offer.plugin.options_help:
        console.print("it has no options")
        return
    options = Table("option", "\\[robot.options] of the station file, or hil run --option NAME=VALUE")
    for option, text in offer.plugin.options_help.items():
        options.add_row(escape(option), escape(text))
    console.print(options)


def _told(value: object) -> str:
    return ("yes" if value else "no") if isinstance(value, bool) else escape(str(value))
