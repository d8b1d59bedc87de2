"""Writes Wireshark's dissector from the protobuf schemas and hand-written parts: ``python -m tools.make_dissector``.

Field names in filters are paths through the messages: ``fri.monitor.measured_position``. A message that is nothing but
a vector (``JointValues``) has no name of its own: its numbers have it.
"""

from collections.abc import Iterable, Iterator
from enum import IntEnum
from typing import Final

from google.protobuf.descriptor import Descriptor, FieldDescriptor

from hil.values.fri import (
    CLIENT_PORT,
    COMMAND_IDENTIFIER,
    MONITORING_IDENTIFIER,
    ClientCommandMode,
    ControlMode,
    DriveState,
    IODirection,
    IOType,
    OperationMode,
    OverlayType,
    Quality,
    RedundancyStrategy,
    SafetyState,
    SessionState,
)
from hil.values.servo import PROTOCOL_VERSION, SERVO_PORT
from tools.wireshark import DISSECTOR, FIRST_LINE
from transport.fri import fri_pb2
from transport.servo import servo_pb2
from transport.servo.tag import MIN_KEY_BYTES, TAG_BYTES, Direction, Envelope

_PARTS: Final = ("wire", "tree", "fri", "servo")
_LAST_CLIENT_PORT: Final = CLIENT_PORT + 9
_NAMES: Final[dict[str, type[IntEnum]]] = {
    "ConnectionInfo.session_state": SessionState,
    "ConnectionInfo.quality": Quality,
    "RobotInfo.safety_state": SafetyState,
    "RobotInfo.drive_state": DriveState,
    "RobotInfo.operation_mode": OperationMode,
    "RobotInfo.control_mode": ControlMode,
    "IpoData.client_command_mode": ClientCommandMode,
    "IpoData.overlay_type": OverlayType,
    "IOValue.type": IOType,
    "IOValue.direction": IODirection,
    "RedundancyInformation.strategy": RedundancyStrategy,
}
"""What the numbers of FRI's fields are called, whose schema has plain numbers."""
_HEXADECIMAL: Final = {"identifier", "token", "nonce"}
_KINDS: Final = {
    FieldDescriptor.TYPE_DOUBLE: "double",
    FieldDescriptor.TYPE_FLOAT: "float",
    FieldDescriptor.TYPE_UINT32: "uint32",
    FieldDescriptor.TYPE_INT32: "int32",
    FieldDescriptor.TYPE_UINT64: "uint64",
    FieldDescriptor.TYPE_FIXED64: "fixed64",
    FieldDescriptor.TYPE_SFIXED64: "sfixed64",
    FieldDescriptor.TYPE_BOOL: "bool",
    FieldDescriptor.TYPE_ENUM: "int32",
    FieldDescriptor.TYPE_STRING: "string",
    FieldDescriptor.TYPE_BYTES: "bytes",
    FieldDescriptor.TYPE_MESSAGE: "message",
}
_NUMBERS: Final = {"double", "float", "uint32", "int32"}
"""What may be repeated."""
_UNITS: Final = {
    "_nm_rad": "Nm/rad",
    "_mm_s": "mm/s",
    "_kg_m2": "kg m2",
    "_percent": "%",
    "_deg": "deg",
    "_kg": "kg",
    "_hz": "Hz",
    "_ms": "ms",
    "_ns": "ns",
    "_nm": "Nm",
    "_m": "m",
    "_n": "N",
    "_s": "s",
}


def dissector_text() -> str:
    """Return the Lua file."""
    fri, servo = fri_pb2.DESCRIPTOR.message_types_by_name, servo_pb2.DESCRIPTOR.message_types_by_name
    parts = (DISSECTOR.parent / "parts" / f"{part}.lua" for part in _PARTS)
    return "\n".join(
        (
            FIRST_LINE,
            "-- Written by tools/make_dissector.py (make dissector); do not edit. How to use it: README.md beside it.",
            "",
            "-- Loaded twice (as a plugin and by -X lua_script) it would be refused with an error.",
            "if _G.fri_hil_dissector then return end",
            "_G.fri_hil_dissector = true",
            "",
            *_constants(),
            "",
            *_root("FRI_MONITORING", fri["MonitoringMessage"], "fri"),
            *_root("FRI_COMMAND", fri["CommandMessage"], "fri"),
            *_root("SERVO_PACKET", servo["Packet"], "servo", servo["AnyPacket"]),
            *(path.read_text(encoding="utf-8") for path in parts),
        )
    )


