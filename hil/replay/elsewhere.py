"""A recording from elsewhere, or one that misses its start, beside an emulator: where the two part, field by field.

The client's datagrams are handed to an emulator that was set up as the recording shows its controller to be. What a
robot application did there is done here too, at the same messages: it opened the session, started and ended its overlay
(here: the start key and the pause key), set inputs, closed the session. All else the emulator decides by itself.

The recorder's clock is not the controller's. So the emulator's time goes by the messages: one send period from one to
the next, and an answer is as old here as it was in the recording.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from hil.config.station import RobotConfig
from hil.core.controller import FRI_LINK, Controller
from hil.replay.fields import differences
from hil.replay.guess import Flow, state_of, value_of
from hil.replay.result import Moment, ReplayResult, Watcher
from hil.runtime.assembly import make_controller, open_parts
from hil.values.errors import BackendError, MalformedDatagram
from hil.values.fri import SEQUENCE_MODULUS, IODirection, SessionState
from hil.values.fri_messages import IOValue, MonitorData, MonitoringMessage
from hil.values.link import Source
from hil.values.operator import PadKey, Press, SetInput
from hil.values.signals import SignalValue
from transport.capture.records import Packet
from transport.fri import FriCodec

_NS_PER_MS: Final = 1_000_000
_MOST_MISSING: Final = 10_000
"""Messages in a row that a recording may have lost; a longer step of the counter is another session."""
_MOST_KEPT: Final = 256
_MOST_STATES: Final = 200


class Beside:
    """An emulator beside one recorded controller. Raises ``ConfigurationError`` where none can be put there."""

    def __init__(
        self,
        flow: Flow,
        config: RobotConfig,
        result: ReplayResult,
        *,
        name: str,
        pace: Callable[[int], None] | None = None,
        watch: Watcher | None = None,
    ) -> None:
        self._watch = watch
        self._flow = flow
        self._result = result
        self._name = name
        self._pace = pace
        self._codec = FriCodec(flow.release)
        fri = config.fri
        self._period_ns = (1 if fri is None else fri.send_period_ms) * _NS_PER_MS
        self._cycle_ns = config.cycle_ms * _NS_PER_MS
        self._config = config
        self._parts = open_parts(config, initial_position_rad=flow.initial_position_rad)
        self._controller = self._fresh(flow.first, flow.first_unix_ns)
        self._first_counter = flow.first.sequence_counter
        self._last_index = -1
        self._next_tick = 0
        self._anchor_unix_ns = flow.first_unix_ns
        """When the last message passed in the recording."""
        self._said: dict[int, bytes] = {}
        """Messages of the emulator that were not compared yet, by their place."""
        self._inputs: dict[str, SignalValue] = {}
        self._recorded_state = self._emulated_state = SessionState.IDLE
        self._commanding = False
        self._failed = False
        self._finished = False
        self._lost_messages = 0

    def close(self) -> None:
        """Release the robot side."""
        self._parts.backend.close()

    def sent(self, packet: Packet) -> None:
        """Take a datagram of the recorded controller."""
        try:
            message = self._codec.decode_monitoring(packet.payload)
        except MalformedDatagram as error:
            self._result.note(f"packet {packet.number} is no monitoring message ({error}): passed over")
            return
        state = state_of(message)
        if state is None:
            self._result.note(f"packet {packet.number} tells of a session state that there is not: passed over")
            return
        index = (message.sequence_counter - self._first_counter) % SEQUENCE_MODULUS
        if self._finished or not self._last_index < index <= self._last_index + _MOST_MISSING:
            self._begin_anew(packet, message)
            index = 0
        if index > self._last_index + 1:
            if not self._lost_messages:
                what = f"messages are missing in the recording, first at {self._moment(index)}"
                self._result.note(f"{self._name}: {what}")
            self._lost_messages += index - self._last_index - 1
        self._act(message, state, index)
        self._run_before(index * self._period_ns + 1)
        self._anchor_unix_ns = packet.at_unix_ns
        self._last_index = index
        self._compare(packet, message, index)

    def answered(self, packet: Packet) -> None:
        """Take a datagram of the recorded client."""
        self._result.inputs += 1
        if self._last_index < 0 or self._failed:
            return
        # An answer to a message that the recording misses is as old as if that message had passed in its time.
        index = max(self._last_index, self._answered_index(packet.payload))
        message_unix_ns = self._anchor_unix_ns + (index - self._last_index) * self._period_ns
        # An answer after the next message was due, which the recording has later than that, comes just before it here.
        age_ns = min(max(packet.at_unix_ns - message_unix_ns, 0), self._period_ns - 1)
        at_ns = index * self._period_ns + age_ns
        # The message that is answered goes out first.
        self._run_before(max(at_ns, index * self._period_ns + 1))
        self._controller.receive(packet.payload, Source(FRI_LINK, self._flow.client), now_ns=at_ns)

    def _answered_index(self, payload: bytes) -> int:
        """Return the place of the message that an answer is to; -1 where that cannot be."""
        try:
            reflected = self._codec.decode_command(payload).reflected_sequence_counter
        except MalformedDatagram:
            return -1
        index = (reflected - self._first_counter) % SEQUENCE_MODULUS
        return index if index <= self._last_index + _MOST_MISSING else -1

    def finish(self) -> None:
        """The recording is over."""
        self._result.missing += self._lost_messages
        self._lost_messages = 0
        self._result.cycles += self._next_tick
        self._result.recorded_s = max(self._result.recorded_s, self._last_index * self._period_ns / 1e9)

    def _fresh(self, first: MonitoringMessage, at_unix_ns: int) -> Controller:
        at = None if first.monitor is None else first.monitor.at
        unix_epoch_ns = at_unix_ns if at is None else at.seconds * 10**9 + at.nanoseconds
        controller = make_controller(
            self._config,
            self._parts,
            unix_epoch_ns=unix_epoch_ns,
            fri_peer=self._flow.client,
            token_secret=b"replay",
            first_sequence_counter=first.sequence_counter,
        )
        connection = first.connection
        if connection is not None and connection.session_state > SessionState.MONITORING_WAIT:
            state = SessionState(connection.session_state).name
            self._result.note(
                f"{self._name}: the recording begins in {state}, the emulator at the beginning of a session, at rest: "
                f"until it has caught up, the differences say nothing of it"
            )
        # The recorded robot application starts its overlay when it likes: until then the program waits.
        controller.operate(Press(PadKey.PAUSE), now_ns=0)
        return controller

    def _begin_anew(self, packet: Packet, message: MonitoringMessage) -> None:
        self._result.note(f"{self._name}: another session begins with packet {packet.number}: a fresh emulator")
        self.finish()
        self._parts.backend.close()
        self._parts = open_parts(
            self._config,
            initial_position_rad=replace(self._flow, first=message).initial_position_rad,
        )
        self._first_counter = message.sequence_counter
        self._controller = self._fresh(message, packet.at_unix_ns)
        self._last_index, self._next_tick = -1, 0
        self._said.clear()
        self._inputs.clear()
        self._commanding = self._failed = self._finished = False
        self._recorded_state = self._emulated_state = SessionState.IDLE

    def _act(self, message: MonitoringMessage, state: SessionState, index: int) -> None:
        """Do what the robot application and the periphery did before this message."""
        commanding = state >= SessionState.COMMANDING_WAIT
        inputs = _changed_inputs(message.monitor, self._inputs)
        if commanding == self._commanding and not inputs and state is not SessionState.IDLE:
            return
        before_ns = index * self._period_ns
        self._run_before(before_ns)
        now_ns = max(before_ns - self._cycle_ns, 0)
        for name, value in inputs.items():
            self._inputs[name] = value
            if index:
                self._controller.operate(SetInput(name, value), now_ns=now_ns)
        if commanding != self._commanding:
            self._commanding = commanding
            key = PadKey.START if commanding else PadKey.PAUSE
            self._controller.operate(Press(key), now_ns=now_ns)
        if state is SessionState.IDLE:
            self._finished = True
            self._controller.close(now_ns=now_ns)
            self._keep()

    def _run_before(self, until_ns: int) -> None:
        """Run the cycles that are due before ``until_ns``."""
        while not self._failed and self._next_tick * self._cycle_ns < until_ns:
            now_ns = self._next_tick * self._cycle_ns
            if self._pace is not None:
                self._pace(now_ns)
            try:
                self._controller.tick(now_ns=now_ns)
            except BackendError as error:
                self._result.note(f"{self._name}: the emulator's robot side failed: {error}")
                self._failed = True
                return
            self._next_tick += 1
            self._keep()
            self._controller.events()

    def _keep(self) -> None:
        for said in self._controller.outgoing():
            if said.link != FRI_LINK:
                continue
            counter = self._codec.decode_monitoring(said.payload).sequence_counter
            self._said[(counter - self._first_counter) % SEQUENCE_MODULUS] = said.payload
            if len(self._said) > _MOST_KEPT:
                del self._said[next(iter(self._said))]

    def _compare(self, packet: Packet, message: MonitoringMessage, index: int) -> None:
        result, moment = self._result, self._moment(index, packet.number)
        said = self._said.pop(index, None)
        if said is None:
            result.extra += 1
            result.differ_whole(moment, "the recording has a message that the emulator did not send")
            return
        result.compared += 1
        emulated = self._codec.decode_monitoring(said)
        self._note_states(moment.t_s, message, emulated)
        result.reached_s = moment.t_s
        if self._watch is not None and self._watch.wants(self._name):
            self._watch.pair(moment.t_s, message, emulated)
        if said == packet.payload:
            result.identical += 1
            return
        found = list(differences(_without_time(message), _without_time(emulated)))
        if found:
            result.differ(moment, found)
        else:
            result.identical += 1

    def _note_states(self, t_s: float, recorded: MonitoringMessage, emulated: MonitoringMessage) -> None:
        for whose, message in (("recording", recorded), ("emulator", emulated)):
            state = state_of(message)
            before = self._recorded_state if whose == "recording" else self._emulated_state
            if state is None or state is before:
                continue
            if whose == "recording":
                self._recorded_state = state
            else:
                self._emulated_state = state
            if len(self._result.states) < _MOST_STATES:
                self._result.states.append((self._name, whose, t_s, state.name))

    def _moment(self, index: int, packet: int = 0) -> Moment:
        t_ns = index * self._period_ns
        return Moment(self._name, t_ns / 1e9, t_ns // self._cycle_ns, packet)


def _changed_inputs(monitor: MonitorData | None, before: dict[str, SignalValue]) -> dict[str, SignalValue]:
    values: tuple[IOValue, ...] = () if monitor is None else monitor.inputs_outputs
    now = {one.name: value_of(one) for one in values if one.direction == IODirection.INPUT}
    return {name: value for name, value in now.items() if before.get(name) != value}


def _without_time(message: MonitoringMessage) -> MonitoringMessage:
    """Leave out when it was sent: the emulator's clock is not the recorded one, and requested poses carry it too."""
    monitor = message.monitor
    return message._replace(
        monitor=None if monitor is None else monitor._replace(at=None),
        requested_transformations=tuple(one._replace(at=None) for one in message.requested_transformations),
    )
