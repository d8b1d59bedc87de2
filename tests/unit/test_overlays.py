"""Torque, wrench and Cartesian pose overlays in virtual time: what they do to the arm, and what they refuse."""

import math
from collections.abc import Callable
from functools import partial

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from backends.mujoco import MujocoBackend
from backends.robots import load_description, load_pinocchio
from hil.config.station import FriConfig
from hil.core.events import TransitionRefused
from hil.core.fri.commands import Refusal
from hil.core.fri.overlay_commands import MAX_WRENCH, PoseTarget, axes_of, cartesian_pose
from hil.core.kinematics.redundancy import largest_change_rad
from hil.core.kinematics.srs import SrsKinematics
from hil.core.motion.set_point import STILL
from hil.core.settings import FriSettings
from hil.values.arm import Push, seven
from hil.values.control import (
    NO_WRENCH,
    CartesianImpedanceControlMode,
    CartesianSineImpedanceControlMode,
    ControlModeSettings,
    JointImpedanceControlMode,
    PositionControlMode,
)
from hil.values.errors import ConfigurationError
from hil.values.fri import ControlMode, OverlayKind, Quality, Release, SessionState
from hil.values.fri_messages import CommandData, CommandMessage, MonitoringMessage, Redundancy, Transformation, Vector
from hil.values.load import Load
from hil.values.outcomes import Outcome
from hil.values.pose import Pose
from hil.values.robot import Seven
from tests.support.captures import FOLDER, datagrams
from tests.support.cases import cases
from tests.support.virtual import PEER, Bench
from transport.fri import FriCodec

Lay = Callable[[MonitoringMessage], CommandData | None]
QUIET = partial(MujocoBackend, torque_noise=False)
JOINT_IMPEDANCE = JointImpedanceControlMode()
CARTESIAN_IMPEDANCE = CartesianImpedanceControlMode()
CONTROL: dict[OverlayKind, ControlModeSettings] = {
    OverlayKind.JOINT_POSITION: PositionControlMode(),
    OverlayKind.TORQUE: JOINT_IMPEDANCE,
    OverlayKind.WRENCH: CARTESIAN_IMPEDANCE,
    OverlayKind.CARTESIAN_POSE: PositionControlMode(),
}


def hold(message: MonitoringMessage) -> Vector:
    """The interpolator position of a message."""
    assert message.ipo is not None
    assert message.ipo.position is not None
    return message.ipo.position


def hold_pose(message: MonitoringMessage) -> Vector:
    """The interpolator pose of a message."""
    assert message.ipo is not None
    assert message.ipo.pose is not None
    return message.ipo.pose.values


def pose(values: Vector, e1_rad: float | None = None) -> CommandData:
    """A command of a pose."""
    return CommandData(
        pose=Transformation("", tuple(values)), redundancy=None if e1_rad is None else Redundancy(0, e1_rad)
    )


def overlay(
    kind: OverlayKind,
    *,
    control: ControlModeSettings | None = None,
    release: Release = Release.V2_7,
    backend: Callable[..., MujocoBackend] = QUIET,
) -> Bench:
    """A bench whose client mirrors; poses too."""
    fri = FriSettings(peer=PEER, overlay=kind, control=CONTROL[kind] if control is None else control)
    bench = Bench(release, backend=backend, fri=fri)
    lay(bench, lambda _: None)
    return bench


def active(kind: OverlayKind, *, control: ControlModeSettings | None = None) -> Bench:
    """A bench whose client commands."""
    bench = overlay(kind, control=control)
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    return bench


def lay(bench: Bench, command: Lay, *, until: SessionState = SessionState.COMMANDING_ACTIVE) -> None:
    """Let the client command this in one state; where it says None, and in the other states, it mirrors."""

    def change(answer: CommandMessage, message: MonitoringMessage) -> CommandMessage:
        assert message.connection is not None
        if message.ipo is None:
            return answer
        data = command(message) if message.connection.session_state == until else None
        if data is None:
            ipo = message.ipo
            data = CommandData(hold(message)) if ipo.pose is None else CommandData(pose=ipo.pose)
        return answer._replace(command=data)

    bench.client.change = change


