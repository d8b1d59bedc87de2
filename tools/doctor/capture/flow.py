"""One controller and its client in a capture from elsewhere, judged from the packets alone by the live rules."""

from collections import deque
from dataclasses import dataclass
from typing import Final, NamedTuple

from hil.core.diagnosis.answer_path import AnswerPath
from hil.core.diagnosis.connection import ConnectionDiagnosis, Sides
from hil.core.diagnosis.findings import FindingLog
from hil.core.diagnosis.release_mix_up import doubted_client, undecodable_client
from hil.core.fri.admission import Admission, Dropped
from hil.core.fri.expected import ExpectedAnswers
from hil.core.fri.quality import QualityMeter
from hil.core.fri.sequence import REMEMBERED, SequenceTracker
from hil.replay.guess import Flow, state_of
from hil.values.errors import MalformedDatagram
from hil.values.finding import Finding, Severity, Whose
from hil.values.fri import MAX_PERIOD_MS, SEQUENCE_MODULUS, TRAITS, Quality, Release, SessionState
from hil.values.fri_messages import CommandMessage, MonitoringMessage
from hil.values.outcomes import FRI_DROPS, Outcome
from tools.doctor.capture.healthy import silent_client
from tools.doctor.capture.place import Place, PlaceSeeker
from tools.doctor.capture.send_grid import SendGrid
from transport.capture.records import Packet
from transport.fri import FriCodec

_NS_PER_MS: Final = 1_000_000
_QUALITIES: Final = frozenset(Quality)
_MOST_LOST: Final = 10_000
"""Messages in a row that a capture may miss; a longer step of the counter is another session."""
_MOST_CHANGES: Final = 1000
_LONGEST_NS: Final = 1 << 60
_SILENT_MESSAGES: Final = 50
_REMEDY: Final = "look at what else the controller did then"


class StateChange(NamedTuple):
    """What a message told anew."""

    at_ns: int
    message: int
    state: str
    quality: str


@dataclass(slots=True)
class _Session:
    """What counts sequence counters."""

    tracker: SequenceTracker
    expected: ExpectedAnswers
    admission: Admission
    diagnosis: ConnectionDiagnosis
    meter: QualityMeter
    grid: SendGrid
    last_counter: int


