"""The client as commander of a joint position overlay: first it mirrors the interpolator, then it commands."""

from hil.core.fri.commands import CommandBounds, Refusal, joint_position
from hil.core.fri.sequence import counter_distance
from hil.core.motion.executive import MotionExecutive
from hil.core.settings import NS_PER_MS, FriSettings
from hil.values.fri_messages import CommandMessage
from hil.values.outcomes import Outcome
from hil.values.robot import JOINT_NAMES, JointLimits, Seven


class JointOverlayCommander:
    """Judges the client's joint positions and hands the legal ones to the motion."""

    def __init__(self, *, settings: FriSettings, cycle_ms: int, motion: MotionExecutive, limits: JointLimits) -> None:
        self._settings = settings
        self._cycles_per_target = settings.budget_ms // cycle_ms
        self._motion = motion
        self._bounds = CommandBounds(limits)
        self._accepted_position: Seven = motion.hold_position_rad
        self._accepted_counter = 0
        self._silent_answers = 0
        self.mirrored = 0
        """Answers in a row that mirrored the interpolator position."""
        self.problem = ""
        """Why the last answer did not mirror it, in words."""
        self.problem_kind = ""
        """The same without the figures, which differ from answer to answer."""

    @property
    def mirrors(self) -> bool:
        """Whether enough answers in a row mirrored the interpolator position."""
        return self.mirrored >= self._settings.mirror_answers

    def wait(self) -> None:
        """A motion with an overlay was started; the client has to mirror it first."""
        self.mirrored = 0
        self.problem = ""

    def mirror(self, message: CommandMessage) -> Refusal | None:
        """Count an answer that mirrors the interpolator position; return why it is none at all, or None."""
        position, refusal = joint_position(message.command)
        if position is None:
            self.mirrored = 0
            if refusal is not None:
                self.problem, self.problem_kind = refusal.detail, refusal.outcome.value
            return refusal
        off = [abs(there - here) for there, here in zip(position, self._motion.hold_position_rad, strict=True)]
        worst = max(range(len(off)), key=off.__getitem__)
        if off[worst] > self._settings.mirror_tolerance_rad:
            self.mirrored = 0
            self.problem_kind = f"{JOINT_NAMES[worst]} is off"
            self.problem = (
                f"{JOINT_NAMES[worst]} of the answers is {off[worst]:.4f} rad off the interpolator position; "
                f"{self._settings.mirror_tolerance_rad:g} rad are allowed"
            )
            return None
        self.mirrored += 1
        self._accepted_counter = message.reflected_sequence_counter
        return None

    def start(self) -> None:
        """The client commands from now on."""
        self._accepted_position = self._motion.hold_position_rad
        self._silent_answers = 0
        self._motion.start_overlay(cycles_per_target=self._cycles_per_target)

    def command(self, message: CommandMessage) -> Refusal | None:
        """Hand a legal position to the motion; return why it is not, or None."""
        position, refusal = joint_position(message.command)
        if position is None:
            return self._without_position(message, refusal)
        periods = counter_distance(self._accepted_counter, message.reflected_sequence_counter)
        elapsed_ns = min(periods * self._settings.send_period_ms * NS_PER_MS, self._settings.watchdog_ns)
        refusal = self._bounds.step(
            position,
            self._accepted_position,
            elapsed_s=elapsed_ns * 1e-9,
            approach_s=self._settings.budget_ns * 1e-9,
        )
        if refusal is not None:
            return refusal._replace(ends_motion=True)
        self._silent_answers = 0
        self._accepted_position = position
        self._accepted_counter = message.reflected_sequence_counter
        self._motion.retarget(position)
        return None

    def _without_position(self, message: CommandMessage, refusal: Refusal | None) -> Refusal | None:
        """An answer that commands nothing holds the arm; for as long as the watchdog would bear silence."""
        data = message.command
        if refusal is None or refusal.outcome is not Outcome.SHAPE or (data is not None and data.position is not None):
            return None if refusal is None else refusal._replace(ends_motion=True)
        self._accepted_counter = message.reflected_sequence_counter
        self._silent_answers += 1
        silent_ns = self._silent_answers * self._settings.budget_ns
        return refusal._replace(ends_motion=silent_ns >= self._settings.watchdog_ns)

    def monitor(self, message: CommandMessage) -> Refusal | None:
        """Look at what a monitoring client says; nothing is done with it but to say what is wrong."""
        if message.command is None or message.command.position is None:
            return None
        position, refusal = joint_position(message.command)
        if position is None:
            return refusal
        return self._bounds.position(position)
