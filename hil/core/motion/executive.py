"""Who has the arm: the hold it always comes back to, an FRI overlay, an application's motion or a brake; as a table."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final

from hil.core.motion.application_motion import ApplicationMotion
from hil.core.motion.axis_range import within_range
from hil.core.motion.brake import Brake
from hil.core.motion.joint_overlay import JointOverlay
from hil.core.motion.position_hold import PositionHold
from hil.core.motion.queue import MotionQueue
from hil.core.motion.set_point import STILL, SetPoint
from hil.core.motion.tempo import Tempo
from hil.values.arm import seven
from hil.values.control import NO_WRENCH, ControlSetup
from hil.values.errors import IllegalTransition
from hil.values.motion import Fault
from hil.values.robot import JointLimits, Seven, Six

POSITION: Final = ControlSetup()


class Phase(StrEnum):
    """What the arm is doing."""

    HOLDING = "holding"
    OVERLAY = "overlay"
    APPLICATION = "application motion"
    BRAKING = "braking"


# A member of an enumeration costs a search each time it is named by its class, and these are named in every cycle.
_OVERLAY: Final = Phase.OVERLAY
_APPLICATION: Final = Phase.APPLICATION
_BRAKING: Final = Phase.BRAKING

PHASES: Final[Mapping[Phase, frozenset[Phase]]] = {
    Phase.HOLDING: frozenset({Phase.OVERLAY, Phase.APPLICATION}),
    Phase.OVERLAY: frozenset({Phase.BRAKING}),
    Phase.APPLICATION: frozenset({Phase.BRAKING, Phase.HOLDING}),
    Phase.BRAKING: frozenset({Phase.HOLDING}),
}
"""Phase to the phases that may follow it. One application's motion may follow another within APPLICATION."""


