"""Control modes over the servo link: the whole controller with a torque-driven MuJoCo arm, in virtual time."""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import pytest

from backends.ideal import IdealBackend
from backends.mujoco import MujocoBackend
from hil.core.events import ArmStopped
from hil.core.servo.control_choice import KIND_STAYS, NOT_VALIDATED
from hil.values.arm import Push
from hil.values.control import (
    CartesianImpedanceControlMode,
    CartesianSineImpedanceControlMode,
    ControlModeSettings,
    ForceOscillation,
    JointImpedanceControlMode,
    PositionControlMode,
    by_translation,
)
from hil.values.frames import FLANGE, Frame, FrameKind, FrameTree
from hil.values.fri import ControlMode, OperationMode
from hil.values.load import NO_LOAD, AttachedTool, Load
from hil.values.motion import MotionEnd, MotionKind, MotionParameters
from hil.values.operator import PadKey
from hil.values.pose import Pose
from hil.values.robot import RobotDescription, Seven
from hil.values.servo import (
    ChangeControlMode,
    LoadValidated,
    PushArm,
    RequestDone,
    RequestError,
    Role,
    SetDestination,
    StartMotion,
    ValidateLoad,
)
from tests.support.servo_virtual import OTHER, Application, ServoBench, offset

ROBOTS = ("lbr-iiwa-7-r800", "lbr-iiwa-14-r820")
GRIPPER = Load(2.0, (0.0, 0.01, 0.06), (0.01, 0.01, 0.005))
TOOL = "gripper"
TCP = "tip"
each_robot = pytest.mark.parametrize("robot", ROBOTS)


def frames(load: Load = GRIPPER) -> FrameTree:
    return FrameTree(
        [
            Frame(TOOL, FrameKind.TOOL, FLANGE, Pose(0.0, 0.0, 0.0), load),
            Frame(TCP, FrameKind.TOOL_FRAME, TOOL, Pose(0.0, 0.0, 0.15)),
        ]
    )


