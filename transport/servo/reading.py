"""Which packet it is, of which version: bytes to values for each end."""

from collections.abc import Callable, Mapping
from typing import Final, TypeVar

from google.protobuf.message import DecodeError

from hil.values.errors import MalformedDatagram
from hil.values.outcomes import Outcome
from hil.values.servo import PROTOCOL_VERSION, FromClient, FromController, Hello, Refused, Role, Welcome
from transport.servo import servo_pb2
from transport.servo.commands import read_command
from transport.servo.fields import undecodable
from transport.servo.openings import read_ended, read_goodbye, read_hello, read_refused, read_welcome
from transport.servo.states import read_state

_P = TypeVar("_P")

_FROM_CLIENT: Final[Mapping[str, Callable[[servo_pb2.Packet], FromClient]]] = {
    "hello": read_hello,
    "command": read_command,
    "goodbye": read_goodbye,
}
_FROM_CONTROLLER: Final[Mapping[str, Callable[[servo_pb2.Packet], FromController]]] = {
    "welcome": read_welcome,
    "refused": read_refused,
    "state": read_state,
    "ended": read_ended,
}


def from_client(packet: bytes) -> FromClient:
    """Return the value of an application's packet; raise :class:`MalformedDatagram`.

    Of a hello of another version, only version and nonce are known; the rest is what an observer may leave out.
    """
    wire = _of_this_version(packet)
    if wire is not None:
        return _body(wire, _FROM_CLIENT)
    other = _of_any_version(packet)
    if other.WhichOneof("body") != "hello":
        raise _other_version(other.header.version)
    return Hello(other.header.version, other.hello.nonce, Role.OBSERVER, 0, 0, "")


def from_controller(packet: bytes) -> FromController:
    """Return the value of the controller's packet; raise :class:`MalformedDatagram`.

    Of a welcome of another version, version, nonce, token and software are known.
    """
    wire = _of_this_version(packet)
    if wire is not None:
        return _body(wire, _FROM_CONTROLLER)
    other = _of_any_version(packet)
    version, body = other.header.version, other.WhichOneof("body")
    if body == "welcome":
        software = other.welcome.text.decode(errors="replace")
        return Welcome(version, other.welcome.nonce, other.header.token, software, "", 0, 0)
    if body == "refused":
        reason = other.refused.text.decode(errors="replace")
        return Refused(version, other.refused.nonce, reason, other.refused.try_again)
    raise _other_version(version)


def _of_this_version(packet: bytes) -> servo_pb2.Packet | None:
    try:
        wire = servo_pb2.Packet.FromString(packet)
    except DecodeError:
        # Another version may use its fields in ways that this schema cannot read: then only the frozen ones count.
        if _of_any_version(packet).header.version == PROTOCOL_VERSION:
            raise undecodable(f"{len(packet)} bytes are no packet of the servo link") from None
        return None
    return wire if wire.header.version == PROTOCOL_VERSION else None


def _of_any_version(packet: bytes) -> servo_pb2.AnyPacket:
    try:
        wire = servo_pb2.AnyPacket.FromString(packet)
    except DecodeError:
        raise undecodable(f"{len(packet)} bytes are no packet of the servo link") from None
    if wire.header.version == 0:
        raise undecodable(f"{len(packet)} bytes without a protocol version")
    return wire


def _body(wire: servo_pb2.Packet, readers: Mapping[str, Callable[[servo_pb2.Packet], _P]]) -> _P:
    name = wire.WhichOneof("body")
    reader = readers.get(name or "")
    if reader is None:
        raise undecodable(f"a packet with {name or 'nothing'} in it, which the other end never sends")
    return reader(wire)


def _other_version(version: int) -> MalformedDatagram:
    return MalformedDatagram(
        Outcome.OTHER_VERSION, f"a packet of version {version} of the servo link, this side speaks {PROTOCOL_VERSION}"
    )
