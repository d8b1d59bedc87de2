"""From what was seen of a TCP connection to sentences: a function of the figures alone."""

from collections.abc import Iterator
from typing import Final

from hil.client.servo.statistic_timer import StatisticTimer
from hil.values.finding import Figure, Finding, Severity, Whose, worst_first
from tools.doctor.capture.tcp.connection import Connection
from tools.doctor.capture.tcp.direction import Direction, Stall
from tools.doctor.capture.tcp.sides import Side, client_of, server_of
from tools.doctor.capture.tcp.vantage import Beside, beside, vantage_words
from tools.doctor.tcp.remedies import nagle_remedies, sender_remedies
from tools.doctor.tcp.verdict import ALLOWED_MEAN_MS, delay_words

_LATE_MS: Final = 20.0
_CERTAIN_STALLS: Final = 3
"""One or two may be chance: a program that sends again just then."""
_STALLED_THROUGHOUT: Final = 0.2
"""Share of segments from which on stalls set the rate: a message in five parts has one stall."""
_OFTEN_RESENT: Final = 3
_RESENT_IN_ORDER: Final = 0.01
"""Share of segments sent again above which a network is not in order."""
_NS_PER_MS: Final = 1e6


def findings_of(connection: Connection) -> list[Finding]:
    """Return what was found of one connection, the worst first; a healthy one gives one good finding."""
    found = [*_opening(connection)]
    client, server = client_of(connection), server_of(connection)
    for direction, sender, acknowledger in (
        (connection.requests, client, server),
        (connection.replies, server, client),
    ):
        found.extend(_of_direction(connection, direction, sender, acknowledger))
    found.extend(_late_answers(connection))
    found = worst_first(found)
    if not found or found[0].severity is Severity.NOTE:
        found[:0] = _healthy(connection, noted=bool(found))
    return found


def _opening(connection: Connection) -> Iterator[Finding]:
    known = connection.handshake
    client, server = client_of(connection), server_of(connection)
    if known.refused:
        yield Finding(
            kind="tcp-refused",
            severity=Severity.FAULT,
            whose=Whose.PEER,
            sentence=f"{server} refused the connection of {client} (packet {connection.first_number}): no program "
            f"listens there, or a firewall answers for it",
        )
    elif known.syn is not None and known.syn_ack is None and known.syns > 1 and not connection.segments:
        yield Finding(
            kind="tcp-no-answer",
            severity=Severity.FAULT,
            whose=Whose.PEER_OR_WIRE,
            sentence=f"{server} never answered {client}, which asked for a connection {known.syns} times from packet "
            f"{connection.first_number} on: the address is wrong, the host is off, or a firewall drops it",
        )
    round_trip_ns = known.round_trip_ns
    if round_trip_ns is not None and round_trip_ns / _NS_PER_MS > ALLOWED_MEAN_MS:
        yield Finding(
            kind="tcp-slow-wire",
            severity=Severity.WARNING,
            whose=Whose.WIRE,
            sentence=f"the wire between {client} and {server} takes {_ms(round_trip_ns)} for a round trip (handshake "
            f"of packet {connection.first_number}), where an update may take {ALLOWED_MEAN_MS:g} ms: no setting of TCP "
            f"makes it shorter",
            figures={"round_trip_ms": round(round_trip_ns / _NS_PER_MS, 3)},
        )


def _of_direction(connection: Connection, direction: Direction, sender: Side, acknowledger: Side) -> Iterator[Finding]:
    if direction.holds:
        yield _nagle(connection, direction, sender, acknowledger)
    elif direction.unclear.count >= _CERTAIN_STALLS and not direction.unheld:
        yield _nagle_or_wire(direction, sender, acknowledger)
    if direction.closed_windows.count:
        yield _closed_window(direction, sender, acknowledger)
    if direction.resent.count:
        yield _resent(connection, direction, sender, acknowledger)
    if direction.missed:
        yield Finding(
            kind="tcp-not-captured",
            severity=Severity.NOTE,
            whose=Whose.NOBODY,
            sentence=f"the capture lacks data of {sender}: {acknowledger} acknowledged more than was captured "
            f"{_times(direction.missed)}, so what is said of this side is less certain",
            figures={"times": direction.missed},
        )
    if direction.reset_by:
        yield Finding(
            kind="tcp-reset",
            severity=Severity.NOTE,
            whose=Whose.PEER,
            sentence=f"{sender} ended the connection with {acknowledger} at once (reset in packet "
            f"{direction.reset_by}): its program closed it with data unread, or ended",
        )
    in_parts = connection.requests_in_parts if direction is connection.requests else connection.replies_in_parts
    if direction.unheld or direction.holds:
        return
    if direction.held.count >= _CERTAIN_STALLS:
        yield _held(direction, sender, acknowledger)
    elif in_parts:
        yield _in_parts(in_parts, sender, acknowledger)


