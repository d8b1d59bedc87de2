"""Our own controller as the Cabinet of another one, in virtual time: what goes through, and what is lost with it."""

import random
from functools import partial
from typing import cast

import pytest

from backends.mujoco import MujocoBackend
from hil.core.events import RobotSideChanged
from hil.values.arm import Push
from hil.values.control import (
    CartesianImpedanceControlMode,
    ControlModeSettings,
    JointImpedanceControlMode,
)
from hil.values.errors import ConfigurationError
from hil.values.fri import OperationMode, OverlayKind, Release, SafetyState, SessionState
from hil.values.fri_messages import CommandMessage, MonitoringMessage
from hil.values.motion import MotionEnd, MotionKind, MotionParameters
from hil.values.operator import PadKey, ProgramState
from hil.values.robot import Seven
from hil.values.servo import RequestError, StartMotion
from tests.support.chain import Chain, cut, mend
from tests.support.servo_virtual import Application, ServoBench, offset

QUIET = partial(MujocoBackend, torque_noise=False)
LOST = "the Cabinet at 127.0.0.1:40200 is lost: no message for"


def arm_rad(chain: Chain) -> Seven:
    """Where the arm is."""
    return chain.arm.read().position_rad


def off_rad(chain: Chain, wanted: tuple[float, ...]) -> float:
    """How far the arm is from where it should be."""
    return max(abs(here - there) for here, there in zip(arm_rad(chain), wanted, strict=True))


def commanding(**what: object) -> tuple[Chain, Application]:
    """Return a chain that commands its arm, and an application of its outer controller."""
    chain = Chain(**what)  # type: ignore[arg-type]
    chain.run_until_commanding()
    application = Application(cast("ServoBench", chain), state_period_ms=10)
    application.join()
    return chain, application


def moving(**what: object) -> tuple[Chain, Application]:
    """The same with a PTP of all axes on its way."""
    chain, application = commanding(**what)
    if chain.settings.operation_mode is OperationMode.T1:
        assert not chain.press(chain.outer, PadKey.START)
    application.start(MotionKind.PTP, tuple(value + 0.3 for value in arm_rad(chain)))
    application.run(0.2)
    assert max(map(abs, chain.arm.read().velocity_rad_s)) > 0.05
    return chain, application


def get_going(chain: Chain, application: Application) -> None:
    """Acknowledge and start on the outer pad."""
    assert not chain.press(chain.outer, PadKey.RESET)
    application.run_until(lambda: chain.outer.backend.condition().takes_commands)
    assert not chain.press(chain.outer, PadKey.START)
    target = tuple(value + 0.02 for value in arm_rad(chain))
    ends = len(application.ends)
    application.start(MotionKind.PTP, target)
    application.run_until(lambda: len(application.ends) > ends)
    assert application.ends[-1].end is MotionEnd.FINISHED
    assert off_rad(chain, target) < 1e-3


@pytest.mark.parametrize("release", list(Release))
@pytest.mark.parametrize("depth", [2, 3])
def test_a_motion_of_an_application_moves_the_arm_at_the_end_of_the_row(release: Release, depth: int) -> None:
    chain, application = commanding(release=release, depth=depth)
    assert chain.largest_step_rad() == 0.0
    target = tuple(value + 0.02 for value in arm_rad(chain))
    application.start(MotionKind.PTP, target)
    application.run_until(lambda: bool(application.ends))
    assert application.ends[0].end is MotionEnd.FINISHED
    chain.run(0.01)
    assert off_rad(chain, target) < 1e-9
    for node in chain.nodes[1:]:
        assert not chain.stops(node)
        assert [str(event) for event in node.events if isinstance(event, RobotSideChanged)][-1].endswith(" commands")
        assert node.cabinet_link.report()["lost"] == 0


@pytest.mark.parametrize("cycle_ms", [2, 5])
def test_it_goes_with_other_cycles_and_with_every_second_message_answered(cycle_ms: int) -> None:
    chain, application = commanding(cycle_ms=cycle_ms, receive_multiplier=2)
    target = tuple(value + 0.02 for value in arm_rad(chain))
    application.start(MotionKind.PTP, target)
    application.run_until(lambda: bool(application.ends))
    chain.run(0.1)
    assert off_rad(chain, target) < 1e-9


