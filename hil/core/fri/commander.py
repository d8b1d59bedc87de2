"""The client as commander of an overlay: first it mirrors the interpolator, then it commands."""

from typing import NamedTuple, TypeAlias

from hil.core.fri.commands import CommandBounds, Refusal, joint_position, not_allowed
from hil.core.fri.overlay_commands import axes_of, axis_torque, cartesian_pose, with_singularity, wrench
from hil.core.kinematics.srs import SrsKinematics
from hil.core.motion.executive import MotionExecutive
from hil.core.motion.set_point import STILL
from hil.core.settings import NS_PER_MS, FriSettings
from hil.values.control import NO_WRENCH, ControlSetup
from hil.values.fri import SEQUENCE_MODULUS, OverlayKind
from hil.values.fri_messages import CommandData, CommandMessage
from hil.values.robot import JOINT_NAMES, JointLimits, Seven, Six

_Demand: TypeAlias = tuple[Seven, Seven, Six]
"""What a command asks for, whatever the overlay: position in rad, and what is added to it: torques in Nm, a wrench."""


class _Off(NamedTuple):
    """What of an answer is not where the interpolator is: in words, and without the figures."""

    problem: str
    kind: str


class OverlayCommander:
    """Judges what the client commands and hands what is legal to the motion, which ``control`` is for."""

    def __init__(
        self,
        *,
        settings: FriSettings,
        cycle_ms: int,
        motion: MotionExecutive,
        limits: JointLimits,
        kinematics: SrsKinematics,
        control: ControlSetup,
    ) -> None:
        self._settings = settings
        self._overlay = settings.overlay
        self._poses = settings.overlay is OverlayKind.CARTESIAN_POSE
        self._torques = settings.overlay is OverlayKind.TORQUE
        self._wrenches = settings.overlay is OverlayKind.WRENCH
        self._cycles_per_target = settings.budget_ms // cycle_ms
        self._motion = motion
        self._bounds = CommandBounds(limits)
        self._torque_limit_nm = limits.torque_nm
        self._kinematics = kinematics
        self._control = control
        self._send_period_ns = settings.send_period_ms * NS_PER_MS
        self._watchdog_ns = settings.watchdog_ns
        self._approach_s = settings.budget_ns * 1e-9
        self._accepted_position: Seven = motion.hold_position_rad
        self._accepted_counter = 0
        self._silent_answers = 0
        self.mirrored = 0
        """Answers in a row that mirrored the interpolator."""
        self.problem = ""
        """Why the last answer did not mirror it, in words."""
        self.problem_kind = ""
        """The same without the figures, which differ from answer to answer."""

    @property
    def mirrors(self) -> bool:
        """Whether enough answers in a row mirrored the interpolator."""
        return self.mirrored >= self._settings.mirror_answers

    def wait(self) -> None:
        """A motion with an overlay was started; the client has to mirror it first."""
        self.mirrored = 0
        self.problem = ""

    def mirror(self, message: CommandMessage) -> Refusal | None:
        """Count an answer that mirrors the interpolator; return why it is none at all, or None."""
        data, hold = message.command, self._motion.hold_position_rad
        off = self._pose_off(data, hold) if self._poses else self._position_off(data, hold)
        if off is None:
            self.mirrored += 1
            self._accepted_counter = message.reflected_sequence_counter
            return None
        self.mirrored = 0
        if isinstance(off, Refusal):
            self.problem, self.problem_kind = off.detail, off.outcome.value
            return off
        self.problem, self.problem_kind = off
        return None

    def refused(self, refusal: Refusal) -> None:
        """An answer was not taken for something else in it; in COMMANDING_WAIT it mirrors nothing."""
        self.mirrored = 0
        self.problem, self.problem_kind = refusal.detail, refusal.outcome.value

    def start(self) -> None:
        """The client commands from now on."""
        self._accepted_position = self._motion.hold_position_rad
        self._silent_answers = 0
        self._motion.start_overlay(cycles_per_target=self._cycles_per_target, control=self._control)

    def command(self, message: CommandMessage) -> Refusal | None:
        """Hand a legal command to the motion; return why it is not, or None.

        What a command adds to the torques lasts until the next answer: one that adds nothing ends it.
        """
        demand = self._demand(message.command)
        if isinstance(demand, Refusal):
            return self._without_demand(message, demand)
        position, torque_nm, force = demand
        reflected = message.reflected_sequence_counter
        periods = (reflected - self._accepted_counter) % SEQUENCE_MODULUS
        elapsed_ns = min(periods * self._send_period_ns, self._watchdog_ns)
        refusal = self._bounds.step(
            position, self._accepted_position, elapsed_s=elapsed_ns * 1e-9, approach_s=self._approach_s
        )
        if refusal is not None:
            if self._poses:
                refusal = with_singularity(refusal, self._kinematics, position)
            return refusal._replace(ends_motion=True)
        self._silent_answers = 0
        self._accepted_position = position
        self._accepted_counter = reflected
        self._motion.retarget(position)
        if self._torques or self._wrenches:
            self._motion.overlay_torque_nm, self._motion.overlay_wrench = torque_nm, force
        return None

    def monitor(self, message: CommandMessage) -> Refusal | None:
        """Look at what a monitoring client says; nothing is done with it but to say what is wrong."""
        if message.command is None or message.command.position is None:
            return None
        if refusal := not_allowed(message.command, OverlayKind.JOINT_POSITION):
            return refusal
        position = joint_position(message.command)
        return position if isinstance(position, Refusal) else self._bounds.position(position)

    def _demand(self, data: CommandData | None) -> _Demand | Refusal:
        refusal = not_allowed(data, self._overlay)
        if refusal is not None:
            return refusal
        if self._poses:
            target = cartesian_pose(data)
            if isinstance(target, Refusal):
                return target
            axes = axes_of(target, self._kinematics, self._accepted_position)
            return axes if isinstance(axes, Refusal) else (axes, STILL, NO_WRENCH)
        position = joint_position(data)
        if isinstance(position, Refusal):
            return position
        return self._added(position, data) if self._torques or self._wrenches else (position, STILL, NO_WRENCH)

    def _added(self, position: Seven, data: CommandData | None) -> _Demand | Refusal:
        if self._torques:
            torque = axis_torque(data, self._torque_limit_nm)
            return torque if isinstance(torque, Refusal) else (position, torque, NO_WRENCH)
        force = wrench(data)
        return force if isinstance(force, Refusal) else (position, STILL, force)

    def _without_demand(self, message: CommandMessage, refusal: Refusal) -> Refusal:
        """An answer that commands nothing holds the arm; for as long as the watchdog would bear silence."""
        if not refusal.missing:
            return refusal._replace(ends_motion=True)
        self._accepted_counter = message.reflected_sequence_counter
        self._silent_answers += 1
        self._motion.overlay_torque_nm, self._motion.overlay_wrench = STILL, NO_WRENCH
        silent_ns = self._silent_answers * self._settings.budget_ns
        return refusal._replace(ends_motion=silent_ns >= self._watchdog_ns)

    def _position_off(self, data: CommandData | None, hold_rad: Seven) -> _Off | Refusal | None:
        demand = self._demand(data)
        if isinstance(demand, Refusal):
            return demand
        off = [abs(there - here) for there, here in zip(demand[0], hold_rad, strict=True)]
        worst = max(range(len(off)), key=off.__getitem__)
        if off[worst] <= self._settings.mirror_tolerance_rad:
            return None
        return _Off(
            f"{JOINT_NAMES[worst]} of the answers is {off[worst]:.4f} rad off the interpolator position; "
            f"{self._settings.mirror_tolerance_rad:g} rad are allowed",
            f"{JOINT_NAMES[worst]} is off",
        )

    def _pose_off(self, data: CommandData | None, hold_rad: Seven) -> _Off | Refusal | None:
        target = not_allowed(data, self._overlay) or cartesian_pose(data)
        if isinstance(target, Refusal):
            return target
        hold, allowed_rad = self._kinematics.forward(hold_rad), self._settings.mirror_tolerance_rad
        off_mm = 1e3 * hold.distance_m(target.flange_in_base)
        if off_mm > self._settings.mirror_tolerance_mm:
            return _Off(
                f"the pose of the answers is {off_mm:.2f} mm off the interpolator's; "
                f"{self._settings.mirror_tolerance_mm:g} mm are allowed",
                "the pose is off",
            )
        turned_rad = hold.angle_rad(target.flange_in_base)
        e1_off_rad = 0.0 if target.e1_rad is None else abs(target.e1_rad - hold_rad[2])
        for name, off_rad in (("orientation", turned_rad), ("E1", e1_off_rad)):
            if off_rad > allowed_rad:
                return _Off(
                    f"the {name} of the answers is {off_rad:.4f} rad off the interpolator's; "
                    f"{allowed_rad:g} rad are allowed",
                    f"the {name} is off",
                )
        return None
