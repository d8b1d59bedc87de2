"""The fuzz targets hold for their seeds and for seeds with a few bytes changed; ``make fuzz`` looks much farther."""

import random

import pytest

from tests.fuzz.targets import TARGETS

VARIANTS = {"controller": 2}
FEW = 40


@pytest.mark.parametrize("name", TARGETS)
def test_an_invariant_holds_near_its_seeds(name: str) -> None:
    target, choice = TARGETS[name], random.Random(7)
    seeds = [seed[: target.longest_bytes] for seed in target.seeds()]
    assert all(seeds)
    for _ in range(VARIANTS.get(name, FEW)):
        changed = bytearray(choice.choice(seeds))
        for _ in range(choice.randrange(6)):
            where = choice.randrange(len(changed))
            changed[where : where + choice.randrange(3)] = choice.randbytes(choice.randrange(3))
            changed = changed or bytearray(b"\0")
        target.run(bytes(changed))


def test_every_target_says_in_a_sentence_what_holds() -> None:
    assert all(target.invariant.endswith(".") and target.invariant.count(".") == 1 for target in TARGETS.values())
