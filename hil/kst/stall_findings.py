"""From what was seen of a KST connection to sentences: a function of the figures alone."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

from hil.values.finding import Figure, Finding, Severity, Whose, worst_first

SEVERAL: Final = 3
"""One or two may be chance."""
_MANY: Final = 10
_THROUGHOUT: Final = 0.2
"""Share of all messages from which on stalls set the rate."""
_FOR_ONE: Final = 2
"""So many times as often as it went otherwise it has to be seen."""
ALLOWED_ROUND_TRIP_MS: Final = 5.0
"""Manual 11.1: what an update of the real-time data may require on average."""
_RESENT_SHARE: Final = 0.01
_PACE_LEAST: Final = 100
_PACE_MS: Final = (10.0, 500.0)
"""A program's own time between a reply and its next request that is worth a note; a person is slower."""
_NO_DELAY: Final = (
    "the client: set TCP_NODELAY on its connection (Python: sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, "
    "1); Java: socket.setTcpNoDelay(true); Matlab: tcpclient(..., EnableTransferDelay=false))"
)
_ONE_WRITE: Final = "the client: write each request with one call, its line end included"
_ANSWERED: Final = (
    "the client: stream with a command that is answered (jp_ for jf_, DcSeCarJP_ for DcSeCar_), and read the answers"
)
_CABINET_TOO: Final = "neither is the server's to change, here or on a Cabinet: its system delays acknowledgements too"


@dataclass(frozen=True, slots=True)
class Waits:
    """Stalls of one kind."""

    count: int = 0
    median_ms: float = 0.0
    longest_ms: float = 0.0
    delay_ms: float = 0.0
    """Median delay of the acknowledgements that were waited for."""
    lines: int = 0
    """Requests that came with them."""
    prompt: int = 0
    """Times that the same was done and nothing waited."""
    against: int = 0
    """Times that the same was done and the wait was the program's own."""

    @property
    def is_certain(self) -> bool:
        """Whether it was seen so often that it is no chance."""
        return self.count >= SEVERAL and self.count >= _FOR_ONE * self.against

    def severity(self, of: int) -> Severity:
        """Return how bad it is, among ``of`` messages."""
        return Severity.FAULT if self.count >= max(_MANY, _THROUGHOUT * of) else Severity.WARNING


class Seen(NamedTuple):
    """What was seen of a connection."""

    parts: Waits = Waits()
    bursts: Waits = Waits()
    full: Waits = Waits()
    """Bursts that filled segments, which wait for no acknowledgement."""
    held: Waits = Waits()
    nagle: bool = False
    requests: int = 0
    replies: int = 0
    least_round_trip_ms: float = 0.0
    retransmissions: int = 0
    """Segments of this side that were sent again."""
    pace_count: int = 0
    pace_median_ms: float = 0.0
    """From a reply to the client's next request."""


def findings_of(seen: Seen) -> list[Finding]:
    """Return what can be said, the worst first; nothing where all is well."""
    return worst_first((*_parts(seen), *_bursts(seen), *_full_bursts(seen), *_held(seen), *_wire(seen), *_notes(seen)))


def late_words(delay_ms: float) -> str:
    """Return how late an acknowledgement is, and which system is known for that."""
    if 25.0 <= delay_ms < 80.0:
        return f"about {delay_ms:.0f} ms late, as Linux does (40 ms)"
    if 150.0 <= delay_ms < 280.0:
        return f"about {delay_ms:.0f} ms late, as Windows does (200 ms)"
    return f"about {delay_ms:.0f} ms late"


