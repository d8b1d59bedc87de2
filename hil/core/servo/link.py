"""The servo link of one robot: sessions, admission, requests and state packets, put together.

Bytes and times in (:meth:`ServoLink.receive`), decisions once a cycle (:meth:`ServoLink.progress`), bytes out
(:meth:`ServoLink.outgoing`). It moves nothing but the :class:`MotionExecutive` it is given.
"""

from collections import deque
from collections.abc import Callable

from hil.core.control.load_validation import LoadValidation
from hil.core.control.stage import ControlStage
from hil.core.counters import PacketCounters
from hil.core.diagnosis.findings import FindingLog
from hil.core.diagnosis.seconds_hand_finding import seconds_hand
from hil.core.events import ApplicationJoined, ApplicationLeft, Event, MotionBegan, MotionOver
from hil.core.kinematics.srs import SrsKinematics
from hil.core.model import ArmModel
from hil.core.motion.application_motion import ApplicationMotion, MotionBasis
from hil.core.motion.executive import MotionExecutive
from hil.core.motion.queue import EndedMotion, Entry
from hil.core.motion.servo_motion import ServoMotion
from hil.core.pushes import Pusher
from hil.core.servo.answer import Answer
from hil.core.servo.control_choice import ControlChoice
from hil.core.servo.door import Door
from hil.core.servo.questions import Question, Questions
from hil.core.servo.requests import Circumstances, RequestHandler
from hil.core.servo.sessions import MAX_WAITING_REQUESTS, Session, SessionTable, TokenSource
from hil.core.servo.set_points import SetPointBook
from hil.core.servo.snapshot import snapshot
from hil.core.settings import ControllerSettings, ServoSettings
from hil.values.arm import ArmState, Contact, Push
from hil.values.errors import MalformedDatagram
from hil.values.link import Address, Outgoing
from hil.values.motion import Fault
from hil.values.operator import OperatorView
from hil.values.outcomes import SERVO_DROPS, Outcome
from hil.values.robot import Seven
from hil.values.servo import (
    PROTOCOL_VERSION,
    Command,
    Ended,
    FromController,
    GoalReached,
    Goodbye,
    Hello,
    MotionEnded,
    PushArm,
    Request,
    RequestDone,
    RequestError,
    Role,
    ServoControllerCodec,
    SetDestination,
    State,
)

SERVO_LINK = "servo"
MAX_ANSWERS = 64
"""Hellos answered in one cycle; more than that are dropped, and their senders say hello again."""
_OBSERVERS_REQUEST = Fault("an observer may watch, not command; connect as commander")


