"""The servo link's codec: datagrams to values and back, for both ends.

Decoding is total: it returns a value or raises :class:`MalformedDatagram`, whose outcome names the counter. A packet of
another protocol version is one, but for what opens a session: a hello, a welcome or a refusal of another version is
returned with its ``version``, so that either end can say in words what is wrong.
"""

from struct import error as struct_error

from hil.values.errors import ConfigurationError, MalformedDatagram
from hil.values.outcomes import Outcome
from hil.values.servo import (
    MAX_SERVO_DATAGRAM_BYTES,
    MIN_HELLO_BYTES,
    Command,
    FromClient,
    FromController,
    Goodbye,
    Hello,
    State,
)
from transport.servo import reading, usual
from transport.servo.commands import write_command
from transport.servo.openings import write_answer, write_goodbye, write_hello
from transport.servo.states import StateWriter
from transport.servo.tag import Direction, Envelope


class ServoCodec:
    """Packets of the servo link; with a ``key`` of 16..64 bytes each has a tag, and one without is refused.

    It keeps the :class:`ServoControllerCodec` and the :class:`ServoClientCodec`; an instance may serve any number of
    sessions of one controller, in one thread.
    """

    def __init__(self, key: bytes | None = None) -> None:
        self._from_client = Envelope(key, Direction.FROM_CLIENT)
        self._from_controller = Envelope(key, Direction.FROM_CONTROLLER)
        self._room_bytes = MAX_SERVO_DATAGRAM_BYTES - self._from_client.overhead_bytes
        self._fill_bytes = MIN_HELLO_BYTES - self._from_client.overhead_bytes
        self._states = StateWriter()

    def decode_from_client(self, datagram: bytes) -> FromClient:
        """Return the packet in an application's datagram; raise :class:`MalformedDatagram`."""
        packet = self._from_client.unwrap(datagram)
        value = usual.read_command(packet) or reading.from_client(packet)
        if isinstance(value, Hello) and len(datagram) < MIN_HELLO_BYTES:
            raise MalformedDatagram(
                Outcome.TOO_SHORT, f"a hello of {len(datagram)} bytes, it is filled up to {MIN_HELLO_BYTES}"
            )
        return value

    def encode_from_client(self, packet: FromClient) -> bytes:
        """Return the datagram of an application's packet, with as many of a command's requests as there is room for.

        Raises :class:`ConfigurationError` for values no packet can carry: a vector of more than 32 numbers, or what is
        no number, or one too large for its field.
        """
        try:
            return self._from_client.wrap(self._packet_from_client(packet))
        except (struct_error, TypeError, ValueError) as error:
            raise ConfigurationError(f"a {type(packet).__name__} cannot be sent with these values: {error}") from error

    def decode_from_controller(self, datagram: bytes) -> FromController:
        """Return the packet in the controller's datagram; raise :class:`MalformedDatagram`."""
        packet = self._from_controller.unwrap(datagram)
        return usual.read_state(packet) or reading.from_controller(packet)

    def encode_from_controller(self, packet: FromController) -> bytes:
        """Return the datagram of the controller's packet, with as many of a state's reports as there is room for."""
        if isinstance(packet, State):
            return self._from_controller.wrap(self._states.write(packet, most_bytes=self._room_bytes))
        return self._from_controller.wrap(write_answer(packet))

    def _packet_from_client(self, packet: FromClient) -> bytes:
        if isinstance(packet, Command):
            return write_command(packet, most_bytes=self._room_bytes)
        if isinstance(packet, Goodbye):
            return write_goodbye(packet)
        return write_hello(packet, fill_bytes=self._fill_bytes)