class Impedance:
    """A commander of an arm on which ``true`` hangs, while the station file tells ``told``."""

    def __init__(
        self,
        *,
        robot: str = "lbr-iiwa-14-r820",
        true: Load = NO_LOAD,
        told: Load = GRIPPER,
        position_rad: Seven | None = None,
        noise: bool = True,
        cycle_ms: int = 1,
        mode: OperationMode = OperationMode.AUT,
    ) -> None:
        def arm(description: RobotDescription) -> MujocoBackend:
            if position_rad is not None:
                description = replace(description, initial_position_rad=position_rad)
            return MujocoBackend(description, load=true, torque_noise=noise)

        self.bench = ServoBench(robot=robot, backend=arm, frames=frames(told), load=true, cycle_ms=cycle_ms, mode=mode)
        self.application = Application(self.bench, state_period_ms=10)
        self.application.join()
        self.application.run(0.1)

    def validate(self, frame: str = FLANGE) -> str:
        """Return why the load is not valid, or an empty text."""
        [done] = self.application.ask(lambda number: ValidateLoad(number, frame))
        assert not done.error, done
        [told] = [
            report
            for report in self.application.reports
            if isinstance(report, LoadValidated) and report.request == done.request
        ]
        return told.reason

    def ask_to_start(
        self,
        mode: ControlModeSettings,
        frame: str = FLANGE,
        kind: MotionKind = MotionKind.SMART_SERVO,
        parameters: MotionParameters | None = None,
    ) -> RequestDone:
        chosen = parameters or MotionParameters()
        [done] = self.application.ask(lambda number: StartMotion(number, kind, chosen, None, mode=mode, frame=frame))
        return done

    def start(self, mode: ControlModeSettings, frame: str = FLANGE) -> int:
        assert not self.validate(frame)
        done = self.ask_to_start(mode, frame)
        assert not done.error, done
        self.application.run(0.05)
        return done.request

    def change(self, motion: int, mode: ControlModeSettings) -> RequestDone:
        [done] = self.application.ask(lambda number: ChangeControlMode(number, motion, mode))
        return done

    def push(self, force: tuple[float, float, float], seconds: float = 30.0, link: int = 7) -> None:
        assert not self.bench.controller.operate(Push(link, force, (0.0, 0.0, 0.0), seconds), now_ns=self.bench.now_ns)

    def run(self, seconds: float) -> None:
        self.application.run(seconds)

    @property
    def flange(self) -> Pose:
        self.application.command(wants_state=True)
        self.bench.cycle()
        return self.application.states[-1].snapshot.flange_in_base

    @property
    def control_mode(self) -> ControlMode:
        self.application.command(wants_state=True)
        self.bench.cycle()
        return self.application.states[-1].snapshot.control_mode

    def torques(self, seconds: float) -> list[Seven]:
        """What the motors are asked for in each cycle to come, Nm, positive towards plus."""
        asked = []
        for _ in range(round(seconds * 1e3) // self.bench.settings.cycle_ms):
            self.application.command()
            self.bench.cycle()
            arm = self.bench.backend.read()
            asked.append(tuple(-torque for torque in arm.commanded_torque_nm))
        return asked  # type: ignore[return-value]  # seven each


def largest_step(torques: list[Seven]) -> float:
    return max(
        max(abs(one - other) for one, other in zip(before, after, strict=True))
        for before, after in itertools.pairwise(torques)
    )


@each_robot
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_push_at_the_flange_deflects_the_controlled_arm(robot: str, axis: int) -> None:
    arm = Impedance(robot=robot)
    arm.start(CartesianImpedanceControlMode(by_translation(1000.0, 200.0)))
    before = arm.flange
    force = [0.0, 0.0, 0.0]
    force[axis] = 10.0
    arm.push((force[0], force[1], force[2]))
    arm.run(3.0)
    after = arm.flange
    off = after.position_m[axis] - before.position_m[axis]
    # The rest is a sag of the elbow, and 2 % of it.
    assert off == pytest.approx(10.0 / 1000.0, rel=0.03)
    assert arm.control_mode == ControlMode.CARTESIAN_IMPEDANCE
    snapshot = arm.application.states[-1].snapshot
    assert snapshot.flange_force[axis] == pytest.approx(10.0, abs=0.6)
    assert all(0.0 < variance < 1.0 for variance in snapshot.external_torque_variance)


def test_nobody_starts_impedance_control_without_a_validated_load() -> None:
    arm = Impedance(true=GRIPPER)
    done = arm.ask_to_start(JointImpedanceControlMode(), TCP)
    assert done.error is RequestError.ILLEGAL_STATE
    assert done.reason == NOT_VALIDATED
    assert "'tip', 2 kg" in done.detail
    assert not arm.validate(TCP)
    assert not arm.ask_to_start(JointImpedanceControlMode(), TCP).error


def test_a_validation_is_the_application_s_own() -> None:
    arm = Impedance()
    assert not arm.validate()
    arm.application.goodbye()
    arm.bench.run(0.1)
    other = Application(arm.bench, address=OTHER, nonce=8)
    other.join()
    [done] = other.ask(
        lambda number: StartMotion(
            number, MotionKind.SMART_SERVO, MotionParameters(), None, mode=JointImpedanceControlMode()
        )
    )
    assert done.reason == NOT_VALIDATED


def test_a_wrong_load_is_found_and_said() -> None:
    arm = Impedance(true=GRIPPER, told=replace(GRIPPER, mass_kg=0.5))
    said = arm.validate(TCP)
    assert said.startswith("the load of 0.5 kg that was told does not explain the torques: A")
    assert "Nm are allowed" in said
    assert arm.validate(FLANGE).startswith("the load of 0 kg")
    assert arm.ask_to_start(JointImpedanceControlMode(), TCP).reason == NOT_VALIDATED


def test_a_tool_of_the_application_s_own_is_validated_and_impedance_acts_in_its_tcp() -> None:
    arm = Impedance(true=GRIPPER)
    own = AttachedTool(GRIPPER, Pose(0.0, 0.0, 0.3))
    for tool, reason in ((AttachedTool(NO_LOAD), "the load of 0 kg that was told"), (own, "")):
        [done] = arm.application.ask(partial(ValidateLoad, frame=FLANGE, tool=tool))
        [told] = [
            report
            for report in arm.application.reports
            if isinstance(report, LoadValidated) and report.request == done.request
        ]
        assert told.reason.startswith(reason)
        assert bool(told.reason) == bool(reason)
    soft = CartesianImpedanceControlMode(by_translation(1000.0, 200.0))
    make = partial(StartMotion, kind=MotionKind.SMART_SERVO, parameters=MotionParameters(), destination=None, mode=soft)
    [refused] = arm.application.ask(lambda number: make(number, tool=AttachedTool(Load(1.0))))
    assert (refused.reason, "validate the load of the tool, 1 kg" in refused.detail) == (NOT_VALIDATED, True)
    [done] = arm.application.ask(lambda number: make(number, tool=own))
    assert not done.error, done
    arm.application.run(0.05)
    before = arm.flange
    # A moment about y is a rotation about the TCP: its place stays, and the flange moves on a circle about it.
    arm.bench.controller.operate(Push(7, (0.0, 0.0, 0.0), (0.0, 10.0, 0.0), 30.0), now_ns=arm.bench.now_ns)
    arm.run(3.0)
    after = arm.flange
    assert before.angle_rad(after) == pytest.approx(10.0 / 200.0, rel=0.05)
    assert (before @ own.tcp_in_flange).distance_m(after @ own.tcp_in_flange) < 2e-3
    assert before.distance_m(after) == pytest.approx(0.3 * 10.0 / 200.0, rel=0.2)


def test_no_load_is_validated_in_a_singularity_or_while_the_arm_moves() -> None:
    stretched = Impedance(position_rad=(0.0, 0.5, 0.0, 0.0, 0.0, 1.0, 0.0))
    assert stretched.validate().startswith("the arm is in a singularity (A4 = 0)")
    moving = Impedance()
    home = moving.bench.description.initial_position_rad
    moving.application.start(MotionKind.PTP, offset(home, A1=0.5))
    moving.run(0.3)
    assert "can only be validated at rest" in moving.validate()


def test_cartesian_impedance_does_not_begin_in_a_singularity() -> None:
    arm = Impedance()
    assert not arm.validate()
    home = arm.bench.description.initial_position_rad
    arm.application.start(MotionKind.PTP, (home[0], home[1], home[2], 0.0, home[4], home[5], home[6]))
    arm.run(3.0)
    done = arm.ask_to_start(CartesianImpedanceControlMode())
    assert done.error is RequestError.ILLEGAL_STATE
    assert done.reason == "Cartesian impedance control cannot begin in a singularity"
    assert done.detail.startswith("A4 = 0")
    assert not arm.ask_to_start(JointImpedanceControlMode()).error


@pytest.mark.parametrize("mode", [CartesianImpedanceControlMode(), JointImpedanceControlMode((200.0,) * 7)])
def test_a_wrong_load_makes_the_arm_drift(mode: ControlModeSettings) -> None:
    """The load changes hands after the validation: somebody takes 2 kg off and does not tell."""
    heavy = Load(2.0, (0.0, 0.0, 0.06))
    drifts = []
    for told in (heavy, NO_LOAD):
        arm = Impedance(true=heavy, told=told)
        validation = arm.bench.link._choice._validation
        validation._valid.add(told)
        before = arm.flange
        assert not arm.ask_to_start(mode, TCP).error
        arm.run(1.5)
        drifts.append(before.position_m[2] - arm.flange.position_m[2])
    right, wrong = drifts
    assert abs(right) < 1e-4
    assert wrong > 5e-3


def test_a_robot_side_without_torques_refuses_in_words() -> None:
    bench = ServoBench(backend=IdealBackend)
    application = Application(bench)
    application.join()
    [done] = application.ask(
        lambda number: StartMotion(
            number, MotionKind.SMART_SERVO, MotionParameters(), None, mode=JointImpedanceControlMode()
        )
    )
    assert done.error is RequestError.ILLEGAL_STATE
    assert "is position controlled only" in done.reason


@pytest.mark.parametrize("frame", ["nowhere", "world"])
def test_a_frame_that_does_not_move_cannot_be_moved(frame: str) -> None:
    arm = Impedance()
    done = arm.ask_to_start(PositionControlMode(), frame)
    assert done.error is RequestError.ILLEGAL_ARGUMENT
    assert repr(frame) in done.reason


def test_parameters_change_while_it_moves_and_the_kind_does_not() -> None:
    arm = Impedance(noise=False)
    stiff, soft = (CartesianImpedanceControlMode(by_translation(value, 200.0)) for value in (2000.0, 500.0))
    motion = arm.start(stiff)
    arm.push((10.0, 0.0, 0.0))
    arm.run(2.0)
    before = arm.flange
    done = arm.change(motion, PositionControlMode())
    assert (done.error, done.reason) == (RequestError.ILLEGAL_ARGUMENT, KIND_STAYS)
    assert not arm.change(motion, soft).error
    torques = arm.torques(2.5)
    # 5 mm of springs that lose 1500 N/m: a step of 7.5 N at the flange, and no more.
    assert largest_step(torques) < 7.5 * 1.3
    assert arm.flange.position_m[0] - before.position_m[0] == pytest.approx(10.0 / 500.0 - 10.0 / 2000.0, rel=0.05)
    assert arm.change(99, soft).error is RequestError.ILLEGAL_STATE


def test_parameters_of_a_motion_that_waits_count_when_its_turn_comes() -> None:
    arm = Impedance()
    first = arm.start(JointImpedanceControlMode())
    waiting = arm.ask_to_start(CartesianImpedanceControlMode()).request
    assert not arm.change(waiting, CartesianImpedanceControlMode(by_translation(300.0, 100.0))).error
    before: ControlMode = arm.control_mode
    assert before is ControlMode.JOINT_IMPEDANCE
    arm.application.stop(first)
    arm.run(0.1)
    assert arm.control_mode == ControlMode.CARTESIAN_IMPEDANCE
    assert arm.bench.controller.motion.control.mode == CartesianImpedanceControlMode(by_translation(300.0, 100.0))


def test_a_change_of_parameters_lets_an_oscillation_go_on() -> None:
    arm = Impedance(noise=False)
    swing = ForceOscillation(amplitude=(10.0,) + (0.0,) * 5, frequency_hz=(2.0,) + (0.0,) * 5)
    mode = CartesianSineImpedanceControlMode(oscillation=swing)
    motion = arm.start(mode)
    arm.run(0.2)
    assert not arm.change(motion, replace(mode, oscillation=replace(swing, frequency_hz=(3.0,) + (0.0,) * 5))).error
    torques = arm.torques(1.0)
    assert largest_step(torques) < 1.0
    assert max(torque[1] for torque in torques) - min(torque[1] for torque in torques) > 3.0


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (CartesianImpedanceControlMode(), PositionControlMode()),
        (CartesianImpedanceControlMode(), JointImpedanceControlMode()),
        (JointImpedanceControlMode((300.0,) * 7), CartesianImpedanceControlMode()),
        (JointImpedanceControlMode((300.0,) * 7), PositionControlMode()),
        (PositionControlMode(), CartesianImpedanceControlMode()),
    ],
)
def test_another_kind_of_control_takes_over_without_a_jump(
    first: ControlModeSettings, second: ControlModeSettings
) -> None:
    """Pushed with 10 N, so the arm is off its set point: what the two laws differ in is what the push is worth."""
    arm = Impedance(noise=False)
    assert not arm.validate()
    motion = arm.ask_to_start(first).request
    arm.push((10.0, 0.0, 0.0))
    arm.run(2.0)
    before = arm.flange
    assert not arm.ask_to_start(second).error
    arm.application.stop(motion)
    torques = arm.torques(1.0)
    # 10 N at 0.8 m of height are 8 Nm on A2; between springs of other kinds the set point stays, so more may differ.
    both_yield = not isinstance(first, PositionControlMode) and not isinstance(second, PositionControlMode)
    assert largest_step(torques) < (40.0 if both_yield else 10.0)
    assert arm.bench.controller.motion.control.mode == second
    if isinstance(second, PositionControlMode):
        assert arm.flange.distance_m(before) < 3e-4
    assert not arm.bench.controller.stops


