"""Whose fault it is, as far as four times and the packets' numbers can tell it."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from hil.core.statistics import Histogram
from hil.values.finding import Diagnosis, EvidenceTable, Figure, Finding, Severity, Whose, worst_first
from hil.values.link import Address
from tools.doctor.udp.figures import LinkFigures

MUCH_LOSS_SHARE: Final = 0.01
LATE_SHARE: Final = 0.01
"""Of the answers: so many from cycles a whole cycle late or more, and the controller is behind."""
LEAST_ANSWERS: Final = 5
_CLOCK_PPM: Final = 100.0
"""A quartz is within this; more is a clock that is being set, or a bad virtual one."""

_HELPS_CONTROLLER: Final = ("on the controller's machine: hil doctor host", "hil run --realtime there")
_SHARED: Final = "both ends are on this machine, and this program takes CPU time from the controller too"


def judge(found: LinkFigures, *, controller: Address, same_machine: bool) -> Diagnosis:
    """Return the verdict on a measurement against ``controller``, the worst finding first."""
    findings = worst_first(_findings(found, same_machine))
    if not any(one.is_wrong for one in findings):
        findings.insert(0, _healthy(found, controller))
    verdict = replace(findings[0], evidence=findings[0].evidence + _context(found), figures=_figures(found))
    return Diagnosis((verdict, *findings[1:]), (_times_table(found), _packets_table(found)))


def _findings(found: LinkFigures, same_machine: bool) -> Iterator[Finding]:
    """Yield what is wrong; of equally bad ones the first counts most."""
    if found.ended_because:
        yield _ended(found)
    elif found.answered < LEAST_ANSWERS and not found.requests_lost:
        yield _too_little(found)
    if found.dropped_here:
        yield _dropped_here(found)
    if found.down_lost_share or found.up_lost_share:
        yield _loss(found, same_machine)
    if found.quality:
        yield _quality(found)
    delayed = [*_late_cycles(found, same_machine)]
    if not delayed or (found.jitter_up.quantile(0.99) or 0) > found.period_ns:
        delayed += _jitter(found, same_machine)
    reading = [*_reads_late(found)]
    if (found.waited_here.quantile(0.99) or 0) > (found.jitter_down.quantile(0.99) or 0):
        delayed, reading = reading, delayed
    yield from (*delayed, *reading)
    if found.drift_ppm is not None and abs(found.drift_ppm) > max(_CLOCK_PPM, found.drift_resolution_ppm):
        yield _drift(found, found.drift_ppm)


def _healthy(found: LinkFigures, controller: Address) -> Finding:
    return Finding(
        "link-healthy",
        Severity.GOOD,
        Whose.NOBODY,
        f"nothing wrong between this host and {controller}: {_loss_text(found)}; {_round_trip_text(found)}; jitter p99 "
        f"{_ms(found.jitter_down.quantile(0.99))} of a period of {found.period_ns / 1e6:g} ms",
    )


def _ended(found: LinkFigures) -> Finding:
    return Finding(
        "link-ended",
        Severity.FAULT,
        Whose.PEER_OR_WIRE,
        f"the session ended after {found.seconds:.1f} s: {found.ended_because}; until then {_loss_text(found)}",
        (),
        ("see what hil run says at the other end, and whether the network went away: ping, ip link",),
    )


def _too_little(found: LinkFigures) -> Finding:
    return Finding(
        "too-little",
        Severity.WARNING,
        Whose.PEER_OR_WIRE,
        f"only {found.answered} of {found.requests_sent} {found.up} were answered in {found.seconds:.1f} s: too little "
        "for a verdict",
        (),
        ("measure longer: --seconds",),
    )


def _dropped_here(found: LinkFigures) -> Finding:
    return Finding(
        "receive-buffer",
        Severity.FAULT,
        Whose.HOST,
        f"this host: {found.dropped_here} of {found.states_sent} {found.down} arrived and were dropped, because the "
        "buffer of the socket was full: it was not read in time",
        (),
        ("see what holds this host up: hil doctor host", "a larger buffer: sysctl -w net.core.rmem_max=4194304"),
    )


def _loss(found: LinkFigures, same_machine: bool) -> Finding:
    worst = max(found.down_lost_share, found.up_lost_share)
    here = f"its socket dropped {found.dropped_here or 'none'}"
    if not found.drops_known:
        here = "unless its socket dropped them, which is not known here"
    between = f"the network between, not this host ({here}) and not the controller's timing"
    remedies = [
        "a cable instead of radio, a port of its own instead of a busy switch",
        "look for drops on both sides: ip -s link, ethtool -S IFACE, tc -s qdisc",
        "on the controller's machine: nstat -az UdpRcvbufErrors; where it grows, hil doctor host there",
    ]
    if same_machine:
        between = (
            "both ends are on this machine, so what stands between them loses them (hil impair, a firewall, tc netem), "
            "or the controller's receive buffer"
        )
        remedies = ["see what stands between: tc qdisc show dev lo, iptables -L -v", "nstat -az UdpRcvbufErrors"]
    return Finding(
        "link-loss",
        Severity.FAULT if worst >= MUCH_LOSS_SHARE else Severity.WARNING,
        Whose.WIRE,
        f"packets are lost: {_loss_text(found)}; {between}",
        (f"{found.up} that came too late, or that a newer one overtook, count as lost: the controller drops them",),
        tuple(remedies),
    )


def _reads_late(found: LinkFigures) -> Iterator[Finding]:
    waited_ns = found.waited_here.quantile(0.99) or 0
    if waited_ns <= found.period_ns / 2:
        return
    yield Finding(
        "receive-late",
        Severity.FAULT if waited_ns > found.period_ns else Severity.WARNING,
        Whose.HOST,
        f"this host reads late: {found.down} waited p99 {_ms(waited_ns)} in its kernel for the program (median "
        f"{_ms(found.waited_here.quantile(0.5))}, max {_ms(found.waited_here.maximum)}), and they come every "
        f"{found.period_ns / 1e6:g} ms; that is not in the figures of the network",
        (f"its timer woke it p99 {_ms(found.send_late.quantile(0.99))} late",) if found.send_late.count else (),
        ("see what holds this host up: hil doctor host",),
    )


def _late_cycles(found: LinkFigures, same_machine: bool) -> Iterator[Finding]:
    """Return what the controller's own clock and kernel say of its lateness."""
    if not found.behind or found.behind < LATE_SHARE * found.answered:
        return
    yield Finding(
        "controller-late",
        Severity.FAULT if found.cycle_late.maximum > found.period_ns else Severity.WARNING,
        Whose.CONTROLLER,
        f"the controller runs late: {found.behind} of {found.answered} answers left in a cycle that began a whole "
        f"cycle or more after it was due, the worst {_ms(found.cycle_late.maximum)} late at least: its own clock says "
        "so, so it is its machine and not the network",
        (
            "told by answers to requests that reached its machine after the cycle was due that answers them",
            f"jitter p99 {_ms(found.jitter_down.quantile(0.99))} from it, {_ms(found.jitter_up.quantile(0.99))} to it",
            *((_SHARED,) if same_machine else ()),
        ),
        _HELPS_CONTROLLER,
    )


