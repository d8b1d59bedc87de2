"""The controller of one robot: six verbs, one cycle.

``receive(datagram, source, now_ns)``, ``operate(action, now_ns)``, ``tick(now_ns)``, ``outgoing(now_ns)``,
``events()``, ``close(now_ns)``. Live process, tests, replay and benchmarks use the same six. Times are integer
nanoseconds on the core's own axis, which starts at 0.
"""

from collections import deque
from collections.abc import Callable
from functools import partial

from hil.core.control.load_validation import LoadValidation
from hil.core.control.stage import ControlStage
from hil.core.diagnosis.findings import FindingLog
from hil.core.diagnosis.oscillation_watch import OscillationWatch
from hil.core.events import ArmResting, ArmStopped, Event, InputSet
from hil.core.fri.link import FriLink
from hil.core.fri.messages import MessageBuilder
from hil.core.fri.outputs import ClientOutputs
from hil.core.fri.overlay_gate import OverlayGate
from hil.core.fri.transformations import RequestedTransformations
from hil.core.kinematics.redundancy import nearest
from hil.core.kinematics.srs import SrsKinematics
from hil.core.model import ArmModel
from hil.core.motion.application_motion import MotionBasis
from hil.core.motion.executive import MotionExecutive, Phase
from hil.core.motion.set_point import SetPoint
from hil.core.pushes import Pusher
from hil.core.safety.supervisor import Supervisor, operator_report
from hil.core.servo.link import SERVO_LINK, ServoLink
from hil.core.settings import ControllerSettings
from hil.core.signals import SignalTable
from hil.values.arm import ArmState, Backend, PeerBackend
from hil.values.control import ControlSetup
from hil.values.errors import ConfigurationError, IllegalTransition
from hil.values.fri import OverlayKind
from hil.values.fri_messages import ControllerCodec
from hil.values.link import Outgoing, Source
from hil.values.motion import Fault
from hil.values.operator import OperatorAction, OperatorView, SetInput, StopCategory
from hil.values.robot import RobotDescription
from hil.values.servo import ServoControllerCodec
from hil.values.tuples import new_tuple

__all__ = ["FRI_LINK", "ROBOT_SIDE_LINK", "SHUTS_DOWN", "Controller", "operator_report"]

FRI_LINK = "fri"
ROBOT_SIDE_LINK = "robot side"
"""The link to a robot side that is a network peer."""
SHUTS_DOWN = Fault("the controller shuts down")
MAX_EVENTS = 10_000
_POSITION_OVERLAYS = frozenset({OverlayKind.JOINT_POSITION, OverlayKind.CARTESIAN_POSE})