def test_an_arm_that_yielded_is_held_where_it_is_when_its_motion_ends() -> None:
    arm = Impedance(noise=False)
    motion = arm.start(CartesianImpedanceControlMode(by_translation(500.0, 100.0)))
    arm.push((15.0, 0.0, 0.0))
    arm.run(2.0)
    before = arm.flange
    arm.application.stop(motion)
    torques = arm.torques(1.0)
    assert largest_step(torques) < 15.0
    assert arm.flange.distance_m(before) < 5e-4
    assert arm.control_mode is ControlMode.POSITION
    assert not arm.bench.controller.stops


def test_the_load_may_change_with_the_motion() -> None:
    arm = Impedance(true=GRIPPER)
    motion = arm.start(JointImpedanceControlMode((500.0,) * 7), TCP)
    before = arm.flange
    arm.bench.link._choice._validation._valid.add(NO_LOAD)
    assert not arm.ask_to_start(JointImpedanceControlMode((500.0,) * 7), FLANGE).error
    arm.application.stop(motion)
    arm.run(1.0)
    assert arm.bench.controller.motion.control.load == NO_LOAD
    assert before.position_m[2] - arm.flange.position_m[2] > 2e-3


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"max_path_deviation": by_translation(5.0, 1e6)}, "max path deviation exceeded"),
        (
            {"max_control_force": by_translation(8.0, 1e6), "stop_on_max_control_force": True},
            "max control force exceeded",
        ),
        ({"max_cartesian_velocity": by_translation(2.0, 1e6)}, "max Cartesian velocity exceeded"),
    ],
)
def test_a_cartesian_limit_ends_the_motion(change: dict[str, object], reason: str) -> None:
    arm = Impedance()
    motion = arm.start(replace(CartesianImpedanceControlMode(), **change))  # type: ignore[arg-type]  # fields of it
    arm.push((20.0, 0.0, 0.0))
    arm.run(1.0)
    [ended] = arm.application.ends
    assert (ended.motion, ended.end, ended.reason) == (motion, MotionEnd.FAILED, reason)
    # z of the flange points along x of the base, all but 10 degrees.
    assert " Z: " in ended.detail
    assert arm.control_mode is ControlMode.POSITION
    stops = [event for event in arm.bench.events if isinstance(event, ArmStopped)]
    assert len(stops) == 1


