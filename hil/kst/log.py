"""What was refused and what is to be said: counted always, told in bounded words."""

from collections import Counter, deque
from typing import Final

from transport.kst import Problem

TOLD_MOST: Final = 200
"""Sentences nobody has taken yet; of more, the oldest are lost."""
TOLD_ALIKE: Final = 5
"""Refusals of one kind that are told each; of those after them the tenth, hundredth, thousandth and so on."""


class Log:
    """One session's."""

    def __init__(self) -> None:
        self.refused: Counter[Problem] = Counter()
        self.told: deque[str] = deque(maxlen=TOLD_MOST)
        """Sentences; whoever shows them takes them."""

    def refuse(self, problem: Problem, sentence: str) -> None:
        """Count something that was refused, and tell it unless there were many of its kind."""
        self.refused[problem] += 1
        count = self.refused[problem]
        if count <= TOLD_ALIKE or str(count).strip("0") == "1":
            more = "" if count < TOLD_ALIKE else f" ({count} of this kind so far)"
            self.tell(f"refused, {problem}: {sentence}{more}")

    def tell(self, sentence: str) -> None:
        """Say something."""
        self.told.append(sentence)
