"""Captures through tshark with our dissector: what it shows, and what it should show of a protobuf message."""

import struct
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import Message

from tools.wireshark import DISSECTOR
from transport.capture.records import CapturedDatagram
from transport.capture.writing import PcapngWriter

_INTEGERS = {
    FieldDescriptor.TYPE_UINT32,
    FieldDescriptor.TYPE_INT32,
    FieldDescriptor.TYPE_UINT64,
    FieldDescriptor.TYPE_FIXED64,
    FieldDescriptor.TYPE_SFIXED64,
    FieldDescriptor.TYPE_ENUM,
}

_FLOATS = {FieldDescriptor.TYPE_DOUBLE, FieldDescriptor.TYPE_FLOAT}


class Node(NamedTuple):
    """A field as it is shown: a number, a text, or the bytes of a floating-point number; and what is below it."""

    name: str
    value: int | str | bytes | None
    below: tuple["Node", ...] = ()


def capture(path: Path, packets: Sequence[CapturedDatagram]) -> Path:
    """Write a capture of ``packets`` and return its path."""
    with PcapngWriter(path) as writer:
        for packet in packets:
            writer.write(packet)
    return path


def tshark(path: Path, *arguments: str, script: bool = True) -> str:
    """Return what tshark says of a capture; a single word on its standard error fails the test."""
    load = ("-X", f"lua_script:{DISSECTOR}") if script else ()
    result = subprocess.run(
        ["tshark", *load, "-r", str(path), *arguments],  # noqa: S607
        capture_output=True,
        text=True,
        check=True,
    )
    assert [line for line in result.stderr.splitlines() if not line.startswith("Running as user")] == []
    assert "Lua Error" not in result.stdout
    return result.stdout


def shown(path: Path, protocol: str, roots: Sequence[Descriptor]) -> Iterator[tuple[Node, ...]]:
    """Yield for each packet the fields of the schema as tshark shows them."""
    fields: dict[str, FieldDescriptor] = {}
    for root in roots:
        fields |= named_fields(root, protocol)
    for packet in ET.fromstring(tshark(path, "-T", "pdml", "-J", protocol)):  # noqa: S314  # tshark is on our side
        found = packet.find(f"./proto[@name='{protocol}']")
        assert found is not None
        assert not {f"{protocol}.malformed", f"{protocol}.unknown"} & {item.get("name") for item in found.iter()}
        yield read_below(found, fields)


def named_fields(message: Descriptor, path: str) -> dict[str, FieldDescriptor]:
    """Return all fields by their names in filters; a vector's numbers are called what the vector is called."""
    named: dict[str, FieldDescriptor] = {}
    for field in message.fields:
        name = f"{path}.{field.name}"
        inner = field.message_type
        named[name] = inner.fields[0] if inner is not None and is_vector(inner) else field
        if inner is not None and not is_vector(inner):
            named |= named_fields(inner, name)
    return named


def is_vector(message: Descriptor) -> bool:
    return len(message.fields) == 1 and message.fields[0].name == "value" and message.fields[0].is_repeated


def read_below(element: ET.Element, fields: dict[str, FieldDescriptor]) -> tuple[Node, ...]:
    nodes = (read(item, fields) for item in element if item.get("name") in fields or is_count(item))
    return tuple(sorted(filter(None, nodes), key=lambda node: node.name))


def is_count(item: ET.Element) -> bool:
    return str(item.get("name")).endswith(".count")


def read(item: ET.Element, fields: dict[str, FieldDescriptor]) -> Node | None:
    """Return a field as it is shown; None for what protobuf does not tell from a field that is not there."""
    name, text = str(item.get("name")), str(item.get("show"))
    if is_count(item):
        return Node(name, int(text), read_below(item, fields))
    field, raw = fields[name], bytes.fromhex(item.get("value") or "")
    if field.type == FieldDescriptor.TYPE_MESSAGE:
        return Node(name, None, read_below(item, fields))
    value: int | str | bytes
    if field.type == FieldDescriptor.TYPE_BOOL:
        value = int(text in {"1", "True"})
    elif field.type in _INTEGERS:
        value = int(text, 0)
    elif field.type == FieldDescriptor.TYPE_STRING:
        value = raw.decode()
    else:
        value = raw
    absent = not (any(raw) if field.type in _FLOATS else value)
    return None if absent and not field.has_presence and not field.is_repeated else Node(name, value)


def expected(message: Message, path: str) -> tuple[Node, ...]:
    """Return the fields of a decoded message as tshark should show them."""
    nodes = []
    for field, value in message.ListFields():
        name = f"{path}.{field.name}"
        if field.message_type is None:
            nodes += numbers(name, field, value) if field.is_repeated else [Node(name, plain(field, value))]
        elif is_vector(field.message_type):
            nodes += numbers(name, field.message_type.fields[0], value.value)
        else:
            nodes += [Node(name, None, expected(one, name)) for one in (value if field.is_repeated else [value])]
    return tuple(sorted(nodes, key=lambda node: node.name))


def numbers(name: str, field: FieldDescriptor, values: Sequence[Any]) -> list[Node]:
    return [Node(f"{name}.count", len(values), tuple(Node(name, plain(field, value)) for value in values))]


def plain(field: FieldDescriptor, value: Any) -> int | str | bytes:
    if field.type == FieldDescriptor.TYPE_DOUBLE:
        return struct.pack("<d", value)
    if field.type == FieldDescriptor.TYPE_FLOAT:
        return struct.pack("<f", value)
    if isinstance(value, str | bytes):
        return value
    return int(value)


def named(nodes: Sequence[Node], path: str) -> Node | None:
    """Return the node at the end of a path through nodes."""
    for node in nodes:
        if node.name == path:
            return node
        if path.startswith(f"{node.name}."):
            return named(node.below, path)
    return None
