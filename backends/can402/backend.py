"""The backend: cyclic synchronous position over seven drives, one SYNC a cycle.

Each cycle sends every drive its control word and target position, then the SYNC at which they count and at which the
drives sample what they answer; the answers are read at the next cycle, without waiting. No thread, no clock: silence
is counted in SYNCs. Anything that goes wrong with one drive stops all of them with a quick stop, and stays a failure
until somebody acknowledges it. Not known here: what pushes the arm, and torques that were asked for; both are zeros.
"""

import contextlib
from typing import TYPE_CHECKING, Final

from backends.can402 import objects
from backends.can402.bus_load import BusLoad, check_bus_load
from backends.can402.capabilities import capabilities
from backends.can402.drive import Drive
from backends.can402.nodes import Nodes
from backends.can402.options import Can402Options
from backends.can402.scaling import AxisScale
from backends.can402.state_machine import DRIVE_STATES, PowerState
from backends.can402.wire import MOST_FRAMES_AT_ONCE, BusFailed, Frame, Wire, open_wire
from hil.values.arm import ArmState, Capabilities, Contact, JointCommand, Push, RobotSideCondition, seven
from hil.values.errors import BackendError, ConfigurationError
from hil.values.fri import DriveState
from hil.values.robot import JOINT_COUNT, JOINT_NAMES, Seven

if TYPE_CHECKING:
    from backends.can402.simulated import SimulatedDrives

_NONE: Final[Seven] = (0.0,) * JOINT_COUNT  # type: ignore[assignment]
_OPERATIONAL: Final = b"\x05"
_FOREIGN: Final = "the bus carries process data of node {node}, which is none of this station's ({nodes})"
_ALL_WELL: Final = RobotSideCondition()