def _parts(seen: Seen) -> Iterator[Finding]:
    parts = seen.parts
    if not parts.is_certain:
        return
    yield Finding(
        kind="kst-request-in-parts",
        severity=parts.severity(seen.requests),
        whose=Whose.PEER,
        sentence=(
            f"the client has to set TCP_NODELAY or to write a request in one piece: {parts.count} of {seen.requests} "
            f"requests came in parts, the rest {parts.median_ms:.1f} ms after the beginning, when this side's delayed "
            f"acknowledgement had left (the client's Nagle algorithm waits for it); that leaves at most "
            f"{1000.0 / parts.median_ms:.0f} requests a second"
        ),
        evidence=(
            (
                f"the rest of a request came after {_waits(parts)}; an acknowledgement without data left before it "
                f"each time, {late_words(parts.delay_ms)}"
            ),
            *_otherwise(parts, "requests in parts"),
            _way(seen),
        ),
        remedies=(_NO_DELAY, _ONE_WRITE, _CABINET_TOO),
        figures=_figures(parts) | {"requests": seen.requests, "requests_per_s_at_most": _per_s(parts.median_ms)},
    )


def _bursts(seen: Seen) -> Iterator[Finding]:
    bursts = seen.bursts
    if not bursts.is_certain:
        return
    at_a_time = bursts.lines / bursts.count
    sent_per_s = at_a_time * 1000.0 / bursts.median_ms
    yield Finding(
        kind="kst-stream-in-bursts",
        severity=bursts.severity(round(seen.requests / at_a_time)),
        whose=Whose.PEER,
        sentence=(
            f"the client has to set TCP_NODELAY: {bursts.count} times its requests without replies came "
            f"{at_a_time:.0f} at a time after {bursts.median_ms:.1f} ms of silence, when this side's delayed "
            f"acknowledgement had left (the client's Nagle algorithm collects them until then); the arm gets "
            f"{1000.0 / bursts.median_ms:.0f} set-points a second then, of the {sent_per_s:.0f} that are sent"
        ),
        evidence=(
            (
                f"silence before a burst: {_waits(bursts)}; an acknowledgement without data left before it each time, "
                f"{late_words(bursts.delay_ms)}, and fewer segments than requests came"
            ),
            *_otherwise(bursts, "bursts"),
            _way(seen),
        ),
        remedies=(
            _NO_DELAY,
            _ANSWERED,
            _CABINET_TOO,
        ),
        figures=_figures(bursts) | {"requests_at_a_time": round(at_a_time, 1), "sent_per_s": round(sent_per_s, 1)},
    )


def _full_bursts(seen: Seen) -> Iterator[Finding]:
    full = seen.full
    if full.count < SEVERAL or seen.bursts.is_certain:
        return
    at_a_time = full.lines / full.count
    yield Finding(
        kind="kst-bursts-unclear",
        severity=Severity.WARNING,
        whose=Whose.PEER,
        sentence=(
            f"{full.count} times requests without replies came {at_a_time:.0f} at a time, in full segments after "
            f"{full.median_ms:.1f} ms of silence: the client's Nagle algorithm collects them, or its program writes "
            f"them at once; TCP_NODELAY there tells which"
        ),
        evidence=(f"silence before a burst: {_waits(full)}", _way(seen)),
        remedies=(_NO_DELAY, _ANSWERED),
        figures=_figures(full) | {"requests_at_a_time": round(at_a_time, 1)},
    )


def _held(seen: Seen) -> Iterator[Finding]:
    held = seen.held
    if not held.is_certain or not seen.nagle:
        return
    yield Finding(
        kind="kst-reply-held",
        severity=held.severity(seen.replies),
        whose=Whose.CONTROLLER,
        sentence=(
            f"this server's Nagle algorithm (--kst-nagle) held {held.count} of {seen.replies} replies back for "
            f"{held.median_ms:.1f} ms, until the client, which acknowledges {late_words(held.delay_ms)}, had "
            f"acknowledged the reply before; a Cabinet's server does the same with a motion's second reply"
        ),
        evidence=(
            f"held: {_waits(held)}; the kernel told that bytes had not left while a reply was not acknowledged",
            *_otherwise(held, "replies that followed another"),
            _way(seen),
        ),
        remedies=(
            "here: run without --kst-nagle, TCP_NODELAY is the default",
            (
                "on a Cabinet the server cannot be changed: a client on Linux sets TCP_QUICKACK after every receive "
                "(Linux takes it back), one on Windows has TcpAckFrequency 1 in the registry of its adapter (manual "
                "11.1; see hil doctor tcp)"
            ),
            "the client: do not time a motion by its second reply; it may be as late as that",
        ),
        figures=_figures(held) | {"replies": seen.replies},
    )


