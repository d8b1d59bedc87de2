"""Getting a seat as an observer, or a sentence that says why there is none, in bounded time."""

import secrets
from typing import Final, NamedTuple

from hil.clock import Deadline
from hil.values.errors import EndpointError, MalformedDatagram
from hil.values.outcomes import Outcome
from hil.values.servo import PROTOCOL_VERSION, Command, Hello, Refused, Role, ServoClientCodec, State, Welcome
from tools.doctor.udp.stamped import Gone, Heard, TimedSocket

ANSWER_WITHIN_S: Final = 3.0
KNOCK_EVERY_S: Final = 0.05
PERIOD_MS: Final = 5
"""Unless told: the client library's."""
LEAST_WATCHDOG_MS: Final = 2000
_NAME: Final = "hil doctor udp"


class Joined(NamedTuple):
    """The seat: the controller's offer, the state period, and the first state with the time it came."""

    welcome: Welcome
    period_ms: int
    first: State
    first_heard: Heard
    commands_sent: int


def join(
    sock: TimedSocket, codec: ServoClientCodec, *, period_ms: int | None, has_key: bool, within_s: float
) -> Joined:
    """Begin a session as an observer; raise :class:`EndpointError` in one sentence."""
    opening = _Opening(sock, codec, has_key=has_key, within_s=within_s)
    asked_ms = PERIOD_MS if period_ms is None else period_ms
    try:
        answer = opening.hello(asked_ms)
        if isinstance(answer, Welcome):
            # What is no multiple of the controller's cycle is as long as the next one.
            return opening.begin(answer, -(-asked_ms // answer.cycle_ms) * answer.cycle_ms)
    except Gone as gone:
        raise EndpointError(
            f"{gone}; start the controller there (hil run --servo ADDR:PORT), or give the address it says at its start"
        ) from gone
    raise EndpointError(f"the controller at {sock.peer} gives no seat: {answer.reason}")


class _Opening:
    def __init__(self, sock: TimedSocket, codec: ServoClientCodec, *, has_key: bool, within_s: float) -> None:
        self._sock, self._codec, self._has_key = sock, codec, has_key
        self._within_s = within_s
        self._strange = ""

    def hello(self, period_ms: int) -> Welcome | Refused:
        """Say hello until it is answered."""
        nonce = secrets.randbits(64)
        watchdog_ms = max(LEAST_WATCHDOG_MS, 10 * period_ms)
        hello = Hello(PROTOCOL_VERSION, nonce, Role.OBSERVER, watchdog_ms, period_ms, _NAME)
        datagram = self._codec.encode_from_client(hello)
        deadline = Deadline(self._within_s)
        while (deadline.left_s() or 0.0) > 0.0:
            self._sock.send(datagram)
            knock = Deadline(KNOCK_EVERY_S)
            while (left_s := knock.left_s() or 0.0) > 0.0:
                heard = self._sock.receive(left_s)
                packet = None if heard is None else self._decoded(heard.datagram)
                if isinstance(packet, Welcome | Refused) and packet.nonce == nonce:
                    return _checked(packet)
        raise EndpointError(self._no_answer())

    def begin(self, welcome: Welcome, period_ms: int) -> Joined:
        """Take up the offer; return when the first state came."""
        deadline = Deadline(self._within_s)
        sequence = 0
        while (deadline.left_s() or 0.0) > 0.0:
            sequence += 1
            self._sock.send(self._codec.encode_from_client(Command(welcome.token, sequence, 0, wants_state=True)))
            knock = Deadline(KNOCK_EVERY_S)
            while (left_s := knock.left_s() or 0.0) > 0.0:
                heard = self._sock.receive(left_s)
                packet = None if heard is None else self._decoded(heard.datagram)
                if heard is not None and isinstance(packet, State) and packet.token == welcome.token:
                    return Joined(welcome, period_ms, packet, heard, sequence)
        raise EndpointError(
            f"the controller at {self._sock.peer} offered a session and then sent no state for {self._within_s:g} s: "
            "its answers to a hello get through, its states do not, or our commands do not reach it"
        )

    def _decoded(self, datagram: bytes) -> object:
        try:
            return self._codec.decode_from_controller(datagram)
        except MalformedDatagram as error:
            if error.outcome is Outcome.UNAUTHENTICATED:
                self._strange = (
                    f"what answers has another key than this side, or one where the other has none ({error.detail})"
                )
            else:
                self._strange = f"what answers is no controller's servo link ({error.detail})"
            return None

    def _no_answer(self) -> str:
        peer, within = self._sock.peer, f"within {self._within_s:g} s"
        if self._strange:
            return f"no controller at UDP {peer} {within}: {self._strange}"
        key = (
            "it has another key than the one given, or none"
            if self._has_key
            else "it has a key (then give it: --servo-key FILE)"
        )
        return (
            f"no answer from UDP {peer} {within}: something on the way drops the packets (firewall, wrong address), or "
            f"a controller is there and is silent to us: {key}"
        )


def _checked(packet: Welcome | Refused) -> Welcome | Refused:
    if isinstance(packet, Welcome) and packet.version != PROTOCOL_VERSION:
        reason = (
            f"it ({packet.software}) speaks version {packet.version} of the servo link, this hil version "
            f"{PROTOCOL_VERSION}: install the same fri-hil on both sides"
        )
        return Refused(packet.version, packet.nonce, reason, try_again=False)
    return packet
