"""A real Cabinet as the robot side: an FRI client without a socket and without a clock.

Its messages pace the cycle, and each cycle's set point is the answer to the newest of them. COMMANDING begins only once
the set point of this controller lies on the Cabinet's interpolator. A Cabinet that was lost (silent for longer than
``silence_ms``, a session closed, commanding left under a moving arm) is not commanded again until somebody acknowledged
that: until then the answers hold a header alone, and the Cabinet's own supervision stops the arm. Source: fri-wire.
"""

import math
from collections import deque
from typing import Final

from backends.cabinet.capabilities import capabilities
from backends.cabinet.options import CabinetOptions
from backends.cabinet.reading import Said, read_message
from backends.cabinet.words import SHADOW, before_commanding, other_command_mode, waits_for_mirror, why_left
from hil.values.arm import ArmState, Capabilities, Contact, JointCommand, PeerLink, Push, RobotSideCondition
from hil.values.control import NO_WRENCH
from hil.values.errors import BackendError, ConfigurationError, MalformedDatagram
from hil.values.fri import CLIENT_PORT, SEQUENCE_MODULUS, OverlayKind, SessionState
from hil.values.fri_messages import CommandData, CommandMessage
from hil.values.link import Address
from hil.values.robot import JOINT_COUNT, Seven
from transport.fri import FriCodec
from transport.udp import parse_address

MIRROR_RAD: Final = 1e-4
"""How near to the Cabinet's interpolator the set point must be; a tenth of what it allows (fri-wire page, *ours*)."""
_NS_PER_MS: Final = 1_000_000
_MOST_TRANSITIONS: Final = 64
_STEPS_BACK: Final = 1000
"""A message that is further back than that is no late one: the Cabinet counts anew."""
_FOREIGN_ENOUGH: Final = 10
"""So many unreadable messages, and none that can be read, are a wrong configuration."""
_COUNTED: Final = (
    "messages", "lost", "duplicate", "old", "strangers", "malformed", "other_period", "restarts", "mirrored"
)  # fmt: skip
_STILL: Seven = (0.0,) * JOINT_COUNT  # type: ignore[assignment]
_CYCLES_MS: Final = (1, 2, 4, 5)
"""Control cycles that a station may have."""
_ACTIVE: Final = SessionState.COMMANDING_ACTIVE
_WAIT: Final = SessionState.COMMANDING_WAIT


