"""The core with a client of each release, in virtual time: the way up, the way down, and everything in between."""

import itertools

import numpy as np
import pytest

from backends.mujoco import MujocoBackend
from backends.robots import load_pinocchio, robot_names
from hil.core.events import (
    ArmResting,
    ClientRestarted,
    QualityChanged,
    ReleaseDoubted,
    StateChanged,
    TransitionRefused,
)
from hil.core.model import ArmModel
from hil.core.motion.executive import MotionExecutive
from hil.core.settings import FriSettings
from hil.values.errors import IllegalTransition
from hil.values.fri import TRAITS, OperationMode, OverlayKind, Quality, Release, SessionState
from hil.values.fri_messages import CommandData, CommandMessage, MonitoringMessage
from hil.values.motion import Fault
from tests.support.motion import proposed
from tests.support.virtual import MS, PEER, UNIX_EPOCH_NS, Bench, RecordingBackend

WAY_UP = [
    SessionState.MONITORING_WAIT,
    SessionState.MONITORING_READY,
    SessionState.COMMANDING_WAIT,
    SessionState.COMMANDING_ACTIVE,
]


@pytest.mark.parametrize("release", list(Release))
def test_client_of_each_release_moves_joint_4_of_the_mujoco_arm(release: Release) -> None:
    bench = Bench(release, backend=MujocoBackend)
    bench.run(2.1)
    report = bench.report()
    assert bench.client.states == WAY_UP
    start, measured = report["initial_position"], report["measured_position"]
    assert isinstance(start, list)
    assert isinstance(measured, list)
    assert measured[3] - start[3] == pytest.approx(bench.client.offset, abs=5e-4)
    assert bench.client.offset > 0.03
    for axis in (0, 1, 2, 4, 5, 6):
        assert measured[axis] == pytest.approx(start[axis], abs=1e-4)
    assert report["stops"] == []


@pytest.mark.parametrize("robot", robot_names())
def test_every_robot_moves(robot: str) -> None:
    bench = Bench(robot=robot, backend=MujocoBackend)
    bench.run(2.0)
    assert bench.state is SessionState.COMMANDING_ACTIVE
    assert bench.client.offset > 0.02


@pytest.mark.parametrize(("cycle_ms", "period_ms", "multiplier"), [(1, 5, 1), (2, 2, 3), (5, 10, 10), (4, 100, 1)])
def test_periods_and_multipliers(cycle_ms: int, period_ms: int, multiplier: int) -> None:
    fri = FriSettings(peer=PEER, send_period_ms=period_ms, receive_multiplier=multiplier)
    bench = Bench(cycle_ms=cycle_ms, fri=fri)
    bench.run_until(SessionState.COMMANDING_ACTIVE, at_most_s=6)
    bench.run(1.5)
    assert bench.state is SessionState.COMMANDING_ACTIVE
    assert bench.client.received == bench.controller.ticks * cycle_ms // period_ms + (
        1 if bench.controller.ticks * cycle_ms % period_ms else 0
    )
    assert bench.client.offset > 0.003


def test_set_points_are_spread_over_the_receive_period() -> None:
    bench = Bench(fri=FriSettings(peer=PEER, send_period_ms=5))
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(1.0)
    path = [command.position_rad[3] for command in bench.backend.commands[-500:]]  # type: ignore[attr-defined]
    steps = [there - here for here, there in itertools.pairwise(path)]
    assert max(steps) < 1.2 * (path[-1] - path[0]) / len(steps) + 1e-5
    assert all(step != 0 for step in steps)


def test_without_a_client_the_session_waits_and_says_why() -> None:
    bench = Bench()
    bench.client.answers = lambda _: False
    bench.run(3.0)
    assert bench.state is SessionState.MONITORING_WAIT
    refused = [event for event in bench.events if isinstance(event, TransitionRefused)]
    assert len(refused) == 1
    assert "no answer from 127.0.0.1:30200 yet" in str(refused[0])


def test_without_an_overlay_it_stays_ready_and_says_why() -> None:
    bench = Bench(fri=FriSettings(peer=PEER, overlay=OverlayKind.NONE))
    bench.run(3.0)
    assert bench.state is SessionState.MONITORING_READY
    refused = [str(event) for event in bench.events if isinstance(event, TransitionRefused)]
    assert any("runs no motion with an overlay" in text for text in refused)


def test_a_client_that_does_not_mirror_stays_in_commanding_wait_with_the_reason() -> None:
    bench = Bench()

    def off(command: CommandMessage, message: MonitoringMessage) -> CommandMessage:
        assert message.connection is not None
        if message.connection.session_state != SessionState.COMMANDING_WAIT:
            return command
        assert command.command is not None
        assert command.command.position is not None
        position = list(command.command.position)
        position[1] += 0.01
        return command._replace(command=command.command._replace(position=tuple(position)))

    bench.client.change = off
    bench.run(3.0)
    assert bench.state is SessionState.COMMANDING_WAIT
    refused = [str(event) for event in bench.events if isinstance(event, TransitionRefused)]
    assert any("A2 of the answers is 0.0100 rad off the interpolator position" in text for text in refused)
    assert bench.controller.report()["commanded_position"] == bench.report()["initial_position"]