def _nagle(connection: Connection, direction: Direction, sender: Side, acknowledger: Side) -> Finding:
    stalls, delays = direction.stalls, direction.delays
    certain = stalls.count >= _CERTAIN_STALLS
    rate = 1000.0 / stalls.mean_ms
    nearly_always = stalls.count >= direction.segments * _STALLED_THROUGHOUT
    cost = (
        f"that leaves at most {rate:.0f} exchanges a second" if nearly_always else f"each cost {stalls.mean_ms:.1f} ms"
    )
    evidence = [
        f"stalls of {sender}: {stalls}",
        *(_stall_words(stall, sender, acknowledger) for stall in direction.examples),
        *_exchange_words(connection),
        *vantage_words(connection),
    ]
    if direction.unheld:
        evidence.append(f"from packet {direction.first_unheld} on {sender} held nothing back any more")
    if direction.own_pace:
        evidence.append(f"{_times(direction.own_pace)} it sent later than that, at its own pace: not counted")
    if not certain:
        evidence.append(f"seen {_times(stalls.count)} only: that may be chance")
    return Finding(
        kind="tcp-nagle",
        severity=Severity.FAULT if certain else Severity.WARNING,
        whose=Whose.CONFIGURATION,
        sentence=f"{sender} {'needs' if certain else 'may need'} TCP_NODELAY: {_times(stalls.count)} in "
        f"{direction.segments} segments it held data back (Nagle's algorithm) until {acknowledger}, which acknowledges "
        f"{delay_words(delays.mean_ms)}, had acknowledged what went before; {cost}",
        evidence=tuple(evidence),
        remedies=nagle_remedies(sender=str(sender), acknowledger=str(acknowledger)),
        figures={
            "sender": sender.address,
            "acknowledger": acknowledger.address,
            "stalls": stalls.count,
            "segments": direction.segments,
            "exchanges_per_s": round(rate, 1),
            "delay_mean_ms": round(delays.mean_ms, 3),
            "first_packet": direction.examples[0].number,
            **_figures("stall", stalls),
        },
    )


def _nagle_or_wire(direction: Direction, sender: Side, acknowledger: Side) -> Finding:
    waits = direction.unclear
    return Finding(
        kind="tcp-nagle-or-wire",
        severity=Severity.WARNING,
        whose=Whose.PEER_OR_WIRE,
        sentence=f"{sender} waits {_times(waits.count)} for an acknowledgement of {acknowledger}, {waits.mean_ms:.1f} "
        f"ms on average: delayed acknowledgements or a wire this long, which a capture without the connection's "
        f"beginning cannot tell",
        evidence=(f"waits of {sender}: {waits}",),
        remedies=(
            "capture again from before the connection is made: the handshake has the wire's own time",
            *nagle_remedies(sender=str(sender), acknowledger=str(acknowledger)),
        ),
        figures={"sender": sender.address, "acknowledger": acknowledger.address, **_figures("wait", waits)},
    )


def _closed_window(direction: Direction, sender: Side, acknowledger: Side) -> Finding:
    closed = direction.closed_windows
    return Finding(
        kind="tcp-zero-window",
        severity=Severity.WARNING if closed.max_ms >= _LATE_MS else Severity.NOTE,
        whose=Whose.PEER,
        sentence=f"the program at {acknowledger} does not read: its receive buffer was full {_times(closed.count)}, up "
        f"to {closed.max_ms:.1f} ms, first in packet {direction.first_closed}, and {sender} had to wait",
        evidence=(f"full buffer at {acknowledger}: {closed}",),
        remedies=(f"read what arrives at {acknowledger} in a loop or thread of its own; send less from {sender}",),
        figures={"first_packet": direction.first_closed, **_figures("closed", closed)},
    )