class CabinetBackend:
    """A :class:`hil.values.arm.PeerBackend`; the controller hands it what came, and sends what it has to say."""

    def __init__(self, options: CabinetOptions, *, cycle_ns: int) -> None:
        self._options = options
        self._cycle_ns = cycle_ns
        self._codec = FriCodec(options.release)
        self._capabilities = capabilities(options.overlay)
        silence_ms = options.silence_ms or max(10, 3 * cycle_ns // _NS_PER_MS)
        believed = None if options.cabinet is None else parse_address(options.cabinet, default_port=0)
        self._link = PeerLink(
            bind=parse_address(options.bind, default_port=CLIENT_PORT),
            peer=believed,
            first_message_s=options.connect_s,
            silence_ns=silence_ms * _NS_PER_MS,
        )
        self._period_ns: int | None = None
        self._begin()

    def _begin(self) -> None:
        self._said: Said | None = None
        self._peer: Address | None = None
        self._arm: ArmState | None = None
        self._sample = 0
        self._heard_ns = 0
        self._set_point: JointCommand | None = None
        self._mirrored = False
        """Whether the newest set point lies on the interpolator of a session in COMMANDING."""
        self._taking = False
        """Whether set points reach the arm: the Cabinet commands, and began to where the set point was."""
        self._other_period = ""
        """What is to be said of messages with a send period that is not the cycle."""
        self._silent = False
        self._failure = ""
        self._condition = RobotSideCondition(takes_commands=False, reason="the Cabinet has sent nothing yet")
        self._until_answer = 1
        self._answer_due = False
        self._answers = 0
        self._outgoing: list[tuple[bytes, Address]] = []
        self._malformed: MalformedDatagram | None = None
        self._counts = dict.fromkeys(_COUNTED, 0)
        self._transitions: deque[tuple[int, str]] = deque(maxlen=_MOST_TRANSITIONS)

    @property
    def capabilities(self) -> Capabilities:
        """Positions, and what the overlay adds; no torques, no drives, no mode of its own."""
        return self._capabilities

    @property
    def link(self) -> PeerLink:
        """Where the Cabinet is met."""
        return self._link

    def open(self, *, period_ns: int) -> None:
        """Begin a session with nothing known of the Cabinet; raise :class:`ConfigurationError` for the period."""
        if self._period_ns is not None:
            return
        shortest_ns, longest_ns = self._capabilities.shortest_period_ns, self._capabilities.longest_period_ns
        if period_ns % shortest_ns or not shortest_ns <= period_ns <= longest_ns:
            raise ConfigurationError(
                f"a control cycle of {period_ns / 1e6:g} ms is no multiple of this backend's {shortest_ns / 1e6:g} ms "
                f"up to {longest_ns / 1e6:g} ms"
            )
        self._begin()
        self._cycle_ns = self._period_ns = period_ns

    def close(self) -> None:
        """Answer no more."""
        self._period_ns = None
        self._outgoing = []

    def receive(self, datagram: bytes, sender: Address, *, now_ns: int) -> bool:
        """Take a datagram; return whether it is a new message of the Cabinet."""
        if self._period_ns is None:
            return False
        if not self._believes(sender):
            self._counts["strangers"] += 1
            return False
        try:
            said = read_message(self._codec.decode_monitoring(datagram), self._options.release)
        except MalformedDatagram as error:
            self._counts["malformed"] += 1
            self._malformed = error
            return False
        if said.send_period_ms * _NS_PER_MS != self._cycle_ns:
            self._counts["other_period"] += 1
            self._other_period = self._words_of_period(said, sender)
            return False
        periods = self._periods_since_last(said.counter)
        if periods == 0:
            return False
        self._peer = sender
        self._heard_ns = now_ns
        self._silent = False
        self._take(said, periods, now_ns)
        return True

    def advance(self, *, now_ns: int) -> None:
        """Notice silence."""
        silent_ns = now_ns - self._heard_ns
        if self._said is None or self._silent or silent_ns <= self._link.silence_ns:
            return
        self._silent = True
        other = f"; {self._other_period}" if self._other_period else ""
        self._fail(
            f"the Cabinet at {self._peer} is lost: no message for {silent_ns / 1e6:.1f} ms, "
            f"{self._link.silence_ns / 1e6:g} ms are allowed; it was in {self._said.state.name}{other}"
        )
        self._transitions.append((now_ns, "silent"))
        self._settle()

    def read(self) -> ArmState:
        """Return what the newest message measured."""
        self._require_open("read")
        if self._arm is None:
            raise BackendError(self.not_ready())
        return self._arm

    def write(self, command: JointCommand) -> None:
        """Take the set point of this cycle; raise :class:`BackendError` for a torque of the motors."""
        self._require_open("write")
        if command.torque_nm is not None:
            raise BackendError("CabinetBackend takes no torque commands: the control laws are the Cabinet's own")
        if command.overlay is not None and not self._capabilities.passes_overlays:
            raise BackendError(f"CabinetBackend passes no torques and no wrenches: overlay = {self._options.overlay}")
        if not math.isfinite(sum(command.position_rad)):
            raise BackendError("CabinetBackend was given a set point that is not finite")
        self._set_point = command
        said = self._said
        if said is not None and said.state >= _WAIT and not self._taking:
            before, self._mirrored = self._mirrored, self._lies_on_interpolator(said)
            if not (before and self._mirrored):
                self._settle()

    def step(self) -> None:
        """Have the answer to the newest message ready."""
        self._require_open("step")
        if not self._answer_due or self._said is None or self._peer is None:
            return
        self._answer_due = False
        answer = CommandMessage(self._answers, self._said.counter, self._command(self._said))
        self._answers = (self._answers + 1) % SEQUENCE_MODULUS
        self._outgoing.append((self._codec.encode_command(answer), self._peer))

    def outgoing(self) -> list[tuple[bytes, Address]]:
        """Return and forget the answer."""
        answers, self._outgoing = self._outgoing, []
        return answers

    def switch_drives(self, *, on: bool) -> None:
        """Refuse: the drives are the Cabinet's."""
        self._require_open("switch the drives of")
        raise BackendError(f"CabinetBackend cannot switch the drives {'on' if on else 'off'}: they are the Cabinet's")

    def push(self, push: Push) -> None:
        """Refuse: this is no simulation."""
        self._require_open("push")
        raise BackendError(f"CabinetBackend cannot be pushed from here (link {push.link})")

    def contacts(self) -> tuple[Contact, ...]:
        """Return nothing: FRI tells forces, not where they act."""
        return ()

    def condition(self) -> RobotSideCondition:
        """Return what the Cabinet says of itself."""
        return self._condition

    def resume(self) -> None:
        """Let the Cabinet be commanded again after it was lost, if it is there."""
        if self._failure and not self._silent and self._said is not None and self._said.state > SessionState.IDLE:
            self._failure = ""
            self._mirrored = False
            self._settle()

    def not_ready(self) -> str:
        """Return why there is no measured state; raise :class:`BackendError` where there will never be one."""
        if self._said is not None:
            return ""
        if self._other_period:
            raise BackendError(self._other_period)
        where = f"UDP {self._link.bind}"
        if self._malformed is None:
            strangers = self._counts["strangers"]
            others = f"; {strangers} datagrams came from elsewhere" if strangers else ""
            return (
                f"no message of a Cabinet came to {where} within {self._link.first_message_s:g} s: does its robot "
                f"application run, with an FRI session to this machine and port?{others}"
            )
        looks_like = self._malformed.looks_like
        hint = f"; set release = {looks_like.value!r}" if looks_like is not None else ""
        text = f"what came to {where} is no message of release {self._options.release}: {self._malformed.detail}{hint}"
        if self._counts["malformed"] >= _FOREIGN_ENOUGH:
            raise BackendError(text)
        return text

    def decode(self, datagram: bytes, *, sent: bool) -> object:
        """Return the message in a datagram; raise :class:`MalformedDatagram`."""
        return self._codec.decode_command(datagram) if sent else self._codec.decode_monitoring(datagram)

    def report(self) -> dict[str, object]:
        """Return figures of the link."""
        said = self._said
        return {
            "release": self._options.release.value,
            "cabinet": None if self._peer is None else str(self._peer),
            "session": None if said is None else said.state.name,
            "quality": None if said is None else said.quality.name,
            "operation_mode": None if said is None else said.operation_mode.name,
            "safety_state": None if said is None else said.safety_state.name,
            "control_mode": None if said is None else said.control_mode.name,
            "takes_commands": self._condition.takes_commands,
            "reason": self._condition.reason,
            "failure": self._failure,
            "shadow": self._options.shadow,
            "answers": self._answers,
            **self._counts,
            "transitions": [{"at_s": round(at_ns / 1e9, 6), "to": to} for at_ns, to in self._transitions],
        }

    def _believes(self, sender: Address) -> bool:
        wanted = self._link.peer
        if wanted is not None and (sender.host != wanted.host or wanted.port not in {0, sender.port}):
            return False
        known = self._peer
        # A Cabinet that was lost may come back from another port of its own, and from no other machine.
        return known is None or sender == known or (self._silent and sender.host == known.host)

    def _periods_since_last(self, counter: int) -> int:
        """Return how many messages this one is after the last; 0 for one that is not new."""
        if self._said is None:
            return 1
        ahead = (counter - self._said.counter) % SEQUENCE_MODULUS
        if ahead < SEQUENCE_MODULUS // 2:
            if ahead == 0:
                self._counts["duplicate"] += 1
            return ahead
        if self._silent or SEQUENCE_MODULUS - ahead > _STEPS_BACK:
            self._counts["restarts"] += 1
            self._arm = None
            if self._taking:
                self._fail(f"the Cabinet at {self._peer} counts its messages anew while it was commanded")
            return 1
        self._counts["old"] += 1
        return 0

    def _take(self, said: Said, periods: int, now_ns: int) -> None:
        before, self._said = self._said, said
        self._counts["messages"] += 1
        self._counts["lost"] += min(periods, _STEPS_BACK) - 1
        self._sample += 1
        velocity = _STILL
        if self._arm is not None:
            per_s = 1e9 / (periods * self._cycle_ns)
            velocity = tuple(  # type: ignore[assignment]  # seven by seven
                (here - there) * per_s for here, there in zip(said.position_rad, self._arm.position_rad, strict=True)
            )
        self._arm = ArmState(
            said.position_rad,
            velocity,
            said.torque_nm,
            said.external_torque_nm,
            said.commanded_torque_nm,
            said.drive_states,
            self._sample,
        )
        if before is None or said.state is not before.state:
            self._transitions.append((now_ns, said.state.name))
            if said.state is not _ACTIVE:
                self._left_active(before, said)
        if said.state is _ACTIVE:
            self._taking = not self._watches(said) and (
                self._taking or (self._mirrored and self._lies_on_interpolator(said))
            )
        self._until_answer -= 1
        if self._until_answer <= 0:
            self._until_answer = said.receive_multiplier
            # The last message of a session is not answered (fri-wire page).
            self._answer_due = said.state is not SessionState.IDLE
        self._settle()

    def _left_active(self, before: Said | None, said: Said) -> None:
        set_point = self._set_point
        moved = self._taking and set_point is not None and (any(set_point.velocity_rad_s) or _adds(set_point))
        self._taking = self._mirrored = False
        if said.state is SessionState.IDLE and before is not None:
            self._fail(f"the Cabinet at {self._peer} closed the FRI session")
        elif moved:
            self._fail(f"the Cabinet left COMMANDING_ACTIVE under a moving arm: {why_left(said)}")

    def _fail(self, failure: str) -> None:
        """Command no more until :meth:`resume`; the first failure is the one that is told."""
        self._taking = self._mirrored = False
        self._failure = self._failure or failure

    def _watches(self, said: Said) -> bool:
        """Whether nothing is commanded now, whatever is written."""
        return bool(self._failure or self._options.shadow or other_command_mode(said, self._options.overlay))

    def _command(self, said: Said) -> CommandData | None:
        """Return what the answer carries beside its header."""
        if said.state < _WAIT:
            return None if said.commanded_position_rad is None else CommandData(said.commanded_position_rad)
        set_point = self._set_point
        if set_point is None or not (self._taking or (self._mirrored and not self._watches(said))):
            return None
        overlay = set_point.overlay
        if not self._taking:
            self._counts["mirrored"] += 1
            overlay = None
        match self._options.overlay:
            case OverlayKind.TORQUE:
                return CommandData(set_point.position_rad, torque=_STILL if overlay is None else overlay.torque_nm)
            case OverlayKind.WRENCH:
                return CommandData(set_point.position_rad, wrench=NO_WRENCH if overlay is None else overlay.wrench)
            case _:
                return CommandData(set_point.position_rad)

    def _lies_on_interpolator(self, said: Said) -> bool:
        if self._set_point is None or said.interpolator_rad is None:
            return False
        steps = zip(self._set_point.position_rad, said.interpolator_rad, strict=True)
        return all(abs(here - there) <= MIRROR_RAD for here, there in steps)

    def _settle(self) -> None:
        """Make the condition what is known now; the same object stays where nothing changed."""
        said = self._said
        if said is None:
            return
        reason = self._reason(said)
        held_rad = said.interpolator_rad if said.state is _WAIT else None
        now = RobotSideCondition(
            takes_commands=not reason,
            reason=reason,
            failure=self._failure,
            operation_mode=said.operation_mode,
            safety_state=said.safety_state,
            held_position_rad=held_rad,
        )
        if now != self._condition:
            self._condition = now

    def _reason(self, said: Said) -> str:
        if self._failure:
            return self._failure
        if self._options.shadow:
            return SHADOW
        if said.state < _WAIT:
            return before_commanding(said)
        if refusal := other_command_mode(said, self._options.overlay):
            return refusal
        if self._taking:
            return ""
        position_rad = None if self._set_point is None or self._mirrored else self._set_point.position_rad
        return waits_for_mirror(position_rad, said.interpolator_rad or said.position_rad, MIRROR_RAD)

    def _words_of_period(self, said: Said, sender: Address) -> str:
        sent_ms, ours_ms = said.send_period_ms, self._cycle_ns // _NS_PER_MS
        do = f"set cycle_ms = {sent_ms}" if sent_ms in _CYCLES_MS else "let it send every 1, 2, 4 or 5 ms"
        return f"the Cabinet at {sender} sends every {sent_ms} ms, this station's cycle is {ours_ms} ms: {do}"

    def _require_open(self, what: str) -> None:
        if self._period_ns is None:
            raise BackendError(f"cannot {what} a CabinetBackend that is not open")


def _adds(command: JointCommand) -> bool:
    """Whether a command adds a torque or a wrench."""
    overlay = command.overlay
    return overlay is not None and (any(overlay.torque_nm) or any(overlay.wrench))
