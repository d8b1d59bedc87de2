"""Who speaks to whom in a capture: an FRI controller with its client, an application with its controller."""

from contextlib import suppress
from pathlib import Path

from hil.replay.guess import Flow
from hil.replay.replay import Wish, flows_of, packets_of
from hil.values.errors import MalformedDatagram, UsageError
from hil.values.link import Address
from hil.values.servo import Hello
from transport.capture.reading import read_section_comment
from transport.servo import ServoCodec


def fri_conversation(file: Path, wish: Wish) -> Flow:
    """Return the first recorded FRI controller with its client; raise :class:`UsageError` where there is none."""
    flows = list(flows_of(file, wish).values())
    if not flows:
        raise UsageError(f"{file} holds no FRI traffic that is understood")
    return flows[0]


def servo_conversation(file: Path, codec: ServoCodec) -> tuple[Address, Address]:
    """Return the first recorded application and its controller; raise :class:`UsageError` where there is none."""
    read_section_comment(file)
    for packet in packets_of(file):
        with suppress(MalformedDatagram):
            if isinstance(codec.decode_from_client(packet.payload), Hello):
                return Address(*packet.source), Address(*packet.destination)
    raise UsageError(f"{file} holds no hello of an application on the servo link (or it needs its key: --servo-key)")