def _resent(connection: Connection, direction: Direction, sender: Side, acknowledger: Side) -> Finding:
    resent = direction.resent
    share = resent.count / max(direction.segments, 1)
    often = resent.count >= _OFTEN_RESENT and (resent.max_ms >= _LATE_MS or share > _RESENT_IN_ORDER)
    timeouts = f", {direction.timeouts} of them after a timeout" if direction.timeouts else ""
    arrived = not direction.resent_unseen and _is_beside(connection, acknowledger)
    if direction.resent_unseen:
        why = "packets are lost on the wire"
    elif arrived:
        why = "they had arrived, so their acknowledgements were lost on the wire or came too late"
    else:
        why = "they, or their acknowledgements, were lost on the wire or came too late"
    return Finding(
        kind="tcp-retransmission",
        severity=Severity.WARNING if direction.timeouts or often else Severity.NOTE,
        whose=Whose.PEER_OR_WIRE if arrived else Whose.WIRE,
        sentence=f"{sender} sent {resent.count} of {direction.segments} segments to {acknowledger} again{timeouts}, "
        f"the first in packet {direction.first_resent}, the longest silence before was {resent.max_ms:.1f} ms: {why}",
        evidence=(
            f"silence before what was sent again: {resent}",
            *_overtaken(direction),
            *vantage_words(connection),
        ),
        remedies=("look at cables, switches and the error counters of both network cards (Linux: ip -s link)",),
        figures={
            "timeouts": direction.timeouts,
            "segments": direction.segments,
            "lost_before_capture": direction.resent_unseen,
            "first_packet": direction.first_resent,
            **_figures("silence", resent),
        },
    )


def _is_beside(connection: Connection, side: Side) -> bool:
    where = beside(connection)
    return where is Beside.BOTH or where is (Beside.CLIENT if side.role == "client" else Beside.SERVER)


def _overtaken(direction: Direction) -> Iterator[str]:
    if direction.overtaken:
        yield f"{direction.overtaken} segments were overtaken on the way, which costs little"


def _held(direction: Direction, sender: Side, acknowledger: Side) -> Finding:
    held = direction.held
    return Finding(
        kind="tcp-held",
        severity=Severity.WARNING if held.mean_ms > ALLOWED_MEAN_MS else Severity.NOTE,
        whose=Whose.APPLICATION,
        sentence=f"{sender} holds small segments back until {acknowledger} acknowledges the one before (Nagle's "
        f"algorithm), {_times(held.count)} in {direction.segments} segments, {held.mean_ms:.2f} ms on average: "
        f"TCP_NODELAY ends that, and 40 to 200 ms more wherever {acknowledger} delays an acknowledgement",
        evidence=(f"held back: {held}",),
        remedies=sender_remedies(str(sender)),
        figures={"sender": sender.address, "segments": direction.segments, **_figures("held", held)},
    )


def _in_parts(in_parts: int, sender: Side, acknowledger: Side) -> Finding:
    return Finding(
        kind="tcp-message-in-parts",
        severity=Severity.NOTE,
        whose=Whose.APPLICATION,
        sentence=f"{sender} writes a message in small parts ({_times(in_parts)}): without TCP_NODELAY the second part "
        f"waits for the acknowledgement of the first, which costs 40 to 200 ms as soon as {acknowledger} delays it",
        remedies=sender_remedies(str(sender)),
        figures={"sender": sender.address, "messages": in_parts},
    )


