"""A KST session with an arm that only notes what it is told, and states of two poses."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from hil.kst.jobs import Ended, Job, Outcome
from hil.kst.original import OriginalSession
from hil.kst.session import Arm, KstSession
from hil.values.fri import ControlMode
from hil.values.kst import KstSettings
from hil.values.pose import NOWHERE, Pose
from hil.values.servo import Snapshot, Vector
from tests.support.servo_controller import RUNNING

MS: Final = 1_000_000
DATA: Final = Path(__file__).parents[1] / "data" / "kst"
BENT: Final[Vector] = (0.0, 0.0, 0.0, -1.5707, 0.0, 1.5708, 0.0)
EXTERNAL_NM: Final[Vector] = (0.01, -0.02, 3e-5, 0.5, -0.25, 0.125, 0.0625)
MEASURED_NM: Final[Vector] = (0.1, -61.2, 0.0, 33.25, 1e-4, -0.5, 0.01)
FORCE: Final[Vector] = (1.5, -2.25, 0.5, 0.01, 0.02, -0.03)
SETTINGS: Final = KstSettings((-2.9,) * 7, (2.9,) * 7)
TURN_B: Final = math.nextafter(9.265358979327931e-05, 1.0)
"""Of the pose of kst-wire; a last digit is lost on the way through a rotation matrix."""


def snapshot(position_rad: Vector, flange_in_base: Pose) -> Snapshot:
    """Return a state."""
    return Snapshot(
        *(0, 0, RUNNING, position_rad, position_rad, MEASURED_NM, EXTERNAL_NM, flange_in_base, ControlMode.POSITION),
        *((0.0,) * 7, FORCE, (0.0,) * 6, "", ()),
    )


STATES: Final = {
    "straight": snapshot((0.0,) * 7, Pose(0.0, 0.0, 1.306)),
    "bent": snapshot(BENT, Pose.from_abc_rad((0.40001167249652696, 0.0, 0.6540385312587345), math.pi, TURN_B, math.pi)),
}


class NotingArm(Arm):
    """Notes what it is told."""

    def __init__(self) -> None:
        self.begun: list[Job] = []
        self.stops = 0

    def begin(self, job: Job) -> None:
        self.begun.append(job)

    def stop(self) -> None:
        self.stops += 1


@dataclass
class Bench:
    """One session at a time of its own, and what it wrote."""

    settings: KstSettings = SETTINGS
    now_ns: int = 0
    state: Snapshot = STATES["bent"]
    arm: NotingArm = field(default_factory=NotingArm)

    def __post_init__(self) -> None:
        kind = OriginalSession if self.settings.strict else KstSession
        self.session = kind(self.settings, self.arm, lambda: self.state)

    def say(self, *lines: str) -> list[bytes]:
        """Send lines in one segment, without their ends; return the writes that follow at once."""
        return self.send("".join(f"{line}\n" for line in lines).encode())

    def send(self, data: bytes) -> list[bytes]:
        """Send bytes; return the writes that follow at once."""
        self.session.receive(data, now_ns=self.now_ns)
        return self.session.replies(now_ns=self.now_ns)

    def end(self, outcome: Outcome = Outcome.DONE, reason: str = "") -> list[bytes]:
        """Let the arm's job end; return the writes that follow at once."""
        self.session.ended(Ended(outcome, reason), now_ns=self.now_ns)
        return self.session.replies(now_ns=self.now_ns)

    def wait(self, milliseconds: float) -> list[bytes]:
        """Let time pass; return the writes."""
        self.now_ns += int(milliseconds * MS)
        return self.session.replies(now_ns=self.now_ns)

    def told(self) -> str:
        """Return what was said in the log, and forget it."""
        words = "\n".join(self.session.told)
        self.session.told.clear()
        return words


class Transcript:
    """Puts a transcript of ``tests/data/kst`` through a session; ``compared`` is how many bytes were."""

    def __init__(self, bench: Bench) -> None:
        self.compared = 0
        self._bench = bench
        self._written: list[bytes] = []
        self._poses = True
        self._begun = self._stops = 0
        self._rounds = 1

    def replay(self, text: str) -> int:
        """Replay it; return how many bytes of replies were compared."""
        does = {
            "C": self._client,
            "S": self._server,
            "A": self._job,
            "H": self._stop,
            "E": self._end,
            "V": self._view,
            "R": self._repeat,
            "T": self._tool,
            "T-": self._other_poses,
            "X": self._closes,
        }
        for line in text.splitlines():
            if line and not line.startswith("#"):
                mark, _, rest = line.partition(" ")
                assert mark == "S" or not self._written, f"{self._written} before {line}"
                does[mark](rest)
        assert (len(self._bench.arm.begun), self._bench.arm.stops) == (self._begun, self._stops)
        return self.compared

    def _client(self, rest: str) -> None:
        self._bench.now_ns += 5 * MS
        for _ in range(self._rounds):
            self._written = self._bench.send(rest.replace("\\n", "\n").encode("ascii"))
            self._bench.now_ns += 2 * MS
        self._rounds = 1

    def _server(self, rest: str) -> None:
        wanted, got = rest.replace("\\n", "\n").encode("ascii"), b"".join(self._written[:1])
        del self._written[:1]
        if self._poses or wanted.count(b"_") != 6:
            assert got == wanted
            self.compared += len(wanted)

    def _job(self, rest: str) -> None:
        self._begun += 1
        assert type(self._bench.arm.begun[-1]).__name__ == rest

    def _stop(self, _rest: str) -> None:
        self._stops += 1

    def _end(self, rest: str) -> None:
        self._bench.now_ns += 300 * MS
        self._written = self._bench.end(Outcome(rest))

    def _view(self, rest: str) -> None:
        self._bench.state = STATES[rest]

    def _repeat(self, rest: str) -> None:
        self._rounds = int(rest)

    def _tool(self, _rest: str) -> None:
        assert self._bench.session.tcp_in_flange != NOWHERE

    def _other_poses(self, _rest: str) -> None:
        self._poses = False

    def _closes(self, _rest: str) -> None:
        assert self._bench.session.over
