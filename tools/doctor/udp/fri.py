"""The FRI link, from where its client will stand: a client that only mirrors, and times what comes.

It works with any controller that sends, a Cabinet too. What an answer met on its way is not stamped there: only that
the controller took it is known, by the counter its next messages reflect.
"""

from collections.abc import Callable
from typing import Final

from hil.client.fri.errors import NothingHeard
from hil.client.fri.handler import FriHandler
from hil.client.fri.session import ClientSession
from hil.client.fri.state import FriState
from hil.clock import Clock, MonotonicClock
from hil.core.settings import NS_PER_MS
from hil.values.errors import EndpointError
from hil.values.finding import Diagnosis
from hil.values.fri import SEQUENCE_MODULUS, Quality, Release
from hil.values.link import Address
from tools.doctor.udp.figures import LinkFigures, add_way_down
from tools.doctor.udp.opening import ANSWER_WITHIN_S
from tools.doctor.udp.stamped import Gone, Heard, StampedSocket, TimedSocket
from tools.doctor.udp.tally import FriTally
from tools.doctor.udp.verdict import judge
from transport.udp import is_local

SILENCE_NS: Final = 1_500_000_000
LOOK_EVERY_S: Final = 0.1


def diagnose_fri(
    controller: Address,
    *,
    bind: Address,
    release: Release,
    seconds: float,
    answer_within_s: float = ANSWER_WITHIN_S,
    progress: Callable[[float], None] = lambda _: None,
) -> Diagnosis:
    """Be the FRI client at ``bind`` for the controller on ``controller``'s host; ``progress`` gets the seconds.

    Raises :class:`EndpointError` where no monitoring message of ``release`` comes.
    """
    clock = MonotonicClock()
    session = ClientSession(release, FriHandler())
    with StampedSocket(controller, clock, bind=bind) as sock:
        tally = watch_fri(
            sock, session, seconds=seconds, answer_within_s=answer_within_s, clock=clock, bound=bind, progress=progress
        )
        peer = sock.peer
    return judge(fri_figures(tally, session.state, release), controller=peer, same_machine=is_local(peer.host))


def watch_fri(
    sock: TimedSocket,
    session: ClientSession,
    *,
    seconds: float,
    answer_within_s: float,
    clock: Clock,
    bound: Address,
    progress: Callable[[float], None],
) -> FriTally:
    """Answer and book what comes for ``seconds`` from the first message on."""
    one = _Watch(sock, session, clock)
    opened_ns = clock.now_ns()
    while not session.received:
        if clock.now_ns() - opened_ns > answer_within_s * 1e9:
            raise EndpointError(_nothing(session, sock.peer.host, bound, answer_within_s))
        one.step()
    began_ns = clock.now_ns()
    told_s = 0
    while not one.tally.ended_because and (gone_ns := clock.now_ns() - began_ns) < seconds * 1e9:
        if gone_ns // 1_000_000_000 > told_s:
            told_s = gone_ns // 1_000_000_000
            progress(told_s)
        one.step()
    return one.tally


class _Watch:
    def __init__(self, sock: TimedSocket, session: ClientSession, clock: Clock) -> None:
        self.tally = FriTally()
        self._sock, self._session, self._clock = sock, session, clock
        self._heard_ns = clock.now_ns()

    def step(self) -> None:
        """Wait for a datagram for a moment, and answer it if it is a message."""
        try:
            heard = self._sock.receive(LOOK_EVERY_S)
            if heard is not None:
                self._take(heard)
        except Gone as gone:
            self.tally.ended_because = str(gone)
        if self._session.ended:
            self.tally.ended_because = "the controller closed the FRI session (IDLE)"
        elif self._session.received and self._clock.now_ns() - self._heard_ns > SILENCE_NS:
            self.tally.ended_because = f"nothing came any more for {SILENCE_NS / 1e9:g} s"

    def _take(self, heard: Heard) -> None:
        session, received, number = self._session, self._session.received, self._session.answered
        answer = session.receive(heard.datagram)
        state = session.state
        if session.received == received or state is None:
            return
        self._heard_ns = self._clock.now_ns()
        self.tally.heard(
            state.sequence_counter,
            reflected=state.message.reflected_sequence_counter,
            period_ns=state.send_period_ms * NS_PER_MS,
            stamp_ns=_stamp_ns(state),
            arrived_ns=heard.arrived_ns,
            waited_ns=heard.waited_ns,
        )
        self.tally.dropped_here = self._sock.dropped
        if answer is not None:
            sent_ns = self._clock.now_ns()
            if self._sock.send(answer):
                self.tally.answered(number % SEQUENCE_MODULUS, sent_ns=sent_ns)


def fri_figures(tally: FriTally, state: FriState | None, release: Release) -> LinkFigures:
    """Return the figures of a measurement; ``state`` is the last message's."""
    period_ms = 1 if state is None else state.send_period_ms
    period_ns = period_ms * NS_PER_MS
    states = tally.states
    found = LinkFigures(
        period_ns,
        period_ns,
        down="messages",
        up="answers",
        software=f"FRI {release.value}",
        robot="no state" if state is None else f"{state.session_state.name}, quality {state.quality.name}",
        states_sent=states.sent,
        states_lost=states.lost,
        states_duplicate=states.duplicates,
        states_reordered=states.reordered,
        dropped_here=min(tally.dropped_here or 0, states.lost),
        drops_known=tally.dropped_here is not None,
        requests_sent=tally.confirmed + tally.lost,
        requests_lost=tally.lost,
        answered=tally.confirmed,
        overtaken=tally.overtaken,
        round_trip=tally.confirmed_after,
        waited_here=tally.waited,
        ended_because=tally.ended_because,
    )
    # Messages without a time stamp are taken for evenly sent.
    stamped = all(tally.stamps_ns)
    due_ns = list(tally.stamps_ns) if stamped else [number * period_ns for number in tally.numbers]
    add_way_down(found, due_ns, tally.arrived_ns)
    found.quality = "" if state is None or state.quality >= Quality.GOOD else state.quality.name
    return found


def _stamp_ns(state: FriState) -> int:
    monitor = state.message.monitor
    at = None if monitor is None else monitor.at
    return 0 if at is None else at.seconds * 1_000_000_000 + at.nanoseconds


def _nothing(session: ClientSession, host: str, bound: Address, within_s: float) -> str:
    if session.malformed:
        return (
            f"from {host} at UDP {bound}: {NothingHeard(session.release, session.malformed)} If it is, its release is "
            "another: --fri-version"
        )
    return (
        f"nothing came from {host} at UDP {bound} within {within_s:g} s: in FRI the controller speaks first, so its "
        "robot application must have opened a session with this host's address and this port as its client"
    )
