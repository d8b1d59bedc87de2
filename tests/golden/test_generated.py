"""Committed generated files are what their generators write today."""

from pathlib import Path

import pytest

from tools.make_dissector import dissector_text
from tools.make_protobuf import ROOT, generate, generated_files
from tools.wireshark import DISSECTOR


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("generated")
    generate(target)
    return target


@pytest.mark.parametrize("name", generated_files())
def test_protobuf_module_is_current(name: str, fresh: Path) -> None:
    assert (ROOT / name).read_text() == (fresh / name).read_text(), "run: make protobuf"


def test_the_dissector_is_current() -> None:
    assert DISSECTOR.read_text(encoding="utf-8") == dissector_text(), "run: make dissector"
