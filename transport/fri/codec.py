"""The FRI codec: datagrams of one configured release to values and back, both directions.

Decoding is total: it returns a message or raises :class:`MalformedDatagram`, whose outcome names the counter. What
was decoded encodes to the same bytes again, which the recorded traffic of all six releases proves in the tests.
"""

from collections.abc import Callable
from typing import TypeVar

from google.protobuf.message import DecodeError

from hil.values.errors import MalformedDatagram
from hil.values.fri import COMMAND_IDENTIFIER, MAX_DATAGRAM_BYTES, MONITORING_IDENTIFIER, TRAITS, Release
from hil.values.fri_messages import CommandData, CommandMessage, MonitoringMessage
from hil.values.outcomes import Outcome
from transport.fri import fri_pb2, reading, writing
from transport.fri.framing import frame, unframe
from transport.fri.usual import usual_command
from transport.fri.writing import MonitoringWriter

_HEADER_BYTES = 10
"""Smallest message: a header submessage whose three varints take at least 4, 2 and 2 bytes, and its own tag."""

_BY_TRANSFORMATION = {TRAITS[release].transformation_values: release for release in (Release.V1_15, Release.V2_5)}

_M = TypeVar("_M", fri_pb2.CommandMessage, fri_pb2.MonitoringMessage)


class FriCodec:
    """Datagrams of one ``release``; an instance may serve any number of sessions, in one thread."""

    def __init__(self, release: Release) -> None:
        self._release = release
        self._traits = TRAITS[release]
        self._framed = self._traits.framed
        self._writer = MonitoringWriter()

    @property
    def release(self) -> Release:
        """Release this codec speaks."""
        return self._release

    def encode_monitoring(self, message: MonitoringMessage) -> bytes:
        """Return the datagram of a monitoring message."""
        return self._wrap(self._writer.monitoring(message))

    def encode_command(self, message: CommandMessage) -> bytes:
        """Return the datagram of a command message."""
        return self._wrap(writing.command(message).SerializeToString())

    def decode_command(self, datagram: bytes) -> CommandMessage:
        """Return the command message in ``datagram``; raise :class:`MalformedDatagram`."""
        body = unframe(datagram)[0] if self._framed else datagram
        usual = None if body is None else usual_command(body)
        if usual is not None and usual.identifier == COMMAND_IDENTIFIER:
            return usual
        wire = self._parse(datagram, fri_pb2.CommandMessage.FromString, COMMAND_IDENTIFIER)
        message = reading.command(wire)
        if message.command is not None:
            self._check_command(message.command)
        return message

    def decode_monitoring(self, datagram: bytes) -> MonitoringMessage:
        """Return the monitoring message in ``datagram``; raise :class:`MalformedDatagram`."""
        return reading.monitoring(self._parse(datagram, fri_pb2.MonitoringMessage.FromString, MONITORING_IDENTIFIER))

    def _wrap(self, body: bytes) -> bytes:
        return frame(body) if self._framed else body

    def _parse(self, datagram: bytes, from_string: Callable[[bytes], _M], identifier: int) -> _M:
        size = len(datagram)
        if size > MAX_DATAGRAM_BYTES:
            raise MalformedDatagram(Outcome.TOO_LONG, f"{size} bytes, at most {MAX_DATAGRAM_BYTES} are allowed")
        if size < _HEADER_BYTES:
            raise MalformedDatagram(Outcome.TOO_SHORT, f"{size} bytes, the smallest message has {_HEADER_BYTES}")
        body = self._body(datagram, from_string, identifier)
        try:
            wire = from_string(body)
        except DecodeError:
            raise self._undecodable(datagram, from_string, identifier) from None
        if wire.header.identifier != identifier:
            raise MalformedDatagram(
                Outcome.OTHER_RELEASE,
                f"message identifier 0x{wire.header.identifier:x}, 0x{identifier:x} was expected",
            )
        return wire

    def _body(self, datagram: bytes, from_string: Callable[[bytes], _M], identifier: int) -> bytes:
        if not self._framed:
            return datagram
        body, reason = unframe(datagram)
        if body is not None:
            return body
        if _speaks(datagram, from_string, identifier):
            raise MalformedDatagram(
                Outcome.OTHER_RELEASE,
                f"a message without length and CRC, as releases 1.x and 2.5 send it, not {self._release}",
                looks_like=_bare_release(from_string(datagram)),
            )
        raise MalformedDatagram(Outcome.FRAMING, str(reason))

    def _undecodable(self, datagram: bytes, from_string: Callable[[bytes], _M], identifier: int) -> MalformedDatagram:
        if not self._framed:
            body, _ = unframe(datagram)
            if body is not None and _speaks(body, from_string, identifier):
                return MalformedDatagram(
                    Outcome.OTHER_RELEASE,
                    f"a message with length and CRC, as release 2.7 sends it, not {self._release}",
                    looks_like=Release.V2_7,
                )
        return MalformedDatagram(Outcome.UNDECODABLE, f"{len(datagram)} bytes are no protobuf message of FRI")

    def _check_command(self, data: CommandData) -> None:
        traits = self._traits
        if not traits.pose and (data.pose is not None or data.redundancy is not None):
            raise self._other_release("a Cartesian pose, which only 2.x has", Release.V2_5)
        if not traits.inputs_outputs and data.inputs_outputs:
            raise self._other_release("outputs, which exist from 1.14 on", Release.V1_14)
        for transformation in (*data.transformations, *(() if data.pose is None else (data.pose,))):
            if len(transformation.values) != traits.transformation_values:
                count = len(transformation.values)
                raise self._other_release(
                    f"a transformation of {count} numbers, where {traits.transformation_values} are needed",
                    _BY_TRANSFORMATION.get(count) if not self._framed else None,
                )

    def _other_release(self, what: str, looks_like: Release | None) -> MalformedDatagram:
        detail = f"the command carries {what}; configured: {self._release}"
        return MalformedDatagram(Outcome.OTHER_RELEASE, detail, looks_like=looks_like)


def _bare_release(wire: fri_pb2.CommandMessage | fri_pb2.MonitoringMessage) -> Release:
    """Return the release of a message without frame: what no 2.5 sends is 1.x, the rest may as well be 2.5."""
    if isinstance(wire, fri_pb2.CommandMessage):
        # To a message it cannot read a client answers nothing, so this is an answer in monitoring at most.
        one = wire.HasField("command") and wire.command.HasField("position")
    else:
        one = wire.HasField("monitor") and wire.monitor.HasField("commanded_position")
    return Release.V1_15 if one else Release.V2_5


def _speaks(body: bytes, from_string: Callable[[bytes], _M], identifier: int) -> bool:
    try:
        return bool(from_string(body).header.identifier == identifier)
    except DecodeError:
        return False
