"""Who talks on the servo link: one commander, any number of observers up to a bound, and offers nobody took up yet.

A hello is only answered with an offer. The session begins with the first packet that carries the offer's token from
the same address: so it takes no seat for a sender that cannot hear us, or that only repeats an old hello.
"""

import hashlib
from collections import OrderedDict, deque
from collections.abc import Iterator
from dataclasses import dataclass, field

from hil.core.servo.latency import LatencyBudget
from hil.core.servo.reports import ReportLog
from hil.core.settings import NS_PER_MS
from hil.values.link import Address
from hil.values.servo import Hello, Request, Role

MAX_OFFERS = 64
MAX_OBSERVERS = 64
MAX_WAITING_REQUESTS = 64
OBSERVER_STATES_A_CYCLE = 4
"""State packets for observers in one cycle; with more observers than that they take turns, and nobody slows the arm."""


@dataclass(slots=True)
class Session:
    """One client, from its offer on."""

    token: int
    address: Address
    role: Role
    name: str
    watchdog_ns: int
    state_period_cycles: int
    heard_ns: int
    latency: LatencyBudget
    sequence: int = 0
    """Sequence number of the client's newest packet."""
    state_sequence: int = 0
    cycles_until_state: int = 0
    wants_state: bool = False
    last_request: int = 0
    """Number of the last request put into the inbox."""
    replaced: int = 0
    """Requests before it that never came: destinations its program replaced by newer ones; not yet accounted for."""
    inbox: deque[tuple[int, Request]] = field(default_factory=deque)
    """Requests with the time they arrived at; what waits for a pause to end stays here."""
    reports: ReportLog = field(default_factory=ReportLog)

    label: str = field(init=False)
    """Name and address, for a person; it is in every state packet."""

    def __post_init__(self) -> None:
        self.label = f"{self.name} at {self.address}" if self.name else str(self.address)

    def __str__(self) -> str:
        return self.label

    def silent_ns(self, *, now_ns: int) -> int:
        """Return how long nothing was heard of the client."""
        return now_ns - self.heard_ns

    def overdue_because(self, *, now_ns: int) -> str:
        """Return in words what the watchdog found: the newest packet that counted, its age, and by how much."""
        silent_ms, watchdog_ms = self.silent_ns(now_ns=now_ns) / 1e6, self.watchdog_ns / 1e6
        text = (
            f"silent for {silent_ms:.0f} ms, the watchdog allows {watchdog_ms:g} ms "
            f"({silent_ms - watchdog_ms:.1f} ms too long)"
        )
        if self.latency.late_in_a_row:
            text += f"; its last {self.latency.late_in_a_row} packets came, but late: {self.latency.last_late}"
        elif self.sequence:
            text += f"; packet {self.sequence} was its last"
        return text


class TokenSource:
    """Session tokens: 64 bits nobody can guess who does not know ``secret``; the same secret gives the same ones."""

    def __init__(self, secret: bytes) -> None:
        self._secret = secret
        self._made = 0

    def next(self) -> int:
        """Return a token that was not returned before; never 0."""
        self._made += 1
        digest = hashlib.blake2b(self._made.to_bytes(8, "little"), key=self._secret, digest_size=8).digest()
        return int.from_bytes(digest, "little") or 1


class SessionTable:
    """All sessions of one robot's servo link, in bounded memory."""

    def __init__(self, *, tokens: TokenSource, cycle_ms: int) -> None:
        self._tokens = tokens
        self._cycle_ms = cycle_ms
        self._offers: OrderedDict[tuple[Address, int], Session] = OrderedDict()
        self._offered: dict[int, tuple[Address, int]] = {}
        self._sessions: OrderedDict[int, Session] = OrderedDict()
        self._left: deque[tuple[int, Address]] = deque(maxlen=MAX_OFFERS)
        self.commander: Session | None = None

    def __iter__(self) -> Iterator[Session]:
        return iter(self._sessions.values())

    @property
    def empty(self) -> bool:
        """Whether nobody is there."""
        return not self._sessions

    @property
    def observers(self) -> int:
        """How many sessions only watch."""
        return len(self._sessions) - (self.commander is not None)

    def offer(self, hello: Hello, sender: Address, *, now_ns: int) -> Session:
        """Return the session offered for ``hello``: the same one for a hello that was sent again."""
        key = (sender, hello.nonce)
        offered = self._offers.get(key)
        if offered is not None:
            return offered
        if len(self._offers) >= MAX_OFFERS:
            _, forgotten = self._offers.popitem(last=False)
            del self._offered[forgotten.token]
        session = Session(
            token=self._tokens.next(),
            address=sender,
            role=hello.role,
            name=hello.name,
            watchdog_ns=hello.watchdog_ms * NS_PER_MS,
            state_period_cycles=-(-hello.state_period_ms // self._cycle_ms),
            heard_ns=now_ns,
            latency=LatencyBudget(
                budget_ns=(hello.latency_budget_ms or hello.watchdog_ms) * NS_PER_MS,
                cycle_ns=self._cycle_ms * NS_PER_MS,
            ),
        )
        self._offers[key] = session
        self._offered[session.token] = key
        return session

    def find(self, token: int, sender: Address) -> Session | None:
        """Return the running session of ``token``, if ``sender`` is its client."""
        session = self._sessions.get(token)
        return session if session is not None and session.address == sender else None

    def offered(self, token: int, sender: Address) -> Session | None:
        """Return the offer of ``token``, if it was made to ``sender``."""
        key = self._offered.get(token)
        return self._offers[key] if key is not None and key[0] == sender else None

    def left(self, token: int, sender: Address) -> bool:
        """Return whether ``sender`` had the session of ``token`` not long ago."""
        return (token, sender) in self._left

    def begin(self, session: Session) -> None:
        """The client took up its offer. The caller has seen that there is room for it."""
        del self._offers[self._offered.pop(session.token)]
        self._sessions[session.token] = session
        if session.role is Role.COMMANDER:
            self.commander = session

    def end(self, session: Session) -> None:
        """The session is over."""
        del self._sessions[session.token]
        self._left.append((session.token, session.address))
        if self.commander is session:
            self.commander = None

    def due_for_state(self) -> list[Session]:
        """Return the sessions that get a state packet in this cycle: those due, but of the observers only a few."""
        due: list[Session] = []
        served: list[Session] = []
        for session in self._sessions.values():
            if session.cycles_until_state > 0:
                session.cycles_until_state -= 1
                if not session.wants_state:
                    continue
            if session.role is not Role.COMMANDER:
                if len(served) >= OBSERVER_STATES_A_CYCLE:
                    continue
                served.append(session)
            session.cycles_until_state = session.state_period_cycles - 1
            session.wants_state = False
            due.append(session)
        if served and self.observers > OBSERVER_STATES_A_CYCLE:
            for session in served:
                self._sessions.move_to_end(session.token)
        return due

    def overdue(self, *, now_ns: int) -> list[Session]:
        """Return the sessions that have been silent for longer than their watchdogs allow."""
        return [session for session in self._sessions.values() if now_ns - session.heard_ns > session.watchdog_ns]