def measured(bench: Bench) -> Seven:
    """Where the arm is."""
    position = bench.report()["measured_position"]
    assert isinstance(position, list)
    return seven(position)


def kinematics(bench: Bench) -> SrsKinematics:
    """Of its arm."""
    return SrsKinematics(load_pinocchio(bench.description.name), bench.description.limits)


def moved(bench: Bench, before: Seven) -> Pose:
    """The flange now, in the flange as it was at ``before``."""
    arm = kinematics(bench)
    return arm.forward(before).inverse() @ arm.forward(measured(bench))


# What does not fit together


@pytest.mark.parametrize(
    ("kind", "control", "sentence"),
    [
        (
            OverlayKind.TORQUE,
            PositionControlMode(),
            "a torque overlay needs joint impedance control, not position control",
        ),
        (
            OverlayKind.TORQUE,
            CARTESIAN_IMPEDANCE,
            "a torque overlay needs joint impedance control, not Cartesian impedance control",
        ),
        (
            OverlayKind.WRENCH,
            PositionControlMode(),
            "a wrench overlay needs Cartesian impedance control, not position control",
        ),
        (
            OverlayKind.WRENCH,
            JOINT_IMPEDANCE,
            "a wrench overlay needs Cartesian impedance control, not joint impedance control",
        ),
    ],
)
def test_an_overlay_without_its_control_mode_is_refused(
    kind: OverlayKind, control: ControlModeSettings, sentence: str
) -> None:
    with pytest.raises(ConfigurationError, match=f"^{sentence}$"):
        FriSettings(peer=PEER, overlay=kind, control=control)


@pytest.mark.parametrize("kind", [OverlayKind.JOINT_POSITION, OverlayKind.CARTESIAN_POSE, OverlayKind.NONE])
@pytest.mark.parametrize(
    "control", [PositionControlMode(), JOINT_IMPEDANCE, CARTESIAN_IMPEDANCE, CartesianSineImpedanceControlMode()]
)
def test_positions_and_poses_go_with_any_control_mode(kind: OverlayKind, control: ControlModeSettings) -> None:
    assert FriSettings(peer=PEER, overlay=kind, control=control).control is control


def test_a_wrench_goes_with_both_kinds_of_cartesian_impedance() -> None:
    for control in (CARTESIAN_IMPEDANCE, CartesianSineImpedanceControlMode()):
        FriSettings(peer=PEER, overlay=OverlayKind.WRENCH, control=control)


@pytest.mark.parametrize("release", [Release.V1_11, Release.V1_14, Release.V1_15, Release.V1_16])
def test_a_pose_overlay_needs_a_client_that_knows_poses(release: Release) -> None:
    sentence = f"a cartesian-pose overlay needs a client of release 2.x, not {release}"
    with pytest.raises(ConfigurationError, match=sentence):
        overlay(OverlayKind.CARTESIAN_POSE, release=release)
    with pytest.raises(ValueError, match=sentence):
        FriConfig(release=release, overlay=OverlayKind.CARTESIAN_POSE)


def test_a_robot_side_of_positions_only_takes_no_impedance() -> None:
    for kind in (OverlayKind.TORQUE, OverlayKind.WRENCH, OverlayKind.JOINT_POSITION):
        control = CARTESIAN_IMPEDANCE if kind is OverlayKind.WRENCH else JOINT_IMPEDANCE
        fri = FriSettings(peer=PEER, overlay=kind, control=control)
        with pytest.raises(ConfigurationError, match="needs a robot side that takes torques"):
            Bench(fri=fri)


# What the client is told


