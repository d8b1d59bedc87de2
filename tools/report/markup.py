"""HTML as a tree: what a recording says is text in it, and cannot become anything else."""

import json
from collections.abc import Iterable, Sequence
from typing import Final
from xml.etree.ElementTree import Element, tostring

_HARMLESS: Final = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026"}


def node(tag: str, *children: "str | Element | None", **attributes: str) -> Element:
    """Return an element; ``class_`` is its class, ``data_x`` its ``data-x``; children that are None are left out."""
    element = Element(tag, {name.rstrip("_").replace("_", "-"): value for name, value in attributes.items()})
    last: Element | None = None
    for child in children:
        if child is None:
            continue
        if isinstance(child, Element):
            element.append(child)
            last = child
        elif last is None:
            element.text = (element.text or "") + child
        else:
            last.tail = (last.tail or "") + child
    return element


def table(columns: Sequence[str], rows: Iterable[Sequence["str | Element"]], *, numbers: Iterable[int] = ()) -> Element:
    """Return a table that scrolls in itself where it is too wide; columns in ``numbers`` are set to the right."""
    right = frozenset(numbers)

    def line(cell: str, cells: Sequence["str | Element"]) -> Element:
        return node(
            "tr", *(node(cell, one, class_="number" if at in right else "text") for at, one in enumerate(cells))
        )

    body = node("tbody", *(line("td", row) for row in rows))
    return node("div", node("table", node("thead", line("th", columns)), body), class_="scrolls")


def json_text(value: object) -> str:
    """Return JSON that ends no script element."""
    told = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return "".join(_HARMLESS.get(one, one) for one in told) if any(one in told for one in _HARMLESS) else told


def to_html(element: Element) -> str:
    """Return the markup of an element."""
    return tostring(element, encoding="unicode", method="html")
