"""Looks at each destination as it arrives, whoever sends it, for the feedback effect."""

from typing import Final

from hil.core.diagnosis.feedback_oscillation import SAMPLE_NS, FeedbackOscillation, Oscillation
from hil.core.diagnosis.findings import FindingLog
from hil.core.diagnosis.oscillation_words import name_of, oscillation_finding
from hil.core.motion.application_motion import ApplicationMotion
from hil.core.motion.executive import MotionExecutive, Phase
from hil.values.motion import MotionKind
from hil.values.robot import JOINT_COUNT, JOINT_NAMES, Seven

_OVERLAY: Final = Phase.OVERLAY
_APPLICATION: Final = Phase.APPLICATION
AGAIN_AFTER_NS: Final = 500_000_000
_NEVER_NS: Final = -AGAIN_AFTER_NS


class OscillationWatch:
    """Watches servo motions, and the overlay where it is one of positions (``positions_laid_over``).

    A torque or a wrench overlay closes its loop through forces, of which its positions say nothing.
    """

    def __init__(self, motion: MotionExecutive, findings: FindingLog, *, positions_laid_over: bool) -> None:
        self._motion = motion
        self._findings = findings
        self._positions_laid_over = positions_laid_over
        self._detector = FeedbackOscillation()
        self._known: Seven | None = None
        """The last destination, which is another object when the same is sent again."""
        self._of: object = None
        self._not_before_ns = 0
        self._told_ns = [_NEVER_NS] * JOINT_COUNT
        self._told_growing = [False] * JOINT_COUNT

    def look(self, measured_rad: Seven, *, now_ns: int) -> None:
        """Once a cycle, when what arrived was taken: look at a new destination."""
        if now_ns < self._not_before_ns:
            return
        motion = self._motion
        phase = motion.phase
        if phase is _OVERLAY:
            destination = motion.overlay_target_rad
            if destination is self._known or not self._positions_laid_over:
                return
            servo = None
            carrier: object = _OVERLAY
        elif phase is _APPLICATION:
            active = motion.applications.active
            if active is None:
                return
            servo = carrier = active.motion
            destination = servo.destination
            if destination is self._known or servo.kind is MotionKind.PTP:
                return
        else:
            self._of = None
            return
        self._known, self._not_before_ns = destination, now_ns + SAMPLE_NS
        if carrier is not self._of:
            self._of = carrier
            self._detector.forget()
            self._told_ns = [_NEVER_NS] * JOINT_COUNT
            self._told_growing = [False] * JOINT_COUNT
        if destination is not None and (seen := self._detector.take(destination, measured_rad, now_ns=now_ns)):
            self._tell(seen, servo, now_ns)

    def _tell(self, seen: tuple[Oscillation, ...], servo: ApplicationMotion | None, now_ns: int) -> None:
        worst = max(seen, key=lambda one: (one.growing, one.grown, one.amplitude_rad))
        axis = worst.axis
        news = worst.growing and not self._told_growing[axis]
        if not news and now_ns - self._told_ns[axis] < AGAIN_AFTER_NS:
            return
        self._told_ns[axis], self._told_growing[axis] = now_ns, worst.growing
        finding = oscillation_finding(
            worst,
            with_it=[one.axis for one in seen if one.axis != axis],
            motion=servo,
            override=self._motion.override,
            yields=self._motion.control.yields,
        )
        self._findings.add(finding, subject=f"{name_of(servo)}, {JOINT_NAMES[axis]}", now_ns=now_ns)
