"""The table of bounds in docs/reliability.md: what it names is there."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
_PLACE = re.compile(r"`([a-z_0-9/]+\.py):(\w+)`")


def test_every_bound_of_the_table_is_where_it_says() -> None:
    places = _PLACE.findall((ROOT / "docs" / "reliability.md").read_text(encoding="utf-8"))
    assert len(places) > 30
    missing = [
        f"{file}:{name}"
        for file, name in places
        if not re.search(rf"^{name}\b.*=", (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE)
    ]
    assert missing == []