def test_the_maximum_of_the_control_force_alone_only_caps() -> None:
    arm = Impedance()
    arm.start(CartesianImpedanceControlMode(max_control_force=by_translation(8.0, 1e6)))
    before = arm.flange
    arm.push((6.0, 0.0, 0.0))
    arm.run(1.0)
    assert arm.flange.distance_m(before) == pytest.approx(3e-3, rel=0.1)
    assert not arm.application.ends


@pytest.mark.parametrize("kind", [MotionKind.SMART_SERVO, MotionKind.DIRECT_SERVO])
@pytest.mark.parametrize("mode", [CartesianImpedanceControlMode(), JointImpedanceControlMode()])
def test_destinations_are_followed_under_impedance(kind: MotionKind, mode: ControlModeSettings) -> None:
    arm = Impedance()
    assert not arm.validate()
    motion = arm.ask_to_start(mode, kind=kind).request
    home = arm.bench.description.initial_position_rad
    [done] = arm.application.ask(lambda number: SetDestination(number, motion, offset(home, A1=0.05, A4=0.05)))
    assert not done.error, done
    arm.run(3.0)
    measured = arm.bench.backend.read().position_rad
    assert measured[0] - home[0] == pytest.approx(0.05, abs=5e-3)
    assert measured[3] - home[3] == pytest.approx(0.05, abs=5e-3)