class Can402Backend:
    """A :class:`hil.values.arm.Backend`. ``start_rad`` is where simulated drives begin."""

    def __init__(self, options: Can402Options, *, start_rad: Seven, wire: Wire | None = None) -> None:
        self._options = options
        self._start_rad = start_rad
        self._given_wire = wire
        self._capabilities = capabilities(simulated=options.simulated)
        names = [f"node {node} ({axis})" for node, axis in zip(options.nodes, JOINT_NAMES, strict=True)]
        self._drives = [
            Drive(name, AxisScale(axis), lost_after=options.lost_after, heartbeat_ms=options.heartbeat_ms)
            for name, axis in zip(names, options.axis, strict=True)
        ]
        self._answers: dict[int, tuple[Drive, int]] = {}
        self._others: dict[int, Drive] = {}
        for node, drive in zip(options.nodes, self._drives, strict=True):
            for part, identifier in enumerate(objects.ANSWERS):
                self._answers[identifier + node] = drive, part
            self._others[objects.SYNC_COB + node] = self._others[objects.HEARTBEAT_COB + node] = drive
        self.simulated: SimulatedDrives | None = None
        """The drives in this process, if they are; to be made to fail."""
        self.load: BusLoad | None = None
        self._wire: Wire | None = None
        self._nodes: Nodes | None = None
        self._period_ns: int | None = None
        self._measured: ArmState | None = None
        self._sample = 0
        self._wanted_on = True
        self._target: list[int] = [0] * JOINT_COUNT
        self._failure = ""
        self._enabling_cycles = 0
        self._heartbeat_in = self._guard_in = 0
        self._synchronised = False
        self._condition = _ALL_WELL

    @property
    def capabilities(self) -> Capabilities:
        """Positions and drives."""
        return self._capabilities

    def open(self, *, period_ns: int) -> None:
        """Set up the drives, which moves nothing; they are enabled in the cycles that follow.

        Raises :class:`ConfigurationError` for a cycle the bus does not hold, :class:`BackendError` for bus or drives.
        """
        if self._period_ns is not None:
            return
        if period_ns % 1_000_000 or not 0 < period_ns <= self._capabilities.longest_period_ns:
            raise ConfigurationError(
                f"a control cycle of {period_ns / 1e6:g} ms is no multiple of this backend's 1 ms up to "
                f"{self._capabilities.longest_period_ns / 1e6:g} ms"
            )
        self._check_reach()
        self.load = check_bus_load(bitrate=self._options.bitrate, period_ns=period_ns)
        self._wire = self._open_wire(period_ns)
        try:
            self._nodes = Nodes(self._options, self._wire, period_ns=period_ns)
            for place, drive in enumerate(self._drives):
                drive.began(*self._nodes.set_up(place))
            for place in range(JOINT_COUNT):
                self._nodes.start(place)
        except BaseException:
            self._leave()
            self._wire.close()
            self._wire = None
            raise
        self._period_ns = period_ns
        self._failure, self._wanted_on, self._synchronised = "", True, False
        self._enabling_cycles = 0
        self._target = [drive.counts for drive in self._drives]
        self._sample += 1
        self._measured = self._state()
        self._settle()

    def read(self) -> ArmState:
        """Return what the drives answered to the last SYNC that all of them answered."""
        self._require_open("read")
        if self._synchronised:
            self._synchronised = False
            self._take_answers()
        if self._measured is None:
            raise BackendError("Can402Backend has measured nothing yet")
        return self._measured

    def write(self, command: JointCommand) -> None:
        """Take the set point of this cycle; raise :class:`BackendError` for a torque or an overlay."""
        self._require_open("write")
        if command.torque_nm is not None:
            raise BackendError("Can402Backend takes no torque commands: the drives are in cyclic synchronous position")
        if command.overlay is not None:
            raise BackendError("Can402Backend passes no overlays on: the drives are in cyclic synchronous position")
        if self._condition.takes_commands:
            self._target = [
                drive.scale.counts(position) for drive, position in zip(self._drives, command.position_rad, strict=True)
            ]

    def step(self) -> None:
        """Send the commands and the SYNC."""
        period_ns = self._require_open("step")
        if self._synchronised:
            self._take_answers()
        try:
            self._send_cycle(period_ns)
        except BusFailed as error:
            self._fail(str(error))
        self._synchronised = True

    def switch_drives(self, *, on: bool) -> None:
        """Enable the drives where they stand, or stop them and take their power."""
        self._require_open("switch the drives of")
        if on == self._wanted_on:
            return
        self._wanted_on = on
        self._enabling_cycles = 0
        self._settle()

    def contacts(self) -> tuple[Contact, ...]:
        """Return nothing: drives feel torques, not where they come from."""
        return ()

    def condition(self) -> RobotSideCondition:
        """Return what is known of the drives."""
        return self._condition

    def resume(self) -> None:
        """Acknowledge a failure: faults are reset, drives that booted anew are set up again, all are enabled again.

        A drive that says nothing is not waited for. To set up one that booted anew takes some tens of milliseconds.
        """
        nodes, wire = self._nodes, self._wire
        if not self._failure or nodes is None or wire is None:
            return
        if silent := [drive for drive in self._drives if drive.silent and not (drive.left or drive.booted)]:
            self._fail(silent[0].failure(), again=True)
            return
        try:
            wire.check()
            for place, drive in enumerate(self._drives):
                if drive.left or drive.silent:
                    drive.began(*nodes.set_up(place))
                    nodes.start(place)
                drive.reset_fault()
        except (BackendError, ConfigurationError) as error:
            self._fail(str(error), again=True)
            return
        self._failure = ""
        self._enabling_cycles = 0
        self._settle()

    def push(self, push: Push) -> None:
        """Refuse: these are drives."""
        self._require_open("push")
        raise BackendError(f"Can402Backend cannot be pushed from here (link {push.link})")

    def close(self) -> None:
        """Stop the drives, take their power, let them leave the exchange, and release the bus."""
        if self._period_ns is None:
            return
        wire = self._wire
        try:
            self._leave()
        finally:
            self._period_ns = None
            if wire is not None:
                wire.close()
            self._wire = self._nodes = None

    def _leave(self) -> None:
        wire, nodes = self._wire, self._nodes
        if wire is None or nodes is None:
            return
        # A bus that failed cannot be told; the drives notice that our heartbeat is missing.
        with contextlib.suppress(BusFailed):
            for identifier, node, drive in self._commanded():
                wire.send(Frame(identifier + node, drive.command(drive.counts, enabled=False)))
            wire.send(Frame(objects.SYNC_COB, b""))
            nodes.release()

    def _open_wire(self, period_ns: int) -> Wire:
        if self._given_wire is not None:
            return self._given_wire
        if not self._options.simulated:
            return open_wire(self._options)
        from backends.can402.simulated import SimulatedDrives

        if self.simulated is None:
            starts = [drive.scale.counts(start) for drive, start in zip(self._drives, self._start_rad, strict=True)]
            self.simulated = SimulatedDrives(self._options.nodes, starts)
        return self.simulated.wire(period_ns=period_ns)

    def _check_reach(self) -> None:
        for drive in self._drives:
            if not drive.scale.reaches(6.3) or not drive.scale.reaches(-6.3):
                raise ConfigurationError(
                    f"{drive.name}: {abs(drive.scale.counts_per_rad):.0f} counts per rad are more than 32 bits hold "
                    f"for one turn of the axis: counts_per_turn x gear is too much"
                )

    def _commanded(self) -> list[tuple[int, int, Drive]]:
        identifier = next(iter(objects.COMMANDS))
        return [(identifier, node, drive) for node, drive in zip(self._options.nodes, self._drives, strict=True)]

    def _send_cycle(self, period_ns: int) -> None:
        wire = self._wire
        if wire is None:
            return
        enabled = self._wanted_on and not self._failure
        holds = self._condition.takes_commands
        for (identifier, node, drive), target in zip(self._commanded(), self._target, strict=True):
            # A drive that is on its way is told to be where it is: it must not jump when it is enabled.
            counts = target if holds else drive.counts
            wire.send(Frame(identifier + node, drive.command(counts, enabled=enabled)))
            drive.synchronised()
        wire.send(Frame(objects.SYNC_COB, b""))
        self._supervise(wire, period_ns)

    def _supervise(self, wire: Wire, period_ns: int) -> None:
        self._heartbeat_in -= period_ns
        if self._heartbeat_in <= 0:
            self._heartbeat_in = self._options.heartbeat_ms * 1_000_000
            wire.send(Frame(objects.HEARTBEAT_COB + objects.OUR_NODE, _OPERATIONAL))
            wire.check()
        if self._nodes is not None and self._nodes.guarded:
            self._guard_in -= period_ns
            if self._guard_in <= 0:
                self._guard_in = self._options.heartbeat_ms * 1_000_000
                for place in self._nodes.guarded:
                    wire.send(Frame(objects.HEARTBEAT_COB + self._options.nodes[place], b"", remote=True))

    def _take_answers(self) -> None:
        """Read what has come since the last SYNC, and judge it."""
        problem = ""
        try:
            for _ in range(MOST_FRAMES_AT_ONCE):
                frame = None if self._wire is None else self._wire.receive()
                if frame is None:
                    break
                problem = self._take(frame) or problem
        except BusFailed as error:
            problem = str(error)
        for drive in self._drives:
            drive.count_silence(self._period_ns or 0)
        problem = problem or next(filter(None, (drive.failure() for drive in self._drives)), "")
        if problem:
            self._fail(problem)
        # A drive that failed still measures; one that is silent leaves the arm where it was seen last.
        if all(drive.answered for drive in self._drives):
            self._sample += 1
            self._measured = self._state()
        elif self._measured is not None and self._measured.drive_states != (states := self._drive_states()):
            self._measured = self._measured._replace(drive_states=states)
        self._progress()

    def _take(self, frame: Frame) -> str:
        known = self._answers.get(frame.identifier)
        if known is not None:
            drive, part = known
            return drive.answer(part, frame.data)
        other = self._others.get(frame.identifier)
        if other is not None and not frame.remote:
            if frame.identifier < objects.HEARTBEAT_COB:
                return other.emergency(frame.data)
            other.heartbeat(frame.data)
            return ""
        if frame.identifier & ~0x7F in objects.ANSWERS:
            return _FOREIGN.format(node=frame.identifier & 0x7F, nodes=", ".join(map(str, self._options.nodes)))
        return ""

    def _progress(self) -> None:
        """Count how long the drives take to be enabled, and make the condition what is known now."""
        if not self._failure and self._wanted_on and not self._condition.takes_commands:
            self._enabling_cycles += 1
            allowed = self._options.enable_timeout_s * 1e9 / (self._period_ns or 1)
            if self._enabling_cycles > allowed:
                late = next(drive for drive in self._drives if drive.state is not PowerState.ENABLED)
                self._fail(f"{late.name} is not enabled after {self._options.enable_timeout_s:g} s: it is {late.state}")
        elif self._condition.takes_commands:
            gone = next((drive for drive in self._drives if drive.state is not PowerState.ENABLED), None)
            if gone is not None:
                self._fail(f"{gone.name} is {gone.state}, though nobody switched it off from here")
        self._settle()

    def _fail(self, reason: str, *, again: bool = False) -> None:
        # The first failure is the cause, what follows its consequence.
        if not self._failure or again:
            self._failure = reason
        self._settle()

    def _settle(self) -> None:
        before = self._condition
        reason = self._failure or self._waits_because()
        if not reason:
            now = _ALL_WELL
            if not before.takes_commands:
                self._target = [drive.counts for drive in self._drives]
        else:
            now = RobotSideCondition(takes_commands=False, reason=reason, failure=self._failure)
        if now != before:
            self._condition = now

    def _waits_because(self) -> str:
        if not self._wanted_on:
            return "the drives are switched off"
        waiting = next((drive for drive in self._drives if drive.state is not PowerState.ENABLED), None)
        return "" if waiting is None else f"the drives are being enabled: {waiting.name} is {waiting.state}"

    def _state(self) -> ArmState:
        drives = self._drives
        return ArmState(
            seven([drive.scale.position_rad(drive.counts) for drive in drives]),
            seven([drive.scale.velocity_rad_s(drive.counts_per_s) for drive in drives]),
            # The sign of the facts (4.4): minus what the motor gives.
            seven([-drive.scale.motor_torque_nm(drive.torque_permille) for drive in drives]),
            _NONE,
            _NONE,
            self._drive_states(),
            self._sample,
        )

    def _drive_states(self) -> tuple[DriveState, ...]:
        """Return the states, as the same object as long as they are the same: whoever reads them looks at that."""
        states = tuple(DriveState.OFF if drive.silent else DRIVE_STATES[drive.state] for drive in self._drives)
        if self._measured is not None and self._measured.drive_states == states:
            return self._measured.drive_states
        return states

    def _require_open(self, what: str) -> int:
        if self._period_ns is None:
            raise BackendError(f"cannot {what} a Can402Backend that is not open")
        return self._period_ns
