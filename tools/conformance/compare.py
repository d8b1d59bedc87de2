"""Two robot sides under the same command stream: what each measured, and where they differ."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Final

import numpy as np

from backends.rig import Rig
from hil.values.arm import ArmState, Capabilities, JointCommand, Push
from hil.values.errors import BackendError
from hil.values.robot import JOINT_COUNT, JOINT_NAMES, Seven
from tools.conformance.stream import Action, Moment

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

QUANTITIES: Final = (
    ("position", "position_rad", 1e3, "mrad"),
    ("velocity", "velocity_rad_s", 1e3, "mrad/s"),
    ("torque", "torque_nm", 1.0, "Nm"),
    ("external torque", "external_torque_nm", 1.0, "Nm"),
)
"""What is compared: its name, the field of the state, and the unit it is told in."""
MOST_LATENCY_CYCLES: Final = 40
_FINEST_CYCLES: Final = 1e-3
_MOVED_RAD: Final = 1e-3
"""An axis that moves less tells no latency."""
_PUSH: Final = Push(JOINT_COUNT, (0.0, 20.0, 0.0), (0.0, 0.0, 0.0), 0.2)
_STILL: Final[Seven] = (0.0,) * JOINT_COUNT  # type: ignore[assignment]


@dataclass(frozen=True, slots=True)
class Course:
    """What one robot side did: one state a cycle, after it."""

    name: str
    capabilities: Capabilities
    states: tuple[ArmState, ...]
    refused: tuple[str, ...]
    """What it would not do, in its own words."""

    def of(self, quantity: str) -> "Array":
        """Return a field of the states, cycles by axes."""
        return np.array([getattr(state, quantity) for state in self.states])


@dataclass(frozen=True, slots=True)
class Difference:
    """How far two courses are apart in one quantity, on one axis, with the latency between them taken away."""

    quantity: str
    unit: str
    axis: str
    rms: float
    worst: float
    """B minus A where it is largest."""
    at_s: float
    part: str
    as_it_was: float
    """The largest difference without the latency taken away."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """Of ``b`` with ``a``."""

    a: Course
    b: Course
    robot: str
    cycle_ms: int
    parts: tuple[str, ...]
    """Of each cycle."""
    latency_ms: float
    """By how much later B does what A does; negative: earlier."""
    differences: tuple[Difference, ...]

    @property
    def worst_position(self) -> Difference:
        """The largest difference in position."""
        return max((one for one in self.differences if one.quantity == "position"), key=lambda one: abs(one.worst))

    def unlike(self) -> list[tuple[str, str, str]]:
        """Return capabilities and refusals that are not the same: what, of A, of B."""
        rows = []
        for field in fields(Capabilities):
            ours, theirs = (_told(getattr(side.capabilities, field.name)) for side in (self.a, self.b))
            if ours != theirs:
                rows.append((field.name.replace("_", " "), ours, theirs))
        if self.a.refused != self.b.refused:
            rows.append(("refuses", "; ".join(self.a.refused) or "nothing", "; ".join(self.b.refused) or "nothing"))
        return rows

    def drive_sequences(self) -> tuple[str, str]:
        """Return the states that the drives went through, of both."""
        a, b = (_sequence(side.states) for side in (self.a, self.b))
        return a, b

    def verdict(self, tolerance_rad: float) -> str:
        """Return the whole in one sentence."""
        worst = self.worst_position
        later = "at the same time"
        if abs(self.latency_ms) >= 0.01:
            later = f"{abs(self.latency_ms):.2f} ms {'later' if self.latency_ms > 0 else 'earlier'}"
        within = abs(worst.worst) <= tolerance_rad * 1e3
        head = f"{self.b.name} does what {self.a.name} does" if within else f"{self.b.name} differs from {self.a.name}"
        return (
            f"{head}: it follows {later}, and that taken away its position is off by at most "
            f"{abs(worst.worst):.3g} mrad, on {worst.axis} at {worst.at_s:.2f} s ({worst.part}); "
            f"{tolerance_rad * 1e3:g} mrad are allowed{self._also_unlike()}"
        )

    def _also_unlike(self) -> str:
        names = [what for what, _, _ in self.unlike()]
        ours, theirs = self.drive_sequences()
        if ours != theirs:
            names.append("drive states")
        return f"; not alike: {', '.join(names)}" if names else ""

    def as_dict(self) -> dict[str, object]:
        """Return it for programs."""
        return {
            "a": self.a.name,
            "b": self.b.name,
            "robot": self.robot,
            "cycle_ms": self.cycle_ms,
            "cycles": len(self.parts),
            "latency_ms": round(self.latency_ms, 4),
            "differences": [
                {field.name: getattr(one, field.name) for field in fields(Difference)} for one in self.differences
            ],
            "unlike": [{"what": what, "a": ours, "b": theirs} for what, ours, theirs in self.unlike()],
            "drive_states": dict(zip(("a", "b"), self.drive_sequences(), strict=True)),
        }


def run_stream(
    rig: Rig, stream: Sequence[Moment], *, name: str, cycle_ms: int, progress: Callable[[int], None]
) -> Course:
    """Give a robot side the stream and close it; ``progress`` is told the cycles that are done."""
    states: list[ArmState] = []
    try:
        rig.open(period_ns=cycle_ms * 1_000_000)
        rig.get_ready()
        capabilities = rig.backend.capabilities
        for count, moment in enumerate(stream, start=1):
            _act(rig, moment.action)
            states.append(rig.cycle(moment.command))
            if failure := rig.backend.condition().failure:
                raise BackendError(f"{name} failed in cycle {count}, {moment.part}: {failure}")
            if count % 250 == 0:
                progress(count)
        asked = {what: _refusal(rig, what, states[-1]) for what in ("torque", "push", "drives")}
    finally:
        rig.close()
    progress(len(stream))
    refused = tuple(f"{what}: {refusal}" for what, refusal in asked.items() if refusal)
    return Course(name, capabilities, tuple(states), refused)


def compare(a: Course, b: Course, stream: Sequence[Moment], *, robot: str, cycle_ms: int) -> Comparison:
    """Return how ``b`` differs from ``a``."""
    parts = tuple(moment.part for moment in stream)
    moving = _moving(stream)
    shift = _latency_cycles(a.of("position_rad"), b.of("position_rad"), moving)
    found = []
    for name, field, factor, unit in QUANTITIES:
        ours, theirs = a.of(field), b.of(field)
        if not (ours.any() and theirs.any()):
            continue  # what one of them does not measure is no difference
        off = factor * (theirs - _shifted(ours, shift))
        raw = factor * (theirs - ours)
        for axis, joint in enumerate(JOINT_NAMES):
            column, whole = off[:, axis], raw[:, axis]
            at = int(np.argmax(np.abs(column)))
            rms, most = float(np.sqrt(np.mean(column**2))), float(np.max(np.abs(whole)))
            at_s = (at + 1) * cycle_ms * 1e-3
            found += [Difference(name, unit, joint, rms, float(column[at]), at_s, parts[at], most)]
    return Comparison(a, b, robot, cycle_ms, parts, shift * cycle_ms, tuple(found))


def _act(rig: Rig, action: Action) -> None:
    if action is Action.PUSH:
        rig.backend.push(_PUSH)
    elif action is not Action.NONE:
        rig.backend.switch_drives(on=action is Action.DRIVES_ON)


def _refusal(rig: Rig, what: str, state: ArmState) -> str:
    """Return what a robot side says where it is asked for what the stream had not."""
    backend = rig.backend
    asked: dict[str, Callable[[], None]] = {
        "torque": lambda: backend.write(JointCommand(state.position_rad, _STILL, _STILL, _STILL)),
        "push": lambda: backend.push(_PUSH),
        "drives": lambda: backend.switch_drives(on=True),
    }
    try:
        asked[what]()
    except BackendError as error:
        return str(error)
    return ""


def _moving(stream: Sequence[Moment]) -> "NDArray[np.bool_]":
    """Return in which cycles something is commanded to move, and a little after."""
    moves = np.array([any(moment.command.velocity_rad_s) for moment in stream])
    kept = moves.copy()
    for later in range(1, 11):
        kept[later:] |= moves[:-later]
    return kept if kept.any() else np.ones(len(stream), dtype=np.bool_)


def _latency_cycles(ours: "Array", theirs: "Array", moving: "NDArray[np.bool_]") -> float:
    """Return by how many cycles, parts of one included, ``theirs`` is later: what most axes are nearest at."""
    most = min(MOST_LATENCY_CYCLES, len(ours) // 4)
    found = []
    for axis in np.flatnonzero(np.ptp(ours, axis=0) > _MOVED_RAD):
        one, other = ours[:, axis], theirs[:, axis]
        best, step = 0.0, 1.0
        shifts = np.arange(-most, most + 1.0)
        while step >= _FINEST_CYCLES:
            off = [float(np.sum((other - _shifted_column(one, shift))[moving] ** 2)) for shift in shifts]
            best = float(shifts[int(np.argmin(off))])
            shifts = best + step * np.linspace(-0.9, 0.9, 19)
            step /= 10.0
        found.append(best)
    return float(np.round(np.median(found), 6)) if found else 0.0


def _shifted(values: "Array", cycles: float) -> "Array":
    """Return values as they were ``cycles`` ago, between two cycles in a straight line."""
    return np.column_stack([_shifted_column(column, cycles) for column in values.T])


def _shifted_column(column: "Array", cycles: float) -> "Array":
    places = np.arange(len(column))
    shifted: Array = np.interp(places - cycles, places, column)
    return shifted


def _sequence(states: Sequence[ArmState]) -> str:
    names: list[str] = []
    for state in states:
        name = state.drive_states[0].name if len(set(state.drive_states)) == 1 else "MIXED"
        if not names or names[-1] != name:
            names.append(name)
    return " ".join(names)


def _told(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, frozenset):
        return ", ".join(sorted(value)) or "none"
    if isinstance(value, tuple):
        return "noise known"
    return "none" if value is None else str(value)