def test_losing_the_client_brakes_the_arm_and_it_is_served_again() -> None:
    bench = Bench()
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(0.5)
    gone_at = bench.client.received
    bench.client.answers = lambda count: not gone_at <= count < gone_at + 700
    bench.run(0.2)
    assert bench.state < SessionState.COMMANDING_WAIT
    assert any("client lost" in reason and "watchdog" in reason for reason in bench.reasons())
    assert any(isinstance(event, ArmResting) for event in bench.events)
    resting = bench.report()["commanded_position"]
    bench.run(0.4)
    assert bench.report()["commanded_position"] == resting
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(0.3)
    assert bench.state is SessionState.COMMANDING_ACTIVE
    assert len(bench.controller.stops) == 1


def test_watchdog_acts_after_fifty_milliseconds_of_silence() -> None:
    bench = Bench()
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(0.3)
    gone_at = bench.client.received
    bench.client.answers = lambda count: count < gone_at
    bench.run(0.049)
    assert bench.state is SessionState.COMMANDING_ACTIVE
    bench.run(0.004)
    assert bench.state is not SessionState.COMMANDING_ACTIVE


def test_sporadic_loss_lowers_quality_and_ends_commanding_with_the_figure() -> None:
    bench = Bench()
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(0.6)
    bench.client.answers = lambda count: count % 10 != 0
    bench.run(1.0)
    assert any(
        "quality FAIR is not enough" in reason and "answers of the last second" in reason for reason in bench.reasons()
    )
    qualities = [event.new for event in bench.events if isinstance(event, QualityChanged)]
    assert Quality.FAIR in qualities


def test_a_client_that_restarts_while_commanding_stops_the_arm_and_comes_back() -> None:
    bench = Bench()
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(0.3)
    bench.client.sequence = 0
    bench.run(0.01)
    assert any("restarted" in reason for reason in bench.reasons())
    assert any(isinstance(event, ClientRestarted) for event in bench.events)
    bench.run_until(SessionState.COMMANDING_ACTIVE)


def test_close_brakes_closes_the_session_and_says_idle_last() -> None:
    bench = Bench()
    bench.keep_messages = True
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(0.5)
    bench.controller.close(now_ns=bench.now_ns)
    closed = [bench.controller.closed]
    bench.run(0.2)
    closed.append(bench.controller.closed)
    assert closed == [False, True]
    assert bench.state is SessionState.IDLE
    last = bench.monitoring[-1].connection
    assert last is not None
    assert last.session_state == SessionState.IDLE
    count = len(bench.monitoring)
    bench.run(0.1)
    assert len(bench.monitoring) == count
    assert [event.new for event in bench.events if isinstance(event, StateChanged)][-1] is SessionState.IDLE


def test_close_at_rest_is_immediate() -> None:
    bench = Bench()
    bench.run(0.1)
    bench.controller.close(now_ns=bench.now_ns)
    assert bench.controller.closed
    assert len(bench.controller.outgoing()) == 1


@pytest.mark.parametrize("release", list(Release))
def test_messages_hold_what_the_release_has(release: Release) -> None:
    traits = TRAITS[release]
    bench = Bench(release, backend=MujocoBackend, mode=OperationMode.T1)
    bench.keep_messages = True
    bench.run(1.2)
    for index, message in enumerate(bench.monitoring):
        assert message.sequence_counter == index
        assert message.monitor is not None
        assert message.robot is not None
        assert message.connection is not None
        assert (message.monitor.commanded_position is not None) == traits.commanded_position
        assert (message.monitor.measured_pose is not None) == traits.pose
        assert (message.monitor.external_force is not None) == traits.external_force
        assert (message.ipo is not None) == (message.connection.session_state >= SessionState.COMMANDING_WAIT)
        assert message.robot.operation_mode == OperationMode.T1
        assert message.monitor.at is not None
        assert message.monitor.at.seconds * 10**9 + message.monitor.at.nanoseconds == UNIX_EPOCH_NS + index * MS
        if message.monitor.measured_pose is not None:
            values = message.monitor.measured_pose.values
            assert sum(part * part for part in values[3:]) == pytest.approx(1.0)
            assert values[1] == pytest.approx(0.0, abs=0.1)
    assert bench.monitoring[-1].reflected_sequence_counter == bench.client.sequence - 2


def test_the_same_inputs_give_the_same_bytes() -> None:
    def run() -> list[bytes]:
        bench = Bench(Release.V2_7, backend=MujocoBackend)
        bench.run(1.5)
        return list(bench.client.heard)

    assert run() == run()


def test_t1_flange_speed_is_limited_before_the_backend_sees_it() -> None:
    bench = Bench(mode=OperationMode.T1)
    bench.client.amplitude_rad, bench.client.frequency_hz = 0.4, 1.0
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(1.0)
    assert any(reason.startswith("cmd T1 illegal speed limit detected") for reason in bench.reasons())
    speed = bench.report()["max_flange_speed_mm_s"]
    assert isinstance(speed, float)
    assert 200 < speed <= 250.0


