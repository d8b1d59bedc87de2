"""Load on one core: ``python -m tools.bench.burn PARENT CORE`` computes there for as long as PARENT is its parent."""

import os
import sys

_TURNS = 100_000


def main() -> None:
    """Burn one core."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {int(sys.argv[2])})
    parent = int(sys.argv[1])
    while os.getppid() == parent:
        for _ in range(_TURNS):
            pass


if __name__ == "__main__":
    main()