@pytest.mark.parametrize(
    ("kind", "capture"),
    [
        (OverlayKind.JOINT_POSITION, "fri-2.7-joint-sine-5ms"),
        (OverlayKind.TORQUE, "fri-2.7-torque-sine-2ms"),
        (OverlayKind.WRENCH, "fri-2.7-wrench-sine-2ms"),
        (OverlayKind.CARTESIAN_POSE, "fri-2.7-cartesian-5ms"),
    ],
)
def test_interpolator_data_have_the_parts_of_the_recorded_ones(kind: OverlayKind, capture: str) -> None:
    codec = FriCodec(Release.V2_7)
    recorded = [
        codec.decode_monitoring(item.payload).ipo
        for item in datagrams(FOLDER / f"{capture}.pcapng")
        if item.from_controller
    ]
    theirs = next(ipo for ipo in recorded if ipo is not None and ipo.tracking_performance == 1.0)
    bench = active(kind)
    bench.keep_messages = True
    bench.run(0.01)
    message = bench.monitoring[-1]
    ours = message.ipo
    assert ours is not None
    assert (ours.client_command_mode, ours.overlay_type, ours.tracking_performance) == theirs[3:]
    assert [part is None for part in ours] == [part is None for part in theirs]
    if ours.pose is not None:
        assert ours.redundancy == Redundancy(0, 0.0)
        assert message.monitor is not None
        assert message.monitor.measured_pose is not None
        assert message.monitor.measured_pose.values == pytest.approx(ours.pose.values, abs=1e-3)


@pytest.mark.parametrize(
    ("kind", "mode"),
    [(OverlayKind.TORQUE, ControlMode.JOINT_IMPEDANCE), (OverlayKind.WRENCH, ControlMode.CARTESIAN_IMPEDANCE)],
)
def test_the_control_mode_is_that_of_the_moment(kind: OverlayKind, mode: ControlMode) -> None:
    bench = overlay(kind)
    bench.keep_messages = True
    bench.run_until(SessionState.COMMANDING_ACTIVE)
    bench.run(0.01)
    told = [message.robot.control_mode for message in bench.monitoring if message.robot is not None]
    assert told[0] is not None
    assert ControlMode(told[0]) is ControlMode.POSITION
    assert told[-1] == mode


# What they do to the arm


@pytest.mark.parametrize("stiffness_nm_rad", [500.0, 2000.0])
def test_a_torque_deflects_its_axis_by_its_share_of_the_stiffness(stiffness_nm_rad: float) -> None:
    bench = active(OverlayKind.TORQUE, control=JointImpedanceControlMode(stiffness_nm_rad=(stiffness_nm_rad,) * 7))
    before = measured(bench)
    lay(bench, lambda message: CommandData(hold(message), torque=(0, 5.0, 0, 0, 0, 0, 0)))
    bench.run(2.0)
    off = [now - then for now, then in zip(measured(bench), before, strict=True)]
    assert off[1] == pytest.approx(5.0 / stiffness_nm_rad, rel=0.05)
    assert max(abs(value) for axis, value in enumerate(off) if axis != 1) < 0.1 * off[1]
    assert bench.reasons() == []


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_force_deflects_the_flange_along_its_own_axis(place: int) -> None:
    bench = active(OverlayKind.WRENCH)
    before = measured(bench)
    force = tuple(20.0 if index == place else 0.0 for index in range(6))
    lay(bench, lambda message: CommandData(hold(message), wrench=force))
    bench.run(2.0)
    off_mm = [1e3 * value for value in moved(bench, before).position_m]
    assert off_mm[place] == pytest.approx(10.0, rel=0.06)
    assert max(abs(value) for index, value in enumerate(off_mm) if index != place) < 0.8
    assert bench.reasons() == []


@pytest.mark.parametrize("place", [3, 4, 5])
def test_moments_are_about_a_b_and_c(place: int) -> None:
    """2 Nm against 200 Nm/rad: A turns about z, B about y, C about x."""
    bench = active(OverlayKind.WRENCH)
    before = measured(bench)
    moment = tuple(2.0 if index == place else 0.0 for index in range(6))
    lay(bench, lambda message: CommandData(hold(message), wrench=moment))
    bench.run(2.0)
    turned = moved(bench, before).abc_rad()
    assert turned[place - 3] == pytest.approx(0.01, rel=0.1)
    assert max(abs(value) for index, value in enumerate(turned) if index != place - 3) < 2e-3


