"""Named tuples that are made without their constructor have all their fields."""

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]


def made() -> Iterator[tuple[str, str, ast.expr]]:
    """Yield module, class and fields of each ``new_tuple(SomeClass, (...))`` of the sources."""
    for room in ("hil", "transport", "backends"):
        for path in sorted((ROOT / room).rglob("*.py")):
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "new_tuple":
                    kind, fields = node.args
                    assert isinstance(kind, ast.Name)
                    yield module, kind.id, fields


def test_each_has_as_many_fields_as_its_class() -> None:
    """The constructor would have told; a literal without a star can be counted."""
    found = list(made())
    assert len(found) > 5
    for module, name, fields in found:
        assert isinstance(fields, ast.Tuple), (module, name)
        assert not any(isinstance(field, ast.Starred) for field in fields.elts), (module, name)
        wanted = getattr(importlib.import_module(module), name)._fields
        assert len(fields.elts) == len(wanted), (module, name, wanted)
