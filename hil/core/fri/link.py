"""The FRI link of one robot: session, quality, admission and the commander of the overlay, put together.

Bytes and times in (:meth:`FriLink.receive`), decisions once a cycle (:meth:`FriLink.progress`), bytes out
(:meth:`FriLink.message`). It moves nothing but the :class:`MotionExecutive` it is given.
"""

from collections.abc import Callable
from typing import Final

from hil.core.counters import EVENT_INTERVAL_NS, PacketCounters
from hil.core.diagnosis.answer_path import AnswerPath
from hil.core.diagnosis.connection import ConnectionDiagnosis
from hil.core.diagnosis.findings import FindingLog
from hil.core.diagnosis.release_mix_up import doubted_client, undecodable_client
from hil.core.events import ClientRestarted, Event, QualityChanged, ReleaseDoubted
from hil.core.fri.admission import Admission, Dropped
from hil.core.fri.commander import OverlayCommander
from hil.core.fri.commands import Refusal
from hil.core.fri.expected import ExpectedAnswers
from hil.core.fri.log import SessionLog
from hil.core.fri.messages import MessageBuilder
from hil.core.fri.outputs import ClientOutputs
from hil.core.fri.overlay_gate import OverlayGate
from hil.core.fri.quality import WINDOW_NS, QualityMeter
from hil.core.fri.sequence import REMEMBERED, SequenceTracker, counter_distance
from hil.core.fri.session import Trigger, next_state
from hil.core.fri.transformations import RequestedTransformations
from hil.core.kinematics.srs import SrsKinematics
from hil.core.motion.executive import MotionExecutive, Phase
from hil.core.settings import NS_PER_MS, FriSettings
from hil.core.statistics import Histogram
from hil.values.arm import ArmState
from hil.values.finding import Finding
from hil.values.fri import TRAITS, OverlayKind, Quality, Release, SessionState
from hil.values.fri_messages import CommandData, CommandMessage, ControllerCodec
from hil.values.link import Address
from hil.values.motion import Fault
from hil.values.operator import OperatorView
from hil.values.outcomes import FRI_DROPS, Outcome
from hil.values.robot import JointLimits

# A member of an enumeration costs a search each time it is named by its class, and these are named in every cycle.
_ACCEPTED: Final = Outcome.ACCEPTED
_GOOD: Final = Quality.GOOD
_IDLE: Final = SessionState.IDLE
_COMMANDING_WAIT: Final = SessionState.COMMANDING_WAIT
_COMMANDING_ACTIVE: Final = SessionState.COMMANDING_ACTIVE
_FIGURES: Final = str.maketrans("", "", "0123456789.+-")