@pytest.mark.parametrize(
    ("control", "within_m"), [(PositionControlMode(), 3e-4), (JOINT_IMPEDANCE, 2e-3), (CARTESIAN_IMPEDANCE, 6e-3)]
)
def test_a_commanded_pose_is_taken_with_e1_as_it_was(control: ControlModeSettings, within_m: float) -> None:
    """The set point exactly; the arm as near as its springs against its dry friction take it."""
    bench = active(OverlayKind.CARTESIAN_POSE, control=control)
    before = measured(bench)
    told = bench.controller.motion.set_point.position_rad
    step = iter(range(10_000))

    def up(message: MonitoringMessage) -> CommandData:
        x, y, z, *turn = hold_pose(message)
        return pose((x, y, z + 30.0 * min(1.0, next(step) / 1000), *turn))

    lay(bench, up)
    bench.run(2.0)
    arm, set_point = kinematics(bench), bench.controller.motion.set_point.position_rad
    start, end = arm.forward(told), arm.forward(set_point)
    assert end.position_m == pytest.approx((start.x_m, start.y_m, start.z_m + 0.03), abs=1e-9)
    assert end.angle_rad(start) < 1e-9
    assert set_point[2] == told[2]
    assert arm.forward(measured(bench)).z_m - arm.forward(before).z_m == pytest.approx(0.03, abs=within_m)
    assert bench.reasons() == []


def test_e1_turns_the_elbow_and_leaves_the_flange() -> None:
    bench = active(OverlayKind.CARTESIAN_POSE)
    before = measured(bench)
    step = iter(range(10_000))
    lay(bench, lambda message: pose(hold_pose(message), e1_rad=0.2 * min(1.0, next(step) / 1000)))
    bench.run(2.0)
    assert measured(bench)[2] == pytest.approx(0.2, abs=1e-3)
    assert moved(bench, before).distance_m(Pose(0.0, 0.0, 0.0)) < 3e-4
    assert bench.reasons() == []


def test_a_pose_beyond_a_border_of_branches_is_followed_into_the_next() -> None:
    """A6 goes through 0 in a straight line; that is another branch, and no axis but A6 has to move far."""
    description = load_description("lbr-iiwa-14-r820")
    arm = SrsKinematics(load_pinocchio(description.name), description.limits)
    present: Seven = (0.1, 0.5, 0.2, 0.9, 0.3, 0.01, -0.2)
    beyond: Seven = (0.1, 0.5, 0.2, 0.9, 0.3, -0.01, -0.2)
    found = axes_of(PoseTarget(arm.forward(beyond), None), arm, present)
    assert arm.status_of(present) != arm.status_of(beyond)
    assert largest_change_rad(seven(found), beyond) < 1e-9  # type: ignore[arg-type]  # no refusal, or this fails


# What the client has to mirror


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda v: pose((v[0] + 1.2, *v[1:])), "the pose of the answers is 1.20 mm off the interpolator's; 1 mm"),
        (
            lambda v: pose(turned(v, 2e-3)),
            "the orientation of the answers is 0.0020 rad off the interpolator's; 0.001 rad are allowed",
        ),
        (lambda v: pose(v, 2e-3), "the E1 of the answers is 0.0020 rad off the interpolator's"),
        (lambda _: CommandData(), "the command has no Cartesian pose"),
    ],
)
def test_a_pose_that_is_not_mirrored_keeps_it_waiting(change: Callable[[Vector], CommandData], sentence: str) -> None:
    bench = overlay(OverlayKind.CARTESIAN_POSE)
    lay(bench, lambda message: change(hold_pose(message)), until=SessionState.COMMANDING_WAIT)
    bench.run_until(SessionState.COMMANDING_WAIT)
    bench.run(0.5)
    assert bench.state is SessionState.COMMANDING_WAIT
    assert any(sentence in str(event) for event in bench.events if isinstance(event, TransitionRefused))


def test_a_pose_within_the_tolerance_is_mirrored() -> None:
    bench = overlay(OverlayKind.CARTESIAN_POSE)

    def near(message: MonitoringMessage) -> CommandData:
        x, *rest = turned(hold_pose(message), 5e-4)
        return pose((x + 0.5, *rest), 5e-4)

    lay(bench, near, until=SessionState.COMMANDING_WAIT)
    bench.run_until(SessionState.COMMANDING_ACTIVE)