class FlowDiagnosis:
    """Fed with the packets in order; all of it in bounded memory."""

    def __init__(self, flow: Flow, *, period_ms: int | None = None) -> None:
        connection = flow.first.connection
        told_ms = None if connection is None else connection.send_period_ms
        self.flow = flow
        self.period_ms = min(max(period_ms or told_ms or 1, 1), MAX_PERIOD_MS)
        multiplier = (None if connection is None else connection.receive_multiplier) or 1
        self.multiplier = min(max(multiplier, 1), MAX_PERIOD_MS // self.period_ms)
        self._budget_ns = self.period_ms * self.multiplier * _NS_PER_MS
        self._codec = FriCodec(flow.release)
        self.findings = FindingLog(lambda _: None)
        self.path = AnswerPath(budget_ns=self._budget_ns)
        self.place = PlaceSeeker()
        self.changes: deque[StateChange] = deque(maxlen=_MOST_CHANGES)
        self.outcomes = dict.fromkeys((Outcome.ACCEPTED, *FRI_DROPS), 0)
        self.messages = self.answers = self.lost = self.sessions = self.shifts = 0
        self.overtaken = 0
        """Messages that passed behind a later one."""
        self.undecodable = 0
        self.undecodable_detail = ""
        """Of the first datagram of the controller that is no message."""
        self.last_ns = 0
        self.by_fault: dict[str, dict[str, int]] = {}
        self._session: _Session | None = None
        self._quality: Quality | None = None
        self._by_rule = Quality.POOR
        self._state: SessionState | None = None
        self._release_told = False
        self._echo_expected = TRAITS[flow.release].commanded_position

    def sent(self, packet: Packet) -> None:
        """Take a datagram of the controller."""
        self.place.look(packet, from_client=False)
        try:
            message = self._codec.decode_monitoring(packet.payload)
        except MalformedDatagram as error:
            self.undecodable += 1
            self.undecodable_detail = self.undecodable_detail or f"packet {packet.number}: {error.detail}"
            return
        at_ns = self._time(packet)
        session = self._session
        steps = 0 if session is None else (message.sequence_counter - session.last_counter) % SEQUENCE_MODULUS
        self.messages += 1
        if steps > SEQUENCE_MODULUS - REMEMBERED:
            self.overtaken += 1  # by the next message, before the capture's place: it was taken for lost by now
            return
        if session is None or not 0 < steps <= _MOST_LOST:
            session, steps = self._begin(message), 1
        self._count_lost(session, steps - 1, at_ns)
        due_ns = session.grid.due_ns(steps, at_ns)
        self.path.began(due_ns, at_ns)
        self.path.cycle = message.sequence_counter
        session.expected.expire(now_ns=at_ns)
        if session.diagnosis.tell_at_ns is not None and at_ns >= session.diagnosis.tell_at_ns:
            session.diagnosis.tell(at_ns)
        counter = session.tracker.sent(at_ns=at_ns)
        if state_of(message) is not SessionState.IDLE:
            session.expected.sent(counter, at_ns=at_ns)
        self.path.sent(counter, due_ns, at_ns)
        session.last_counter = counter
        self._note_connection(session, message, at_ns)
        self._note_rule(session, counter, at_ns)

    def answered(self, packet: Packet) -> None:
        """Take a datagram of the client."""
        self.place.look(packet, from_client=True)
        self.answers += 1
        session = self._session
        if session is None:
            return
        at_ns = self._time(packet)
        admitted = session.admission.admit(packet.payload, self.flow.client, now_ns=at_ns)
        if isinstance(admitted, Dropped):
            self.outcomes[admitted.outcome] += 1
            if admitted.looks_like is not None:
                self._note_release(admitted.looks_like, f"packet {packet.number}: {admitted.detail}", at_ns)
            if admitted.overtaken is not None:
                reflected, age_ns = admitted.overtaken
                session.diagnosis.uncounted(reflected, age_ns=age_ns, now_ns=at_ns, overtaken=True)
                self.path.arrived.append((at_ns, age_ns, reflected))
            return
        message, age_ns, outcome, _, _ = admitted
        self.outcomes[outcome] += 1
        reflected = message.reflected_sequence_counter
        if not session.expected.answered(reflected, age_ns=age_ns, now_ns=at_ns):
            session.diagnosis.uncounted(reflected, age_ns=age_ns, now_ns=at_ns)
        self.path.arrived.append((at_ns, age_ns, reflected))
        self._doubt_release(message, at_ns)

    def finish(self) -> None:
        """The capture is over."""
        self.path.began(self.last_ns, self.last_ns)
        self._end_session()
        if not self.answers and self.messages >= _SILENT_MESSAGES:
            found = silent_client(
                "",
                client=str(self.flow.client),
                release=self.flow.release,
                messages=self.messages,
                seconds=self.last_ns / 1e9,
            )
            self.findings.add(found, now_ns=self.last_ns)

    @property
    def sides(self) -> Sides:
        """Who the two are, as far as is known by now."""
        place = self.place.place
        if place in {Place.ONE_MACHINE, Place.CLIENT}:
            return Sides("the controller", "the client", Whose.PEER, "message", _REMEDY)
        return Sides("the controller", "peer or wire", Whose.PEER_OR_WIRE, "message", _REMEDY)

    def _time(self, packet: Packet) -> int:
        at_ns = packet.at_unix_ns - self.flow.first_unix_ns
        # A damaged time stamp may be of any century; a clock that was set back is none either.
        if not 0 <= at_ns < _LONGEST_NS:
            at_ns = self.last_ns
        self.last_ns = max(self.last_ns, at_ns)
        return at_ns

    def _begin(self, message: MonitoringMessage) -> _Session:
        self._end_session()
        self.sessions += 1
        tracker = SequenceTracker(first_counter=message.sequence_counter)
        meter = QualityMeter(budget_ns=self._budget_ns)
        if message.connection is not None and message.connection.quality in _QUALITIES:
            # The capture may begin in the middle of a session.
            meter.quality = Quality(message.connection.quality)
        diagnosis = ConnectionDiagnosis(
            send_period_ms=self.period_ms,
            receive_multiplier=self.multiplier,
            path=self.path,
            meter=meter,
            add=self._find,
            sides=self.sides,
        )
        expected = ExpectedAnswers(
            receive_multiplier=self.multiplier, budget_ns=self._budget_ns, meter=meter, on_missed=diagnosis.missed
        )
        admission = Admission(peer=self.flow.client, codec=self._codec, tracker=tracker, budget_ns=self._budget_ns)
        grid = SendGrid(self.period_ms * _NS_PER_MS)
        last = (message.sequence_counter - 1) % SEQUENCE_MODULUS
        self._session = _Session(tracker, expected, admission, diagnosis, meter, grid, last)
        self._quality = self._state = None
        self._by_rule = meter.quality
        return self._session

    def _end_session(self) -> None:
        session = self._session
        if session is None:
            return
        session.diagnosis.tell(self.last_ns, over=True)
        self.shifts += session.grid.shifts
        for what, counts in session.diagnosis.report().items():
            if isinstance(counts, dict):
                whole = self.by_fault.setdefault(what, {})
                for whose, count in counts.items():
                    whole[whose] = whole.get(whose, 0) + count

    def _count_lost(self, session: _Session, lost: int, at_ns: int) -> None:
        """Messages that the capture misses were sent all the same: the counter tells."""
        self.lost += lost
        for back in range(lost, 0, -1):
            due_ns = at_ns - back * self.period_ms * _NS_PER_MS
            counter = session.tracker.sent(at_ns=due_ns)
            session.expected.sent(counter, at_ns=due_ns)
            self.path.sent(counter, due_ns, due_ns)

    def _note_connection(self, session: _Session, message: MonitoringMessage, at_ns: int) -> None:
        connection, state = message.connection, state_of(message)
        if connection is None or state is None or connection.quality not in _QUALITIES:
            return
        quality = Quality(connection.quality)
        before = self._quality
        if quality is before and state is self._state:
            return
        commanding = self._state is not None and self._state >= SessionState.COMMANDING_WAIT
        self._quality, self._state = quality, state
        self.changes.append(StateChange(at_ns, message.sequence_counter, state.name, quality.name))
        if before is not None and quality < before and state is not SessionState.IDLE:
            session.diagnosis.recorded_fall(
                before, quality, message.sequence_counter, now_ns=at_ns, commanding=commanding
            )

    def _note_rule(self, session: _Session, message: int, at_ns: int) -> None:
        """Where the controller tells more than our rule says: its rule is its own, so that is a note."""
        quality, before = session.meter.quality, self._by_rule
        self._by_rule = quality
        if quality >= before or self._quality is None or self._quality <= quality:
            return
        self._find(
            Finding(
                "quality-by-rule",
                Severity.NOTE,
                Whose.NOBODY,
                f"by this project's rule the quality would be {quality.name} from message {message} on "
                f"({session.meter.describe()}); the controller tells {self._quality.name}",
                figures={"message": message, "at_s": at_ns / 1e9},
            ),
            quality.name,
            at_ns,
        )

    def _find(self, finding: Finding, subject: str, now_ns: int) -> None:
        self.findings.add(finding, subject=subject, now_ns=now_ns)

    def _doubt_release(self, message: CommandMessage, at_ns: int) -> None:
        monitoring = self._state in {SessionState.MONITORING_WAIT, SessionState.MONITORING_READY}
        if self._release_told or not monitoring:
            return
        echoes = message.command is not None and message.command.position is not None
        if echoes is self._echo_expected or not (echoes or message.command is None):
            return
        monitor = self.flow.first.monitor
        if not echoes and monitor is not None and monitor.inputs_outputs:
            return  # a client that only sets outputs answers without positions too, whatever its release
        self._release_told = True
        found = doubted_client(self.flow.release, peer=str(self.flow.client), echoes_positions=echoes)
        self._find(found, "", at_ns)

    def _note_release(self, looks_like: Release, detail: str, at_ns: int) -> None:
        peer = str(self.flow.client)
        self._find(undecodable_client(looks_like, self.flow.release, peer=peer, detail=detail), "", at_ns)
