"""What the steps came to: a table, JSON, Markdown, and the manual's statements held against them."""

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final, NamedTuple

from hil.core.settings import ReactionSettings
from tools.bench.reaction import TOLERANCE_MS
from tools.step_response.figures_of_merit import peak
from tools.step_response.measuring import DIRECT, FAST, SMART, THRESHOLD_DEG, Case, Step

COLUMNS: Final = (
    ("axis", ""),
    ("motion", ""),
    ("reaction", "ms"),
    ("2 % after", "ms"),
    ("rise", "ms"),
    ("overshoot", "%"),
    ("settling", "ms"),
    ("velocity", "deg/s"),
    ("acceleration", "deg/s²"),
    ("jerk", "1000 deg/s³"),
)
NOTES: Final = (
    (
        "Of the measured position, from the arrival of the destination: "
        f"reaction: the first cycle in which the axis is more than {THRESHOLD_DEG:.1g} degrees from where it stood; "
        "rise: from 10 to 90 % of the step; settling: from when on it stays within 2 % of the step."
    ),
    (
        "Velocity, acceleration and jerk are the largest that the interpolator commanded; jerk is by how much its "
        "acceleration changes in one cycle."
    ),
)
_JERK_TOLERANCE: Final = 1e-6


class Statement(NamedTuple):
    """What the manual says in 7.12, and what was measured; ``holds`` is None where there was nothing to compare."""

    sentence: str
    measured: str
    holds: bool | None

    @property
    def verdict(self) -> str:
        """In a word."""
        return "not measured" if self.holds is None else "holds" if self.holds else "DOES NOT HOLD"


@dataclass(frozen=True, slots=True)
class StepResponseReport:
    """All steps of one run."""

    robot: str
    backend: str
    reaction: ReactionSettings
    start_deg: tuple[float, ...]
    step_deg: float
    steps: tuple[Step, ...]

    @property
    def title(self) -> str:
        """What was stepped."""
        return f"step of {self.step_deg:g} degrees: {self.robot}, {self.backend}"

    @property
    def axes(self) -> list[int]:
        """The axes that were stepped, in order."""
        return list(dict.fromkeys(step.axis for step in self.steps))

    def of_axis(self, axis: int) -> list[Step]:
        """Return the steps of one axis."""
        return [step for step in self.steps if step.axis == axis]

    def rows(self) -> list[tuple[str, ...]]:
        """Return the table's rows under :data:`COLUMNS`; a step that tripped has its reason in :meth:`tripped`."""
        return [_row(step) for step in self.steps]

    def tripped(self) -> list[str]:
        """Return a sentence for each step that did not go its way."""
        return [f"{step.joint}, {step.case.name}: {step.tripped}" for step in self.steps if step.tripped]

    def statements(self) -> list[Statement]:
        """Hold the manual's statements of 7.12 against the figures.

        Its reaction times only where the controller was set to them.
        """
        timed = self._reaction_times() if self.reaction == ReactionSettings() else []
        return [*timed, self._faster(), self._smoother()]

    def as_dict(self) -> dict[str, Any]:
        """Return the report for JSON; names have their units."""
        return {
            "robot": self.robot,
            "backend": self.backend,
            "reaction": asdict(self.reaction),
            "start_deg": list(self.start_deg),
            "step_deg": self.step_deg,
            "threshold_deg": THRESHOLD_DEG,
            "steps": [_step_dict(step) for step in self.steps],
            "statements": [statement._asdict() for statement in self.statements()],
        }

    def markdown(self) -> str:
        """Return table and statements as Markdown."""
        head = [f"{name}, {unit}" if unit else name for name, unit in COLUMNS]
        lines = [f"# {self.title[0].upper()}{self.title[1:]}", "", _line(head), _line(["---"] * len(head))]
        lines += map(_line, self.rows())
        for sentence in self.tripped():
            lines += ["", f"**{sentence}**"]
        for note in NOTES:
            lines += ["", note]
        lines += ["", _line(("the manual, 7.12", "measured", "")), _line(["---"] * 3)]
        lines += [_line((said.sentence, said.measured, said.verdict)) for said in self.statements()]
        return "\n".join(lines) + "\n"

    def _reaction_times(self) -> list[Statement]:
        smart, direct = self._reactions(SMART), self._reactions(DIRECT)
        return [
            _near("SmartServo responds after 22 ms", smart, self.reaction.smart_servo_ms),
            _near("DirectServo responds after 12 ms", direct, self.reaction.direct_servo_ms),
        ]

    def _reactions(self, case: Case) -> list[float]:
        found = (step.figures().reaction for step in self.steps if step.case is case and not step.tripped)
        return [time for time in found if time is not None]

    def _faster(self) -> Statement:
        def figure(step: Step) -> float:
            settling = step.figures().settling
            return math.inf if settling is None else settling

        pairs = [(figure(slow), figure(fast)) for slow, fast in self._pairs(SMART, FAST)]
        return _compared(
            "with jerk 500 and override 20 SmartServo is faster than with its defaults",
            pairs,
            lambda slow, fast: fast < slow,
            lambda slow, fast: f"the slowest settles after {max(fast):.0f} instead of {max(slow):.0f} ms",
        )

    def _smoother(self) -> Statement:
        kept = all(
            peak(step.course.jerk_deg_s3) <= step.jerk_limit_deg_s3 * (1.0 + _JERK_TOLERANCE)
            for step in self.steps
            if step.jerk_limit_deg_s3 is not None and not step.tripped
        )
        beyond = "" if kept else "; SmartServo's limit was NOT kept"
        pairs = [
            (peak(smart.course.jerk_deg_s3), peak(direct.course.jerk_deg_s3))
            for case in (SMART, FAST)
            for smart, direct in self._pairs(case, DIRECT)
        ]
        return _compared(
            "SmartServo is smoother: its jerk is limited, DirectServo's goes to the drives",
            pairs,
            lambda smart, direct: kept and smart < direct,
            lambda smart, direct: f"jerk at most {max(smart):,.0f} against at least {min(direct):,.0f} deg/s³{beyond}",
        )

    def _pairs(self, one: Case, other: Case) -> list[tuple[Step, Step]]:
        found = {(step.axis, step.case.name): step for step in self.steps if not step.tripped}
        named = ((found.get((axis, one.name)), found.get((axis, other.name))) for axis in self.axes)
        return [(first, second) for first, second in named if first is not None and second is not None]


