"""The client's side of a servo link session, without a socket and without a clock.

Datagrams in (:meth:`ServoSession.receive`), a datagram out when there is something to say
(:meth:`ServoSession.outgoing`); who owns the clock says when to knock and when to keep alive. Nothing a sender sends
raises: it is counted in ``outcomes``.
"""

from collections import Counter, deque
from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Final, NamedTuple

from hil.client.servo._requests import Pending, RequestBook
from hil.values.errors import MalformedDatagram
from hil.values.frames import FrameTree
from hil.values.motion import MotionEnd, MotionKind
from hil.values.operator import ProgramState
from hil.values.outcomes import Outcome
from hil.values.pose import NOWHERE, Pose
from hil.values.servo import (
    MAX_MOTIONS_IN_PACKET,
    PROTOCOL_VERSION,
    Command,
    Ended,
    FlangeLocated,
    FrameDescribed,
    FromController,
    GoalReached,
    Goodbye,
    Hello,
    LoadValidated,
    MotionEnded,
    MotionState,
    Refused,
    Report,
    Request,
    RequestDone,
    RequestError,
    Role,
    ServoClientCodec,
    SetDestination,
    Snapshot,
    StartMotion,
    State,
    Welcome,
)

MAX_GOALS: Final = 256
"""Goals reached that wait for a handler; where a handler is slower than they come, the oldest are lost, and counted."""
JOIN_KNOCKS: Final = 5
"""Commands that get no state before the offer is thought forgotten, and asked for anew."""
_NONCE_MODULUS: Final = 1 << 64
_END_LOST: Final = "the controller's report of how this motion ended was lost"


class SessionPhase(StrEnum):
    """Where a session is."""

    CLOSED = "closed"
    """Nothing was said yet."""
    GREETING = "greeting"
    """It says hello."""
    JOINING = "joining"
    """It was offered a session, and sends commands to begin it."""
    RUNNING = "running"
    """States come."""
    OVER = "over"


PHASES: Final[Mapping[tuple[SessionPhase, type[FromController]], SessionPhase]] = {
    (SessionPhase.GREETING, Welcome): SessionPhase.JOINING,
    (SessionPhase.GREETING, Refused): SessionPhase.GREETING,
    (SessionPhase.JOINING, State): SessionPhase.RUNNING,
    (SessionPhase.JOINING, Ended): SessionPhase.OVER,
    (SessionPhase.RUNNING, State): SessionPhase.RUNNING,
    (SessionPhase.RUNNING, Ended): SessionPhase.OVER,
}
"""What a packet of the controller does; one that is not here belongs to no session, and is dropped."""


class Update(NamedTuple):
    """A state packet, and one motion as that shows it."""

    snapshot: Snapshot
    motion: MotionState


class MotionRecord:
    """What is known of one motion of this session."""

    __slots__ = ("ended", "flange_in_moved", "kind", "number", "on_goal", "sent", "session", "shown", "taken")

    def __init__(self, session: "ServoSession", number: int, kind: MotionKind) -> None:
        self.session = session
        self.number = number
        self.kind = kind
        self.shown: Update | None = None
        """The latest state packet that had it."""
        self.ended: MotionEnded | None = None
        self.on_goal: Callable[[GoalReached], None] | None = None
        """Who wants to hear of goals reached; called by the shell, not by the session."""
        self.flange_in_moved = NOWHERE
        """Where the flange stands in the frame that the motion moves."""
        self.taken: DestinationTaken | None = None
        """The last destination that the controller took."""
        self.sent = 0
        """Destinations the program set."""


class DestinationTaken(NamedTuple):
    """A destination that the controller took ``at_ns``, and its pose where it was given as one."""

    at_ns: int
    flange_in_base: Pose | None


class GoalEvent(NamedTuple):
    """A goal reached that somebody wants to hear of."""

    record: MotionRecord
    report: GoalReached