class MotionExecutive:
    """Owns the set point. Starts as a position hold at ``position_rad``.

    An arm that yields need not be where its set point is. When it is to be stiff again, the set point begins anew
    where the arm is: a stiff arm would jump there.
    """

    def __init__(
        self,
        position_rad: Seven,
        *,
        limits: JointLimits,
        cycle_s: float,
        hold_control: ControlSetup = POSITION,
        always_yields: bool = False,
    ) -> None:
        """``always_yields``: it is the robot side that yields, also while the arm is held."""
        self._limits = limits
        self._hold_control = hold_control
        self._always_yields = always_yields
        self._cycle_s = cycle_s
        position_rad = within_range(position_rad, limits)
        self._motion: PositionHold | JointOverlay | Brake = PositionHold(position_rad)
        self.phase = Phase.HOLDING
        self.hold_position_rad = position_rad
        self.set_point = self._motion.interpolate()
        self.applications = MotionQueue()
        self._tempo = Tempo(limits=limits, cycle_s=cycle_s)
        self.override = 1.0
        """Share of their velocity at which motions of applications run, 0..1."""
        self._paused_since_ns: int | None = None
        self.control = hold_control
        """How what has the arm is controlled; an arm that is held is held stiffly."""
        self.control_of: object = None
        """Whose control that is."""
        self.overlay_torque_nm: Seven = STILL
        """What a torque overlay adds to joint impedance, Nm; zero without one."""
        self.overlay_wrench: Six = NO_WRENCH
        """What a wrench overlay adds to Cartesian impedance, N and Nm; zero without one."""
        self._measured = position_rad, STILL
        """Where the arm was measured last, and how fast."""

    @property
    def tracking_performance(self) -> float:
        """1.0 when the set point follows the overlay at once, less while it is slowed to the axis velocities."""
        return self._motion.tracking_performance if isinstance(self._motion, JointOverlay) else 0.0

    @property
    def overlay_target_rad(self) -> Seven | None:
        """The last position the overlay was given, None without an overlay."""
        return self._motion.target if isinstance(self._motion, JointOverlay) else None

    @property
    def at_rest(self) -> bool:
        """True while the arm holds its position and no motion is about to begin."""
        return self.phase is Phase.HOLDING and not self.applications

    @property
    def paused(self) -> bool:
        """Whether motions of applications are paused, or about to stand still because of a pause."""
        return self._paused_since_ns is not None

    @property
    def stands(self) -> bool:
        """Whether the set point stands still and goes on standing: nothing has the arm, or what has it is paused."""
        if self.phase is Phase.APPLICATION:
            return self.paused and self._tempo.stands
        return self.phase is Phase.HOLDING

    def set_override(self, share: float) -> None:
        """Let motions of applications run at ``share`` (0..1) of their velocity from now on."""
        active = self.applications.active
        if 0.0 in {share, self.override} and active is not None and active.motion.seconds_hand is not None:
            active.motion.seconds_hand.begins_anew()
        self.override = share
        if not self.paused:
            self._aim(share)

    def pause(self, *, now_ns: int) -> None:
        """Bring a motion of an application to a stop on its path, and begin none, until :meth:`resume`."""
        if not self.paused:
            self._paused_since_ns = now_ns
            self._aim(0.0)

    def resume(self, *, now_ns: int) -> None:
        """Let the paused motion go on from where it stands, and begin what waits."""
        if self._paused_since_ns is None:
            return
        if self.applications.active is not None:
            self.applications.active.motion.resumed(paused_ns=now_ns - self._paused_since_ns)
        self._paused_since_ns = None
        self._aim(self.override)

    def drop(self, fault: Fault, *, now_ns: int) -> None:
        """End whatever moves the arm without braking it: its drives are dropped, and the brakes do that."""
        self.applications.fail(fault, now_ns=now_ns)
        if self.phase is not Phase.HOLDING:
            if self.phase is not Phase.BRAKING:
                self._enter(Phase.BRAKING)
            self._hold()
        self.set_point = self._motion.interpolate()

    def change_control(self, motion: ApplicationMotion, control: ControlSetup) -> None:
        """A motion is controlled with other parameters from now on, now or when its turn comes."""
        motion.control = control
        if self.control_of is motion:
            self.control = control

    def follow(self, position_rad: Seven) -> None:
        """The arm is where it is, and no drive holds it: hold it there once one does. Needs a phase of holding.

        An arm at the end of an axis range is measured a little beyond it; it is held at the end.
        """
        self.hold_position_rad = position_rad = within_range(position_rad, self._limits)
        self._motion = PositionHold(position_rad)
        self.set_point = self._motion.interpolate()

    def start_overlay(self, *, cycles_per_target: int, control: ControlSetup | None = None) -> None:
        """Lay a joint overlay over the hold; raise :class:`IllegalTransition` unless the arm is holding."""
        self._enter(Phase.OVERLAY)
        self.control, self.control_of = control or self._hold_control, None
        self._motion = JointOverlay(
            self.set_point, limits=self._limits, cycle_s=self._cycle_s, cycles_per_target=cycles_per_target
        )

    def retarget(self, target: Seven) -> None:
        """Hand a target (rad) to the running overlay."""
        if not isinstance(self._motion, JointOverlay):
            raise IllegalTransition(self.phase.value, "a new overlay target", [Phase.OVERLAY.value])
        self._motion.retarget(target)

    def stop_application_motion(self, *, now_ns: int) -> None:
        """End the application's active motion; what waits takes over in the next cycle, else the arm brakes."""
        self.applications.stop_active(now_ns=now_ns)
        if not self.applications:
            self._brake()

    def fail_application_motion(self, fault: Fault, *, now_ns: int, number: int | None = None) -> bool:
        """End an application's motion and all behind it; return whether the arm began to brake with it."""
        had_the_arm = self.applications.fail(fault, now_ns=now_ns, number=number)
        # Between the end of one motion and the beginning of the next the arm still moves as the first one left it.
        in_between = self.phase is Phase.APPLICATION and self.applications.active is None and not self.applications
        if not (had_the_arm or in_between):
            return False
        self._brake()
        return True

    def brake(self, fault: Fault, *, now_ns: int) -> bool:
        """End whatever moves the arm by braking, and drop what waits; return whether something had the arm."""
        if self.phase is Phase.OVERLAY:
            self._brake()
            return True
        return bool(self.applications) and self.fail_application_motion(fault, now_ns=now_ns)

    def brake_harder(self) -> bool:
        """Brake from the present set point in half the time the running brake takes, at last within one cycle.

        Return whether that was possible: nothing is harder than within one cycle. Raise :class:`IllegalTransition`
        unless the arm is braking.
        """
        if not isinstance(self._motion, Brake):
            raise IllegalTransition(self.phase.value, "braking harder", [Phase.BRAKING.value])
        if self._motion.duration_s == 0.0:
            return False
        half_s = self._motion.duration_s / 2
        self._motion = Brake(
            self.set_point,
            limits=self._limits,
            cycle_s=self._cycle_s,
            longest_s=half_s if half_s > self._cycle_s else 0.0,
        )
        return True

    def propose(
        self, *, measured_rad: Seven, now_ns: int, started_ns: int, measured_rad_s: Seven = STILL
    ) -> SetPoint | Fault:
        """Return the set point the running motion wants next, which counts only once it is committed.

        A fault is one of the application's motion; the caller ends it with :meth:`brake` and asks again.
        """
        applications = self.applications
        self._measured = measured_rad, measured_rad_s
        if self.phase is _OVERLAY:
            return self._motion.interpolate()
        if self.phase is _APPLICATION and not applications:
            # The last motion left while none had the arm: between the end of one and the beginning of the next.
            self._rest()
        if not applications or self.phase is _BRAKING:
            return self._motion.interpolate()
        if self.phase is not _APPLICATION:
            if self.paused:
                return self._motion.interpolate()
            self._enter(_APPLICATION)
            self._tempo.begins(self.set_point)

        def next_of_motion() -> SetPoint | Fault:
            active = applications.active
            if active is None or (len(applications) > 1 and applications.next_blends(now_ns=now_ns)):
                fault = self._hand_over(measured_rad=measured_rad, now_ns=now_ns)
                if fault is not None:
                    return fault
                active = applications.active
            if active is None:
                return self.set_point
            return active.motion.interpolate(now_ns=now_ns, started_ns=started_ns)

        return next_of_motion() if self._tempo.full else self._tempo.next(next_of_motion)

    def commit(self, set_point: SetPoint, *, now_ns: int) -> bool:
        """Take ``set_point`` as the present one; return True when braking ended with it."""
        self.set_point = set_point
        phase = self.phase
        if phase is _BRAKING and self._motion.at_rest:
            self._hold()
            return True
        if phase is _APPLICATION and (active := self.applications.active) and active.motion.ended:
            if not self._tempo.settled:
                return False
            self.applications.finish(now_ns=now_ns)
            if not self.applications:
                self._rest()
        return False

    def _hand_over(self, *, measured_rad: Seven, now_ns: int) -> Fault | None:
        """Begin the motion whose turn it is, blended into or not; return why it cannot begin."""
        if self.applications.active is not None:
            self.applications.finish(now_ns=now_ns, blended=True)
        motion = self.applications.first.motion
        if self.control.yields and not motion.control.yields:
            self._begin_anew()
        self.control, self.control_of = motion.control, motion
        start = self._tempo.takes_over_at(self.set_point)
        return self.applications.begin_next(start, measured_rad=measured_rad, now_ns=now_ns)

    def _aim(self, tempo: float) -> None:
        self._tempo.aim(tempo, present=self.set_point, moving=self.phase is Phase.APPLICATION)

    def _begin_anew(self) -> None:
        """Put the set point where the arm is, moving as it moves."""
        limits = self._limits
        position_rad, velocity_rad_s = self._measured
        velocity = seven(
            [min(max(value, -most), most) for value, most in zip(velocity_rad_s, limits.velocity_rad_s, strict=True)]
        )
        self.set_point = SetPoint(within_range(position_rad, limits), velocity)
        self._tempo.begins_anew(self.set_point)

    def _rest(self) -> None:
        if self.control.yields:
            self._begin_anew()
        if self.set_point.velocity_rad_s == STILL:
            self._hold()
        else:
            self._brake()

    def _brake(self) -> None:
        self._enter(Phase.BRAKING)
        self.overlay_torque_nm, self.overlay_wrench = STILL, NO_WRENCH
        self._motion = Brake(self.set_point, limits=self._limits, cycle_s=self._cycle_s)

    def _hold(self) -> None:
        self._enter(Phase.HOLDING)
        if self.control.yields and not self._always_yields:
            self._begin_anew()
            self.set_point = SetPoint(self.set_point.position_rad, STILL)
        self.control, self.control_of = self._hold_control, None
        self.overlay_torque_nm, self.overlay_wrench = STILL, NO_WRENCH
        self.hold_position_rad = self.set_point.position_rad
        self._motion = PositionHold(self.hold_position_rad)

    def _enter(self, phase: Phase) -> None:
        if phase not in PHASES[self.phase]:
            raise IllegalTransition(self.phase.value, phase.value, [known.value for known in PHASES[self.phase]])
        self.phase = phase