def test_a_smart_servo_follows_its_destinations_on_the_simulated_arm() -> None:
    chain, application = commanding(backend=QUIET, depth=3)
    start = arm_rad(chain)
    motion = application.start(MotionKind.SMART_SERVO)
    for step in range(1, 21):
        assert not application.set_destination(motion, offset(start, A1=0.005 * step)).error
        application.run(0.02)
    application.run(0.5)
    application.stop(motion)
    application.run(0.1)
    assert off_rad(chain, offset(start, A1=0.1)) < 1e-3
    assert not any(chain.stops(node) for node in chain.nodes)
    assert max(map(abs, chain.outer.controller.arm.torque_nm)) > 5.0


def test_a_motion_that_waits_for_the_cabinet_begins_without_a_jump_when_it_commands() -> None:
    chain = Chain(backend=QUIET)
    chain.run_until(lambda: chain.outer.made is not None)
    target = tuple(value + 0.02 for value in arm_rad(chain))
    application = chain.application()
    push = Push(7, (0.0, 300.0, 0.0), (0.0, 0.0, 0.0), 0.03)
    assert not chain.cabinet.controller.operate(push, now_ns=chain.now_ns)
    application.run(0.01)
    assert not chain.outer.backend.condition().takes_commands
    assert abs(arm_rad(chain)[0] - target[0] + 0.02) > 3e-4, "the arm is not where the Cabinet holds it"
    application.start(MotionKind.PTP, target)
    application.run_until(lambda: bool(application.ends))
    assert application.ends[0].end is MotionEnd.FINISHED
    assert off_rad(chain, target) < 1e-3
    assert not chain.stops(chain.cabinet)


def test_losing_the_cabinet_stops_the_motion_and_nothing_moves_until_reset_and_start() -> None:
    chain, application = moving()
    cut(chain)
    application.run(0.2)
    [end] = application.ends
    assert end.end is MotionEnd.FAILED
    assert end.reason.startswith(LOST)
    assert chain.stops(chain.outer)[0].startswith(LOST)
    assert "client lost" in chain.stops(chain.cabinet)[0]
    [refusal] = chain.press(chain.outer, PadKey.RESET)
    assert refusal.startswith(f"the robot side has not recovered: {LOST}")
    mend(chain)
    rest = arm_rad(chain)
    commands = len(chain.commanded(0))
    application.run(1.5)
    assert chain.outer.controller.operator.program is ProgramState.STOPPED
    assert chain.cabinet.fri.state is SessionState.COMMANDING_WAIT
    get_going(chain, application)
    assert chain.largest_step_rad(since=commands) < 1e-3
    assert off_rad(chain, tuple(value + 0.02 for value in rest)) < 1e-9


def test_a_short_silence_is_none() -> None:
    chain, application = moving()
    cut(chain)
    application.run(0.007)
    mend(chain)
    application.run_until(lambda: bool(application.ends))
    assert application.ends[0].end is MotionEnd.FINISHED
    assert chain.outer.cabinet_link.report()["lost"] == 7


def test_lost_datagrams_either_way_are_borne_and_counted() -> None:
    chain, application = commanding()
    chance = random.Random(3)
    chain.carries = lambda _number, payload: None if chance.random() < 0.02 else payload
    target = tuple(value + 0.1 for value in arm_rad(chain))
    application.start(MotionKind.PTP, target)
    application.run_until(lambda: bool(application.ends))
    mend(chain)
    application.run(0.05)
    assert application.ends[0].end is MotionEnd.FINISHED
    assert off_rad(chain, target) < 1e-9
    lost = chain.outer.cabinet_link.report()["lost"]
    assert isinstance(lost, int)
    assert lost > 0