class ServoLink:
    """All applications of one robot. ``emit`` takes events; ``failed`` is told that the arm brakes, and why.

    ``contacts`` is asked what touches the arm, in cycles in which a state leaves.
    """

    def __init__(
        self,
        *,
        settings: ControllerSettings,
        servo: ServoSettings,
        codec: ServoControllerCodec,
        executive: MotionExecutive,
        control: ControlStage,
        basis: MotionBasis,
        kinematics: SrsKinematics,
        model: ArmModel,
        takes_torque: bool,
        pusher: Pusher,
        contacts: Callable[[], tuple[Contact, ...]],
        findings: FindingLog,
        emit: Callable[[Event], None],
        failed: Callable[[Fault, int], None],
    ) -> None:
        self._codec = codec
        self._executive = executive
        self._findings = findings
        self._set_points = SetPointBook()
        self._emit = emit
        self._failed = failed
        self._sessions = SessionTable(tokens=TokenSource(servo.token_secret), cycle_ms=settings.cycle_ms)
        self._door = Door(
            settings=servo,
            sessions=self._sessions,
            cycle_ms=settings.cycle_ms,
            unix_epoch_ns=settings.unix_epoch_ns,
            barred=lambda: self._closed_because,
        )
        self._kinematics = kinematics
        self._model = model
        self._contacts = contacts
        self._control = control
        self._choice = ControlChoice(
            frames=settings.frames,
            kinematics=kinematics,
            validation=LoadValidation(dynamics=control.dynamics, kinematics=kinematics, limits=basis.limits),
            takes_torque=takes_torque,
        )
        self._questions = Questions(frames=settings.frames, kinematics=kinematics, control=self._choice)
        self._requests = RequestHandler(executive=executive, basis=basis, control=self._choice, failed=failed)
        self._pusher = pusher
        self._answers: deque[tuple[Address, FromController]] = deque()
        self._closed_because = ""
        self._leaving: list[Session] = []
        """Sessions whose states leave with this cycle."""
        self._goals_told: dict[int, int] = {}
        self._moves = ""
        """What has the arm, and whose it is: the kind of the last motion that began, the name of its application."""
        self._measured_rad: Seven = executive.set_point.position_rad
        self.counters = PacketCounters(SERVO_DROPS)
        self.sessions_begun = 0
        self.requests_taken = 0
        self.requests_refused = 0
        executive.applications.on_begin = self._motion_began
        executive.applications.on_end = self._motion_ended

    @property
    def commander(self) -> str:
        """Who commands, for a person; empty when nobody does."""
        return "" if self._sessions.commander is None else self._sessions.commander.label

    def receive(self, datagram: bytes, sender: Address, *, now_ns: int) -> None:
        """Take one datagram from the link's socket; never raises for what anybody sends."""
        self.counters.received += 1
        try:
            packet = self._codec.decode_from_client(datagram)
        except MalformedDatagram as error:
            self._drop(error.outcome, f"{sender}: {error.detail}", now_ns)
            return
        if isinstance(packet, Hello):
            self._hello(packet, sender, now_ns)
            return
        if isinstance(packet, Goodbye) and self._sessions.left(packet.token, sender):
            # Said several times, because each may be lost.
            self.counters.accepted()
            return
        session = self._session_of(packet, sender, now_ns)
        if session is None or not self._in_order(session, packet, now_ns):
            return
        self.counters.accepted()
        if isinstance(packet, Goodbye):
            self._leave(session, "it said goodbye", now_ns)
        else:
            self._command(session, packet, now_ns)

    def progress(self, *, arm: ArmState, now_ns: int, started_ns: int, barred: str) -> None:
        """Once a cycle: end silent sessions, do what the commander asks. ``barred`` says why no motion may start."""
        self._measured_rad = arm.position_rad
        if self._sessions.empty:
            return
        for session in self._sessions.overdue(now_ns=started_ns):
            self._end(session, session.overdue_because(now_ns=started_ns), now_ns)
        circumstances = Circumstances(arm, now_ns, self._closed_because or barred)
        for session in self._sessions:
            if session.inbox:
                for arrived_ns, request in self._requests.ready(session.inbox):
                    self._do(session, request, arrived_ns, circumstances)

    def outgoing(self, arm: ArmState, *, operator: OperatorView, cycle: int, now_ns: int) -> list[Outgoing]:
        """Return the packets of this cycle: answers to hellos, and the state for every session it is due for."""
        if self._sessions.empty and not self._answers:
            self._leaving.clear()
            return []
        active = self._executive.applications.active
        if active is not None:
            motion = active.motion
            self._tell_goal(active.number, motion, now_ns)
            if motion.seconds_hand is not None and motion.seconds_hand.due:
                self._diagnose(active.number, motion, now_ns)
        packets = [self._send(address, answer) for address, answer in self._answers]
        self._answers.clear()
        shown = None
        self._leaving.clear()
        for session in self._sessions.due_for_state():
            if shown is None:
                shown = snapshot(
                    arm=arm,
                    control=self._control,
                    executive=self._executive,
                    operator=operator,
                    flange_in_base=self._kinematics.forward(arm.position_rad),
                    flange_speed_mm_s=self._model.flange_speed_mm_s(arm.position_rad, arm.velocity_rad_s),
                    contacts=self._contacts(),
                    commander=self.commander,
                    cycle=cycle,
                    now_ns=now_ns,
                )
            session.state_sequence += 1
            session.latency.sent(session.state_sequence, at_ns=now_ns)
            self._leaving.append(session)
            state = State(
                session.token,
                session.state_sequence,
                session.sequence,
                session.last_request,
                shown,
                session.reports.to_tell(),
            )
            packets.append(self._send(session.address, state))
        return packets

    def departed(self, *, now_ns: int) -> None:
        """The states of this cycle leave at ``now_ns``, not when the cycle began."""
        for session in self._leaving:
            session.latency.departed(at_ns=now_ns)

    def close_door(self, reason: str) -> None:
        """From now on no session begins and no motion starts."""
        self._closed_because = reason

    def close(self, *, now_ns: int) -> list[Outgoing]:
        """End all sessions; return what tells them."""
        for session in list(self._sessions):
            self._end(session, self._closed_because, now_ns)
        packets = [self._send(address, answer) for address, answer in self._answers]
        self._answers.clear()
        return packets

    def report(self) -> dict[str, object]:
        """Return what is known of the link, for the status file."""
        return {
            "commander": self.commander,
            "observers": self._sessions.observers,
            "sessions_begun": self.sessions_begun,
            "requests_taken": self.requests_taken,
            "requests_refused": self.requests_refused,
            "motions_begun": self._executive.applications.started,
            "motions": self._set_points.report(),
            "packets": self.counters.report(),
        }

    def _hello(self, hello: Hello, sender: Address, now_ns: int) -> None:
        if len(self._answers) >= MAX_ANSWERS:
            self._drop(Outcome.CROWDED, f"{sender}: more than {MAX_ANSWERS} hellos in one cycle", now_ns)
            return
        answer = self._door.answer(hello, sender, now_ns=now_ns)
        self._answers.append((sender, answer))
        if hello.version != PROTOCOL_VERSION:
            self._drop(Outcome.OTHER_VERSION, f"{sender} speaks version {hello.version} of the servo link", now_ns)
        else:
            self.counters.accepted()

    def _session_of(self, packet: Command | Goodbye, sender: Address, now_ns: int) -> Session | None:
        """Return the session of a packet; an offer becomes one with its first packet, if there is still room."""
        session = self._sessions.find(packet.token, sender)
        if session is not None:
            return session
        offer = self._sessions.offered(packet.token, sender)
        if offer is None:
            self._drop(Outcome.UNKNOWN_SESSION, f"{sender} sends for a session that is not there", now_ns)
            return None
        if reason := self._door.not_now_because(offer.role, now_ns=now_ns):
            self._drop(Outcome.CROWDED, f"{sender} comes too late: {reason}", now_ns)
            return None
        self._sessions.begin(offer)
        self.sessions_begun += 1
        self._emit(ApplicationJoined(now_ns, str(offer), offer.role))
        return offer

    def _in_order(self, session: Session, packet: Command | Goodbye, now_ns: int) -> bool:
        # Newest wins: whatever an overtaken packet carried and is not done yet, a later one carries too.
        sequence = packet.sequence
        if sequence <= session.sequence:
            outcome = Outcome.DUPLICATE if sequence == session.sequence else Outcome.REORDERED
            self._drop(outcome, f"packet {sequence} of {session} after {session.sequence}", now_ns)
            return False
        session.sequence = sequence
        if isinstance(packet, Command) and (late := session.latency.late(packet.reflected_sequence, now_ns=now_ns)):
            self._drop(Outcome.LATE, f"packet {sequence} of {session} {late}", now_ns)
            return False
        session.heard_ns = max(session.heard_ns, now_ns)
        return True

    def _command(self, session: Session, command: Command, now_ns: int) -> None:
        session.reports.seen(command.reports_seen)
        session.wants_state |= command.wants_state
        for request in command.requests:
            if request.number <= session.last_request:
                continue
            if len(session.inbox) >= MAX_WAITING_REQUESTS:
                self._drop(Outcome.CROWDED, f"{session} asks for more than is done in a cycle", now_ns)
                return
            session.replaced += request.number - session.last_request - 1
            session.last_request = request.number
            session.inbox.append((now_ns, request))

    def _do(self, session: Session, request: Request, arrived_ns: int, circumstances: Circumstances) -> None:
        if isinstance(request, Question):
            error, why = self._questions.answer(request, session.reports, circumstances.arm)
        elif isinstance(request, PushArm):
            error, why = self._push(request, session.role)
        elif session.role is Role.COMMANDER:
            if session.replaced and isinstance(request, SetDestination):
                self._requests.replaced_on_the_way(request.motion, session.replaced)
                session.replaced = 0
            error, why = self._requests.handle(request, arrived_ns=arrived_ns, circumstances=circumstances)
        else:
            error, why = RequestError.ILLEGAL_STATE, _OBSERVERS_REQUEST
        if error is RequestError.NONE:
            self.requests_taken += 1
        else:
            self.requests_refused += 1
        session.wants_state = True
        session.reports.add(
            lambda number: RequestDone(number, request.number, arrived_ns, error, why.reason, why.detail)
        )

    def _push(self, request: PushArm, role: Role) -> Answer:
        if role is not Role.OPERATOR:
            return Answer(RequestError.ILLEGAL_STATE, Fault("only an operator pushes the arm"))
        force, moment = request.force_n, request.moment_nm
        if len(force) != 3 or len(moment) != 3:
            return Answer(RequestError.ILLEGAL_ARGUMENT, Fault("a push is three forces in N and three moments in Nm"))
        refusal = self._pusher.push(Push(request.link, force, moment, request.duration_s))
        return Answer(RequestError.ILLEGAL_ARGUMENT, Fault(refusal)) if refusal else Answer()

    def _leave(self, session: Session, reason: str, now_ns: int) -> None:
        self._sessions.end(session)
        self._emit(ApplicationLeft(now_ns, str(session), session.role, reason))
        if session.role is Role.COMMANDER:
            self._goals_told.clear()
            self._choice.forget()
            fault = Fault("the application left", reason)
            if self._executive.applications and self._executive.fail_application_motion(fault, now_ns=now_ns):
                self._failed(fault, now_ns)
            self._executive.applications.forget_ends()

    def _end(self, session: Session, reason: str, now_ns: int) -> None:
        self._leave(session, reason, now_ns)
        self._answers.append((session.address, Ended(session.token, reason)))

    def _tell_goal(self, number: int, motion: ApplicationMotion, now_ns: int) -> None:
        commander = self._sessions.commander
        if commander is None or motion.goals_reached == self._goals_told.get(number, 0):
            return
        self._goals_told[number] = motion.goals_reached
        commander.wants_state = True
        measured_rad = self._measured_rad
        commander.reports.add(lambda told: GoalReached(told, number, now_ns, motion.interpolator, measured_rad))

    def _diagnose(self, number: int, motion: ApplicationMotion, now_ns: int) -> None:
        if not isinstance(motion, ServoMotion):
            return
        self._findings.add(seconds_hand(motion, number), subject=self._moves, now_ns=now_ns)
        motion.seconds_hand.told(now_ns)

    def _motion_began(self, entry: Entry, now_ns: int) -> None:
        self._set_points.began(entry, self.commander, now_ns=now_ns)
        commander = self._sessions.commander
        name = "" if commander is None else commander.name
        self._moves = f"{entry.motion.kind.name} of {name or 'an application'}"
        self._emit(MotionBegan(now_ns, entry.number, entry.motion.kind))

    def _motion_ended(self, ended: EndedMotion) -> None:
        self._tell_goal(ended.number, ended.motion, ended.at_ns)
        self._goals_told.pop(ended.number, None)
        hand = ended.motion.seconds_hand
        if hand is not None and hand.untold:
            self._diagnose(ended.number, ended.motion, ended.at_ns)
        self._set_points.ended(ended)
        self._emit(MotionOver(ended.at_ns, ended.number, ended.motion.kind, ended.end, str(ended.why)))
        commander = self._sessions.commander
        if commander is not None:
            commander.wants_state = True
            commander.reports.add(
                lambda number: MotionEnded(
                    number, ended.number, ended.at_ns, ended.end, ended.why.reason, ended.why.detail
                )
            )

    def _send(self, address: Address, packet: FromController) -> Outgoing:
        self.counters.sent += 1
        return Outgoing(SERVO_LINK, self._codec.encode_from_controller(packet), address)

    def _drop(self, outcome: Outcome, detail: str, now_ns: int) -> None:
        event = self.counters.dropped(outcome, detail, now_ns=now_ns)
        if event is not None:
            self._emit(event)