def test_an_emergency_stop_brakes_a_yielding_arm_and_drops_its_drives() -> None:
    arm = Impedance()
    arm.start(CartesianImpedanceControlMode())
    arm.push((20.0, 0.0, 0.0), seconds=0.5)
    arm.run(0.2)
    arm.bench.press(PadKey.EMERGENCY_STOP)
    arm.run(1.0)
    state = arm.bench.backend.read()
    assert max(map(abs, state.velocity_rad_s)) < 1e-3
    assert arm.control_mode is ControlMode.POSITION
    assert "OFF" in str(arm.bench.controller._safety.drives.read(state) or state.drive_states)


def test_t1_s_measured_speed_stops_an_arm_that_is_pushed_too_fast() -> None:
    arm = Impedance(mode=OperationMode.T1)
    soft = CartesianImpedanceControlMode(by_translation(10.0, 10.0), null_space_stiffness_nm_rad=1.0)
    arm.start(soft)
    arm.push((120.0, 0.0, 0.0))
    arm.run(1.0)
    assert any("msr T1 illegal speed limit detected" in stop.reason for stop in arm.bench.controller.stops)


@pytest.mark.parametrize("cycle_ms", [2, 5])
def test_longer_control_cycles_are_stable(cycle_ms: int) -> None:
    arm = Impedance(cycle_ms=cycle_ms)
    arm.start(CartesianImpedanceControlMode())
    before = arm.flange
    arm.push((10.0, 0.0, 0.0))
    arm.run(3.0)
    assert arm.flange.distance_m(before) == pytest.approx(5e-3, rel=0.05)
    assert max(map(abs, arm.bench.backend.read().velocity_rad_s)) < 1e-3