def _jitter(found: LinkFigures, same_machine: bool) -> Iterator[Finding]:
    down_ns, up_ns = found.jitter_down.quantile(0.99) or 0, found.jitter_up.quantile(0.99) or 0
    down, up = down_ns > found.period_ns, up_ns > found.period_ns
    if not down and not up:
        return
    there = f", {_ms(up_ns)} to the controller" if found.jitter_up.count else ""
    figures = f"p99 {_ms(down_ns)} to this host{there}, in a period of {found.period_ns / 1e6:g} ms"
    if up:
        whose, side = Whose.WIRE, "the network, both ways" if down else "the network, towards the controller"
        why = "what arrives there is stamped by its kernel, so its own timing is not in it"
    elif same_machine:
        whose, side = Whose.CONTROLLER, "the controller, which is on this machine"
        why = "nothing is between but what was put there (hil impair, tc netem)"
    else:
        whose, side = Whose.PEER_OR_WIRE, "the controller, or the network towards this host"
        evenly = "what is sent to it arrives evenly; " if found.jitter_up.count else ""
        why = f"{evenly}a capture on its machine tells the two apart (hil doctor capture)"
    if whose is Whose.WIRE and same_machine:
        why += "; both ends are on this machine, so something was put between them (hil impair, tc netem)"
    yield Finding(
        "jitter",
        Severity.FAULT,
        whose,
        f"jitter is larger than the period: {figures}: {side}; {why}",
        (),
        (
            "a cable instead of radio (or iw dev IFACE set power_save off), a network of its own for the robot",
            "no coalescing of interrupts: ethtool -C IFACE rx-usecs 0",
            "on the controller's machine: hil doctor host",
        )
        if whose is not Whose.CONTROLLER
        else _HELPS_CONTROLLER,
    )


def _quality(found: LinkFigures) -> Finding:
    return Finding(
        "quality",
        Severity.WARNING,
        Whose.PEER_OR_WIRE,
        f"the controller says {found.robot}, and needs GOOD to be commanded: too many answers come late or not at all, "
        "or the session is younger than a second",
        (),
        ("see what else is found here; measure longer: --seconds",),
    )


def _drift(found: LinkFigures, ppm: float) -> Finding:
    return Finding(
        "clock-drift",
        Severity.NOTE,
        Whose.PEER_OR_WIRE,
        f"the clocks drift apart: the controller's is {abs(ppm):.0f} ppm {'slow' if ppm > 0 else 'fast'} against this "
        f"host's (to {found.drift_resolution_ppm:.0f} ppm): {abs(ppm) * 0.06:.1f} ms a minute",
        (),
        ("never count its cycles as this host's time: states carry the controller's own time",),
    )


def _round_trip_text(found: LinkFigures) -> str:
    if not found.network.count:
        return f"answers are confirmed after {_ms(found.round_trip.quantile(0.5))}, the wait for a message included"
    return (
        f"round trip {_ms(found.network.quantile(0.5))} (p99 {_ms(found.network.quantile(0.99))}) beside the wait for "
        f"the controller's cycle of {found.cycle_ns / 1e6:g} ms"
    )