def turned(values: Vector, angle_rad: float) -> Vector:
    """The pose turned about its own z."""
    x, y, z, *quaternion = values
    w, a, b, c = quaternion
    turn = Pose.from_quaternion((x, y, z), (w, a, b, c)) @ Pose.from_abc_rad((0.0, 0.0, 0.0), angle_rad, 0.0, 0.0)
    return (x, y, z, *turn.quaternion_wxyz())


# What is refused, in words


def torques(value: float, axis: int = 1) -> Vector:
    return tuple(value if index == axis else 0.0 for index in range(7))


@pytest.mark.parametrize(
    ("kind", "change", "outcome", "sentence"),
    [
        (
            OverlayKind.TORQUE,
            lambda m: CommandData(hold(m), torque=torques(-320.5)),
            Outcome.TORQUE_LIMIT,
            "A2 is to get -320.5 Nm more, its limit is 320 Nm",
        ),
        (
            OverlayKind.TORQUE,
            lambda m: CommandData(hold(m), torque=torques(math.nan, 6)),
            Outcome.NOT_FINITE,
            "A7 is nan (torques)",
        ),
        (
            OverlayKind.TORQUE,
            lambda m: CommandData(hold(m), torque=(0.0,) * 6),
            Outcome.SHAPE,
            "6 torques, 7 are needed",
        ),
        (
            OverlayKind.TORQUE,
            lambda m: CommandData(hold(m), wrench=(0.0,) * 6),
            Outcome.NOT_ALLOWED,
            "the command carries a wrench; the running overlay takes joint positions and torques",
        ),
        (
            OverlayKind.WRENCH,
            lambda m: CommandData(hold(m), wrench=(0.0, 0.0, MAX_WRENCH[2] + 1, 0.0, 0.0, 0.0)),
            Outcome.TORQUE_LIMIT,
            "Fz is +201.0 N, 200 N are allowed",
        ),
        (
            OverlayKind.WRENCH,
            lambda m: CommandData(hold(m), wrench=(0.0, 0.0, 0.0, 0.0, -41.0, 0.0)),
            Outcome.TORQUE_LIMIT,
            "the moment about B is -41.0 Nm, 40 Nm are allowed",
        ),
        (
            OverlayKind.WRENCH,
            lambda m: CommandData(hold(m), wrench=(math.inf, 0.0, 0.0, 0.0, 0.0, 0.0)),
            Outcome.NOT_FINITE,
            "Fx is inf",
        ),
        (
            OverlayKind.WRENCH,
            lambda m: CommandData(hold(m), torque=(0.0,) * 7),
            Outcome.NOT_ALLOWED,
            "the command carries torques; the running overlay takes joint positions and a wrench",
        ),
        (
            OverlayKind.CARTESIAN_POSE,
            lambda m: pose((*hold_pose(m)[:3], 1.002, 0.0, 0.0, 0.0)),
            Outcome.SHAPE,
            "the quaternion of the pose has the length 1.0020",
        ),
        (
            OverlayKind.CARTESIAN_POSE,
            lambda m: pose((math.nan, *hold_pose(m)[1:])),
            Outcome.NOT_FINITE,
            "tx is nan",
        ),
        (OverlayKind.CARTESIAN_POSE, lambda m: pose(hold_pose(m), math.inf), Outcome.NOT_FINITE, "E1 is inf"),
        (
            OverlayKind.CARTESIAN_POSE,
            lambda m: pose(hold_pose(m))._replace(redundancy=Redundancy(2, 0.0)),
            Outcome.NOT_ALLOWED,
            "redundancy strategy 2; 0 (E1) or 4 (none) are taken",
        ),
        (
            OverlayKind.CARTESIAN_POSE,
            lambda m: pose((2000.0, *hold_pose(m)[1:])),
            Outcome.UNREACHABLE,
            "is unreachable: the wrist centre is",
        ),
        (
            OverlayKind.CARTESIAN_POSE,
            lambda m: pose(hold_pose(m), 3.1),
            Outcome.UNREACHABLE,
            "is outside its limits: A3 at 3.1 rad",
        ),
        (
            OverlayKind.CARTESIAN_POSE,
            lambda m: pose((hold_pose(m)[0] + 20.0, *hold_pose(m)[1:])),
            Outcome.AXIS_VELOCITY,
            "rad/s; its limit is",
        ),
        (
            OverlayKind.CARTESIAN_POSE,
            lambda m: CommandData(position=(0.0,) * 7, pose=m.ipo.pose if m.ipo else None),
            Outcome.NOT_ALLOWED,
            "the command carries joint positions; the running overlay takes a Cartesian pose",
        ),
    ],
)
def test_an_illegal_command_ends_the_motion_in_words(
    kind: OverlayKind, change: Lay, outcome: Outcome, sentence: str
) -> None:
    bench = active(kind)
    before = measured(bench)
    lay(bench, change)
    bench.run(0.1)
    assert bench.dropped(outcome) == 1
    (stop,) = bench.controller.stops
    assert sentence in str(stop)
    assert f"command out of bounds ({outcome.value})" in str(stop)
    assert largest_change_rad(measured(bench), before) < 0.01