@each_robot
@pytest.mark.parametrize("link", [2, 4, 7])
def test_a_push_on_any_link_shows_with_the_right_sign_and_size(robot: str, link: int) -> None:
    """Against MuJoCo's own Jacobian of the place that is pushed; in position control."""
    import mujoco
    import numpy as np

    arm = Impedance(robot=robot)
    arm.run(0.3)
    resting = np.array(arm.bench.backend.read().external_torque_nm)
    arm.push((0.0, 15.0, -10.0), link=link)
    arm.run(0.5)
    backend = arm.bench.backend
    assert isinstance(backend, MujocoBackend)
    model, data = backend._model, backend._data
    linear = np.zeros((3, 7))
    if link == 7:
        mujoco.mj_jacSite(model, data, linear, None, model.site("flange").id)
    else:
        at = data.xpos[model.body(f"link_{link + 1}").id]
        mujoco.mj_jac(model, data, linear, None, at, model.body(f"link_{link}").id)
    felt = np.array(arm.bench.controller._arm.external_torque_nm) - resting
    # Dry friction of the joints takes its part, 0.34 Nm at most (facts 4.1).
    assert np.abs(felt - linear.T @ (0.0, 15.0, -10.0)).max() < 0.45
    arm.bench.controller.operate(Push(link, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0), now_ns=arm.bench.now_ns)
    arm.run(0.5)
    assert np.abs(arm.bench.controller._arm.external_torque_nm).max() < 0.6


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda number: PushArm(number, 8, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0),
            "link 8 is outside its range 1 ...",
        ),
        (lambda number: PushArm(number, 7, (501.0, 0.0, 0.0), (0.0,) * 3, 1.0), "force along x 501"),
        (lambda number: PushArm(number, 7, (1.0, 0.0, 0.0), (0.0, math.nan, 0.0), 1.0), "moment along y nan"),
        (lambda number: PushArm(number, 7, (1.0, 0.0), (0.0,) * 3, 1.0), "three forces in N"),
        (lambda number: PushArm(number, 7, (1.0, 0.0, 0.0), (0.0,) * 3, 61.0), "duration of a push 61"),
    ],
)
def test_operators_push_over_the_link_and_wrong_pushes_are_refused(make: Callable[[int], PushArm], words: str) -> None:
    arm = Impedance()
    operator = Application(arm.bench, address=OTHER, role=Role.OPERATOR, nonce=8)
    operator.join()
    [done] = operator.ask(make)
    assert done.error is RequestError.ILLEGAL_ARGUMENT
    assert words in done.reason
    [done] = operator.ask(lambda number: PushArm(number, 7, (0.0, 10.0, 0.0), (0.0,) * 3, 5.0))
    assert not done.error
    for _ in range(400):
        operator.command()
        arm.application.command()
        arm.bench.cycle()
    assert arm.bench.controller._arm.external_torque_nm[0] == pytest.approx(10.0 * arm.flange.x_m, abs=0.5)
    [refused] = arm.application.ask(lambda number: PushArm(number, 7, (0.0, 10.0, 0.0), (0.0,) * 3, 5.0))
    assert refused.reason == "only an operator pushes the arm"
    [refused] = operator.ask(lambda number: ValidateLoad(number, "nowhere"))
    assert refused.error is RequestError.ILLEGAL_ARGUMENT


def test_a_push_of_a_robot_side_that_cannot_be_pushed_is_refused_in_words() -> None:
    bench = ServoBench(backend=IdealBackend)
    bench.run(0.01)
    said = bench.controller.operate(Push(7, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0), now_ns=bench.now_ns)
    assert said == "this robot side is no simulation that could be pushed from here"
