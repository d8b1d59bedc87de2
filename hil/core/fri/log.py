"""The session's present state, and its history with times and reasons in bounded memory."""

from collections import deque
from collections.abc import Callable

from hil.core.events import Event, StateChanged, TransitionRefused
from hil.values.fri import Quality, SessionState

HISTORY = 1000


class SessionLog:
    """Every change and every refused change, each told to ``emit`` once."""

    def __init__(self, *, emit: Callable[[Event], None]) -> None:
        self._emit = emit
        self._refused_key: tuple[SessionState, str] | None = None
        self.state = SessionState.IDLE
        self.history: deque[StateChanged] = deque(maxlen=HISTORY)
        self.refused: deque[TransitionRefused] = deque(maxlen=HISTORY)
        self.changes = 0

    def enter(self, state: SessionState, quality: Quality, reason: str, *, now_ns: int) -> None:
        """Book a change of state."""
        change = StateChanged(now_ns, self.state, state, quality, reason)
        self.state = state
        self._refused_key = None
        self.changes += 1
        self.history.append(change)
        self._emit(change)

    def refuse(self, wanted: SessionState, reason: str, *, key: str, now_ns: int) -> None:
        """Book that ``wanted`` is not entered; the same ``key`` is told once."""
        if self._refused_key == (wanted, key):
            return
        self._refused_key = (wanted, key)
        refusal = TransitionRefused(now_ns, self.state, wanted, reason)
        self.refused.append(refusal)
        self._emit(refusal)

    def report(self, quality: Quality) -> dict[str, object]:
        """Return state, quality, history and refusals for the status file; times in seconds."""
        return {
            "state": self.state.name,
            "quality": quality.name,
            "changes": self.changes,
            "history": [
                {
                    "at_s": round(change.at_ns / 1e9, 6),
                    "from": change.old.name,
                    "to": change.new.name,
                    "quality": change.quality.name,
                    "reason": change.reason,
                }
                for change in self.history
            ],
            "refused": [
                {
                    "at_s": round(refusal.at_ns / 1e9, 6),
                    "state": refusal.state.name,
                    "wanted": refusal.wanted.name,
                    "reason": refusal.reason,
                }
                for refusal in self.refused
            ],
        }
