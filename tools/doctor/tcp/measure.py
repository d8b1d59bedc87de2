"""Measure small messages to a responder or an echo server, case by case, each on a connection of its own."""

import platform
from collections.abc import Callable, Sequence

from hil.clock import Deadline
from hil.values.link import Address
from tools.doctor.tcp.cases import ECHO_CASES, RESPONDER_CASES, Case, CaseResult, Exchange, Measured
from tools.doctor.tcp.connection import Connection, Trip
from transport.tcp import PeerSettings, Reply, Request

COUNT_MOST = 200
"""Round trips of each case; the responder lets no peer have many more."""
TOTAL_S = 5.5
"""What all cases together may take, the last round trip of each apart."""
_LEAST = 3
_WARM_UP = 4
_WARM_UP_S = 0.05
_ECHO_PART = bytes(range(32))
_NS_TO_MS = 1e-6

Progress = Callable[[str, int, int], None]
"""Told the case, how many cases are done, and how many there are."""


def measure_responder(address: Address, *, count: int, timeout_s: float, progress: Progress) -> Measured:
    """Measure all cases; raise HilError where the peer is no responder."""
    with Connection(address, timeout_s=timeout_s) as connection:
        greeting = connection.greeting()
        connect_ms, kernel = connection.connect_ms, connection.kernel()

    def one(case: Case, budget: Deadline) -> CaseResult:
        return _responder_case(address, case, count=count, timeout_s=timeout_s, budget=budget)

    results, left_out = _all_cases(RESPONDER_CASES, one, progress)
    return Measured(
        peer=str(address),
        here=platform.system(),
        there=greeting.system,
        connect_ms=connect_ms,
        results=results,
        left_out=left_out,
        kernel_round_trip_ms=None if kernel is None else kernel.round_trip_ms,
    )


def measure_echo(address: Address, *, count: int, timeout_s: float, progress: Progress) -> Measured:
    """Measure an echo server; raise HilError where the peer is none."""
    with Connection(address, timeout_s=timeout_s) as connection:
        connect_ms, kernel = connection.connect_ms, connection.kernel()

    def one(case: Case, budget: Deadline) -> CaseResult:
        return _echo_case(address, case, count=count, timeout_s=timeout_s, budget=budget)

    results, left_out = _all_cases(ECHO_CASES, one, progress)
    return Measured(
        peer=str(address),
        here=platform.system(),
        there="",
        connect_ms=connect_ms,
        results=results,
        left_out=left_out,
        echo=True,
        kernel_round_trip_ms=None if kernel is None else kernel.round_trip_ms,
    )


def _all_cases(
    cases: Sequence[Case], one: Callable[[Case, Deadline], CaseResult], progress: Progress
) -> tuple[tuple[CaseResult, ...], tuple[Case, ...]]:
    total = Deadline(TOTAL_S)
    results: list[CaseResult] = []
    for number, case in enumerate(cases):
        left_s = total.left_s() or 0.0
        # Without the first case there is nothing to compare with.
        if results and left_s <= 0.0:
            return tuple(results), tuple(cases[number:])
        progress(case.name, number, len(cases))
        results.append(one(case, Deadline(left_s / (len(cases) - number))))
    return tuple(results), ()


def _responder_case(address: Address, case: Case, *, count: int, timeout_s: float, budget: Deadline) -> CaseResult:
    result = CaseResult(case)
    with Connection(address, timeout_s=timeout_s) as connection:
        connection.greeting()
        reply, as_is = _warm_up(connection, case)
        result.nagle_there = not reply.settings.no_delay
        if reply.settings.after(case.wishes) != reply.settings:
            result.not_done = "it refused"
        elif case.asked and reply.settings == as_is:
            result.not_done = "it is so"
        if result.not_done:
            return result
        connection.set_no_delay(case.no_delay)
        first = _sent_again(connection, reply)
        sequence = _WARM_UP
        while _goes_on(result, count, budget):
            sequence += 1
            reply, trip = connection.ask(Request(sequence, case.wishes), writes=case.writes)
            result.add(_exchange(trip, reply))
        result.retransmissions = (_sent_again(connection, reply) - first) % (1 << 16)
    return result


def _warm_up(connection: Connection, case: Case) -> tuple[Reply, PeerSettings]:
    """Talk until both kernels take the connection for a dialogue; return the last reply, and what held before wishes.

    A Linux connection begins by acknowledging everything at once (quick-ack mode), and ends that when its side has
    answered, once (Linux 4.x, 5.19 and newer) or three times (5.1 to 5.18). Measured on 6.18: without this the first
    exchange of a connection is not delayed, all others are.
    """
    budget = Deadline(_WARM_UP_S)
    connection.set_no_delay(True)
    as_is = connection.ask(Request(0), writes=1)[0].settings
    for sequence in range(1, _WARM_UP):
        reply, _ = connection.ask(Request(sequence, case.wishes), writes=1)
        if (budget.left_s() or 0.0) <= 0.0:
            break
    return reply, as_is


def _echo_case(address: Address, case: Case, *, count: int, timeout_s: float, budget: Deadline) -> CaseResult:
    result = CaseResult(case)
    parts = (_ECHO_PART[:16], _ECHO_PART[16:]) if case.writes == 2 else (_ECHO_PART,)
    with Connection(address, timeout_s=timeout_s) as connection:
        connection.set_no_delay(True)
        warm_up = Deadline(_WARM_UP_S)
        for _ in range(_WARM_UP):
            connection.echo((_ECHO_PART,))
            if (warm_up.left_s() or 0.0) <= 0.0:
                break
        connection.set_no_delay(case.no_delay)
        kernel = connection.kernel()
        while _goes_on(result, count, budget):
            trip = connection.echo(parts)
            result.add(
                Exchange(
                    total_ms=(trip.complete_ns - trip.began_ns) * _NS_TO_MS,
                    held_there_ms=(trip.complete_ns - max(trip.first_byte_ns, trip.wrote_last_ns)) * _NS_TO_MS,
                )
            )
        after = connection.kernel()
        if kernel is not None and after is not None:
            result.retransmissions = after.retransmissions - kernel.retransmissions
    return result


def _goes_on(result: CaseResult, count: int, budget: Deadline) -> bool:
    done = result.total.count
    return done < count and (done < min(_LEAST, count) or (budget.left_s() or 0.0) > 0.0)


def _exchange(trip: Trip, reply: Reply) -> Exchange:
    written_apart_ns = trip.wrote_last_ns - trip.began_ns
    return Exchange(
        total_ms=(trip.complete_ns - trip.began_ns) * _NS_TO_MS,
        held_here_ms=max(0, reply.parts_apart_ns - written_apart_ns) * _NS_TO_MS,
        held_there_ms=(trip.complete_ns - trip.first_byte_ns) * _NS_TO_MS,
        thought_ms=reply.thought_ns * _NS_TO_MS,
    )


def _sent_again(connection: Connection, reply: Reply) -> int:
    kernel = connection.kernel()
    return reply.retransmissions + (0 if kernel is None else kernel.retransmissions)