def test_a_cabinet_that_is_started_anew_is_a_new_session() -> None:
    chain, application = moving()
    application.run(0.8)
    application.start(MotionKind.PTP, tuple(value - 0.3 for value in arm_rad(chain)))
    application.run(0.2)
    chain.restart_cabinet()
    application.run(0.05)
    assert "counts its messages anew while it was commanded" in chain.stops(chain.outer)[0]
    application.run(0.3)
    get_going(chain, application)
    assert chain.outer.cabinet_link.report()["restarts"] == 1


def test_a_cabinet_that_shuts_down_has_closed_the_session() -> None:
    chain, _ = commanding()
    chain.cabinet.controller.close(now_ns=chain.now_ns)
    chain.run(0.05)
    assert chain.stops(chain.outer) == ["the Cabinet at 127.0.0.1:40200 closed the FRI session"]
    [refusal] = chain.press(chain.outer, PadKey.RESET)
    assert "closed the FRI session" in refusal


def test_the_emergency_stop_of_the_cabinet_is_seen_outside_and_cleared_there_first() -> None:
    chain, application = moving()
    chain.press(chain.cabinet, PadKey.EMERGENCY_STOP)
    application.run(0.4)
    assert application.ends[0].reason == "the robot side is stopped"
    assert application.ends[0].detail == "SAFETY_STOP_LEVEL_1"
    assert chain.outer.controller.operator.safety_state is not SafetyState.NORMAL_OPERATION
    assert chain.press(chain.outer, PadKey.RESET) == [
        "the robot side is stopped (SAFETY_STOP_LEVEL_1): clear that there first"
    ]
    assert not chain.press(chain.cabinet, PadKey.RESET, PadKey.START)
    application.run(1.0)
    assert chain.outer.controller.operator.program is ProgramState.STOPPED
    get_going(chain, application)


def test_the_mode_is_the_cabinets() -> None:
    chain, application = commanding()
    for mode in (OperationMode.T1, OperationMode.AUT):
        assert "the mode selector is at the robot side" in chain.select(chain.outer, mode)
        assert not chain.select(chain.cabinet, mode)
        application.run(0.4)
        assert chain.outer.controller.operator.mode is mode
        if mode is OperationMode.T1:
            assert "hold the enabling switch (at the robot side)" in chain.outer.controller.operator.reason
            assert chain.press(chain.outer, PadKey.ENABLE) == ["the enabling switch is at the robot side: use it there"]
        assert not chain.press(chain.cabinet, PadKey.ENABLE, PadKey.RESET, PadKey.START)
        application.run(0.6)
        get_going(chain, application)


def test_in_t1_the_enabling_switch_is_at_the_cabinet() -> None:
    chain, application = moving(mode=OperationMode.T1)
    chain.press(chain.cabinet, PadKey.RELEASE)
    application.run(0.3)
    assert application.ends[0].end is MotionEnd.FAILED
    assert set(chain.outer.controller.arm.drive_states) == {0}
    assert not chain.press(chain.cabinet, PadKey.ENABLE, PadKey.START)
    application.run(0.6)
    get_going(chain, application)


def test_a_cabinet_in_t1_without_enabling_switch_is_a_named_reason_at_the_start() -> None:
    chain = Chain(mode=OperationMode.T1)
    chain.press(chain.cabinet, PadKey.RELEASE)
    chain.run(0.2)
    assert not chain.outer.backend.condition().takes_commands
    assert "the enabling switch" in chain.outer.controller.operator.reason


