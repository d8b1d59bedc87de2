"""One target in this process, led by coverage: ``python -m tests.fuzz.one NAME LIBFUZZER_OPTIONS...``."""

import sys

import atheris


def main() -> None:
    """Run it; libFuzzer ends the process."""
    # What is imported from here on tells which of its branches an input reaches.
    with atheris.instrument_imports(include=["transport", "hil", "tests.fuzz"]):
        from tests.fuzz.targets import TARGETS
    target = TARGETS[sys.argv.pop(1)]
    atheris.Setup(sys.argv, target.run)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
