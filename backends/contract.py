"""The suite that every backend passes, to be subclassed in a test file::

    class TestMyBackend(BackendContract):
        elapsed_ns = staticmethod(time.perf_counter_ns)

        def make_rig(self) -> Rig:
            return InProcessRig(MyBackend(load_description("lbr-iiwa-7-r800")))

A robot side whose drives can be dropped from here also passes :class:`DrivesContract`, one with somebody behind it that
can be lost :class:`PeerContract`; :meth:`BackendContract.test_all_that_applies_is_tested` fails where one is left out.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ClassVar, Final

from backends.rig import STILL, Rig
from hil.values.arm import (
    MAX_CONTACTS,
    MIN_CONTACT_N,
    ArmState,
    Contact,
    JointCommand,
    OverlayCommand,
    PeerBackend,
    Push,
    seven,
)
from hil.values.control import NO_WRENCH
from hil.values.errors import BackendError, ConfigurationError
from hil.values.fri import DriveState, OverlayKind
from hil.values.robot import JOINT_COUNT, Seven

LONGEST_READ_NS: Final = 50_000_000
"""A read that takes longer waits for something; a busy machine must not fail it."""
SPEED_RAD_S: Final = 0.1


class BackendContract(ABC):
    """What holds for every robot side."""

    elapsed_ns: ClassVar[Callable[[], int]]
    """A clock in ns, such as ``time.perf_counter_ns``: backends have none."""
    period_ns = 1_000_000
    still_rad = 1e-4
    """How far an arm that is held may be off."""
    still_rad_s = 1e-2
    """How fast an arm that is held may be, as it is measured."""
    tracking_rad = 2e-3
    """How far an arm may be behind its set point at 0.1 rad/s on all axes."""
    far_rad = 0.3
    """How far away a command is that must not move the arm."""

    @abstractmethod
    def make_rig(self) -> Rig:
        """Return a new robot side that is not open."""

    @contextmanager
    def opened(self, *, ready: bool = True) -> Iterator[Rig]:
        """Open a rig, ready to be commanded unless told not to, and close it."""
        rig = self.make_rig()
        try:
            rig.open(period_ns=self.period_ns)
            if ready:
                rig.get_ready()
            yield rig
        finally:
            rig.close()

    def test_all_that_applies_is_tested(self) -> None:
        rig = self.make_rig()
        try:
            assert isinstance(self, DrivesContract) == rig.backend.capabilities.switches_drives
            assert isinstance(self, PeerContract) == rig.has_peer
        finally:
            rig.close()

    def test_capabilities_are_told_once_and_for_all(self) -> None:
        rig = self.make_rig()
        before = rig.backend.capabilities
        rig.close()
        with self.opened() as opened:
            assert opened.backend.capabilities == before
        assert before.joint_count == JOINT_COUNT
        assert 0 < before.shortest_period_ns <= before.longest_period_ns
        assert before.torque_sigma_nm is None or min(before.torque_sigma_nm) >= 0.0
        assert not (before.takes_torque and before.passes_overlays), "a law is run here or there, not twice"

    def test_whose_messages_and_whose_operator_there_are_is_told_truthfully(self) -> None:
        with self.opened() as rig:
            capabilities = rig.backend.capabilities
            assert capabilities.paces_the_cycle == isinstance(rig.backend, PeerBackend)
            assert capabilities.has_own_operator == (rig.backend.condition().operation_mode is not None)

    def test_a_measured_state_is_seven_finite_numbers_of_each(self) -> None:
        with self.opened() as rig:
            state = rig.backend.read()
            for measured in state[:5]:
                assert isinstance(measured, tuple), "what can be changed in place is no measured state"
                assert len(measured) == JOINT_COUNT
                assert all(isinstance(value, float) and math.isfinite(value) for value in measured)
            assert len(state.drive_states) == JOINT_COUNT
            assert all(isinstance(drive, DriveState) for drive in state.drive_states)

    def test_nothing_works_before_open_and_after_close(self) -> None:
        rig = self.make_rig()
        _nothing_works(rig)
        rig.open(period_ns=self.period_ns)
        rig.backend.read()
        for _ in range(2):
            rig.close()
            _nothing_works(rig)

    def test_open_is_idempotent(self) -> None:
        with self.opened() as rig:
            before = rig.backend.read()
            rig.backend.open(period_ns=self.period_ns)
            assert rig.backend.read() == before

    def test_open_moves_nothing(self) -> None:
        with self.opened(ready=False) as rig:
            before = rig.true_position_rad()
            for _ in range(200):
                state = rig.cycle()
                assert _distance(rig.true_position_rad(), before) <= self.still_rad
                assert _distance(state.position_rad, before) <= self.still_rad

    def test_getting_ready_moves_nothing(self) -> None:
        with self.opened(ready=False) as rig:
            before = rig.true_position_rad()
            rig.get_ready()
            assert _distance(rig.true_position_rad(), before) <= self.still_rad

    def test_an_arm_opened_again_stands_where_it_was(self) -> None:
        with self.opened() as rig:
            told, _ = self.ramp(rig, 100)
            for _ in range(100):
                rig.cycle(JointCommand(told, STILL))
            before = rig.true_position_rad()
            rig.backend.close()
            rig.open(period_ns=self.period_ns)
            opened = rig.true_position_rad()
            assert _distance(opened, before) <= self.still_rad
            for _ in range(100):
                rig.cycle()
            assert _distance(rig.true_position_rad(), opened) <= self.still_rad

    def test_a_period_that_cannot_be_kept_is_refused_in_words(self) -> None:
        rig = self.make_rig()
        shortest_ns, longest_ns = (
            rig.backend.capabilities.shortest_period_ns,
            rig.backend.capabilities.longest_period_ns,
        )
        for period_ns in (shortest_ns // 2, shortest_ns * 3 // 2, longest_ns + shortest_ns):
            try:
                rig.open(period_ns=period_ns)
            except ConfigurationError as error:
                assert f"{period_ns / 1e6:g} ms" in str(error)
            else:
                raise AssertionError(
                    f"{period_ns} ns was taken as a period; it takes {shortest_ns} ... {longest_ns} ns"
                )
        _nothing_works(rig)
        rig.close()

    def test_it_holds_still(self) -> None:
        with self.opened() as rig:
            start = rig.backend.read().position_rad
            for _ in range(math.ceil(1e9 / self.period_ns)):
                state = rig.cycle(JointCommand(start, STILL))
                assert _distance(state.position_rad, start) <= self.still_rad
            assert max(map(abs, state.velocity_rad_s)) <= self.still_rad_s

    def test_it_follows_a_ramp(self) -> None:
        with self.opened() as rig:
            told, state = self.ramp(rig, 300)
            assert _distance(state.position_rad, told) <= self.tracking_rad
            for speed in state.velocity_rad_s:
                assert abs(speed - SPEED_RAD_S) <= 0.2 * SPEED_RAD_S

    def test_what_it_returns_stays_as_it_was(self) -> None:
        with self.opened() as rig:
            before = rig.backend.read()
            kept, place = repr(before), before.position_rad
            told, _ = self.ramp(rig, 50)
            assert repr(before) == kept
            assert _distance(told, before.position_rad) > 0.0
            assert rig.backend.read().position_rad != place

    def test_a_measurement_is_known_by_its_sample(self) -> None:
        with self.opened() as rig:
            first = rig.backend.read().sample
            for number in range(1, 20):
                assert rig.cycle(JointCommand(rig.backend.read().position_rad, STILL)).sample == first + number
                assert rig.backend.read() == rig.backend.read()

    def test_reading_waits_for_nothing(self) -> None:
        with self.opened() as rig:
            assert self.longest_read_ns(rig) < LONGEST_READ_NS

    def test_a_torque_is_taken_or_refused_in_words(self) -> None:
        with self.opened() as rig:
            command = JointCommand(rig.backend.read().position_rad, STILL, STILL, STILL)
            if rig.backend.capabilities.takes_torque:
                told = seven([0.1 * number for number in range(JOINT_COUNT)])
                _takes(lambda: rig.backend.write(command._replace(torque_nm=told)), "a torque")
                state = rig.cycle()
                # What the drives are asked for has the sign of the sensors: minus that of the motors.
                assert _distance(seven([-value for value in state.commanded_torque_nm]), told) <= 1e-9
            else:
                _refuses(lambda: rig.backend.write(command), "torque")

    def test_an_overlay_is_taken_or_refused_in_words(self) -> None:
        with self.opened() as rig:
            passes = rig.backend.capabilities.passes_overlays
            assert passes <= {OverlayKind.TORQUE, OverlayKind.WRENCH}
            start = rig.backend.read().position_rad
            command = JointCommand(start, STILL, overlay=OverlayCommand(STILL, NO_WRENCH))
            if passes:
                _takes(lambda: rig.backend.write(command), "an overlay")
                rig.cycle()
            else:
                _refuses(lambda: rig.backend.write(command), "overlay")
            assert _distance(rig.cycle(JointCommand(start, STILL)).position_rad, start) <= self.still_rad

    def test_a_push_is_felt_or_refused_in_words(self) -> None:
        with self.opened() as rig:
            start = rig.backend.read().position_rad
            push = Push(JOINT_COUNT, (0.0, 0.0, 0.0), (0.0, 0.0, 20.0), 1.0)
            if not rig.backend.capabilities.can_be_pushed:
                _refuses(lambda: rig.backend.push(push), "push")
                return
            before = rig.cycle(JointCommand(start, STILL))
            _takes(lambda: rig.backend.push(push), "a push")
            for _ in range(math.ceil(0.2e9 / self.period_ns)):
                state = rig.cycle(JointCommand(start, STILL))
            # A moment about the vertical is one about A1, in every pose.
            felt_nm = abs(state.torque_nm[0] - before.torque_nm[0]) + abs(state.external_torque_nm[0])
            moved_rad = abs(state.position_rad[0] - before.position_rad[0])
            assert felt_nm > 5.0 or moved_rad > 10.0 * self.still_rad, "a push of 20 Nm was taken, and nothing felt it"

    def test_what_touches_it_is_told_the_strongest_first(self) -> None:
        with self.opened() as rig:
            start = rig.backend.read().position_rad
            for _ in range(5):
                rig.cycle(JointCommand(start, STILL))
                told = rig.backend.contacts()
                assert isinstance(told, tuple), "what can be changed in place is no answer"
                assert len(told) <= MAX_CONTACTS
                for contact in told:
                    assert isinstance(contact, Contact)
                    assert len(contact.point_m) == len(contact.force_n) == 3
                    assert all(map(math.isfinite, contact.point_m + contact.force_n))
                strengths_n = [math.hypot(*contact.force_n) for contact in told]
                assert strengths_n == sorted(strengths_n, reverse=True)
                assert min(strengths_n, default=MIN_CONTACT_N) >= MIN_CONTACT_N * (1.0 - 1e-9)

    def test_drives_that_cannot_be_switched_from_here_say_so(self) -> None:
        with self.opened() as rig:
            if not rig.backend.capabilities.switches_drives:
                for on in (False, True):
                    _refuses(lambda on=on: rig.backend.switch_drives(on=on), "drives")  # type: ignore[misc]

    def test_the_condition_is_the_same_object_while_nothing_changed(self) -> None:
        with self.opened() as rig:
            start = rig.backend.read().position_rad
            before = rig.backend.condition()
            assert before.takes_commands
            assert not before.reason
            assert not before.failure
            for _ in range(50):
                rig.cycle(JointCommand(start, STILL))
                assert rig.backend.condition() is before

    def test_to_resume_what_works_changes_nothing(self) -> None:
        with self.opened() as rig:
            start, before = rig.true_position_rad(), rig.backend.condition()
            rig.backend.resume()
            assert rig.backend.condition() == before
            for _ in range(20):
                rig.cycle()
                assert _distance(rig.true_position_rad(), start) <= self.still_rad

    def ramp(self, rig: Rig, cycles: int) -> tuple[Seven, ArmState]:
        """Move all axes at :data:`SPEED_RAD_S`; return the last command, and the state after it."""
        start = told = rig.backend.read().position_rad
        state = rig.backend.read()
        for number in range(1, cycles + 1):
            told = _shifted(start, SPEED_RAD_S * number * self.period_ns * 1e-9)
            state = rig.cycle(JointCommand(told, (SPEED_RAD_S,) * JOINT_COUNT))  # type: ignore[arg-type]
        return told, state

    def longest_read_ns(self, rig: Rig) -> int:
        """Return how long the longest of some reads without a cycle between them took."""
        clock = type(self).elapsed_ns
        longest_ns = 0
        for _ in range(20):
            before_ns = clock()
            rig.backend.read()
            longest_ns = max(longest_ns, clock() - before_ns)
        return longest_ns


class DrivesContract(BackendContract):
    """What holds where the drives can be dropped from here."""

    def test_drives_are_switched_only_while_it_is_open(self) -> None:
        rig = self.make_rig()
        _no_drives(rig)
        rig.open(period_ns=self.period_ns)
        rig.close()
        _no_drives(rig)

    def test_dropped_drives_stop_the_arm_and_hold_it(self) -> None:
        with self.opened() as rig:
            self.ramp(rig, 100)
            for _ in range(2):
                rig.backend.switch_drives(on=False)
            for _ in range(200):
                state = rig.cycle()
            stopped = rig.true_position_rad()
            assert set(state.drive_states) == {DriveState.OFF}
            for _ in range(200):
                rig.cycle(JointCommand(_shifted(stopped, self.far_rad), STILL))
            assert _distance(rig.true_position_rad(), stopped) <= self.still_rad

    def test_drives_that_come_back_hold_the_arm_without_a_jump(self) -> None:
        with self.opened() as rig:
            rig.backend.switch_drives(on=False)
            for _ in range(50):
                rig.cycle()
            rest = rig.true_position_rad()
            for _ in range(2):
                rig.backend.switch_drives(on=True)
            states = set()
            for _ in range(5_000):
                state = rig.cycle(JointCommand(rest, STILL))
                states.add(state.drive_states[0])
                assert _distance(rig.true_position_rad(), rest) <= self.still_rad
                if set(state.drive_states) == {DriveState.ACTIVE}:
                    break
            assert set(state.drive_states) == {DriveState.ACTIVE}, "the drives never came back"
            assert states <= {DriveState.TRANSITIONING, DriveState.ACTIVE, DriveState.OFF}
            told, state = self.ramp(rig, 200)
            assert _distance(state.position_rad, told) <= self.tracking_rad


class PeerContract(BackendContract):
    """What holds where there is somebody behind the backend who can be lost."""

    silent_cycles = 100
    """So many periods of silence are noticed for certain."""

    def test_a_lost_peer_is_named_and_nothing_waits_for_it(self) -> None:
        with self.opened() as rig:
            start = rig.backend.read()
            rig.lose_peer()
            for _ in range(self.silent_cycles):
                rig.cycle(JointCommand(start.position_rad, STILL))
            condition = rig.backend.condition()
            assert condition.failure
            assert not condition.takes_commands
            assert self.longest_read_ns(rig) < LONGEST_READ_NS
            for _ in range(20):
                rig.cycle(JointCommand(start.position_rad, STILL))
                assert rig.backend.condition() is condition

    def test_what_a_lost_peer_measured_last_is_no_new_measurement(self) -> None:
        with self.opened() as rig:
            rig.lose_peer()
            rig.cycle()
            last = rig.backend.read()
            for _ in range(20):
                state = rig.cycle(JointCommand(last.position_rad, STILL))
                assert state.sample == last.sample
                assert state.position_rad == last.position_rad

    def test_it_moves_again_only_when_it_is_told_to(self) -> None:
        with self.opened() as rig:
            rig.lose_peer()
            for _ in range(self.silent_cycles):
                rig.cycle()
            rig.restore_peer()
            before = rig.true_position_rad()
            for _ in range(500):
                rig.cycle(JointCommand(_shifted(before, self.far_rad), STILL))
                assert _distance(rig.true_position_rad(), before) <= self.still_rad
            assert rig.backend.condition().failure
            rig.backend.resume()
            rig.get_ready()
            assert _distance(rig.true_position_rad(), before) <= self.still_rad
            told, state = self.ramp(rig, 200)
            assert _distance(state.position_rad, told) <= self.tracking_rad

    def test_a_lost_peer_does_not_recover_by_being_told_to(self) -> None:
        with self.opened() as rig:
            rig.lose_peer()
            for _ in range(self.silent_cycles):
                rig.cycle()
            rig.backend.resume()
            rig.cycle()
            assert rig.backend.condition().failure
            assert not rig.backend.condition().takes_commands


def _nothing_works(rig: Rig) -> None:
    backend = rig.backend
    for call in (backend.read, backend.step, lambda: backend.write(JointCommand(STILL, STILL))):
        _refuses(call, "not open")


def _no_drives(rig: Rig) -> None:
    for on in (True, False):
        _refuses(lambda on=on: rig.backend.switch_drives(on=on), "not open")  # type: ignore[misc]


def _refuses(call: Callable[[], object], word: str) -> None:
    try:
        call()
    except BackendError as error:
        assert word in str(error), error
    else:
        raise AssertionError(f"it was taken, though there is nothing ({word})")


def _takes(call: Callable[[], object], what: str) -> None:
    try:
        call()
    except BackendError as error:
        raise AssertionError(f"{what} was refused, though the capabilities promise it: {error}") from error


def _shifted(position: Seven, by_rad: float) -> Seven:
    return seven([value + by_rad for value in position])


def _distance(one: Seven, other: Seven) -> float:
    return max(abs(here - there) for here, there in zip(one, other, strict=True))
