"""What a replay found: how many datagrams are the same, where the first one is not, and which fields differ."""

import re
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple, Protocol

from hil.replay.fields import FieldDifference

_AXIS: Final = re.compile(r"A\d")
_PARTINGS: Final = (
    (" commanded", "commanded positions", "rad"),
    (" interpolator", "interpolator positions", "rad"),
    (" measured", "measured positions", "rad"),
    (" measured torque", "measured torques", "Nm"),
)
MAX_FIELDS: Final = 200
MAX_TOLD: Final = 20
"""Of a kind of event; all are counted."""


class Watcher(Protocol):
    """Looks on: pairs of messages as they are compared."""

    def wants(self, robot: str) -> bool:
        """Whether the next pair of ``robot`` is to be handed over; asked once for each."""

    def pair(self, t_s: float, recorded: object, emulated: object) -> None:
        """Take a recorded message and the emulator's."""


class Moment(NamedTuple):
    """When and where in a recording."""

    robot: str
    t_s: float
    """On the robot's core axis [s]."""
    cycle: int
    """From 0; -1 where control cycles are not known."""
    packet: int
    """Number in the file, from 1; 0 where there is none."""

    def __str__(self) -> str:
        cycle = f", cycle {self.cycle}" if self.cycle >= 0 else ""
        place = f", packet {self.packet}" if self.packet else ""
        return f"t={self.t_s:.3f} s{cycle}{place}"


@dataclass(slots=True)
class FieldTally:
    """One field over the whole recording."""

    first: Moment
    first_difference: FieldDifference
    count: int = 0
    largest: float = 0.0
    """Largest size of emulator minus recording, where the field is a number."""

    def add(self, difference: FieldDifference) -> None:
        """Count one more message in which it differs."""
        self.count += 1
        change = difference.change
        if change is not None:
            self.largest = max(self.largest, abs(change))