def _constants() -> Iterator[str]:
    framing = (Envelope(key, Direction.FROM_CLIENT).wrap(b"")[0] for key in (None, bytes(MIN_KEY_BYTES)))
    yield f"local FRI_MONITORING_IDENTIFIER = {MONITORING_IDENTIFIER:#x}"
    yield f"local FRI_COMMAND_IDENTIFIER = {COMMAND_IDENTIFIER:#x}"
    yield f'local FRI_PORTS, SERVO_PORTS = "{CLIENT_PORT}-{_LAST_CLIENT_PORT}", "{SERVO_PORT}"'
    yield f"local SERVO_BARE, SERVO_TAGGED = {', '.join(map(hex, framing))}"
    yield f"local SERVO_TAG_BYTES, SERVO_VERSION = {TAG_BYTES}, {PROTOCOL_VERSION}"


def _root(name: str, message: Descriptor, path: str, frozen: Descriptor | None = None) -> Iterator[str]:
    yield f"local {name} = {{"
    yield from _message(message, path, frozen, indent="  ")
    yield "}\n"


def _message(message: Descriptor, path: str, frozen: Descriptor | None, indent: str) -> Iterator[str]:
    """Yield the inside of a message's table; ``frozen`` has the fields that mean the same in every version."""
    required = [str(field.number) for field in message.fields if field.is_required]
    if required:
        yield f"{indent}required = {{{', '.join(required)}}},"
    yield f"{indent}fields = {{"
    for field in message.fields:
        yield from _field(field, path, frozen, indent + "  ")
    yield f"{indent}}},"


def _field(field: FieldDescriptor, path: str, frozen: Descriptor | None, indent: str) -> Iterator[str]:
    kind, inner = _KINDS[field.type], field.message_type
    vector = inner is not None and is_vector(inner)
    if (field.is_repeated and kind not in _NUMBERS | {"message"}) or (vector and field.is_repeated):
        raise NotImplementedError(f"{field.full_name} is repeated: the hand-written part cannot show that")
    its_path = (
        path if field.containing_type is not None and is_vector(field.containing_type) else f"{path}.{field.name}"
    )
    parts = [f'name = "{field.name}"', f'path = "{its_path}"', f'label = "{_label(its_path)}"']
    parts.append(f'kind = "{"vector" if vector else kind}"')
    parts += ["repeated = true"] * field.is_repeated + ["hexadecimal = true"] * (field.name in _HEXADECIMAL)
    always = None if frozen is None else frozen.fields_by_number.get(field.number)
    parts += ["frozen = true"] * (always is not None)
    if names := _names(field):
        parts.append("names = {" + ", ".join(f'[{number}] = "{name}"' for number, name in names) + "}")
    head = f"{indent}[{field.number}] = {{{', '.join(parts)}"
    if inner is None:
        yield head + "},"
        return
    yield head + ", message = {"
    yield from _message(inner, its_path, None if always is None else always.message_type, indent + "  ")
    yield f"{indent}}}}},"


def is_vector(message: Descriptor) -> bool:
    """Tell whether a message is nothing but numbers, so that they are called what the message is called."""
    return len(message.fields) == 1 and message.fields[0].name == "value" and message.fields[0].is_repeated


def _names(field: FieldDescriptor) -> Iterable[tuple[int, str]]:
    if field.name == "identifier":
        return (MONITORING_IDENTIFIER, "monitoring"), (COMMAND_IDENTIFIER, "command")
    if field.enum_type is not None:
        return [(value.number, value.name) for value in field.enum_type.values]
    kind = _NAMES.get(f"{field.containing_type.name}.{field.name}") if field.containing_type is not None else None
    return () if kind is None else [(int(member), member.name) for member in kind]


def _label(path: str) -> str:
    name = path.rpartition(".")[2]
    unit = next(((suffix, unit) for suffix, unit in _UNITS.items() if name.endswith(suffix)), None)
    text = name if unit is None else name.removesuffix(unit[0])
    return text.replace("_", " ").capitalize() + ("" if unit is None else f" [{unit[1]}]")


def main() -> None:
    """Write the file that Wireshark loads."""
    DISSECTOR.write_text(dissector_text(), encoding="utf-8")
    print(DISSECTOR)


if __name__ == "__main__":
    main()