def _loss_text(found: LinkFigures) -> str:
    lost = max(0, found.states_lost - found.dropped_here)
    if not lost and not found.requests_lost:
        return f"none of {found.states_sent} {found.down} and {found.requests_sent} {found.up} was lost"
    return (
        f"{_percent(found.down_lost_share)} of what the controller sent was lost ({lost} of {found.states_sent} "
        f"{found.down}), {_percent(found.up_lost_share)} of what this host sent ({found.requests_lost} of "
        f"{found.requests_sent} {found.up})"
    )


def _context(found: LinkFigures) -> tuple[str, ...]:
    lines = []
    if found.cycle_late.count:
        lines.append(
            f"{found.cycle_late.count} of {found.answered} answers show their cycle late, by at most "
            f"{_ms(found.cycle_late.maximum)}"
        )
    if found.overtaken:
        lines.append(
            f"{found.overtaken} {found.up} were not confirmed, the next of the {found.down} came right after them"
        )
    if found.states_duplicate or found.states_reordered:
        lines.append(f"{found.states_duplicate} {found.down} came twice, {found.states_reordered} out of order")
    if found.drift_ppm is not None:
        resolution = f"{found.drift_resolution_ppm:.1f} ppm"
        if abs(found.drift_ppm) <= found.drift_resolution_ppm:
            lines.append(f"no drift of the clocks is seen, to {resolution}")
        else:
            way = "slow" if found.drift_ppm > 0 else "fast"
            lines.append(f"the controller's clock is {abs(found.drift_ppm):.1f} ppm {way}, to {resolution}")
    if found.clock_ahead_ns is not None:
        lines.append(
            f"the controller's time of day is {_time(abs(found.clock_ahead_ns))} "
            f"{'ahead of' if found.clock_ahead_ns >= 0 else 'behind'} this host's, to {_ms(found.clock_resolution_ns)}"
        )
    return tuple(lines)


def _times_table(found: LinkFigures) -> EvidenceTable:
    rows = (
        ("round trip", found.round_trip),
        ("- of it, at the controller: its cycle, and answers lost", found.cycle_wait),
        ("- the rest: both ways, and the controller's lateness", found.network),
        (f"jitter of {found.down}, controller to this host", found.jitter_down),
        (f"jitter of {found.up}, this host to controller", found.jitter_up),
        ("this host: from the kernel to the program", found.waited_here),
        ("this host: timer woke it late", found.send_late),
    )
    title = (
        f"{found.seconds:.1f} s with {found.software}, {found.robot}: {found.down} every {found.period_ns / 1e6:g} ms"
    )
    return EvidenceTable(
        title,
        ("ms", "p50", "p99", "p99.9", "max"),
        tuple((name, *_numbers(times)) for name, times in rows if times.count),
    )


def _packets_table(found: LinkFigures) -> EvidenceTable:
    return EvidenceTable(
        "packets",
        ("way", "sent", "lost", "of them dropped by this host", "twice", "out of order"),
        (
            (
                f"{found.down}, controller to this host",
                *map(str, (found.states_sent, found.states_lost, found.dropped_here)),
                *map(str, (found.states_duplicate, found.states_reordered)),
            ),
            (f"{found.up}, this host to controller", str(found.requests_sent), str(found.requests_lost), "-", "-", "-"),
        ),
    )


def _numbers(times: Histogram) -> tuple[str, ...]:
    return tuple(f"{(times.quantile(share) or 0) / 1e6:.3f}" for share in (0.5, 0.99, 0.999, 1.0))


def _figures(found: LinkFigures) -> dict[str, Figure]:
    times = {
        "round_trip": found.round_trip,
        "cycle_wait": found.cycle_wait,
        "network": found.network,
        "jitter_down": found.jitter_down,
        "jitter_up": found.jitter_up,
        "waited_here": found.waited_here,
    }
    quantiles = {
        f"{name}_{label}_ms": round((histogram.quantile(share) or 0) / 1e6, 4)
        for name, histogram in times.items()
        if histogram.count
        for label, share in (("p50", 0.5), ("p99", 0.99), ("max", 1.0))
    }
    return {
        "seconds": round(found.seconds, 3),
        "period_ms": found.period_ns / 1e6,
        "cycle_ms": found.cycle_ns / 1e6,
        "states_sent": found.states_sent,
        "states_lost": found.states_lost,
        "states_dropped_here": found.dropped_here,
        "states_duplicate": found.states_duplicate,
        "states_reordered": found.states_reordered,
        "requests_sent": found.requests_sent,
        "requests_lost": found.requests_lost,
        "drift_ppm": None if found.drift_ppm is None else round(found.drift_ppm, 2),
        **quantiles,
    }


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 0.1 else f"{100 * share:.1f} %"


def _time(value_ns: int) -> str:
    return f"{value_ns / 1e9:.3f} s" if value_ns >= 1_000_000_000 else _ms(value_ns)


def _ms(value_ns: int | None) -> str:
    return "-" if value_ns is None else f"{value_ns / 1e6:.2f} ms"