def _near(sentence: str, times_ms: Sequence[float], told_ms: float) -> Statement:
    if not times_ms:
        return Statement(sentence, "-", None)
    median_ms = statistics.median(times_ms)
    measured = (
        f"{min(times_ms):.1f} to {max(times_ms):.1f} ms, median {median_ms:.1f} ms (allowed: {TOLERANCE_MS:g} ms)"
    )
    return Statement(sentence, measured, abs(median_ms - told_ms) <= TOLERANCE_MS)


def _compared(
    sentence: str,
    pairs: Sequence[tuple[float, float]],
    better: Callable[[float, float], bool],
    told: Callable[[Sequence[float], Sequence[float]], str],
) -> Statement:
    if not pairs:
        return Statement(sentence, "-", None)
    held = sum(better(*pair) for pair in pairs)
    ones, others = zip(*pairs, strict=True)
    return Statement(sentence, f"{held} of {len(pairs)}: {told(ones, others)}", held == len(pairs))


def _row(step: Step) -> tuple[str, ...]:
    if step.tripped:
        return step.joint, step.case.name, "tripped", *("-",) * (len(COLUMNS) - 3)
    figures, course = step.figures(), step.course
    return (
        step.joint,
        step.case.name,
        _shown(figures.reaction, 1),
        _shown(figures.seen, 1),
        _shown(figures.rise, 1),
        _shown(figures.overshoot_percent, 3),
        _shown(figures.settling, 1),
        f"{peak(course.velocity_deg_s):.0f}",
        f"{peak(course.acceleration_deg_s2):.0f}",
        f"{1e-3 * peak(course.jerk_deg_s3):.1f}",
    )


def _shown(figure: float | None, digits: int) -> str:
    return "-" if figure is None else f"{figure:.{digits}f}"


def _step_dict(step: Step) -> dict[str, Any]:
    course, figures = step.course, step.figures()
    told: dict[str, Any] = {"axis": step.joint, "motion": step.case.name, "tripped": step.tripped or None}
    if step.tripped:
        return told
    figures_told = {
        "reaction_ms": figures.reaction,
        "two_percent_ms": figures.seen,
        "rise_ms": figures.rise,
        "overshoot_percent": figures.overshoot_percent,
        "settling_ms": figures.settling,
        "commanded_peak_velocity_deg_s": peak(course.velocity_deg_s),
        "commanded_peak_acceleration_deg_s2": peak(course.acceleration_deg_s2),
        "commanded_peak_jerk_deg_s3": peak(course.jerk_deg_s3),
        "jerk_limit_deg_s3": step.jerk_limit_deg_s3,
        "measured_peak_velocity_deg_s": peak(course.measured_velocity_deg_s),
        "measured_peak_acceleration_deg_s2": peak(course.measured_acceleration_deg_s2),
    }
    return told | {name: None if figure is None else round(figure, 4) for name, figure in figures_told.items()}


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