@dataclass(slots=True)
class ReplayResult:
    """Counts are datagrams of the controller, unless they say otherwise."""

    file: str
    own: bool
    """Whether the recording holds all inputs of one of our controllers from its start on."""
    other: str = "emulator"
    """Who is compared with the recording."""
    inputs: int = 0
    compared: int = 0
    identical: int = 0
    missing: int = 0
    """That the emulator sent and the recording has not."""
    extra: int = 0
    """That the recording has and the emulator did not send."""
    strangers: int = 0
    """Datagrams that are not between a controller and its client."""
    cycles: int = 0
    recorded_s: float = 0.0
    reached_s: float = 0.0
    """How far in the recording the replay is."""
    took_s: float = 0.0
    first: str = ""
    """The first difference, in one sentence."""
    fields: dict[str, FieldTally] = field(default_factory=dict)
    altered: list[str] = field(default_factory=list)
    altered_count: int = 0
    """Datagrams that are not what the recorder wrote."""
    notes: list[str] = field(default_factory=list)
    damage: str = ""
    """Where and why the file could not be read any further; everything before was replayed."""
    complete: bool = False
    """Whether the recording was ended in order."""
    other_arithmetic: bool = False
    """Whether the recorder's machine rounds otherwise than this one, so that last digits may differ."""
    states: list[tuple[str, str, float, str]] = field(default_factory=list)
    """Robot, whose (recording or emulator), when [s], session state."""
    updated: bool = False

    @property
    def equal(self) -> bool:
        """Whether every byte is as recorded, and there was something to compare, and nothing was unreadable."""
        return self.compared > 0 and self.alike and not self.damage

    @property
    def alike(self) -> bool:
        """Whether what could be compared is as recorded."""
        return not (self.compared - self.identical or self.missing or self.extra or self.altered_count)

    @property
    def real_time_factor(self) -> float | None:
        """Return recorded time over the time it took; None before there is one."""
        return self.recorded_s / self.took_s if self.took_s > 0 and self.recorded_s > 0 else None

    @property
    def verdict(self) -> str:
        """Return what was found, in one sentence."""
        if not self.compared and not self.extra:
            return "nothing to compare: the recording holds no datagram of a controller that is understood"
        if self.alike:
            whole = "byte for byte" if self.own else "byte for byte, though recorded elsewhere"
            told = f"identical {whole}: {self.compared} datagrams of {self.recorded_s:.3f} s"
            return f"{told}, up to where the file cannot be read" if self.damage else told
        if not self.own:
            return self._parting
        if self.altered and not self.first:
            return f"all {self.compared} datagrams are identical, but the recording was changed: {self.altered[0]}"
        parted = self.compared - self.identical + self.missing + self.extra
        told = f"{parted} of {self.compared + self.missing + self.extra} datagrams differ; the first: {self.first}"
        if self.other_arithmetic:
            told += (
                f"; the recorder's machine rounds otherwise than this one, and the largest difference of a number is "
                f"{self.largest:.3g}"
            )
        return told

    @property
    def _parting(self) -> str:
        """Where emulator and recording part, in one sentence."""
        told = f"{self.compared} messages of {self.recorded_s:.3f} s compared, {self.identical} alike"
        shares = [
            f"{name} by {largest:.3g} {unit}"
            for ending, name, unit in _PARTINGS
            if (largest := self._largest_of(ending)) is not None
        ]
        if shares:
            told += f"; emulator and recording part at most in {', '.join(shares)}"
        apart = self.fields.get("session state")
        if apart is not None:
            count = f"{apart.count} message{'s' if apart.count > 1 else ''}"
            told += f"; their session states are not the same in {count}, first at {apart.first}"
        return told

    def _largest_of(self, ending: str) -> float | None:
        found = [tally.largest for name, tally in self.fields.items() if _AXIS.fullmatch(name.removesuffix(ending))]
        return max(found, default=None)

    @property
    def largest(self) -> float:
        """Largest difference of a number, in its unit."""
        return max((tally.largest for tally in self.fields.values()), default=0.0)

    def note(self, text: str) -> None:
        """Tell something beside the comparison, each once."""
        if text not in self.notes and len(self.notes) < MAX_TOLD:
            self.notes.append(text)

    @property
    def tells_altered(self) -> bool:
        """Whether the next one would be told: to find out what was changed in a datagram takes milliseconds."""
        return len(self.altered) < MAX_TOLD

    def alter(self, text: str) -> None:
        """Tell of a datagram that is not what the recorder wrote."""
        self.altered_count += 1
        if self.tells_altered:
            self.altered.append(text)

    def differ(self, moment: Moment, found: list[FieldDifference]) -> None:
        """Tell of a message that differs in these fields."""
        for one in found:
            tally = self.fields.get(one.name)
            if tally is None:
                if len(self.fields) >= MAX_FIELDS:
                    continue
                tally = self.fields[one.name] = FieldTally(moment, one)
            tally.add(one)
        if not self.first:
            what = found[0].told(self.other) if found else "the same fields in other bytes"
            more = f" and {len(found) - 1} more" if len(found) > 1 else ""
            self.first = f"{what} at {moment}{more}"

    def differ_whole(self, moment: Moment, what: str) -> None:
        """Tell of a message that one side has and the other has not."""
        if not self.first:
            self.first = f"{what} at {moment}"

    def as_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        factor = self.real_time_factor
        return {
            "file": self.file,
            "verdict": self.verdict,
            "equal": self.equal,
            "own": self.own,
            "complete": self.complete,
            "damage": self.damage or None,
            "inputs": self.inputs,
            "compared": self.compared,
            "identical": self.identical,
            "missing": self.missing,
            "extra": self.extra,
            "strangers": self.strangers,
            "cycles": self.cycles,
            "recorded_s": round(self.recorded_s, 6),
            "took_s": round(self.took_s, 3),
            "real_time_factor": None if factor is None else round(factor, 2),
            "first": self.first or None,
            "altered": {"count": self.altered_count, "first": self.altered},
            "fields": {
                name: {
                    "count": tally.count,
                    "first_t_s": round(tally.first.t_s, 6),
                    "first_cycle": tally.first.cycle,
                    "first_packet": tally.first.packet,
                    "recorded": _plain(tally.first_difference.recorded),
                    "emulated": _plain(tally.first_difference.emulated),
                    "largest": tally.largest,
                    "unit": tally.first_difference.unit,
                }
                for name, tally in self.fields.items()
            },
            "states": [
                {"robot": robot, "of": whose, "t_s": round(t_s, 6), "state": state}
                for robot, whose, t_s, state in self.states
            ],
            "other_arithmetic": self.other_arithmetic,
            "notes": self.notes,
            "updated": self.updated,
        }


def _plain(value: object) -> object:
    return value if isinstance(value, bool | int | float | str | None) else str(value)
