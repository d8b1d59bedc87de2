"""The suite of all backends finds what is wrong: each of these is caught by the test that is about it."""

import dataclasses
import itertools
import math
from collections.abc import Callable

import pytest

from backends.contract import DrivesContract, PeerContract
from backends.ideal import IdealBackend
from backends.rig import InProcessRig, Rig
from backends.robots import load_description
from hil.clock import VirtualClock, elapsed_ns
from hil.values.arm import (
    AT_WORK,
    MAX_CONTACTS,
    ArmState,
    Capabilities,
    Contact,
    JointCommand,
    Push,
    RobotSideCondition,
    seven,
)
from hil.values.robot import RobotDescription
from tools.conformance.simulated_drives import SimulatedDrivesRig

DESCRIPTION = load_description("lbr-iiwa-7-r800")


class MovesOnOpen(IdealBackend):
    def _open(self, period_ns: int) -> None:
        super()._open(period_ns)
        self._next = JointCommand(seven([value + 0.01 for value in self._position]), (0.0,) * 7)


class OpensTwice(IdealBackend):
    def open(self, *, period_ns: int) -> None:
        self._period_ns = None
        super().open(period_ns=period_ns)


class WorksWhenClosed(IdealBackend):
    def _require_open(self, what: str) -> int:
        return self._period_ns or 1_000_000


