"""A recording of ours through a fresh controller: the same inputs at the same times, every output byte compared."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol
from zlib import crc32

from hil.config.station import RobotConfig
from hil.core.controller import FRI_LINK, ROBOT_SIDE_LINK, Controller
from hil.core.servo.link import SERVO_LINK
from hil.replay.altered import alteration
from hil.replay.fields import differences
from hil.replay.result import Moment, ReplayResult, Watcher
from hil.runtime.assembly import RobotParts, make_controller, open_parts, tell_first_message
from hil.runtime.capture_header import CaptureHeader, RobotStart
from hil.runtime.pad_requests import read_request
from hil.values.arm import PeerBackend
from hil.values.errors import BackendError, MalformedDatagram
from hil.values.link import Address, Outgoing, Source
from transport.capture.journal import (
    ActionEntry,
    CloseEntry,
    EndEntry,
    Entry,
    FailedEntry,
    JournalError,
    LostEntry,
    TickEntry,
    inputs_crc32,
)
from transport.capture.records import CapturedDatagram, Packet
from transport.fri import FriCodec
from transport.servo import ServoCodec

_MAX_KEPT_INPUTS = 64
_MAX_SOURCES = 1024
_LAST_NS = 1 << 61
"""73 years: the core is not told of a later time, nor of one so long before the run."""


class Sink(Protocol):
    """Takes the recording anew, with what the emulator sent in the place of what was recorded."""

    def note(self, entry: Entry) -> None:
        """Take an entry of the journal; raise ``JournalError`` for one that cannot be."""

    def put(self, datagram: CapturedDatagram) -> None:
        """Take a datagram."""


class Observer(Protocol):
    """Looks into the controller of one robot."""

    def cycle(self, now_ns: int) -> None:
        """The cycle of core time ``now_ns`` has run, with everything that was told before it."""


Observe = Callable[[RobotStart, RobotConfig, RobotParts, Controller], Observer]
"""Asked once for each robot, before its first cycle."""


@dataclass(slots=True)
class _Robot:
    """One fresh controller, and what it was told and said since its last cycle."""

    start: RobotStart
    controller: Controller
    parts: RobotParts
    decoders: dict[tuple[str, bool], Callable[[bytes], object]]
    """By link, and whether the controller sent it."""
    observer: Observer | None
    said: list[Outgoing] = field(default_factory=list)
    inputs_crc32: int = 0
    inputs: list[Packet] = field(default_factory=list)
    """Datagrams since the last cycle, the first ones."""
    told_altered: bool = False
    """Whether one of them was told to be changed."""
    t_ns: int = -1
    departed_ns: int = 0
    cycle: int = -1
    ended: bool = False
    unix_epoch_ns: int = field(init=False)
    fri_client: Address | None = field(init=False)

    def __post_init__(self) -> None:
        self.unix_epoch_ns = self.start.unix_epoch_ns
        self.fri_client = self.start.fri_client


class ExactReplay:
    """Feeds what a recording holds, in order; the caller opens it in a ``with`` block or calls :meth:`close`.

    ``pace`` is told the core time of each cycle before it runs; who ``observe`` returns is told after it.
    """

    def __init__(
        self,
        header: CaptureHeader,
        result: ReplayResult,
        *,
        sink: Sink | None = None,
        pace: Callable[[int], None] | None = None,
        watch: Watcher | None = None,
        observe: Observe | None = None,
    ) -> None:
        self._watch = watch
        self._observe = observe
        self._result = result
        self._sink = sink
        self._pace = pace
        self._robots: list[_Robot] = []
        self._routes: dict[tuple[str, int], tuple[_Robot, str]] = {}
        self._sources: dict[tuple[str, tuple[str, int]], Source] = {}
        try:
            self._surroundings = header.station.surroundings()
            for number, start in enumerate(header.robots):
                self._add(start, header.config(number))
        except BaseException:
            self.close()
            raise

    def _add(self, start: RobotStart, config: RobotConfig) -> None:
        """Make a robot's fresh controller."""
        parts = open_parts(config, surroundings=self._surroundings)
        try:
            if start.robot_side is not None:
                first = start.robot_side
                tell_first_message(parts.backend, bytes.fromhex(first.datagram), Address(*first.sender))
            controller = make_controller(
                config,
                parts,
                unix_epoch_ns=start.unix_epoch_ns,
                fri_peer=start.fri_client,
                token_secret=bytes.fromhex(start.token_secret) or None,
            )
        except BaseException:
            parts.backend.close()
            raise
        decoders: dict[tuple[str, bool], Callable[[bytes], object]] = {}
        if config.fri is not None:
            codec = FriCodec(config.fri.release)
            decoders[FRI_LINK, True] = codec.decode_monitoring
            decoders[FRI_LINK, False] = codec.decode_command
        if isinstance(parts.backend, PeerBackend):
            for sent in (True, False):
                decoders[ROBOT_SIDE_LINK, sent] = partial(parts.backend.decode, sent=sent)
        if isinstance(parts.servo_codec, ServoCodec):
            decoders[SERVO_LINK, True] = parts.servo_codec.decode_from_controller
            decoders[SERVO_LINK, False] = parts.servo_codec.decode_from_client
        observer = None if self._observe is None else self._observe(start, config, parts, controller)
        robot = _Robot(start, controller, parts, decoders, observer)
        self._robots.append(robot)
        self._routes.update({address: (robot, link) for link, address in start.bound.items()})

    def close(self) -> None:
        """Release the robot sides."""
        for robot in self._robots:
            robot.parts.backend.close()

    def controllers(self) -> list[tuple[str, Controller]]:
        """Return the fresh controllers by the name of their robot, to be looked at when the recording is over."""
        return [(robot.start.name, robot.controller) for robot in self._robots]

    def packet(self, packet: Packet) -> None:
        """Take a datagram: hand it to the core it was sent to, or compare it with what the core said."""
        route = self._routes.get(packet.destination)
        if route is not None:
            self._input(route[0], route[1], packet)
            return
        route = self._routes.get(packet.source)
        if route is None:
            self._result.note(f"datagrams between strangers are passed over, the first is packet {packet.number}")
            return
        self._output(route[0], route[1], packet)

    def entry(self, entry: Entry) -> None:
        """Take an entry of the journal; raise ``JournalError`` for a robot or a time that the run has not."""
        match entry:
            case TickEntry():
                self.tick(entry)
                return
            case LostEntry(records):
                self._result.note(
                    f"{records} records are missing at t={self._now_s():.3f} s: the disk did not keep up with the run"
                )
            case EndEntry():
                self._result.complete = True
            case ActionEntry() | CloseEntry() | FailedEntry():
                self._told(self._robot(entry.robot, entry.at_ns), entry)
        if self._sink is not None:
            self._sink.note(entry)

    def finish(self) -> None:
        """The recording is over."""
        for robot in self._robots:
            if self._result.complete:
                self._missing(robot)
            self._result.cycles += robot.cycle + 1
            self._result.recorded_s = max(self._result.recorded_s, robot.t_ns / 1e9)

    def _robot(self, number: int, at_ns: int) -> _Robot:
        if number >= len(self._robots):
            raise JournalError(f"an entry of robot {number}, and the run has {len(self._robots)}, from 0")
        if not 0 <= at_ns <= _LAST_NS:
            raise JournalError(f"an entry of the time {at_ns} ns; valid: 0 to {_LAST_NS}")
        return self._robots[number]

    def _told(self, robot: _Robot, entry: ActionEntry | CloseEntry | FailedEntry) -> None:
        if robot.ended:
            return
        controller = robot.controller
        match entry:
            case ActionEntry(_, at_ns, action):
                request = read_request(action.encode())
                told = getattr(request, "action", None)
                if told is None:
                    self._result.note(f"an action of the operator is not understood: {action[:80]}")
                else:
                    controller.operate(told, now_ns=at_ns)
            case CloseEntry(_, at_ns):
                controller.close(now_ns=at_ns)
            case FailedEntry(_, at_ns, reason):
                self._result.note(
                    f"{robot.start.name}: its robot side failed at t={at_ns / 1e9:.3f} s ({reason}), which a fresh one "
                    f"does not: the rest is not compared"
                )
                robot.ended = True

    def tick(self, entry: TickEntry) -> None:
        """Take the entry of a cycle: run it, and keep what the core said to be compared; errors as of :meth:`entry`."""
        robot = self._robot(entry.robot, entry.due_ns)
        if robot.ended:
            return
        if not (
            robot.t_ns < entry.due_ns
            and -_LAST_NS <= entry.lateness_ns <= _LAST_NS
            and 0 <= entry.departed_ns <= _LAST_NS
        ):
            raise JournalError(
                f"a cycle at {entry.due_ns} ns after one at {robot.t_ns} ns, {entry.lateness_ns} ns late, whose "
                f"datagrams left at {entry.departed_ns} ns"
            )
        if self._pace is not None:
            self._pace(entry.due_ns)
        self._before_cycle(robot, entry)
        controller = robot.controller
        try:
            controller.tick(now_ns=entry.due_ns, lateness_ns=entry.lateness_ns)
        except BackendError as error:
            self._result.note(f"{robot.start.name}: the emulator's robot side failed: {error}")
            robot.ended = True
            return
        robot.t_ns, robot.departed_ns = entry.due_ns, entry.departed_ns
        self._result.reached_s = entry.due_ns / 1e9
        robot.cycle += 1
        robot.inputs_crc32, robot.told_altered = 0, False
        if robot.inputs:
            robot.inputs.clear()
        robot.said = said = controller.outgoing(now_ns=entry.departed_ns)
        if robot.observer is not None:
            robot.observer.cycle(entry.due_ns)
        if self._sink is not None:
            self._sink.note(entry)
            for one in said:
                self._sink.put(self._sent(robot, one))

    def _before_cycle(self, robot: _Robot, entry: TickEntry) -> None:
        """What was said in the cycle before is compared by now, and what was told since is what was recorded."""
        if robot.said:
            self._missing(robot)
        if robot.inputs_crc32 != entry.inputs_crc32:
            self._inputs_altered(robot)

    def _input(self, robot: _Robot, link: str, packet: Packet) -> None:
        self._result.inputs += 1
        at_ns = packet.at_unix_ns - robot.unix_epoch_ns
        recorded = packet.recorded_crc32
        if recorded is not None and recorded != crc32(packet.frame):
            robot.told_altered = True
            if self._result.tells_altered:
                what = alteration(packet, robot.decoders.get((link, False), bytes))
                self._result.alter(f"{self._input_in_words(robot, link, packet)}: {what}")
            else:
                self._result.altered_count += 1
        robot.inputs_crc32 = inputs_crc32(packet.payload, at_ns, robot.inputs_crc32)
        if len(robot.inputs) < _MAX_KEPT_INPUTS:
            robot.inputs.append(packet)
        if not robot.ended:
            told_ns = at_ns if -_LAST_NS <= at_ns <= _LAST_NS else robot.t_ns  # its time stamp is damaged
            robot.controller.receive(packet.payload, self._source(link, packet.source), now_ns=told_ns)
        if self._sink is not None:
            self._sink.put(packet.datagram)

    def _output(self, robot: _Robot, link: str, packet: Packet) -> None:
        if robot.ended:
            return
        result = self._result
        recorded = packet.recorded_crc32
        if recorded is not None and recorded != crc32(packet.frame):
            if result.tells_altered:
                what = alteration(packet, robot.decoders.get((link, True), bytes))
                result.alter(f"the controller's datagram at {self._moment(robot, packet)}: {what}")
            else:
                result.altered_count += 1
        if not robot.said:
            moment = self._moment(robot, packet)
            result.extra += 1
            result.differ_whole(
                moment, f"the recording has a datagram on the {link} link that the emulator did not send"
            )
            return
        said = robot.said.pop(0)
        result.compared += 1
        if self._watch is not None:
            self._show(robot, link, packet.payload, said)
        destination = said.destination or robot.fri_client
        if said.payload == packet.payload and destination == packet.destination and said.link == link:
            result.identical += 1
        else:
            self._differ(robot, link, packet, said)

    def _differ(self, robot: _Robot, link: str, packet: Packet, said: Outgoing) -> None:
        result, moment = self._result, self._moment(robot, packet)
        if said.link != link:
            result.differ_whole(moment, f"the emulator sent on the {said.link} link where the recording has {link}")
            return
        if said.payload == packet.payload:
            destination = said.destination or robot.fri_client
            result.differ_whole(moment, f"sent to {destination} instead of {Address(*packet.destination)}")
            return
        decode = robot.decoders[link, True]
        try:
            result.differ(moment, list(differences(decode(packet.payload), decode(said.payload))))
        except MalformedDatagram as error:
            result.differ_whole(moment, f"the recorded datagram is no message of the {link} link ({error})")

    def _source(self, link: str, sender: tuple[str, int]) -> Source:
        """Return who sent it; the same object for the same sender, of which a recording has few."""
        source = self._sources.get((link, sender))
        if source is None:
            if len(self._sources) >= _MAX_SOURCES:
                self._sources.clear()
            source = self._sources[link, sender] = Source(link, Address(*sender))
        return source

    def _show(self, robot: _Robot, link: str, recorded: bytes, said: Outgoing) -> None:
        if self._watch is None or said.link != link:
            return
        if self._watch.wants(f"{robot.start.name} {link}"):
            decode = robot.decoders[link, True]
            with suppress(MalformedDatagram):
                self._watch.pair(robot.t_ns / 1e9, decode(recorded), decode(said.payload))

    def _missing(self, robot: _Robot) -> None:
        """What was said in the last cycle, and is not in the recording behind it, is missing there."""
        if robot.said:
            self._result.missing += len(robot.said)
            link = robot.said[0].link
            what = f"the emulator sent a datagram on the {link} link that the recording has not"
            self._result.differ_whole(self._moment(robot, None), what)
            robot.said.clear()

    def _inputs_altered(self, robot: _Robot) -> None:
        if robot.told_altered:
            return
        if not robot.inputs:
            what = "a datagram to the controller is missing"
        else:
            names = "; ".join(
                self._input_in_words(robot, self._routes[one.destination][1], one) for one in robot.inputs
            )
            what = f"{names}: not what was recorded, or not when it was, or one beside it is missing"
        self._result.alter(f"between cycles {robot.cycle} and {robot.cycle + 1}, t={robot.t_ns / 1e9:.3f} s: {what}")

    def _input_in_words(self, robot: _Robot, link: str, packet: Packet) -> str:
        at_s = (packet.at_unix_ns - robot.start.unix_epoch_ns) / 1e9
        what = "datagram"
        with suppress(MalformedDatagram):
            message = robot.decoders.get((link, False), bytes)(packet.payload)
            number = getattr(message, "sequence_counter", getattr(message, "sequence", None))
            what = type(message).__name__ if number is None else f"{type(message).__name__} {number}"
        return f"packet {packet.number}, {what} from {Address(*packet.source)} at t={at_s:.6f} s"

    def _sent(self, robot: _Robot, said: Outgoing) -> CapturedDatagram:
        source = robot.start.bound[said.link]
        destination = said.destination or robot.start.fri_peer or source
        return CapturedDatagram(robot.start.unix_epoch_ns + robot.departed_ns, source, destination, said.payload)

    def _moment(self, robot: _Robot, packet: Packet | None) -> Moment:
        return Moment(robot.start.name, robot.t_ns / 1e9, robot.cycle, 0 if packet is None else packet.number)

    def _now_s(self) -> float:
        return max((robot.t_ns for robot in self._robots), default=0) / 1e9