def _wire(seen: Seen) -> Iterator[Finding]:
    way_ms = seen.least_round_trip_ms
    if way_ms > ALLOWED_ROUND_TRIP_MS and seen.requests >= SEVERAL:
        yield Finding(
            kind="kst-slow-wire",
            severity=Severity.WARNING,
            whose=Whose.WIRE,
            sentence=(
                f"the wire to the client takes {way_ms:.1f} ms for a round trip at least, which leaves at most "
                f"{1000.0 / way_ms:.0f} requests a second to a program that waits for replies; no setting of TCP makes "
                f"it shorter"
            ),
            remedies=("a cable instead of wireless, fewer hops, no VPN; ping measures the way itself",),
            figures={"least_round_trip_ms": round(way_ms, 3)},
        )
    again = seen.retransmissions
    if again >= SEVERAL and again >= _RESENT_SHARE * seen.replies:
        yield Finding(
            kind="kst-retransmissions",
            severity=Severity.WARNING,
            whose=Whose.WIRE,
            sentence=(
                f"{again} segments to the client were sent again, for {seen.replies} replies: they or their "
                f"acknowledgements were lost on the wire; each costs 200 ms or more where nothing follows it"
            ),
            remedies=("look at cables, switches and the error counters of both network cards (Linux: ip -s link)",),
            figures={"count": again, "replies": seen.replies},
        )


def _notes(seen: Seen) -> Iterator[Finding]:
    if not seen.parts.is_certain and seen.parts.prompt >= SEVERAL:
        yield Finding(
            kind="kst-parts-not-held",
            severity=Severity.NOTE,
            whose=Whose.APPLICATION,
            sentence=(
                f"the client writes requests in parts ({seen.parts.prompt} times) and none waited: either its "
                f"TCP_NODELAY is set, or acknowledgements came in time; without it, each costs 40 ms or more as soon "
                f"as one is delayed"
            ),
            remedies=(_ONE_WRITE,),
            figures={"count": seen.parts.prompt},
        )
    least_ms, most_ms = _PACE_MS
    own_ms = seen.pace_median_ms - seen.least_round_trip_ms
    if seen.pace_count >= _PACE_LEAST and least_ms <= own_ms <= most_ms and not seen.parts.is_certain:
        yield Finding(
            kind="kst-client-pace",
            severity=Severity.NOTE,
            whose=Whose.APPLICATION,
            sentence=(
                f"the client takes {own_ms:.0f} ms from a reply to its next request, half of the time or more: its own "
                f"loop sets the rate, {1000.0 / seen.pace_median_ms:.0f} a second, and TCP holds nothing back"
            ),
            figures={"pace_median_ms": round(seen.pace_median_ms, 3), "count": seen.pace_count},
        )


def _waits(waits: Waits) -> str:
    return f"{waits.median_ms:.1f} ms (median of {waits.count}, longest {waits.longest_ms:.1f} ms)"


def _otherwise(waits: Waits, what: str) -> Iterator[str]:
    if waits.prompt or waits.against:
        yield f"{what} that did not wait: {waits.prompt}; at the client's own pace, not counted: {waits.against}"


def _way(seen: Seen) -> str:
    return (
        f"least round trip {seen.least_round_trip_ms:.2f} ms (TCP_INFO): not the wire; sent again: "
        f"{seen.retransmissions}"
    )


def _per_s(period_ms: float) -> float:
    return round(1000.0 / period_ms, 1)


def _figures(waits: Waits) -> dict[str, Figure]:
    return {
        "count": waits.count,
        "median_ms": round(waits.median_ms, 3),
        "max_ms": round(waits.longest_ms, 3),
        "delay_ms": round(waits.delay_ms, 3),
    }