class FriLink:
    """One client. ``emit`` takes events; ``stop`` makes the arm brake for a reason; ``gate`` lets the overlay begin."""

    def __init__(
        self,
        *,
        settings: FriSettings,
        cycle_ms: int,
        codec: ControllerCodec,
        messages: MessageBuilder,
        motion: MotionExecutive,
        limits: JointLimits,
        outputs: ClientOutputs,
        transformations: RequestedTransformations,
        kinematics: SrsKinematics,
        gate: OverlayGate,
        findings: FindingLog,
        emit: Callable[[Event], None],
        stop: Callable[[Fault, int], bool],
    ) -> None:
        self._settings = settings
        self._codec = codec
        self._messages = messages
        self._motion = motion
        self._outputs = outputs
        self.transformations = transformations
        self._emit = emit
        self._stop = stop
        self._cycles_per_message = settings.send_period_ms // cycle_ms
        self._cycles_until_message = 0
        self._budget_ns, self._watchdog_ns = settings.budget_ns, settings.watchdog_ns
        self._tracker = SequenceTracker(first_counter=settings.first_sequence_counter)
        self._meter = QualityMeter(budget_ns=self._budget_ns, rise_ns=settings.quality_rise_ms * NS_PER_MS)
        self._cycle_ns = cycle_ms * NS_PER_MS
        self.path = AnswerPath(budget_ns=self._budget_ns)
        self._findings = findings
        self.diagnosis = ConnectionDiagnosis(
            send_period_ms=settings.send_period_ms,
            receive_multiplier=settings.receive_multiplier,
            path=self.path,
            meter=self._meter,
            add=self._find,
        )
        self._expected = ExpectedAnswers(
            receive_multiplier=settings.receive_multiplier,
            budget_ns=self._budget_ns,
            meter=self._meter,
            on_missed=self.diagnosis.missed,
        )
        self._admission = Admission(peer=settings.peer, codec=codec, tracker=self._tracker, budget_ns=self._budget_ns)
        self._known_quality = Quality.POOR
        self._gate = gate
        self._commander = OverlayCommander(
            settings=settings,
            cycle_ms=cycle_ms,
            motion=motion,
            limits=limits,
            kinematics=kinematics,
            control=gate.setup,
        )
        self._leaving = False
        """Whether a message of this cycle has not left yet."""
        self._now_ns = 0
        self._overlay_not_before_ns = 0
        self._release_doubted = False
        self._echo_expected = TRAITS[codec.release].commanded_position
        self._restart_told_before_ns = 0
        self._overlay_ended_because = ""
        self._first_counter_of_state: int | None = None
        self._client_saw_state = False
        self._heard: tuple[int, int] | None = None
        """Message that the last answer in time was to, and when that came."""
        self.counters = PacketCounters(FRI_DROPS)
        self.log = SessionLog(emit=emit)

    @property
    def state(self) -> SessionState:
        """Session state."""
        return self.log.state

    @property
    def quality(self) -> Quality:
        """Connection quality."""
        return self._meter.quality

    @property
    def client(self) -> Address:
        """Where the client is."""
        return self._settings.peer

    @property
    def release(self) -> Release:
        """Release that is spoken."""
        return self._codec.release

    @property
    def budget_ns(self) -> int:
        """Time a client has for its answer."""
        return self._budget_ns

    @property
    def answer_latency(self) -> Histogram:
        """Of all answers, from the message's departure to the kernel's stamp, those too late included."""
        return self.path.peer_and_wire

    @property
    def commanding(self) -> bool:
        """True in COMMANDING_WAIT and COMMANDING_ACTIVE."""
        return self.log.state >= _COMMANDING_WAIT

    def receive(self, datagram: bytes, sender: Address, *, now_ns: int) -> None:
        """Take one datagram from the link's socket; never raises for what a peer sends."""
        self.counters.received += 1
        admitted = self._admission.admit(datagram, sender, now_ns=now_ns)
        if isinstance(admitted, Dropped):
            self._drop(admitted.outcome, admitted.detail, now_ns)
            if admitted.looks_like is not None:
                self._note_release(admitted.looks_like, admitted.detail, now_ns)
            elif admitted.overtaken is not None:
                reflected, age_ns = admitted.overtaken
                self.diagnosis.uncounted(reflected, age_ns=age_ns, now_ns=now_ns, overtaken=True)
                self.path.arrived.append((now_ns, age_ns, reflected))
            return
        message, age_ns, outcome, detail, restarted_from = admitted
        reflected = message.reflected_sequence_counter
        if not self._expected.answered(reflected, age_ns=age_ns, now_ns=now_ns):
            self.diagnosis.uncounted(reflected, age_ns=age_ns, now_ns=now_ns)
        self.path.arrived.append((now_ns, age_ns, reflected))
        if restarted_from is not None:
            self._note_restart(restarted_from, message.sequence_counter, now_ns)
        if outcome is not _ACCEPTED:
            self._drop(outcome, detail, now_ns)
            return
        self._heard = reflected, now_ns
        refusal = self._take(message, now_ns)
        if refusal is None:
            self.counters.accepted()
        else:
            self._drop(refusal.outcome, refusal.detail, now_ns)

    def progress(self, *, arm: ArmState, now_ns: int, started_ns: int, closing: bool, barred: str) -> None:
        """Once a cycle: judge what is overdue and move the session.

        ``started_ns`` is when the cycle really began, ``barred`` why no overlay may start, empty when one may.
        """
        self.path.began(now_ns, started_ns)
        if now_ns - self._now_ns > self._cycle_ns:
            self._note_missed_cycles(now_ns)
        self._expected.expire(now_ns=started_ns)
        self._now_ns = now_ns
        tell_at_ns = self.diagnosis.tell_at_ns
        if tell_at_ns is not None and now_ns >= tell_at_ns:
            self.diagnosis.tell(now_ns)
        state = self.log.state
        if state is _IDLE:
            if not closing:
                self._gate.session_opened()
                self._go(Trigger.SESSION_OPENED, "the robot application opens the session", now_ns)
            return
        if self._meter.quality is not self._known_quality:
            self._note_quality(now_ns)
        if state >= _COMMANDING_WAIT:
            self._guard_commanding(now_ns)
        elif state is SessionState.MONITORING_WAIT:
            self._try_ready(now_ns)
        else:
            self._try_overlay(arm, now_ns, barred=barred)

    def end_motion(self, reason: str, *, now_ns: int) -> None:
        """The motion under the overlay ends: back to monitoring. The caller makes the arm brake."""
        if self.commanding:
            trigger = Trigger.MOTION_ENDED if self.quality >= Quality.GOOD else Trigger.QUALITY_LOST
            self._go(trigger, reason, now_ns)
            self._overlay_ended_because = reason
            self._overlay_not_before_ns = now_ns + self._settings.overlay_restart_ms * NS_PER_MS

    def message(self, arm: ArmState, *, operator: OperatorView, now_ns: int, started_ns: int) -> bytes | None:
        """Return the monitoring message of this cycle, or None when none is due."""
        if self._cycles_until_message:
            self._cycles_until_message -= 1
            return None
        if self.log.state is _IDLE:
            return None
        self._cycles_until_message = self._cycles_per_message - 1
        return self._encode(arm, operator, now_ns=now_ns, sent_ns=started_ns)

    def departed(self, *, now_ns: int) -> None:
        """The message of this cycle leaves at ``now_ns``, not when the cycle began."""
        # What leaves may be of the servo link alone: then the message sent last has left long ago.
        if self._leaving:
            self._leaving = False
            self._tracker.departed(at_ns=now_ns)
            self._expected.departed(at_ns=now_ns)
            self.path.departed_ns = now_ns

    def close(self, arm: ArmState, *, operator: OperatorView, now_ns: int) -> bytes | None:
        """Close the session and return its last message, which says IDLE; None if it was not open."""
        self.diagnosis.tell(now_ns, over=True)
        if self.log.state is SessionState.IDLE:
            return None
        self._go(Trigger.SESSION_CLOSED, "the robot application closes the session", now_ns)
        return self._encode(arm, operator, now_ns=now_ns, sent_ns=now_ns)

    def _encode(self, arm: ArmState, operator: OperatorView, *, now_ns: int, sent_ns: int) -> bytes:
        motion = self._motion
        counter = self._tracker.sent(at_ns=sent_ns)
        if self._first_counter_of_state is None:
            self._first_counter_of_state = counter
        self._expected.sent(counter, at_ns=sent_ns)
        self.path.sent(counter, now_ns, sent_ns)
        self._leaving = True
        self.counters.sent += 1
        return self._codec.encode_monitoring(
            self._messages.build(
                sequence_counter=counter,
                reflected_sequence_counter=self._tracker.client_counter or 0,
                state=self.log.state,
                quality=self._meter.quality,
                arm=arm,
                operator=operator,
                control_mode=motion.control.kind,
                set_point=motion.set_point,
                hold_position_rad=motion.hold_position_rad,
                tracking_performance=motion.tracking_performance,
                now_ns=now_ns,
            )
        )

    def _take(self, message: CommandMessage, now_ns: int) -> Refusal | None:
        """Do with the command what it asks for, all or nothing; return why it is ignored, or None."""
        data = message.command
        if data is None or not (data.inputs_outputs or data.transformations):
            return self._take_position(message, now_ns)
        refusal = self._extras_refused(data, now_ns)
        if refusal is not None:
            if self._answers_this_state(message) and self.commanding:
                self._commander.refused(refusal)
                if self.log.state is SessionState.COMMANDING_ACTIVE:
                    self._stop_for(refusal, now_ns)
            return refusal
        refusal = self._take_position(message, now_ns)
        # The recorded I/O clients send no positions, in no state: what else they say counts all the same.
        if refusal is not None and not refusal.missing:
            return refusal
        self._outputs.take(data.inputs_outputs, now_ns=now_ns)
        self.transformations.take(data.transformations, now_ns=now_ns)
        return None

    def _extras_refused(self, data: CommandData, now_ns: int) -> Refusal | None:
        """Judge outputs and transformations, which a client may send in every state."""
        if data.inputs_outputs and (refusal := self._outputs.refusal(data.inputs_outputs)):
            return refusal
        return self.transformations.refusal(data.transformations, now_ns=now_ns) if data.transformations else None

    def _stop_for(self, refusal: Refusal, now_ns: int) -> None:
        self._stop(Fault(f"command out of bounds ({refusal.outcome.value})", refusal.detail), now_ns)

    def _take_position(self, message: CommandMessage, now_ns: int) -> Refusal | None:
        """Do with the position what the state asks for; return why it is ignored, or None."""
        if not (self._client_saw_state or self._answers_this_state(message)):
            return None
        state = self.log.state
        if state is _COMMANDING_ACTIVE:
            refusal = self._commander.command(message)
            if refusal is not None and refusal.ends_motion:
                self._stop_for(refusal, now_ns)
            return refusal
        if state is _COMMANDING_WAIT:
            refusal = self._commander.mirror(message)
            if self._commander.mirrors:
                self._commander.start()
                reason = f"{self._commander.mirrored} answers in a row mirrored the interpolator"
                self._go(Trigger.CLIENT_MIRRORS, reason, now_ns)
            return refusal
        self._doubt_release(message, now_ns)
        return self._commander.monitor(message)

    def _doubt_release(self, message: CommandMessage, now_ns: int) -> None:
        """Say once what an answer in monitoring tells of the client's release (fri-wire, "What a client does")."""
        echoes = message.command is not None and message.command.position is not None
        if self._release_doubted or echoes == self._echo_expected:
            return
        self._release_doubted = True
        self._emit(ReleaseDoubted(now_ns, self._codec.release, echoes_positions=echoes))
        # A client that only sets outputs answers without positions too, whatever its release.
        if echoes or not (message.command or self._outputs.any):
            found = doubted_client(self._codec.release, peer=str(self._settings.peer), echoes_positions=echoes)
            self._find(found, "", now_ns)

    def _note_release(self, looks_like: Release, detail: str, now_ns: int) -> None:
        configured = self._codec.release
        self._find(undecodable_client(looks_like, configured, peer=str(self._settings.peer), detail=detail), "", now_ns)

    def _note_missed_cycles(self, now_ns: int) -> None:
        # Messages go by cycles: what would have left in the missed ones leaves later, and so does all that follows.
        missed_ns = now_ns - self._now_ns - self._cycle_ns
        messages = missed_ns // (self._cycles_per_message * self._cycle_ns)
        if messages and self.log.state is not _IDLE:
            self.path.skip(messages, now_ns=now_ns)
            self.diagnosis.skipped(messages, missed_ns, now_ns=now_ns)

    def _find(self, finding: Finding, subject: str, now_ns: int) -> None:
        self._findings.add(finding, subject=subject, now_ns=now_ns)

    def _answers_this_state(self, message: CommandMessage) -> bool:
        """Whether the client knew the present state; an answer to an earlier one says nothing about this one."""
        first = self._first_counter_of_state
        if first is None:
            return False
        if not self._client_saw_state:
            self._client_saw_state = counter_distance(first, message.reflected_sequence_counter) < REMEMBERED
        return self._client_saw_state

    def _guard_commanding(self, now_ns: int) -> None:
        meter = self._meter
        silent_ns = meter.missed_in_a_row * self._budget_ns
        if silent_ns >= self._watchdog_ns:
            self.diagnosis.lost(
                in_a_row=meter.missed_in_a_row,
                silent_ns=silent_ns,
                watchdog_ns=self._watchdog_ns,
                heard=self._heard,
                now_ns=now_ns,
            )
            self._stop(
                Fault(
                    "client lost",
                    f"{meter.missed_in_a_row} answers in a row are missing, {silent_ns / 1e6:g} ms of silence, "
                    f"the watchdog allows {self._watchdog_ns / 1e6:g} ms{self._last_answer(now_ns)}",
                ),
                now_ns,
            )
        elif meter.quality < _GOOD:
            figure = f"{meter.describe()}{self._own_lateness()}"
            self._stop(Fault(f"quality {meter.quality.name} is not enough", figure), now_ns)
        elif self.log.state is _COMMANDING_WAIT and (problem := self._commander.problem):
            kind = self._commander.problem_kind
            self.log.refuse(SessionState.COMMANDING_ACTIVE, problem, key=kind, now_ns=now_ns)

    def _try_ready(self, now_ns: int) -> None:
        if self.quality >= Quality.GOOD:
            self._go(Trigger.QUALITY_REACHED, self._meter.describe(), now_ns)
        elif self._meter.ever_answered:
            self.log.refuse(
                SessionState.MONITORING_READY,
                f"quality is {self.quality.name}, GOOD is needed: {self._meter.describe()}"
                + ("; it rises one level each half second" if self._meter.rising else self._own_lateness()),
                key=f"quality {self.quality.name} {self._meter.rising}",
                now_ns=now_ns,
            )
        else:
            self.log.refuse(
                SessionState.MONITORING_READY,
                f"no answer from {self._settings.peer} yet: does a client of release {self._codec.release} "
                f"run there and listen on that port?",
                key="never answered",
                now_ns=now_ns,
            )

    def _try_overlay(self, arm: ArmState, now_ns: int, *, barred: str) -> None:
        if self.quality < Quality.GOOD:
            self._go(Trigger.QUALITY_LOST, f"quality {self.quality.name}: {self._meter.describe()}", now_ns)
            return
        if not self._client_saw_state:
            return
        if refusal := barred or self._no_overlay_because(now_ns):
            self.log.refuse(SessionState.COMMANDING_WAIT, refusal, key=refusal, now_ns=now_ns)
            return
        if refusal := self._gate.refusal(arm, now_ns=now_ns):
            key = refusal.translate(_FIGURES)
            self.log.refuse(SessionState.COMMANDING_WAIT, refusal, key=key, now_ns=now_ns)
            return
        self._commander.wait()
        reason = f"the robot application starts a position hold with a {self._settings.overlay} overlay"
        self._go(Trigger.OVERLAY_STARTED, reason, now_ns)

    def _no_overlay_because(self, now_ns: int) -> str:
        if self._settings.overlay is OverlayKind.NONE:
            return "the robot application runs no motion with an overlay (start it with --overlay joint-position)"
        if self._motion.phase is not Phase.HOLDING:
            return f"the arm still brakes ({self._overlay_ended_because})"
        if now_ns < self._overlay_not_before_ns:
            return f"the overlay rests after its end ({self._overlay_ended_because})"
        return ""

    def _last_answer(self, now_ns: int) -> str:
        if self._heard is None:
            return ""
        counter, heard_ns = self._heard
        return f"; the last answer was to message {counter}, {(now_ns - heard_ns) / 1e6:.1f} ms ago"

    def _own_lateness(self) -> str:
        """What this process did to the connection in the last second, in words; nothing when it was on time."""
        since_ns = self._now_ns - WINDOW_NS
        late = sum(
            1
            for due_ns, lateness_ns in self.path.late_cycles
            if due_ns > since_ns and 2 * lateness_ns > self._budget_ns
        )
        if not late:
            return ""
        return (
            f"; {late} of this controller's own cycles began more than half the budget late in that second "
            f"(a busy machine: try --realtime or a longer send period)"
        )

    def _note_quality(self, now_ns: int) -> None:
        old, self._known_quality = self._known_quality, self._meter.quality
        self._emit(QualityChanged(now_ns, old, self._known_quality, self._meter.describe()))
        if self._known_quality < old:
            self.diagnosis.fell(old, self._known_quality, now_ns=now_ns, commanding=self.commanding)

    def _note_restart(self, before: int, counter: int, now_ns: int) -> None:
        if now_ns >= self._restart_told_before_ns:
            self._restart_told_before_ns = now_ns + EVENT_INTERVAL_NS
            self._emit(ClientRestarted(now_ns, before, counter))
        if self.commanding:
            self._stop(Fault("the client restarted while it was commanding"), now_ns)

    def _drop(self, outcome: Outcome, detail: str, now_ns: int) -> None:
        event = self.counters.dropped(outcome, detail, now_ns=now_ns)
        if event is not None:
            self._emit(event)

    def _go(self, trigger: Trigger, reason: str, now_ns: int) -> None:
        self.log.enter(next_state(self.log.state, trigger), self.quality, reason, now_ns=now_ns)
        self._first_counter_of_state = None
        self._client_saw_state = False