class ServoSession:
    """One session; ``nonce`` is a random number of 64 bits. A new session needs a new object."""

    def __init__(
        self,
        codec: ServoClientCodec,
        *,
        role: Role,
        watchdog_ms: int,
        state_period_ms: int,
        name: str,
        nonce: int,
        latency_budget_ms: int = 0,
    ) -> None:
        self.phase = SessionPhase.CLOSED
        self.welcome: Welcome | None = None
        """What the controller said of itself."""
        self.refusal: Refused | None = None
        """Why it gave no session, as long as that is its last word."""
        self.ended_because = ""
        self.snapshot: Snapshot | None = None
        """The latest state."""
        self.outcomes: Counter[Outcome] = Counter()
        """What became of everything that was received."""
        self.frames: FrameTree | None = None
        """Frames of the robot, once they were fetched."""
        self.requests = RequestBook()
        self.motions: dict[int, MotionRecord] = {}
        """Motions that did not end, by number."""
        self.goals: deque[GoalEvent] = deque(maxlen=MAX_GOALS)
        """Goals reached that the shell has yet to tell."""
        self.goals_lost = 0
        """Goals reached that no handler was told of, because it was busy with those before."""
        self.states = 0
        """State packets taken."""
        self.sent = 0
        """Packets sent."""
        self.trouble = ""
        """What this machine said last of a packet it could not send; set by the shell."""
        self.reports_seen = 0
        self.reports_lost = 0
        """Reports the controller gave up before they came through."""
        self._codec = codec
        self._hello = Hello(PROTOCOL_VERSION, nonce, role, watchdog_ms, state_period_ms, name, latency_budget_ms)
        self._token = 0
        self._knocks = 0
        self._due = False
        self._sequence = 0
        self._state_sequence = 0
        self._reflected = 0
        self._wanted = 0
        self._ends_missed = 0
        """Reports that were lost when it was last seen which motions had ended unheard."""

    @property
    def running(self) -> bool:
        """Whether states come."""
        return self.phase is SessionPhase.RUNNING

    @property
    def over(self) -> bool:
        """Whether it ran, or nearly, and is over; ``ended_because`` says why."""
        return self.phase is SessionPhase.OVER

    @property
    def refused_for_good(self) -> bool:
        """Whether the controller gives no session, and time will not change that."""
        return self.refusal is not None and not self.refusal.try_again

    @property
    def paused(self) -> bool:
        """Whether the latest state says that motions wait for the operator's start."""
        return self.snapshot is not None and self.snapshot.operator.program is ProgramState.PAUSED

    def knock(self) -> None:
        """Say hello, or begin the session that was offered; again each time until it runs."""
        if self.phase is SessionPhase.CLOSED:
            self.phase = SessionPhase.GREETING
        elif self.phase is SessionPhase.JOINING:
            self._knocks += 1
            if self._knocks >= JOIN_KNOCKS:
                self.phase = SessionPhase.GREETING
                self._hello = self._hello._replace(nonce=(self._hello.nonce + 1) % _NONCE_MODULUS)
        self._due = self.phase in (SessionPhase.GREETING, SessionPhase.JOINING)

    def keep_alive(self) -> None:
        """Nothing was sent for a while: send something."""
        self._due = self.running or self._due

    def ask(self, make: Callable[[int], Request]) -> Pending:
        """Ask the controller for the request that ``make`` returns for its number; see :meth:`RequestBook.add`."""
        pending = self.requests.add(make)
        request = pending.request
        if isinstance(request, StartMotion):
            record = self.motions[request.number] = MotionRecord(self, request.number, request.kind)
            record.sent += request.destination is not None or request.flange_in_base is not None
        elif isinstance(request, SetDestination) and request.motion in self.motions:
            self.motions[request.motion].sent += 1
        self._due = True
        return pending

    def want_state(self) -> int:
        """Ask for a state that is sent after now; return the number :meth:`is_fresh` takes."""
        self._wanted = self._sequence + 1
        self._due = True
        return self._wanted

    def is_fresh(self, wanted: int) -> bool:
        """Whether the latest state was sent after :meth:`want_state` was called."""
        return self._reflected >= wanted

    def outgoing(self) -> bytes | None:
        """Return the datagram that is due, if any."""
        if not self._due:
            return None
        self._due = False
        self.sent += 1
        if self.phase is SessionPhase.GREETING:
            return self._codec.encode_from_client(self._hello)
        self._sequence += 1
        return self._codec.encode_from_client(
            Command(
                self._token,
                self._sequence,
                self._state_sequence,
                self.reports_seen,
                self._reflected < self._wanted,
                self.requests.to_send(),
            )
        )

    def goodbye(self) -> bytes | None:
        """Return the datagram that leaves the session, if there is one to leave; each call makes another."""
        if self.phase not in (SessionPhase.JOINING, SessionPhase.RUNNING):
            return None
        self._sequence += 1
        self.sent += 1
        return self._codec.encode_from_client(Goodbye(self._token, self._sequence))

    def end(self, reason: str) -> None:
        """The session is over, and its motions with it; the first reason counts."""
        if self.over:
            return
        self.ended_because = reason
        self._due = False
        for record in self.motions.values():
            record.ended = MotionEnded(0, record.number, 0, MotionEnd.FAILED, "the session is over", reason)
        self.motions.clear()
        self.phase = SessionPhase.OVER

    def receive(self, datagram: bytes) -> None:
        """Take a datagram."""
        try:
            packet = self._codec.decode_from_controller(datagram)
        except MalformedDatagram as error:
            self.outcomes[error.outcome] += 1
            return
        outcome = self._outcome(packet)
        self.outcomes[outcome] += 1
        if outcome is not Outcome.ACCEPTED:
            return
        phase = PHASES[self.phase, type(packet)]
        if isinstance(packet, State):
            self._take_state(packet)
        elif isinstance(packet, Welcome):
            self._take_welcome(packet)
        elif isinstance(packet, Refused):
            self.refusal = packet
        else:
            self.end(packet.reason or "the controller gave no reason")
        self.phase = phase

    def _outcome(self, packet: FromController) -> Outcome:
        if (self.phase, type(packet)) not in PHASES:
            return Outcome.UNKNOWN_SESSION
        if isinstance(packet, State):
            if packet.token != self._token:
                return Outcome.UNKNOWN_SESSION
            if packet.sequence > self._state_sequence:
                return Outcome.ACCEPTED
            return Outcome.DUPLICATE if packet.sequence == self._state_sequence else Outcome.REORDERED
        if isinstance(packet, Ended):
            return Outcome.ACCEPTED if packet.token == self._token else Outcome.UNKNOWN_SESSION
        return Outcome.ACCEPTED if packet.nonce == self._hello.nonce else Outcome.UNKNOWN_SESSION

    def _take_welcome(self, welcome: Welcome) -> None:
        if welcome.version != PROTOCOL_VERSION:
            self.phase = SessionPhase.GREETING
            reason = (
                f"the controller ({welcome.software}) speaks version {welcome.version} of the servo link, this "
                f"application version {PROTOCOL_VERSION}: install the same fri-hil on both sides"
            )
            self.refusal = Refused(welcome.version, welcome.nonce, reason, try_again=False)
            return
        self.welcome, self.refusal = welcome, None
        self._token, self._knocks, self._due = welcome.token, 0, True

    def _take_state(self, state: State) -> None:
        self.states += 1
        self._state_sequence = state.sequence
        self._reflected = max(self._reflected, state.reflected_sequence)
        self.snapshot = state.snapshot
        motions = self.motions
        for motion in state.snapshot.motions:
            record = motions.get(motion.motion)
            if record is not None:
                record.shown = Update(state.snapshot, motion)
        self.requests.taken(state.requests_done)
        for report in state.reports:
            if report.number > self.reports_seen:
                self._take_report(report)
        if self._ends_missed != self.reports_lost and not state.reports:
            self._end_what_is_gone(state.snapshot)
        if state.reports or self.requests or self._reflected < self._wanted:
            self._due = True

    def _take_report(self, report: Report) -> None:
        # Seen last: whoever is interrupted in here meets the report again.
        if isinstance(report, RequestDone):
            self._take_done(self.requests.resolve(report), report)
        elif isinstance(report, FrameDescribed | FlangeLocated | LoadValidated):
            self.requests.answered(report)
        elif isinstance(report, GoalReached):
            record = self.motions.get(report.motion)
            if record is not None and record.on_goal is not None:
                self.goals_lost += len(self.goals) == MAX_GOALS
                self.goals.append(GoalEvent(record, report))
        else:
            record = self.motions.pop(report.motion, None)
            if record is not None:
                record.ended = report
        self.reports_lost += report.number - self.reports_seen - 1
        self.reports_seen = report.number

    def _end_what_is_gone(self, snapshot: Snapshot) -> None:
        """Reports were lost, and there are no more: a motion that is not there any more ended, and nobody heard it."""
        if len(snapshot.motions) >= MAX_MOTIONS_IN_PACKET:
            return
        self._ends_missed = self.reports_lost
        there = {motion.motion for motion in snapshot.motions}
        gone = [number for number in self.motions if number not in there and not self.requests.waits_for(number)]
        for number in gone:
            self.motions.pop(number).ended = MotionEnded(0, number, snapshot.now_ns, MotionEnd.FAILED, _END_LOST, "")

    def _take_done(self, request: Request | None, done: RequestDone) -> None:
        if isinstance(request, StartMotion):
            number = request.number
            if done.error is not RequestError.NONE:
                self.motions.pop(number, None)
        elif isinstance(request, SetDestination):
            number = request.motion
        else:
            return
        record = self.motions.get(number)
        if record is not None and done.error is RequestError.NONE:
            record.taken = DestinationTaken(done.at_ns, request.flange_in_base)