class Controller:
    """One robot. The backend is open before and closed after; ``on_stage`` is told the end of each stage of a tick."""

    def __init__(
        self,
        settings: ControllerSettings,
        *,
        description: RobotDescription,
        model: ArmModel,
        backend: Backend,
        codec: ControllerCodec | None = None,
        servo_codec: ServoControllerCodec | None = None,
        on_stage: Callable[[str], None] | None = None,
    ) -> None:
        self._settings = settings
        self._backend = backend
        self._peer = backend if isinstance(backend, PeerBackend) else None
        self._on_stage = on_stage
        self._events: deque[Event] = deque(maxlen=MAX_EVENTS)
        self._outgoing: list[Outgoing] = []
        self._findings = FindingLog(self._events.append)
        self._arm = backend.read()
        self._robot_side_yields = bool(backend.capabilities.passes_overlays)
        """Whether the robot side runs an impedance of its own, also while nothing is laid over."""
        self._motion = MotionExecutive(
            self._arm.position_rad,
            limits=description.limits,
            cycle_s=settings.cycle_ns * 1e-9,
            hold_control=ControlSetup(load=settings.load),
            always_yields=self._robot_side_yields,
        )
        self._oscillation = OscillationWatch(
            self._motion,
            self._findings,
            positions_laid_over=settings.fri is not None and settings.fri.overlay in _POSITION_OVERLAYS,
        )
        self._control = ControlStage(
            model.dynamics(settings.load),
            sensor_sigma_nm=backend.capabilities.torque_sigma_nm,
            runs_laws=backend.capabilities.takes_torque or not backend.capabilities.passes_overlays,
        )
        self._pusher = Pusher(backend)
        self._safety = Supervisor(
            settings=settings,
            limits=description.limits,
            model=model,
            backend=backend,
            pusher=self._pusher,
            motion=self._motion,
            emit=self._events.append,
        )
        self._signals = SignalTable(settings.signals)
        kinematics = model.kinematics(description.limits)
        self._fri = self._make_fri(codec, description, model, kinematics)
        self._servo = self._make_servo(servo_codec, description, model, kinematics)
        self._safety.end_overlay = self._end_overlay
        self._before: SetPoint = self._motion.set_point
        self._closing = False
        self._proposed = self._motion.set_point
        self._yielded = self._robot_side_yields
        """Whether the arm was to yield in the cycle before."""
        self._stages: tuple[tuple[str, Callable[[int, int], None]], ...] = (
            ("read", self._read),
            ("session", self._progress),
            ("interpolate", self._interpolate),
            ("safety on the set point", self._check_set_point),
            ("backend", self._move),
            ("safety on the measured state", self._check_measured),
            ("send", self._send),
        )
        self.initial_position_rad = self._arm.position_rad
        self.ticks = 0
        self.closed = False

    def receive(self, datagram: bytes, source: Source, *, now_ns: int) -> bool:
        """Take one datagram that arrived at ``now_ns``; nothing a peer sends raises.

        Return whether a robot side that paces the cycle waits for one now.
        """
        if source.link == FRI_LINK and self._fri is not None:
            self._fri.receive(datagram, source.address, now_ns=now_ns)
        elif source.link == SERVO_LINK and self._servo is not None:
            self._servo.receive(datagram, source.address, now_ns=now_ns)
        elif source.link == ROBOT_SIDE_LINK and self._peer is not None:
            return self._peer.receive(datagram, source.address, now_ns=now_ns)
        return False

    def operate(self, action: OperatorAction, *, now_ns: int) -> str:
        """Do what the operator did with the pad; return why that changes nothing, or an empty text."""
        if self.closed or self._closing:
            return SHUTS_DOWN.reason
        if isinstance(action, SetInput):
            refusal = self._signals.set_input(action.name, action.value)
            self._events.append(InputSet(now_ns, action.name, action.value, refusal))
            return refusal
        return self._safety.operate(action, commanding=self._fri_commands, now_ns=now_ns)

    def tick(self, *, now_ns: int, lateness_ns: int = 0) -> None:
        """Run one control cycle. ``now_ns`` is its nominal time, ``lateness_ns`` how late it really began.

        Raises :class:`hil.values.errors.BackendError` when the robot side fails.
        """
        if self.closed:
            return
        self.ticks += 1
        started_ns = now_ns + lateness_ns
        on_stage = self._on_stage
        if on_stage is None:
            for _, stage in self._stages:
                stage(now_ns, started_ns)
            return
        for name, stage in self._stages:
            stage(now_ns, started_ns)
            on_stage(name)

    def outgoing(self, *, now_ns: int | None = None) -> list[Outgoing]:
        """Return and forget the datagrams to send.

        ``now_ns`` is when they leave; without it they leave when their cycle began. Answers are timed from there.
        """
        datagrams, self._outgoing = self._outgoing, []
        if now_ns is not None and datagrams:
            if self._fri is not None:
                self._fri.departed(now_ns=now_ns)
            if self._servo is not None:
                self._servo.departed(now_ns=now_ns)
        return datagrams

    def events(self) -> list[Event]:
        """Return and forget what happened."""
        if not self._events:
            return []
        happened = list(self._events)
        self._events.clear()
        return happened

    def close(self, *, now_ns: int) -> None:
        """Bring the arm to rest and end every session; ticks are needed until ``closed`` unless the arm rests."""
        if self.closed or self._closing:
            return
        self._closing = True
        if self._servo is not None:
            self._servo.close_door(SHUTS_DOWN.reason)
        self._safety.stop(SHUTS_DOWN, now_ns)
        if self._motion.at_rest:
            self._finish(now_ns)

    def abandon(self, *, now_ns: int) -> None:
        """The robot side failed: end every session at once, with what is known of the arm. Nothing moves any more."""
        if not self.closed:
            failed = Fault("the robot side failed")
            self._safety.stop(failed, now_ns, StopCategory.DROP)
            if self._servo is not None:
                self._servo.close_door(failed.reason)
            self._finish(now_ns)

    def report(self) -> dict[str, object]:
        """Return what the core knows of the run, for the status file; rad, mm/s, microseconds, seconds."""
        fri = self._fri
        return {
            "ticks": self.ticks,
            "answer_latency_us": fri.answer_latency.summary_us() if fri is not None else None,
            "answer_path_us": fri.path.report() if fri is not None else None,
            "answers_at_fault": fri.diagnosis.report() if fri is not None else None,
            "slowest_answers": [one.as_dict() for one in fri.path.worst] if fri is not None else [],
            "session": fri.log.report(fri.quality) if fri is not None else None,
            "packets": fri.counters.report() if fri is not None else None,
            "servo": self._servo.report() if self._servo is not None else None,
            "io": self._signals.report(),
            "robot_side": self._peer.report() if self._peer is not None else None,
            "findings": self._findings.report(),
            "transformations": fri.transformations.report() if fri is not None else {},
            **self._safety.report(),
            "initial_position": list(self.initial_position_rad),
            "measured_position": list(self._arm.position_rad),
            "commanded_position": list(self._motion.set_point.position_rad),
        }

    @property
    def fri(self) -> FriLink | None:
        """The FRI link, to be looked at."""
        return self._fri

    @property
    def servo(self) -> ServoLink | None:
        """The servo link, to be looked at."""
        return self._servo

    @property
    def cycle_ns(self) -> int:
        """Time from one tick to the next."""
        return self._settings.cycle_ns

    @property
    def findings(self) -> FindingLog:
        """What was diagnosed, to be looked at."""
        return self._findings

    @property
    def signals(self) -> SignalTable:
        """Inputs and outputs, to be looked at."""
        return self._signals

    @property
    def arm(self) -> ArmState:
        """What was measured last."""
        return self._arm

    @property
    def operator(self) -> OperatorView:
        """What the pad shows."""
        return self._safety.view

    @property
    def closest(self) -> str:
        """Smallest margin of the run so far, in words."""
        return self._safety.closest

    @property
    def margins(self) -> dict[str, dict[str, object]]:
        """How much of each limit was used at most, when, and by which axis."""
        return self._safety.monitors.report()

    @property
    def stops(self) -> deque[ArmStopped]:
        """The last stops, and ends of motions for an error."""
        return self._safety.stops

    @property
    def motion(self) -> MotionExecutive:
        """Who has the arm, to be looked at."""
        return self._motion

    def _make_fri(
        self,
        codec: ControllerCodec | None,
        description: RobotDescription,
        model: ArmModel,
        kinematics: SrsKinematics,
    ) -> FriLink | None:
        settings = self._settings
        if settings.fri is None:
            return None
        if codec is None:
            raise ConfigurationError("an FRI link needs the codec of its release")
        transformations = RequestedTransformations(
            settings.fri.transformations, release=codec.release, unix_epoch_ns=settings.unix_epoch_ns
        )
        settings.fri.check_release(codec.release)
        settings.fri.check_robot_side(self._backend.capabilities)
        validation = LoadValidation(dynamics=self._control.dynamics, kinematics=kinematics, limits=description.limits)
        return FriLink(
            settings=settings.fri,
            cycle_ms=settings.cycle_ms,
            codec=codec,
            messages=MessageBuilder(
                control=self._control,
                release=codec.release,
                settings=settings,
                fri=settings.fri,
                model=model,
                signals=self._signals,
                requested_transformations=transformations.on_wire,
            ),
            motion=self._motion,
            limits=description.limits,
            outputs=ClientOutputs(self._signals, emit=self._events.append),
            transformations=transformations,
            kinematics=kinematics,
            gate=OverlayGate(
                setup=ControlSetup(settings.fri.control, settings.load), validation=validation, kinematics=kinematics
            ),
            findings=self._findings,
            emit=self._events.append,
            stop=self._safety.stop,
        )

    def _make_servo(
        self,
        codec: ServoControllerCodec | None,
        description: RobotDescription,
        model: ArmModel,
        kinematics: SrsKinematics,
    ) -> ServoLink | None:
        settings = self._settings
        if settings.servo is None:
            return None
        if codec is None:
            raise ConfigurationError("a servo link needs its codec")
        basis = MotionBasis(
            limits=description.limits,
            servo=description.servo,
            cycle_ns=settings.cycle_ns,
            smart_servo_dead_time_ns=settings.reaction.smart_servo_dead_time_ns,
            direct_servo_dead_time_ns=settings.reaction.direct_servo_dead_time_ns,
            flange=self._safety.flange,
            axes_nearest=partial(nearest, kinematics),
        )
        return ServoLink(
            settings=settings,
            servo=settings.servo,
            codec=codec,
            executive=self._motion,
            control=self._control,
            basis=basis,
            kinematics=kinematics,
            model=model,
            takes_torque=self._backend.capabilities.takes_torque,
            pusher=self._pusher,
            contacts=self._backend.contacts,
            findings=self._findings,
            emit=self._events.append,
            failed=self._safety.note_stop,
        )

    @property
    def _fri_commands(self) -> bool:
        return self._fri is not None and self._fri.commanding

    def _end_overlay(self, fault: Fault, now_ns: int) -> None:
        if self._fri is not None:
            self._fri.end_motion(str(fault), now_ns=now_ns)

    def _read(self, now_ns: int, _started_ns: int) -> None:
        self._before = self._motion.set_point
        if self._peer is not None:
            self._peer.advance(now_ns=now_ns)
        self._arm = arm = self._control.read(self._backend.read(), now_ns=now_ns)
        self._safety.read(arm, now_ns=now_ns)

    def _progress(self, now_ns: int, started_ns: int) -> None:
        fri, servo, safety = self._fri, self._servo, self._safety
        commanding = fri is not None and fri.commanding
        waits = safety.follow_operator(self._arm, commanding=commanding, closing=self._closing, now_ns=now_ns)
        if fri is not None:
            barred = SHUTS_DOWN.reason if self._closing else waits
            if not barred and servo is not None and (commander := servo.commander):
                barred = f"the application {commander} commands the arm over the servo link"
            fri.progress(arm=self._arm, now_ns=now_ns, started_ns=started_ns, closing=self._closing, barred=barred)
        if servo is not None:
            # A paused program lets motions wait; a stop lets none in.
            barred = safety.bars_motions
            if fri is not None and fri.commanding:
                barred = "the FRI client commands the arm: end its overlay first, or run the controller without one"
            servo.progress(arm=self._arm, now_ns=now_ns, started_ns=started_ns, barred=barred)
        self._oscillation.look(self._arm.position_rad, now_ns=now_ns)

    def _interpolate(self, now_ns: int, started_ns: int) -> None:
        proposed = self._propose(now_ns, started_ns)
        if isinstance(proposed, Fault):
            self._safety.stop(proposed, now_ns)
            proposed = self._propose(now_ns, started_ns)
            if isinstance(proposed, Fault):
                raise IllegalTransition(self._motion.phase.value, f"a second fault ({proposed})", ["a set point"])
        self._proposed = proposed

    def _propose(self, now_ns: int, started_ns: int) -> SetPoint | Fault:
        arm = self._arm
        return self._motion.propose(
            measured_rad=arm.position_rad,
            measured_rad_s=arm.velocity_rad_s,
            now_ns=now_ns,
            started_ns=started_ns,
        )

    def _check_set_point(self, now_ns: int, started_ns: int) -> None:
        safety, motion = self._safety, self._motion
        trip = safety.check_set_point(self._proposed, now_ns=now_ns)
        if trip is None:
            return
        if safety.stop(trip.fault, now_ns, trip.category):
            self._interpolate(now_ns, started_ns)
        # A brake may fail a monitor too: the flange can still get faster while the axes get slower.
        while (trip := safety.check_set_point(self._proposed, now_ns=now_ns)) is not None:
            if motion.phase is not Phase.BRAKING or not motion.brake_harder():
                # Nothing the arm could be told is legal: it is told nothing.
                safety.stop(trip.fault, now_ns, StopCategory.DROP)
                self._proposed = motion.set_point
                return
            self._interpolate(now_ns, started_ns)

    def _move(self, now_ns: int, _started_ns: int) -> None:
        proposed, motion, backend = self._proposed, self._motion, self._backend
        backend.write(self._control.command(proposed, motion, now_ns=now_ns))
        backend.step()
        if self._peer is not None:
            self._outgoing += [Outgoing(ROBOT_SIDE_LINK, *answer) for answer in self._peer.outgoing()]
        if motion.commit(proposed, now_ns=now_ns):
            self._events.append(ArmResting(now_ns))

    def _check_measured(self, now_ns: int, _started_ns: int) -> None:
        self._safety.check_measured(self._arm, self._before, yields=self._yielded, now_ns=now_ns)
        self._yielded = self._robot_side_yields or self._motion.control.yields
        fault = self._control.violation
        if fault is not None and self._motion.phase is not Phase.BRAKING:
            self._safety.stop(fault, now_ns)

    def _send(self, now_ns: int, started_ns: int) -> None:
        if self._closing and self._motion.at_rest:
            self._finish(now_ns)
            return
        if self._fri is not None:
            message = self._fri.message(self._arm, operator=self._safety.view, now_ns=now_ns, started_ns=started_ns)
            if message is not None:
                self._outgoing.append(new_tuple(Outgoing, (FRI_LINK, message, None)))
        if self._servo is not None:
            self._outgoing += self._servo.outgoing(
                self._arm, operator=self._safety.view, cycle=self.ticks, now_ns=now_ns
            )

    def _finish(self, now_ns: int) -> None:
        if self._fri is not None:
            last = self._fri.close(self._arm, operator=self._safety.view, now_ns=now_ns)
            if last is not None:
                self._outgoing.append(Outgoing(FRI_LINK, last))
        if self._servo is not None:
            self._outgoing += self._servo.close(now_ns=now_ns)
        self.closed = True
