"""One fuzz target: a function of bytes, and the sentence that holds for all of them."""

from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Target:
    """``run`` raises where ``invariant`` does not hold; ``seeds`` are inputs to begin with."""

    name: str
    invariant: str
    run: Callable[[bytes], None]
    seeds: Callable[[], list[bytes]] = field(default=lambda: [b""])
    longest_bytes: int = 4096


def refusal(call: Callable[[], object], *kinds: type[Exception]) -> str:
    """Return what an error of these kinds says, or an empty text; any other error is a finding."""
    try:
        call()
    except kinds as error:
        return str(error)
    return ""
