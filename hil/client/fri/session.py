"""The client's side of an FRI session, without a socket and without a clock."""

from collections import Counter

from hil.client.fri._answer import admitted, command_data
from hil.client.fri.command import Command
from hil.client.fri.handler import FriHandler
from hil.client.fri.state import FriState
from hil.values.errors import MalformedDatagram
from hil.values.fri import SEQUENCE_MODULUS, Release, SessionState
from hil.values.fri_messages import CommandMessage
from hil.values.outcomes import Outcome
from transport.fri import FriCodec


class ClientSession:
    """Turns monitoring messages of one ``release`` into the answers of ``handler``.

    A peer's fault never raises: it is counted in ``malformed``. An error of the handler does, and is the caller's.
    """

    def __init__(self, release: Release, handler: FriHandler) -> None:
        self.release = release
        self.handler = handler
        self.received = 0
        """Monitoring messages, well-formed ones."""
        self.answered = 0
        """Answers made."""
        self.malformed: Counter[Outcome] = Counter()
        """Datagrams that were no monitoring message of the release, by what was wrong with them."""
        self.state: FriState | None = None
        """Latest state; None before the first message."""
        self.ended = False
        """Whether the controller has closed the session: IDLE after another state."""
        self._codec = FriCodec(release)
        self._session_state = SessionState.IDLE
        self._sequence = 0
        self._since_answer = 0

    def receive(self, datagram: bytes) -> bytes | None:
        """Take a monitoring message and return the answer to it, if it wants one."""
        try:
            state, mirror = admitted(self.release, self._codec.decode_monitoring(datagram))
        except MalformedDatagram as error:
            self.malformed[error.outcome] += 1
            return None
        self.received += 1
        self.state = self.handler.robot_state = state
        self._follow(state.session_state)
        if mirror is None:
            return None
        command = self._ask(state)
        self._since_answer += 1
        if self._since_answer < state.receive_multiplier:
            return None
        self._since_answer = 0
        answer = CommandMessage(self._sequence, state.sequence_counter, command_data(state, mirror, command))
        self._sequence = (self._sequence + 1) % SEQUENCE_MODULUS
        self.answered += 1
        return self._codec.encode_command(answer)

    def _follow(self, new: SessionState) -> None:
        old = self._session_state
        if new is not old:
            self._session_state = new
            self.ended = new is SessionState.IDLE
            self.handler.on_state_change(old, new)

    def _ask(self, state: FriState) -> Command | None:
        if state.session_state is SessionState.COMMANDING_ACTIVE:
            return self.handler.command(state)
        if state.session_state is SessionState.COMMANDING_WAIT:
            return self.handler.wait_for_command(state)
        return self.handler.monitor(state)
