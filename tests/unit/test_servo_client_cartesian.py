"""Frames and poses in the client: destinations, readers, the manual's four texts, against the stand-in controller."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from hil.client.servo import (
    PTP,
    AsyncDirectServo,
    AsyncPTP,
    AsyncServoClient,
    AsyncSmartServo,
    CommandInvalidException,
    DirectServo,
    EndpointError,
    ErrorReason,
    Frame,
    FrameKind,
    FrameTree,
    IllegalArgumentException,
    Pose,
    Role,
    ServoClient,
    SmartServo,
    SmartServoRuntime,
    UsageError,
)
from hil.client.servo import _operations as operations
from hil.values.frames import MAX_FRAMES
from hil.values.servo import (
    Command,
    DescribeFrame,
    LocateFlange,
    RequestDone,
    SetDestination,
    StartMotion,
    ValidateLoad,
)
from tests.support.servo_client import VirtualShell, connected
from tests.support.servo_controller import FIRST, FRAMES, START, forward
from tests.support.servo_served import Served, served

THERE = Pose.from_abc_deg((0.4, -0.3, 0.5), 20, 40, -100)
ELSEWHERE = Pose.from_abc_deg((0.1, 0.2, -0.1), -50, 10, 170)
FRAME_TEXT = "frameOnFlange is not frame below or equal to the flange of this robot"
BASE_TEXT = "base is not static relative to the base of this robot"
NAN = math.nan


def assert_close(one: Pose | None, other: Pose, *, within: float = 1e-12) -> None:
    assert one is not None
    assert one.distance_m(other) < within
    assert one.angle_rad(other) < within


@pytest.fixture
def controller() -> Iterator[Served]:
    with served() as stand_in:
        yield stand_in


@pytest.fixture
def client(controller: Served) -> Iterator[ServoClient]:
    with ServoClient(controller.address, name="test") as robot:
        yield robot


def smart(client: ServoClient, frame: str | Frame = "flange") -> SmartServoRuntime:
    """Start a SmartServo and return its runtime."""
    motion = SmartServo()
    client.move_async(motion, frame)
    return motion.get_runtime()


def until_reached(runtime: SmartServoRuntime) -> None:
    while not runtime.is_destination_reached():
        runtime.update_with_realtime_system()


def questions(controller: Served) -> list[DescribeFrame | LocateFlange | ValidateLoad]:
    """What was asked since the frames were fetched."""
    return controller.do(lambda stand_in: stand_in.questions[len(FRAMES) :])


# The tree


@pytest.mark.parametrize("role", Role)
def test_the_frames_of_the_robot_come_with_the_session(controller: Served, role: Role) -> None:
    with ServoClient(controller.address, role=role) as robot:
        frames = robot.frames
    assert isinstance(frames, FrameTree)
    assert list(frames) == list(FRAMES)
    for name, frame in FRAMES.items():
        got = frames[name]
        assert got._replace(in_parent=frame.in_parent) == frame
        assert_close(got.in_parent, frame.in_parent)
    assert [place.place for place in controller.controller.questions] == list(range(len(FRAMES)))  # type: ignore[union-attr]


def tree_of(count: int) -> FrameTree:
    return FrameTree(
        Frame(f"tip {place}", FrameKind.TOOL_FRAME, "flange", Pose(0.001 * place, 0.0, 0.0))
        for place in range(count - 3)
    )


@pytest.mark.parametrize("count", [3, 4, 9, 10, MAX_FRAMES])
def test_a_tree_of_any_size_is_fetched_six_in_a_packet(count: int) -> None:
    shell = connected()
    shell.controller.frames = tree_of(count)
    sizes: list[int] = []
    shell.controller.on_command = lambda command: sizes.append(len(command.requests))
    assert dict(shell.run(operations.fetch_frames(shell.session))) == dict(tree_of(count))
    assert max(sizes) == min(6, max(3, count - 3))
    assert len(shell.controller.questions) == count


def test_a_controller_that_describes_no_frames_is_given_up() -> None:
    shell = connected()
    shell.controller.answers_commands = False
    shell.controller.pause()
    with pytest.raises(EndpointError, match="did not describe the frames of the robot within 10 s, though it sends"):
        shell.run(operations.fetch_frames(shell.session))


def test_frames_that_are_no_tree_are_refused_in_words() -> None:
    shell = connected()
    frames = [*FRAMES.values(), FRAMES["tip"]]

    class Twice(FrameTree):
        def values(self) -> Any:
            return frames

    shell.controller.frames = Twice()
    with pytest.raises(
        EndpointError, match="the controller has frames that are no tree: two frames have the name 'tip'"
    ):
        shell.run(operations.fetch_frames(shell.session))


def test_a_client_that_is_not_open_has_no_frames() -> None:
    with pytest.raises(UsageError, match="the servo client is not open"):
        _ = ServoClient().frames


# Destinations


@pytest.mark.parametrize("kind", [PTP, SmartServo, DirectServo])
@pytest.mark.parametrize("frame", ["flange", "gripper", "tip", FRAMES["gripper"]], ids=str)
def test_a_motion_takes_the_moved_frame_to_a_pose(
    client: ServoClient, controller: Served, kind: type[PTP | SmartServo | DirectServo], frame: str | Frame
) -> None:
    if isinstance(frame, Frame):
        frame = client.frames[frame.name]
    client.move_async(kind(THERE).set_joint_velocity_rel(0.5), frame)
    controller.until(lambda stand_in: stand_in.position != START)
    start = controller.do(lambda stand_in: stand_in.taken[0])
    assert isinstance(start, StartMotion)
    assert start.destination is None
    name = frame if isinstance(frame, str) else frame.name
    assert_close(start.flange_in_base, THERE @ FRAMES.in_flange(name).inverse())
    assert_close(forward(controller.do(lambda stand_in: stand_in.position)) @ FRAMES.in_flange(name), THERE)


@pytest.mark.parametrize("frame", ["flange", "tip", "side"])
@pytest.mark.parametrize("reference", [None, "base", "world", "table", "hole"])
def test_a_destination_is_a_pose_of_the_moved_frame_in_a_frame_that_stands_still(
    client: ServoClient, controller: Served, frame: str, reference: str | None
) -> None:
    runtime = smart(client, frame)
    at_ns = runtime.set_destination(THERE) if reference is None else runtime.set_destination(THERE, reference)
    assert runtime.get_time_stamp_of_set_realtime_destination() == at_ns
    assert runtime.get_time_stamp_of_update() >= at_ns
    in_base = FRAMES.in_base(reference or "base") @ THERE
    asked = controller.do(lambda stand_in: stand_in.taken[-1])
    assert isinstance(asked, SetDestination)
    assert asked[:4] == (FIRST + 1, FIRST, None, None)
    assert_close(asked.flange_in_base, in_base @ FRAMES.in_flange(frame).inverse())
    until_reached(runtime)
    assert_close(runtime.get_current_cartesian_position(frame), in_base)
    assert_close(runtime.get_current_cartesian_position(frame, reference or "base"), THERE)
    assert_close(forward(runtime.get_current_joint_destination()) @ FRAMES.in_flange(frame), in_base)
    assert_close(runtime.get_current_cartesian_destination(frame, reference or "base"), THERE)
    assert questions(controller) == []


def test_a_ptp_to_a_pose_is_waited_for(client: ServoClient) -> None:
    client.move(PTP(THERE), frame="tip")
    assert_close(client.read_state().flange_in_base @ FRAMES.in_flange("tip"), THERE)


def test_a_pose_out_of_reach_ends_the_motion_and_not_the_session(client: ServoClient) -> None:
    runtime = smart(client)
    with pytest.raises(CommandInvalidException) as caught:
        runtime.set_destination(Pose(2.5, 0.0, 0.0))
    assert (caught.value.error_reason, caught.value.detail) == (ErrorReason.POSITIONAL_LIMITS, "beyond 2 m")
    smart(client).set_destination(THERE)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((THERE, None), "base is null"),
        ((THERE, "tip"), BASE_TEXT),
        ((THERE, "flange"), BASE_TEXT),
        ((THERE, FRAMES["flange"]), BASE_TEXT),
        ((THERE, "tabel"), BASE_TEXT),
        ((THERE, FRAMES["table"]._replace(name="desk")), BASE_TEXT),
        ((THERE, [0.1] * 7), "a Pose is followed by the frame it is in, or nothing, not by .* a target velocity needs"),
        ((THERE, 7), "a Pose is followed by the frame it is in, or nothing, not by 7;"),
        ((THERE, ELSEWHERE), "a Pose is followed by the frame it is in, or nothing, not by Pose"),
        ((START, "table"), "a destination in axis positions has no reference frame"),
        ((START, FRAMES["table"]), "a destination in axis positions has no reference frame"),
        ((START, ["x"]), "target velocity is"),
        (("table",), "destination is 'table'; a sequence of seven numbers"),
        ((None,), "destination is None; a sequence of seven numbers"),
        ((FRAMES["table"],), "destination is Frame"),
        (
            (Pose(NAN, 0.0, 0.0),),
            "destination is Pose.* a Pose of finite numbers in m with a rotation matrix is needed",
        ),
        ((Pose(0.0, math.inf, 0.0),), "a Pose of finite numbers"),
        ((Pose(0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, NAN)),), "a Pose of finite numbers"),
        ((Pose(0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0)),), "a Pose of finite numbers"),
        ((Pose(0.0, 0.0, 0.0, (0.5, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)),), "a Pose of finite numbers"),
        ((Pose(0.0, 0.0, 0.0, (1.0, 0.0, 0.0)),), "a Pose of finite numbers"),  # type: ignore[arg-type]
        ((Pose("x", 0.0, 0.0),), "a Pose of finite numbers"),  # type: ignore[arg-type]
    ],
)
def test_destinations_that_are_none_are_refused_at_the_call(
    client: ServoClient, controller: Served, arguments: tuple[Any, ...], words: str
) -> None:
    runtime = smart(client)
    with pytest.raises(IllegalArgumentException, match=words):
        runtime.set_destination(*arguments)
    assert len(controller.do(lambda stand_in: stand_in.taken)) == 1
    runtime.set_destination(START, None)
    runtime.set_destination(START)


def test_a_direct_servo_takes_a_pose_and_no_target_velocity(client: ServoClient) -> None:
    motion = DirectServo()
    client.move_async(motion)
    runtime = motion.get_runtime()
    runtime.set_destination(THERE, "table")
    with pytest.raises(IllegalArgumentException, match="a DirectServo takes no target velocity"):
        runtime.set_destination(START, [0.1] * 7)


@pytest.mark.parametrize("kind", [PTP, SmartServo, DirectServo, AsyncPTP, AsyncSmartServo, AsyncDirectServo])
def test_a_motion_to_what_is_no_pose_is_refused(kind: Callable[[Any], object]) -> None:
    with pytest.raises(IllegalArgumentException, match=r"destination is Pose.* a Pose of finite numbers in m"):
        kind(Pose(0.0, 0.0, NAN))


# Readers, and the manual's texts


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        (None, "frameOnFlange is null"),
        ("table", FRAME_TEXT),
        ("base", FRAME_TEXT),
        ("world", FRAME_TEXT),
        ("tool", FRAME_TEXT),
        (FRAMES["hole"], FRAME_TEXT),
        (FRAMES["tip"]._replace(in_parent=THERE), FRAME_TEXT),
        (7, FRAME_TEXT),
    ],
)
def test_a_frame_that_is_not_on_the_flange_is_refused_in_the_manuals_words(
    client: ServoClient, controller: Served, frame: Any, words: str
) -> None:
    runtime = smart(client)
    calls: list[Callable[[], object]] = [
        lambda: runtime.get_current_cartesian_position(frame),
        lambda: runtime.get_current_cartesian_destination(frame),
        lambda: client.move_async(SmartServo(), frame),
        lambda: client.move(PTP(START), frame=frame),
    ]
    for call in calls:
        with pytest.raises(IllegalArgumentException) as caught:
            call()
        assert str(caught.value) == words
        assert (caught.value.detail == "") is (frame is None)
    assert len(controller.do(lambda stand_in: stand_in.taken)) == 1
    assert questions(controller) == []


@pytest.mark.parametrize(
    ("reference", "words"),
    [(None, "base is null"), ("tip", BASE_TEXT), ("flange", BASE_TEXT), ("tabel", BASE_TEXT)],
)
def test_a_base_that_is_not_static_is_refused_in_the_manuals_words(
    client: ServoClient, controller: Served, reference: Any, words: str
) -> None:
    runtime = smart(client)
    calls: list[Callable[[], object]] = [
        lambda: runtime.get_current_cartesian_position("tip", reference),
        lambda: runtime.get_current_cartesian_destination("tip", reference),
        lambda: runtime.set_destination(THERE, reference),
    ]
    for call in calls:
        with pytest.raises(IllegalArgumentException) as caught:
            call()
        assert str(caught.value) == words
    assert questions(controller) == []


def test_what_is_wrong_with_a_frame_is_in_the_detail(client: ServoClient) -> None:
    runtime = smart(client)
    for frame, words in (
        ("tpi", "this robot has no such frame: unknown frame 'tpi'; valid: world, base, flange, gripper, tip"),
        ("table", "'table' stands still in the base"),
        (3, "3 is neither a Frame nor the name of one"),
        (client.frames["tip"]._replace(parent="flange"), "is not this robot's frame of that name"),
    ):
        with pytest.raises(IllegalArgumentException) as caught:
            runtime.get_current_cartesian_position(frame)  # type: ignore[arg-type]
        assert words in caught.value.detail
        assert caught.value.__notes__ == [caught.value.detail]


def test_readers_read_the_last_update_only(client: ServoClient, controller: Served) -> None:
    runtime = smart(client, "tip")
    while not runtime.is_destination_reached():
        runtime.update_with_realtime_system()
    controller.do(lambda stand_in: setattr(stand_in, "position", (*START[:2], 0.25, *START[3:])))
    assert_close(runtime.get_current_cartesian_position("flange"), forward(START))
    runtime.update_with_realtime_system()
    assert_close(runtime.get_current_cartesian_position("flange"), forward((*START[:2], 0.25, *START[3:])))


def test_the_destination_of_axis_positions_is_asked_for_once(client: ServoClient, controller: Served) -> None:
    runtime = smart(client, "tip")
    axes = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
    for _ in range(3):
        assert_close(runtime.get_current_cartesian_destination("flange"), forward(START))
    runtime.set_destination(axes)
    for frame in ("flange", "tip"):
        expected = forward(axes) @ FRAMES.in_flange(frame)
        assert_close(runtime.get_current_cartesian_destination(frame), expected)
        in_hole = FRAMES.in_base("hole").inverse() @ expected
        assert_close(runtime.get_current_cartesian_destination(frame, "hole"), in_hole)
    runtime.set_destination(THERE)
    assert_close(runtime.get_current_cartesian_destination("tip"), THERE)
    assert [asked.position for asked in questions(controller) if isinstance(asked, LocateFlange)] == [START, axes]


def test_a_motion_to_a_pose_knows_its_destination(client: ServoClient, controller: Served) -> None:
    motion = SmartServo(THERE)
    client.move_async(motion, "side")
    runtime = motion.get_runtime()
    assert_close(runtime.get_current_cartesian_destination("side"), THERE)
    assert questions(controller) == []


def test_a_motion_without_a_destination_has_no_cartesian_one(client: ServoClient, controller: Served) -> None:
    runtime = smart(client)
    runtime._update = runtime._update._replace(motion=runtime._update.motion._replace(destination=()))
    assert runtime.get_current_cartesian_destination("tip") is None
    with pytest.raises(IllegalArgumentException, match=FRAME_TEXT):
        runtime.get_current_cartesian_destination("base")
    assert questions(controller) == []


def test_an_observer_may_ask(controller: Served) -> None:
    with ServoClient(controller.address, role=Role.OBSERVER) as watcher:
        assert_close(watcher.read_state().flange_in_base, forward(START))
        assert_close(watcher._run(operations.locate_flange(watcher.session, START)), forward(START))


def test_the_text_of_a_runtime_has_the_pose_of_the_flange(client: ServoClient) -> None:
    runtime = smart(client)
    runtime.set_detailed_output(2)
    [line] = [line for line in str(runtime).splitlines() if line.startswith("flange ")]
    assert line == (
        "flange      [0.000000, 0.500000, 0.000000] m, A B C [0.700000, 0.000000, 1.500000] rad in the robot base"
    )


def test_an_answer_that_was_lost_is_said_to_be() -> None:
    shell = connected()
    asking = operations.locate_flange(shell.session, START)
    next(asking)
    [pending] = shell.session.requests._unresolved.values()
    pending.resolve(RequestDone(1, 1, 0))
    with pytest.raises(EndpointError, match="did not say where the flange is"):
        asking.send(True)


# The same in asyncio


async def test_the_asyncio_client_does_the_same(controller: Served) -> None:
    async with AsyncServoClient(controller.address) as robot:
        assert list(robot.frames) == list(FRAMES)
        await robot.move(AsyncPTP(ELSEWHERE), frame="tip")
        assert_close(robot.read_state().flange_in_base @ FRAMES.in_flange("tip"), ELSEWHERE)
        for motion in (AsyncSmartServo(), AsyncDirectServo()):
            await robot.move_async(motion, "tip")
            runtime = await motion.get_runtime()
            at_ns = await runtime.set_destination(THERE, "hole")
            assert runtime.get_time_stamp_of_set_realtime_destination() == at_ns
            assert_close(await runtime.get_current_cartesian_destination("tip", "hole"), THERE)
            assert questions(controller) == []
            while not runtime.is_destination_reached():
                await runtime.update_with_realtime_system()
            assert_close(runtime.get_current_cartesian_position("tip", "hole"), THERE)
            await runtime.set_destination(START)
            for _ in range(2):
                assert_close(await runtime.get_current_cartesian_destination("flange"), forward(START))
            assert len(questions(controller)) == 1
            controller.do(lambda stand_in: stand_in.questions.pop())
            with pytest.raises(IllegalArgumentException, match="base is null"):
                await runtime.set_destination(THERE, None)  # type: ignore[arg-type]
            with pytest.raises(IllegalArgumentException, match="base is null"):
                await runtime.get_current_cartesian_destination("tip", None)  # type: ignore[arg-type]
            await runtime.stop_motion()
        with pytest.raises(IllegalArgumentException, match="frameOnFlange is null"):
            await robot.move_async(AsyncSmartServo(), None)  # type: ignore[arg-type]


def test_a_cartesian_destination_costs_one_packet() -> None:
    """In virtual time: one request in one command, the answer in the state that follows."""
    shell: VirtualShell = connected()
    shell.run(operations.fetch_frames(shell.session))
    motion = shell.start()
    record, shown = shell.run(operations.transferred(motion.record, timeout_s=1.0))
    commands: list[Command] = []
    shell.controller.on_command = commands.append
    runtime = SmartServoRuntime(None, record, shown)  # type: ignore[arg-type]
    shell.run(runtime._setting_destination(THERE, "table"))
    assert [len(command.requests) for command in commands] == [1]