def _late_answers(connection: Connection) -> Iterator[Finding]:
    thinking = connection.thinking
    median_ms, late_ms = thinking.quantile_ms(0.5), thinking.quantile_ms(0.99)
    mostly = median_ms > ALLOWED_MEAN_MS
    if not mostly and late_ms < _LATE_MS:
        return
    server, client = server_of(connection), client_of(connection)
    # An answer that was lost before the capture looks like one that was given late, but it cannot be most of them.
    told_apart = mostly or _is_beside(connection, server)
    took = (
        f"{thinking.timer.mean_ms:.1f} ms on average and up to {thinking.timer.max_ms:.1f} ms from a request of "
        f"{client} to the answer"
    )
    if told_apart:
        often = "" if mostly else " now and then"
        sentence = (
            f"the program at {server} takes its time{often}: {took}, with nothing held back or seen to be lost on the "
            f"way: the peer's application"
        )
    else:
        sentence = (
            f"now and then the program at {server} takes its time, or an answer is lost on the way: {took}; a capture "
            f"beside {server} would tell"
        )
    yield Finding(
        kind="tcp-slow-program" if told_apart else "tcp-late-answers",
        severity=Severity.WARNING if mostly else Severity.NOTE,
        whose=Whose.PEER if told_apart else Whose.PEER_OR_WIRE,
        sentence=sentence,
        evidence=(f"thinking time at {server}: {thinking}", *_exchange_words(connection), *vantage_words(connection)),
        figures={
            "p50_ms": round(median_ms, 3),
            "p99_ms": round(late_ms, 3),
            **_figures("thinking", thinking.timer),
        },
    )


def _healthy(connection: Connection, *, noted: bool) -> Iterator[Finding]:
    if connection.handshake.refused or not connection.segments:
        return
    server, client = server_of(connection), client_of(connection)
    rounds = connection.first_answers
    if rounds.count:
        seen = f"{server} answers {client}, half of the time within {rounds.quantile_ms(0.5):.2f} ms, {rounds}"
    else:
        seen = (
            f"{client} sent {connection.requests.segments} segments with data to {server}, which sent "
            f"{connection.replies.segments} unasked"
        )
    yield Finding(
        kind="tcp-healthy",
        severity=Severity.GOOD,
        whose=Whose.NOBODY,
        sentence=f"{seen}: {'in order, but for what is noted' if noted else 'nothing was held back, lost or late'}",
        evidence=(*_exchange_words(connection), *_not_held(connection), *vantage_words(connection)),
        figures={
            "client": client.address,
            "server": server.address,
            **_figures("round_trip", rounds.timer),
        },
    )


def _not_held(connection: Connection) -> Iterator[str]:
    for direction, sender, in_parts in (
        (connection.requests, client_of(connection), connection.requests_in_parts),
        (connection.replies, server_of(connection), connection.replies_in_parts),
    ):
        if direction.unheld >= _CERTAIN_STALLS:
            parts = f"; {in_parts} of its messages are in small parts, and one write each would be better" * bool(
                in_parts
            )
            yield (
                f"{sender} sends small segments without waiting for acknowledgements ({_times(direction.unheld)}"
                f", first in packet {direction.first_unheld}): TCP_NODELAY is set there{parts}"
            )


def _exchange_words(connection: Connection) -> Iterator[str]:
    rounds, whole = connection.first_answers, connection.whole_answers
    if rounds.count:
        yield (
            f"{client_of(connection)} asks, {server_of(connection)} answers: {rounds}, half of them within "
            f"{rounds.quantile_ms(0.5):.2f} ms, 99 % within {rounds.quantile_ms(0.99):.2f} ms"
        )
    if whole.count and whole.timer.mean_ms > rounds.timer.mean_ms * 1.1:
        yield f"until the answer's last segment: {whole}"


def _stall_words(stall: Stall, sender: Side, acknowledger: Side) -> str:
    before, freed = stall.before, stall.acknowledged
    return (
        f"packet {before.number}: {_bytes(before.size)} of {sender}; packet {freed.number}: {acknowledger} "
        f"acknowledges them {_ms(freed.waited_ns)} later, without data; packet {stall.number}: "
        f"{stall.released_ns / 1000:.0f} us after that {sender} sends the next {_bytes(stall.size)}"
    )


def _figures(what: str, times: StatisticTimer) -> dict[str, Figure]:
    return {
        f"{what}_count": times.count,
        f"{what}_min_ms": round(times.min_ms, 3),
        f"{what}_mean_ms": round(times.mean_ms, 3),
        f"{what}_max_ms": round(times.max_ms, 3),
        f"{what}_std_dev_ms": round(times.standard_deviation_ms, 3),
    }


def _ms(time_ns: float) -> str:
    return f"{time_ns / _NS_PER_MS:.1f} ms" if time_ns >= 1e5 else f"{time_ns / 1000:.0f} us"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _bytes(size: int) -> str:
    return "1 byte" if size == 1 else f"{size} bytes"