class TakesEveryPeriod(IdealBackend):
    def open(self, *, period_ns: int) -> None:
        super().open(period_ns=max(1, period_ns // 1_000_000) * 1_000_000)


class TakesTorquesItHasNot(IdealBackend):
    def write(self, command: JointCommand) -> None:
        super().write(command._replace(torque_nm=None))


class PromisesPushes(IdealBackend):
    @property
    def capabilities(self) -> Capabilities:
        return dataclasses.replace(super().capabilities, can_be_pushed=True)


class ChangesItsMind(IdealBackend):
    @property
    def capabilities(self) -> Capabilities:
        return dataclasses.replace(super().capabilities, takes_torque=self._period_ns is not None)


class PromisesTorques(IdealBackend):
    @property
    def capabilities(self) -> Capabilities:
        return dataclasses.replace(super().capabilities, takes_torque=True)


class SaysItPacesTheCycle(IdealBackend):
    @property
    def capabilities(self) -> Capabilities:
        return dataclasses.replace(super().capabilities, paces_the_cycle=True)


class SaysItHasAnOperator(IdealBackend):
    @property
    def capabilities(self) -> Capabilities:
        return dataclasses.replace(super().capabilities, has_own_operator=True)


class TakesLongPeriods(IdealBackend):
    def open(self, *, period_ns: int) -> None:
        super().open(period_ns=period_ns if period_ns % 1_000_000 else min(period_ns, 5_000_000))


class DropsOverlays(IdealBackend):
    def write(self, command: JointCommand) -> None:
        super().write(command._replace(overlay=None))


class TurnsWhenResumed(IdealBackend):
    def resume(self) -> None:
        self._position = seven([value + 0.01 for value in self._position])
        self._next = JointCommand(self._position, (0.0,) * 7)


class ComesBackElsewhere(IdealBackend):
    def _close(self) -> None:
        self._position = DESCRIPTION.initial_position_rad


class SwallowsPushes(PromisesPushes):
    def push(self, push: Push) -> None:
        push.check()


class LendsItsMemory(IdealBackend):
    def __init__(self, description: RobotDescription) -> None:
        super().__init__(description)
        self._memory = list(description.initial_position_rad)

    def _read(self) -> ArmState:
        self._memory[:] = self._position
        return super()._read()._replace(position_rad=self._memory)  # type: ignore[arg-type]


class MeasuresNothing(IdealBackend):
    def _read(self) -> ArmState:
        return super()._read()._replace(velocity_rad_s=(math.nan,) * 7)


class SampleStands(IdealBackend):
    def _read(self) -> ArmState:
        return super()._read()._replace(sample=1)


class TouchesFaintly(IdealBackend):
    def _contacts(self) -> tuple[Contact, ...]:
        return (Contact((0.0, 0.0, 0.0), (0.0, 0.1, 0.0)),)


class TouchesEverything(IdealBackend):
    def _contacts(self) -> tuple[Contact, ...]:
        return (Contact((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),) * (MAX_CONTACTS + 1)


class TellsTheWeakestFirst(IdealBackend):
    def _contacts(self) -> tuple[Contact, ...]:
        return tuple(Contact((0.0, 0.0, 0.0), (0.0, force_n, 0.0)) for force_n in (1.0, 2.0))


class NewConditions(IdealBackend):
    def condition(self) -> RobotSideCondition:
        return AT_WORK._replace()


class Lags(IdealBackend):
    def _write(self, command: JointCommand) -> None:
        half = [
            0.5 * (here + there) for here, there in zip(self._position, DESCRIPTION.initial_position_rad, strict=True)
        ]
        super()._write(command._replace(position_rad=seven(half)))


class Trembles(IdealBackend):
    sign = itertools.cycle((1.0, -1.0))

    def _step(self) -> None:
        super()._step()
        self._position = seven([value + next(self.sign) * 1e-3 for value in self._position])


class FallsWithoutDrives(IdealBackend):
    def _step(self) -> None:
        super()._step()
        if self._braked:
            self._position = seven([value + 1e-3 for value in self._position])


class JumpsWhenDrivesComeBack(IdealBackend):
    def _release_brakes(self) -> None:
        super()._release_brakes()
        if self._period_ns is not None:
            self._position = seven([value + 0.01 for value in self._position])


def suite(make: Callable[[RobotDescription], IdealBackend]) -> DrivesContract:
    class Suite(DrivesContract):
        def make_rig(self) -> Rig:
            return InProcessRig(make(DESCRIPTION))

    Suite.elapsed_ns = staticmethod(elapsed_ns)
    return Suite()


@pytest.mark.parametrize(
    ("broken", "test"),
    [
        (MovesOnOpen, "open_moves_nothing"),
        (OpensTwice, "open_is_idempotent"),
        (WorksWhenClosed, "drives_are_switched_only_while_it_is_open"),
        (WorksWhenClosed, "nothing_works_before_open_and_after_close"),
        (TakesEveryPeriod, "a_period_that_cannot_be_kept_is_refused_in_words"),
        (TakesTorquesItHasNot, "a_torque_is_taken_or_refused_in_words"),
        (SwallowsPushes, "a_push_is_felt_or_refused_in_words"),
        (PromisesPushes, "a_push_is_felt_or_refused_in_words"),
        (PromisesTorques, "a_torque_is_taken_or_refused_in_words"),
        (DropsOverlays, "an_overlay_is_taken_or_refused_in_words"),
        (SaysItPacesTheCycle, "whose_messages_and_whose_operator_there_are_is_told_truthfully"),
        (SaysItHasAnOperator, "whose_messages_and_whose_operator_there_are_is_told_truthfully"),
        (TakesLongPeriods, "a_period_that_cannot_be_kept_is_refused_in_words"),
        (TurnsWhenResumed, "to_resume_what_works_changes_nothing"),
        (ComesBackElsewhere, "an_arm_opened_again_stands_where_it_was"),
        (LendsItsMemory, "what_it_returns_stays_as_it_was"),
        (LendsItsMemory, "a_measured_state_is_seven_finite_numbers_of_each"),
        (MeasuresNothing, "a_measured_state_is_seven_finite_numbers_of_each"),
        (ChangesItsMind, "capabilities_are_told_once_and_for_all"),
        (SampleStands, "a_measurement_is_known_by_its_sample"),
        (TouchesFaintly, "what_touches_it_is_told_the_strongest_first"),
        (TouchesEverything, "what_touches_it_is_told_the_strongest_first"),
        (TellsTheWeakestFirst, "what_touches_it_is_told_the_strongest_first"),
        (NewConditions, "the_condition_is_the_same_object_while_nothing_changed"),
        (Lags, "it_follows_a_ramp"),
        (Trembles, "it_holds_still"),
        (FallsWithoutDrives, "dropped_drives_stop_the_arm_and_hold_it"),
        (JumpsWhenDrivesComeBack, "drives_that_come_back_hold_the_arm_without_a_jump"),
    ],
)
def test_a_broken_backend_is_caught(broken: type[IdealBackend], test: str) -> None:
    getattr(suite(IdealBackend), f"test_{test}")()
    # By an assertion of the suite: what the broken one raises by mistake would be no proof.
    with pytest.raises(AssertionError):
        getattr(suite(broken), f"test_{test}")()


def test_who_subclasses_the_suite_sees_the_values() -> None:
    # Of a module that is no test file, pytest shows them only where the plugin of the test kit asked for it.
    with pytest.raises(AssertionError, match=r"assert 0\.0\d+ <= 0\.002"):
        suite(Lags).test_it_follows_a_ramp()


def test_a_read_that_waits_is_caught() -> None:
    clock = VirtualClock()

    class Waits(IdealBackend):
        def read(self) -> ArmState:
            clock.advance(60_000_000)
            return super().read()

    waiting = suite(Waits)
    type(waiting).elapsed_ns = staticmethod(clock.now_ns)
    with pytest.raises(AssertionError):
        waiting.test_reading_waits_for_nothing()


def test_a_part_of_the_suite_that_is_left_out_is_missed() -> None:
    class Forgetful(DrivesContract):
        def make_rig(self) -> Rig:
            return SimulatedDrivesRig(DESCRIPTION)

    with pytest.raises(AssertionError):
        Forgetful().test_all_that_applies_is_tested()


def test_a_robot_side_that_resumes_by_itself_is_caught() -> None:
    class Eager(SimulatedDrivesRig):
        def cycle(self, command: JointCommand | None = None) -> ArmState:
            self.backend.resume()
            return super().cycle(command)

    class Suite(DrivesContract, PeerContract):
        period_ns = 4_000_000
        far_rad = 0.1

        def make_rig(self) -> Rig:
            return Eager(DESCRIPTION)

    Suite.elapsed_ns = staticmethod(elapsed_ns)
    with pytest.raises(AssertionError):
        Suite().test_it_moves_again_only_when_it_is_told_to()
