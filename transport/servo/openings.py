"""What opens and ends a session: hello, welcome, refusal, goodbye, end."""

from hil.values.servo import (
    MAX_NAME_BYTES,
    MAX_REASON_BYTES,
    PROTOCOL_VERSION,
    Ended,
    Goodbye,
    Hello,
    Refused,
    Welcome,
)
from transport.servo import servo_pb2
from transport.servo.fields import ROLES, read_member, read_text, undecodable, wire_number, wire_text


def read_hello(wire: servo_pb2.Packet) -> Hello:
    """Return a hello; raise :class:`MalformedDatagram`."""
    hello = wire.hello
    name = read_text(hello.name, MAX_NAME_BYTES, "name")
    if not name.isprintable():
        raise undecodable(f"the name {name!r} cannot be printed")
    role = read_member(ROLES, hello.role, "role")
    return Hello(
        wire.header.version,
        hello.nonce,
        role,
        hello.watchdog_ms,
        hello.state_period_ms,
        name,
        hello.latency_budget_ms,
    )


def read_welcome(wire: servo_pb2.Packet) -> Welcome:
    """Return an offer; raise :class:`MalformedDatagram`."""
    welcome = wire.welcome
    return Welcome(
        wire.header.version,
        welcome.nonce,
        wire.header.token,
        read_text(welcome.software, MAX_NAME_BYTES, "software"),
        read_text(welcome.robot, MAX_NAME_BYTES, "robot"),
        welcome.cycle_ms,
        welcome.unix_epoch_ns,
    )


def read_refused(wire: servo_pb2.Packet) -> Refused:
    """Return a refusal; raise :class:`MalformedDatagram`."""
    refused = wire.refused
    reason = read_text(refused.reason, MAX_REASON_BYTES, "reason")
    return Refused(wire.header.version, refused.nonce, reason, refused.try_again)


def read_goodbye(wire: servo_pb2.Packet) -> Goodbye:
    """Return a goodbye."""
    return Goodbye(wire.header.token, wire.header.sequence)


def read_ended(wire: servo_pb2.Packet) -> Ended:
    """Return the end of a session; raise :class:`MalformedDatagram`."""
    return Ended(wire.header.token, read_text(wire.ended.reason, MAX_REASON_BYTES, "reason"))


def write_hello(packet: Hello, *, fill_bytes: int) -> bytes:
    """Return a hello, filled up to ``fill_bytes``, which must leave more than 130 to fill."""
    printable = "".join(character if character.isprintable() else "?" for character in packet.name)
    wire = servo_pb2.Packet(
        header=servo_pb2.Header(version=packet.version),
        hello=servo_pb2.Hello(
            nonce=packet.nonce,
            role=wire_number(packet.role),
            watchdog_ms=packet.watchdog_ms,
            state_period_ms=packet.state_period_ms,
            name=wire_text(printable, MAX_NAME_BYTES),
            latency_budget_ms=packet.latency_budget_ms,
        ),
    )
    missing = fill_bytes - wire.ByteSize()
    wire.hello.padding = bytes(missing)
    # Again without what its tag and the lengths around it took: both paddings have lengths of two bytes.
    wire.hello.padding = bytes(missing - (wire.ByteSize() - fill_bytes))
    return wire.SerializeToString()


def write_goodbye(packet: Goodbye) -> bytes:
    """Return the packet with which a client leaves."""
    header = servo_pb2.Header(version=PROTOCOL_VERSION, token=packet.token, sequence=packet.sequence)
    return servo_pb2.Packet(header=header, goodbye=servo_pb2.Goodbye()).SerializeToString()


def write_answer(packet: Welcome | Refused | Ended) -> bytes:
    """Return what the controller says of a session as a whole."""
    if isinstance(packet, Ended):
        header = servo_pb2.Header(version=PROTOCOL_VERSION, token=packet.token)
        ended = servo_pb2.Ended(reason=wire_text(packet.reason, MAX_REASON_BYTES))
        return servo_pb2.Packet(header=header, ended=ended).SerializeToString()
    if isinstance(packet, Refused):
        refused = servo_pb2.Refused(
            nonce=packet.nonce, reason=wire_text(packet.reason, MAX_REASON_BYTES), try_again=packet.try_again
        )
        header = servo_pb2.Header(version=packet.version)
        return servo_pb2.Packet(header=header, refused=refused).SerializeToString()
    welcome = servo_pb2.Welcome(
        nonce=packet.nonce,
        software=wire_text(packet.software, MAX_NAME_BYTES),
        robot=wire_text(packet.robot, MAX_NAME_BYTES),
        cycle_ms=packet.cycle_ms,
        unix_epoch_ns=packet.unix_epoch_ns,
    )
    header = servo_pb2.Header(version=packet.version, token=packet.token)
    return servo_pb2.Packet(header=header, welcome=welcome).SerializeToString()