@pytest.mark.parametrize(
    ("overlay", "control", "axis"),
    [
        (OverlayKind.TORQUE, JointImpedanceControlMode(), 3),
        (OverlayKind.WRENCH, CartesianImpedanceControlMode(), 3),
    ],
)
def test_torques_and_wrenches_of_a_client_reach_the_arm(
    overlay: OverlayKind, control: ControlModeSettings, axis: int
) -> None:
    chain = Chain(release=Release.V2_7, backend=QUIET, overlay=overlay, control=control, client=True)
    pushes = False

    def add(command: CommandMessage, message: MonitoringMessage) -> CommandMessage:
        data, connection = command.command, message.connection
        if data is None or message.ipo is None or connection is None:
            return command
        much = 10.0 if pushes and connection.session_state == SessionState.COMMANDING_ACTIVE else 0.0
        if overlay is OverlayKind.TORQUE:
            return command._replace(command=data._replace(torque=(0.0, 0.0, 0.0, much, 0.0, 0.0, 0.0)))
        return command._replace(command=data._replace(wrench=(0.0, 0.0, 2 * much, 0.0, 0.0, 0.0)))

    assert chain.client is not None
    chain.client.change = add
    chain.run_until(lambda: chain.states() == [SessionState.COMMANDING_ACTIVE] * 2)
    chain.run(0.1)
    before = arm_rad(chain)[axis]
    pushes = True
    chain.run(0.3)
    assert abs(arm_rad(chain)[axis] - before) > 0.004
    chain.client.answers = lambda _: False
    chain.run(0.3)
    assert "quality FAIR is not enough" in chain.stops(chain.outer)[0]
    assert not chain.stops(chain.cabinet)
    assert chain.cabinet.fri.state is SessionState.COMMANDING_ACTIVE


def test_impedance_control_of_an_application_is_refused_in_words() -> None:
    _, application = commanding()
    mode = JointImpedanceControlMode()
    [done] = application.ask(
        lambda number: StartMotion(number, MotionKind.SMART_SERVO, MotionParameters(), None, mode=mode)
    )
    assert done.error is RequestError.ILLEGAL_STATE
    assert "this robot side is position controlled only" in done.reason


def test_an_overlay_that_the_station_does_not_name_is_refused_before_anything_starts() -> None:
    with pytest.raises(ConfigurationError, match="a torque overlay under joint impedance control needs"):
        Chain(
            overlay=OverlayKind.TORQUE,
            control=JointImpedanceControlMode(),
            client=True,
            backend=QUIET,
            options={"overlay": "joint-position"},
        ).run(0.01)


@pytest.mark.parametrize("seed", range(4))
def test_damaged_messages_move_nothing(seed: int) -> None:
    chain, _ = commanding(release=Release.V1_15)
    chance = random.Random(seed)

    def damage(_number: int, payload: bytes) -> bytes:
        if chance.random() < 0.8:
            return payload
        damaged = bytearray(payload)
        damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        return bytes(damaged)

    chain.carries = damage
    commands = len(chain.commanded(0))
    chain.run(0.4)
    mend(chain)
    chain.run(0.1)
    assert chain.largest_step_rad(since=commands) < 1e-3


def test_what_is_lost_two_deep_stops_the_outermost_and_comes_back_from_the_inside_out() -> None:
    chain, application = moving(depth=3)
    cut(chain, link=0)
    application.run(0.3)
    assert application.ends[0].end is MotionEnd.FAILED
    assert chain.stops(chain.nodes[1])[0].startswith(LOST)
    # Nothing paces the one in the middle while its own Cabinet is silent, so that it falls silent as well.
    assert chain.stops(chain.outer)[0].startswith("the Cabinet at 127.0.0.1:40201 is lost")
    assert chain.outer.backend.condition().safety_state is not SafetyState.NORMAL_OPERATION
    [refusal] = chain.press(chain.outer, PadKey.RESET)
    assert "clear that there first" in refusal
    mend(chain)
    application.run(1.5)
    assert not chain.press(chain.nodes[1], PadKey.RESET)
    application.run_until(lambda: chain.nodes[1].backend.condition().takes_commands)
    assert not chain.press(chain.nodes[1], PadKey.START)
    get_going(chain, application)


def test_commanding_that_ends_at_rest_is_no_stop_and_motions_wait_for_it() -> None:
    chain, application = commanding()
    assert not chain.press(chain.cabinet, PadKey.PAUSE)
    application.run(0.2)
    assert not chain.stops(chain.outer)
    assert not chain.outer.backend.condition().takes_commands
    target = tuple(value + 0.02 for value in arm_rad(chain))
    application.start(MotionKind.PTP, target)
    application.run(0.2)
    assert not application.ends
    assert not chain.press(chain.cabinet, PadKey.START)
    application.run_until(lambda: bool(application.ends))
    assert application.ends[0].end is MotionEnd.FINISHED
    assert off_rad(chain, target) < 1e-3