@pytest.mark.parametrize("seed", range(25))
def test_in_t1_no_set_point_moves_the_flange_faster_even_while_braking(seed: int) -> None:
    random = np.random.default_rng(seed)
    bench = Bench(mode=OperationMode.T1)
    velocity = random.uniform(-1, 1, 7) * bench.description.limits.velocity_rad_s
    velocity *= random.uniform(0.3, 1.0)
    start = np.array(bench.description.initial_position_rad)
    offset = np.zeros(7)
    share = 0.0

    def rush(command: CommandMessage, message: MonitoringMessage) -> CommandMessage:
        nonlocal offset, share
        assert message.connection is not None
        if message.connection.session_state != SessionState.COMMANDING_ACTIVE:
            offset, share = np.zeros(7), 0.0
            return command
        share = min(1.0, share + 0.01)
        offset = offset + velocity * share * 1e-3
        return command._replace(command=CommandData(position=tuple((start + offset).tolist())))

    bench.client.change = rush
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(0.8)
    assert isinstance(bench.backend, RecordingBackend)
    model = ArmModel(load_pinocchio(bench.description.name))
    commands = bench.backend.commands
    speeds = [model.flange_speed_mm_s(command.position_rad, command.velocity_rad_s) for command in commands]
    assert max(speeds) <= 250.0 * (1 + 1e-9)
    if bench.controller.stops:
        assert bench.backend.commands[-1].velocity_rad_s == (0.0,) * 7


def test_braking_harder_stops_from_where_it_is() -> None:
    limits = Bench().description.limits
    executive = MotionExecutive((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), limits=limits, cycle_s=1e-3)
    with pytest.raises(IllegalTransition):
        executive.brake_harder()
    executive.start_overlay(cycles_per_target=1)
    executive.retarget((1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3))
    executive.commit(proposed(executive), now_ns=0)
    executive.brake(Fault("a test"), now_ns=0)
    for _ in range(20):
        executive.brake_harder()
    at = executive.set_point.position_rad
    assert proposed(executive).position_rad == at
    assert executive.commit(proposed(executive), now_ns=0)


def test_a_long_stall_of_our_own_is_not_the_clients_fault() -> None:
    bench = Bench()
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(0.7)
    bench.now_ns += 1_500 * MS
    bench.run(0.3)
    assert bench.state is SessionState.COMMANDING_ACTIVE
    assert bench.reasons() == []


def test_an_answer_that_comes_before_its_message_left_is_survived() -> None:
    bench = Bench()
    bench.run(0.1)
    bench.now_ns += MS
    bench.controller.tick(now_ns=bench.now_ns)
    bench.inject(bench.codec.encode_command(CommandMessage(bench.client.sequence, bench.client.received)))
    assert len(bench.controller.outgoing(now_ns=bench.now_ns + 1000)) == 1


def test_events_cannot_be_flooded_by_a_client() -> None:
    bench = Bench()
    bench.client.change = lambda command, _: command._replace(sequence_counter=7)
    bench.run(3.0)
    assert sum(isinstance(event, ClientRestarted) for event in bench.events) <= 4
    random = np.random.default_rng(1)
    bench = Bench()
    bench.client.change = lambda command, _: command._replace(
        command=CommandData(position=(random.uniform(0.2, 0.5), 0.5, 0.0, 0.7, 0.0, 1.5, 0.0))
    )
    bench.run(3.0)
    assert bench.state is SessionState.COMMANDING_WAIT
    assert sum(isinstance(event, TransitionRefused) for event in bench.events) < 10


@pytest.mark.parametrize(("ours", "theirs"), [(Release.V2_5, True), (Release.V1_15, False)])
def test_answers_that_look_like_another_release_are_told_once(ours: Release, *, theirs: bool) -> None:
    bench = Bench(ours)
    position = bench.description.initial_position_rad
    bench.client.change = lambda command, _: command._replace(
        command=CommandData(position=position) if theirs else None
    )
    bench.run(0.5)
    doubts = [event for event in bench.events if isinstance(event, ReleaseDoubted)]
    assert len(doubts) == 1
    assert f"configured is {ours}" in str(doubts[0])


@pytest.mark.parametrize("release", list(Release))
def test_the_right_release_is_not_doubted(release: Release) -> None:
    bench = Bench(release)
    bench.run(1.5)
    assert not [event for event in bench.events if isinstance(event, ReleaseDoubted)]


def test_reasons_name_this_controllers_own_lateness() -> None:
    bench = Bench()
    bench.lateness_ns = 700_000
    bench.client.answers = lambda count: count % 2 == 0
    bench.run(1.2)
    refused = [str(event) for event in bench.events if isinstance(event, TransitionRefused)]
    assert any("of this controller's own cycles began more than half the budget late" in text for text in refused)
