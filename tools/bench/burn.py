"""Load on one core: ``python -m tools.bench.burn CORE`` computes there until it is ended."""

import os
import sys


def main() -> None:
    """Burn one core."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {int(sys.argv[1])})
    while True:
        pass


if __name__ == "__main__":
    main()
