"""docs/testing-your-application.md runs as it stands, and names what is there."""

import re
import textwrap
from pathlib import Path

import pytest

import hil.testkit as public
from hil.testkit import VirtualController
from hil.testkit.operator import Operator
from tests.support.processes import ROOT
from tests.support.virtual_controller import PLUGIN

pytest_plugins = ["pytester"]

PAGE = (ROOT / "docs" / "testing-your-application.md").read_text(encoding="utf-8")
BLOCKS = [textwrap.dedent(block) for block in re.findall(r"^ *```python\n(.*?)^ *```", PAGE, re.DOTALL | re.MULTILINE)]
FILES = {found[1]: block for block in BLOCKS if (found := re.match(r"# (tests/\S+\.py)\n", block))}


def test_every_example_is_a_file_that_is_run_or_says_why_not() -> None:
    assert len(FILES) == 10
    assert [block.splitlines()[0] for block in BLOCKS if block not in FILES.values()] == [
        "# not run here: it needs your program"
    ]


@pytest.mark.parametrize("name", FILES)
def test_the_example_passes(pytester: pytest.Pytester, name: str) -> None:
    file = Path(pytester.path, name)
    file.parent.mkdir()
    file.write_text(FILES[name], encoding="utf-8")
    result = pytester.runpytest_inprocess(*PLUGIN, "-p", "no:asyncio", "-W", "error", "--strict-markers")
    outcomes = result.parseoutcomes()
    assert result.ret == 0
    assert set(outcomes) == {"passed"}


def test_the_first_test_has_ten_lines() -> None:
    assert len(FILES["tests/test_first.py"].strip().splitlines()) <= 11


def test_what_the_page_names_is_there() -> None:
    table = PAGE.split("## What a test sees")[1].split("When a test fails")[0]
    named = {word for cell in re.findall(r"`(\w+)(?:\(|`)", table) for word in [cell]} - {"hil_controller"}
    seen = {name for name in dir(VirtualController) if not name.startswith("_")}
    fields_of_others = {"category", "reason", "at_ns"}
    inner = {"active", "never_happened"}
    assert named - fields_of_others == seen - inner
    operator = PAGE.split("## An operator")[1].split("What changes nothing")[0]
    assert {name for name in dir(Operator) if not name.startswith("_")} == set(re.findall(r"`(\w+)\(", operator))
    faults = re.search(r"from `hil\.testkit` \((.*?);", PAGE, re.DOTALL)
    assert faults is not None
    assert all(hasattr(public, name) for name in re.findall(r"`(\w+)`", faults[1]))


def test_everything_the_kit_offers_can_be_imported() -> None:
    assert all(hasattr(public, name) for name in public.__all__)
    assert public.__all__ == sorted(public.__all__)
    with pytest.raises(AttributeError, match="no attribute 'Lose'"):
        _ = public.Lose
