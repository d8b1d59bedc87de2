"""What was refused and what is to be said: counted always, told in bounded words."""

from collections import Counter, deque
from typing import Final

from transport.kst import Problem

TOLD_MOST: Final = 200
"""Sentences nobody has taken yet; of more, the oldest are lost."""
TOLD_ALIKE: Final = 5
"""Of one kind that are told each; of those after them the tenth, hundredth, thousandth and so on."""


class Log:
    """One session's."""

    def __init__(self) -> None:
        self.refused: Counter[Problem] = Counter()
        self._noted: Counter[str] = Counter()
        self.told: deque[str] = deque(maxlen=TOLD_MOST)
        """Sentences; whoever shows them takes them."""

    def refuse(self, problem: Problem, sentence: str) -> None:
        """Count something that was refused, and tell it unless there were many of its kind."""
        self.refused[problem] += 1
        self._tell_in_short(f"refused, {problem}: {sentence}", self.refused[problem])

    def note(self, kind: str, sentence: str) -> None:
        """Tell what a client may cause as often as it likes, unless there were many of its ``kind``."""
        self._noted[kind] += 1
        self._tell_in_short(sentence, self._noted[kind])

    def tell(self, sentence: str) -> None:
        """Say something."""
        self.told.append(sentence)

    def _tell_in_short(self, sentence: str, count: int) -> None:
        if is_told(count):
            self.tell(sentence + how_many(count))


def is_told(count: int) -> bool:
    """Whether the ``count``-th of one kind is told: the first few, and then seldom."""
    return count <= TOLD_ALIKE or str(count).strip("0") == "1"


def how_many(count: int) -> str:
    """Return what follows the sentence of the ``count``-th of one kind."""
    return "" if count < TOLD_ALIKE else f" ({count} of this kind so far)"
