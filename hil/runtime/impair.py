"""Run a relay with faults until asked to stop, and report what each fault did."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from hil.clock import Clock, MonotonicClock
from hil.runtime.console import Console
from hil.runtime.lifetime import check_result_file, repeated, stop_on_signals, write_result_file
from hil.runtime.relay import Relay, open_relay
from hil.values.link import Address
from hil.version import SOFTWARE
from transport.impairment import Direction, Fault, FaultNeverFired, FaultReport, Network, PacketId


class Link(StrEnum):
    """Which link runs through the relay: that says who speaks first, and to whom."""

    FRI = "fri"
    """The controller speaks first; the relay sends on to the client."""
    SERVO = "servo"
    """Applications speak first; the relay sends on to the controller."""


@dataclass(frozen=True, slots=True)
class ImpairOptions:
    """What to impair, and how."""

    listen: Address
    to: Address
    link: Link
    faults: Sequence[Fault] = ()
    seed: int = 0
    forward_from: Address | None = None
    duration_s: float | None = None
    json_file: Path | None = None
    progress_s: float = 1.0


@dataclass(frozen=True, slots=True)
class ImpairResult:
    """What became of it; ``fault`` is None when it ended as it was asked to."""

    report: dict[str, object]
    fault: str | None
    never_fired: str | None
    """The sentence for armed faults that did nothing; None where all fired."""


def run_impair(options: ImpairOptions) -> ImpairResult:
    """Pass datagrams on until SIGINT, SIGTERM or the duration ends it. Raises HilError when it cannot start."""
    check_result_file(options.json_file)
    return asyncio.run(_run(options))


async def _run(options: ImpairOptions) -> ImpairResult:
    clock: Clock = MonotonicClock()
    network = Network(options.faults, seed=options.seed)
    relay = await open_relay(
        network,
        listen=options.listen,
        to=options.to,
        towards=Direction.TO_PEER if options.link is Link.FRI else Direction.TO_CONTROLLER,
        forward_from=options.forward_from,
        clock=clock,
    )
    console = Console()
    with stop_on_signals(relay.stop):
        try:
            console.say(_serving(relay, options))
            began_ns = clock.now_ns()

            def say_progress() -> None:
                console.say(progress_line(relay, elapsed_s=(clock.now_ns() - began_ns) * 1e-9))

            with repeated(options.progress_s, say_progress):
                deadline = None
                if options.duration_s is not None:
                    deadline = asyncio.get_running_loop().call_later(options.duration_s, relay.stop)
                try:
                    await relay.run()
                finally:
                    if deadline is not None:
                        deadline.cancel()
        finally:
            relay.close()
            console.close()
        report = _report(relay, options, elapsed_s=(clock.now_ns() - began_ns) * 1e-9)
        write_result_file(options.json_file, report)
    return ImpairResult(report, relay.fault, _never_fired(network))


def progress_line(relay: Relay, *, elapsed_s: float) -> str:
    """Return time, packets of both directions, what is on the way, and how often each fault fired in one line."""
    parts = [
        f"{elapsed_s:7.1f} s",
        ", ".join(f"{direction} {count}" for direction, count in relay.network.packets.items()),
        f"on the way {relay.network.on_the_way}",
        *(f"{report.fault} {report.fired}" for report in relay.network.reports()),
    ]
    if relay.refused:
        parts.append(f"refused {relay.refused}")
    return " | ".join(parts)


def _serving(relay: Relay, options: ImpairOptions) -> str:
    host, port = relay.forwards_from
    faults = ", ".join(map(str, options.faults)) or "no fault: it only passes on"
    return (
        f"{relay.local} stands for {options.to}, link {options.link}; sends on from {host}, port {port or 'any'}; "
        f"seed {options.seed}; {faults}"
    )


def _report(relay: Relay, options: ImpairOptions, *, elapsed_s: float) -> dict[str, object]:
    network = relay.network
    return {
        "software": SOFTWARE,
        "fault": relay.fault,
        "listen": str(relay.local),
        "to": str(options.to),
        "from": str(relay.forwards_from),
        "link": options.link.value,
        "seed": options.seed,
        "seconds": round(elapsed_s, 3),
        "packets": {direction.value: count for direction, count in network.packets.items()},
        "delivered": {direction.value: count for direction, count in relay.delivered.items()},
        "on_the_way": network.on_the_way,
        "speakers": [
            {"source": str(line.source), "from": str(line.endpoint.local), "sent": line.forwarded, "got": line.answered}
            for line in relay.lines
        ],
        "refused": relay.refused,
        "strangers": relay.strangers,
        "turned_away": relay.turned_away,
        "lateness_us": relay.lateness.summary_us(),
        "faults": [_fault(report) for report in network.reports()],
        "never_fired": _never_fired(network),
    }


def _fault(report: FaultReport) -> dict[str, object]:
    return {
        "fault": str(report.fault),
        "fired": report.fired,
        "met": report.met,
        "lost": report.lost,
        "added": report.added,
        "first": [_packet(packet) for packet in report.first],
        "last": [_packet(packet) for packet in report.last],
        "packets_text": report.packets_text,
    }


def _packet(packet: PacketId) -> dict[str, object]:
    return {"direction": packet.direction.value, "number": packet.number}


def _never_fired(network: Network) -> str | None:
    try:
        network.require_fired()
    except FaultNeverFired as error:
        return str(error)
    return None