def test_a_pose_of_six_numbers_is_none() -> None:
    refusal = cartesian_pose(pose((0.0,) * 6))
    assert isinstance(refusal, Refusal)
    assert (refusal.outcome, refusal.detail) == (Outcome.SHAPE, "6 numbers of a pose, 7 are needed")


@pytest.mark.parametrize("kind", [OverlayKind.TORQUE, OverlayKind.WRENCH])
def test_torques_and_wrenches_do_not_excuse_a_position_out_of_bounds(kind: OverlayKind) -> None:
    bench = active(kind)
    lay(bench, lambda message: CommandData((hold(message)[0] + 0.2, *hold(message)[1:])))
    bench.run(0.1)
    assert bench.dropped(Outcome.AXIS_VELOCITY) == 1


NUMBERS = st.one_of(
    st.floats(-2.0, 2.0), st.floats(), st.sampled_from([0.0, -0.0, 1.0, 1e308, -1e308, 5e-324, math.nan, math.inf])
)


def some(least: int, most: int) -> st.SearchStrategy[Vector | None]:
    """A vector of so many numbers, or none."""
    return st.one_of(st.none(), st.lists(NUMBERS, min_size=least, max_size=most).map(tuple))


@pytest.mark.parametrize("kind", [OverlayKind.TORQUE, OverlayKind.WRENCH, OverlayKind.CARTESIAN_POSE])
@settings(max_examples=cases(20), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_command_raises_or_leads_out_of_bounds(kind: OverlayKind, data: st.DataObject) -> None:
    """Invariant: whatever a client commands, the core raises nothing and what is added stays within its limits."""
    bench = active(kind)
    limits = bench.description.limits
    for _ in range(data.draw(st.integers(1, 6))):
        values = data.draw(some(7, 7))
        command = CommandData(
            position=data.draw(some(6, 8)) if kind is OverlayKind.CARTESIAN_POSE else None,
            torque=data.draw(some(6, 8)),
            wrench=data.draw(some(5, 7)),
            pose=None if values is None else Transformation("", values),
            redundancy=data.draw(
                st.one_of(st.none(), st.builds(Redundancy, st.sampled_from([0, 4]), st.one_of(st.just(0.0), NUMBERS)))
            ),
        )
        if kind is not OverlayKind.CARTESIAN_POSE:
            command = command._replace(pose=None, redundancy=None)
        lay(bench, lambda m, c=command: c if kind is OverlayKind.CARTESIAN_POSE else c._replace(position=hold(m)))  # type: ignore[misc]
        bench.run(0.003)
        torque_nm, wrench = added(bench)
        assert all(abs(value) <= most for value, most in zip(torque_nm, limits.torque_nm, strict=True))
        assert all(abs(value) <= most for value, most in zip(wrench, MAX_WRENCH, strict=True))
        told = bench.controller.motion.set_point.position_rad
        ends = zip(limits.position_min_rad, told, limits.position_max_rad, strict=True)
        assert all(low <= value <= high for low, value, high in ends)


# What is added does not stay


def added(bench: Bench) -> tuple[Vector, Vector]:
    """What the overlay adds now."""
    return bench.controller.motion.overlay_torque_nm, bench.controller.motion.overlay_wrench


def push_with(kind: OverlayKind) -> Lay:
    """Five newtons or newton metres."""
    if kind is OverlayKind.TORQUE:
        return lambda message: CommandData(hold(message), torque=torques(5.0))
    return lambda message: CommandData(hold(message), wrench=(5.0, 0.0, 0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("kind", [OverlayKind.TORQUE, OverlayKind.WRENCH])
def test_an_answer_without_torque_or_wrench_adds_none(kind: OverlayKind) -> None:
    bench = active(kind)
    lay(bench, push_with(kind))
    bench.run(0.1)
    assert any(map(any, added(bench)))
    lay(bench, lambda message: CommandData(hold(message)))
    bench.run(0.005)
    assert added(bench) == (STILL, NO_WRENCH)
    assert bench.state is SessionState.COMMANDING_ACTIVE


@pytest.mark.parametrize("kind", [OverlayKind.TORQUE, OverlayKind.WRENCH])
def test_an_answer_that_commands_nothing_adds_none_and_may_come_until_the_watchdog(kind: OverlayKind) -> None:
    bench = active(kind)
    lay(bench, push_with(kind))
    bench.run(0.1)
    lay(bench, lambda _: CommandData())
    bench.run(0.005)
    assert added(bench) == (STILL, NO_WRENCH)
    assert bench.state is SessionState.COMMANDING_ACTIVE
    bench.run(0.06)
    assert bench.state is not SessionState.COMMANDING_ACTIVE


@pytest.mark.parametrize("kind", [OverlayKind.TORQUE, OverlayKind.WRENCH])
def test_silence_keeps_the_last_one_until_the_watchdog_ends_it(kind: OverlayKind) -> None:
    bench = active(kind)
    lay(bench, push_with(kind))
    bench.run(0.1)
    bench.client.answers = lambda _: False
    bench.run(0.03)
    assert any(map(any, added(bench)))
    bench.run(0.03)
    assert added(bench) == (STILL, NO_WRENCH)
    assert "client lost" in bench.reasons()[0]
    bench.run(0.5)
    assert bench.controller.motion.control.kind is ControlMode.POSITION
    assert added(bench) == (STILL, NO_WRENCH)


# Before an arm yields, its load is looked at


def pushed(bench: Bench, force_n: float, duration_s: float) -> None:
    """Somebody pushes the flange down."""
    bench.backend.push(Push(7, (0.0, 0.0, -force_n), (0.0, 0.0, 0.0), duration_s))


@pytest.mark.parametrize("kind", [OverlayKind.TORQUE, OverlayKind.WRENCH])
def test_a_load_nobody_told_keeps_the_overlay_from_beginning(kind: OverlayKind) -> None:
    bench = overlay(kind, backend=partial(MujocoBackend, load=Load(2.0)))
    bench.run(4.0)
    assert bench.state is SessionState.MONITORING_READY
    told = [str(event) for event in bench.events if isinstance(event, TransitionRefused)]
    said = [text for text in told if "does not explain the torques" in text]
    assert len(said) == 1
    assert "the load of 0 kg could not be validated for impedance control" in said[0]


def test_it_is_looked_at_again_and_then_no_more() -> None:
    bench = overlay(OverlayKind.TORQUE)
    pushed(bench, 50.0, 3.0)
    bench.run(2.8)
    assert bench.state is SessionState.MONITORING_READY
    assert bench.controller.fri is not None
    assert bench.controller.fri.quality >= Quality.GOOD
    bench.run_until(SessionState.COMMANDING_ACTIVE, at_most_s=1.0)
    bench.client.answers = lambda _: False
    bench.run(0.1)
    bench.client.answers = lambda _: True
    pushed(bench, 50.0, 10.0)
    bench.run_until(SessionState.COMMANDING_ACTIVE, at_most_s=5.0)


def test_position_control_asks_for_no_load() -> None:
    bench = overlay(OverlayKind.JOINT_POSITION, backend=partial(MujocoBackend, load=Load(2.0)))
    bench.run_until(SessionState.COMMANDING_ACTIVE)
