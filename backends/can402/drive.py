"""One drive, as the cycle sees it: what it answered last, what it is told next, and what is wrong with it."""

import struct
from typing import Final

from backends.can402.error_codes import error_in_words
from backends.can402.scaling import AxisScale
from backends.can402.state_machine import FAULT_RESET, TO_ENABLED, TO_OFF, PowerState, power_state

_COMMAND: Final = struct.Struct("<Hi")
_STATE: Final = struct.Struct("<Hi")
_MOTION: Final = struct.Struct("<ihH")
_OPERATIONAL: Final = 5
_FAULTS: Final = (PowerState.FAULT, PowerState.FAULT_REACTION)
_ANSWERS_TOO_MANY: Final = 2
_RESET_NS: Final = 500_000_000
"""What a fault reset may take. Ours."""
_MOST_BEATS_MISSED: Final = 3
_NMT_STATES: Final = {0: "booted anew", 4: "stopped", 5: "operational", 127: "pre-operational"}


class Drive:
    """``name`` is how it is told of: node number and axis."""

    def __init__(self, name: str, scale: AxisScale, *, lost_after: int, heartbeat_ms: int) -> None:
        self.name = name
        self.scale = scale
        self._lost_after = lost_after
        self._most_silence_ns = _MOST_BEATS_MISSED * heartbeat_ms * 1_000_000
        self.state = PowerState.UNKNOWN
        self.counts = 0
        self.counts_per_s = 0
        self.torque_permille = 0
        self.error_code = 0
        self.unanswered = 0
        """SYNCs in a row without an answer to each part."""
        self.resets = 0
        """Faults that were acknowledged one after the other."""
        self.left = ""
        """Why it exchanges nothing any more, though nobody told it to."""
        self.booted = False
        """Whether it started anew since it was set up, as far as it said so."""
        self._seen = [False, False]
        self._owed = [0, 0]
        """SYNCs without an answer less answers without a SYNC: an answer may be late."""
        self._takes_part = False
        """Whether it has answered a SYNC since it was set up."""
        self._beat_ago_ns = 0
        self._reset = False
        self._resetting_ns = 0
        """What it may still take to leave its fault."""

    def began(self, status_word: int, counts: int) -> None:
        """It was set up, and stands there."""
        self.state, self.counts, self.counts_per_s = power_state(status_word), counts, 0
        self.unanswered, self.left, self.error_code = 0, "", 0
        self._seen, self._owed, self._beat_ago_ns = [False, False], [0, 0], 0
        self._takes_part = self.booted = False

    def synchronised(self) -> None:
        """A SYNC goes out."""
        self._seen = [False, False]
        # What was never answered excuses only so many late answers.
        self._owed = [min(owed + 1, self._lost_after) for owed in self._owed]

    @property
    def answered(self) -> bool:
        """Whether all of the answer to the last SYNC is there."""
        return self._seen[0] and self._seen[1]

    @property
    def silent(self) -> bool:
        """Whether it answers nothing any more."""
        return self.unanswered >= self._lost_after

    def count_silence(self, period_ns: int) -> None:
        """The cycle is over."""
        self.unanswered = 0 if self.answered else self.unanswered + 1
        self._takes_part = self._takes_part or self.answered
        self._beat_ago_ns += period_ns
        self._resetting_ns = max(0, self._resetting_ns - period_ns) if self.state in _FAULTS else 0

    def answer(self, part: int, data: bytes) -> str:
        """Take one part of an answer; return what is wrong with it, or nothing."""
        layout = (_STATE, _MOTION)[part]
        if len(data) != layout.size:
            return f"{self.name} answers with {len(data)} bytes where {layout.size} are mapped"
        self._owed[part] -= 1
        if self._owed[part] < -_ANSWERS_TOO_MANY:
            return f"{self.name} answers more often than it is asked: two drives have the same node number"
        self._seen[part] = True
        if part == 0:
            status_word, self.counts = layout.unpack(data)
            self.state = power_state(status_word)
        else:
            self.counts_per_s, self.torque_permille, self.error_code = layout.unpack(data)
        return ""

    def emergency(self, data: bytes) -> str:
        """Take an emergency message; return the failure it is, or nothing where it says that all is well again."""
        code = int.from_bytes(data[:2], "little")
        if code == 0:
            return ""
        self.error_code = code
        return f"{self.name}: {error_in_words(code)}"

    def heartbeat(self, data: bytes) -> None:
        """Take a heartbeat, or an answer to node guarding."""
        self._beat_ago_ns = 0
        state = data[0] & 0x7F if data else -1
        self.booted = self.booted or state == 0
        # What was said before it took part may come late.
        if state != _OPERATIONAL and self._takes_part:
            self.left = f"{self.name} is {_NMT_STATES.get(state, f'in NMT state {state}')}"

    def failure(self) -> str:
        """Return what is wrong with it now, or nothing."""
        if self.left:
            return self.left
        if self.silent:
            return f"{self.name} is lost: no answer to the last {self.unanswered} SYNCs"
        if self._beat_ago_ns > self._most_silence_ns:
            return f"{self.name} is lost: no heartbeat for {self._beat_ago_ns // 1_000_000} ms"
        if self.state in _FAULTS and not self._resetting_ns:
            again = f", still there after its reset number {self.resets}" if self.resets else ""
            return f"{self.name}: {error_in_words(self.error_code)}{again}"
        if self.state is PowerState.UNKNOWN:
            return f"{self.name} is in no state of CiA 402"
        return ""

    def reset_fault(self) -> None:
        """Acknowledge its fault with the next command."""
        if self.state in _FAULTS:
            self._reset = True
            self._resetting_ns = _RESET_NS
            self.resets += 1
        else:
            self.resets = 0

    def command(self, target_counts: int, *, enabled: bool) -> bytes:
        """Return the process data that lead it on."""
        word = (TO_ENABLED if enabled else TO_OFF)[self.state]
        if self._reset and self.state is PowerState.FAULT:
            word, self._reset = FAULT_RESET, False
        return _COMMAND.pack(word, target_counts)
