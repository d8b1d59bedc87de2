"""The client's operations in virtual time, and over a channel that loses, repeats and reorders a third."""

from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.client.servo import (
    CommandInvalidException,
    EndpointError,
    IllegalStateException,
    Pose,
    SessionEnded,
    SmartServo,
    SmartServoRuntime,
)
from hil.client.servo import _operations as operations
from hil.client.servo._frames import moved_frame
from hil.client.servo._operations import Operation, Wait
from hil.values.servo import GoalReached, MotionEnded, RequestError, SetDestination
from tests.support.cases import cases
from tests.support.servo_client import Channel, VirtualShell, connected, destination, tell
from tests.support.servo_controller import FRAMES, PAUSED, START, forward

# Operations


def test_an_ended_session_ends_every_call_with_its_reason() -> None:
    shell = connected()
    motion = shell.start()
    record = motion.record
    assert record is not None
    updating = operations.update(record)
    wait = next(updating)
    shell.controller.end("silent for 400 ms, the watchdog allows 300 ms")
    with pytest.raises(SessionEnded, match="is over: silent for 400 ms") as caught:
        updating.send(shell.wait(wait))
    assert caught.value.reason == "silent for 400 ms, the watchdog allows 300 ms"
    for operation in (
        operations.update(record),
        operations.stop(record),
        operations.finished(record, timeout_s=1.0),
        operations.transferred(record, timeout_s=1.0),
        operations.start(shell.session, SmartServo()),
        operations.next_state(shell.session, after=shell.session.states, timeout_s=1.0),
    ):
        with pytest.raises(SessionEnded):
            shell.run(operation)
    assert not motion.started


def test_a_request_that_gets_no_outcome_while_states_come_is_given_up() -> None:
    shell = connected()
    shell.controller.answers_commands = False
    with pytest.raises(EndpointError, match="did not answer a request within 10 s, though it sends states"):
        shell.run(operations.start(shell.session, SmartServo()))
    record = shell.session.motions[1]
    with pytest.raises(EndpointError, match="sent no fresh state of the motion within 10 s"):
        shell.run(operations.update(record))


def test_patience_begins_anew_when_the_operator_starts_again() -> None:
    shell = connected()
    record = shell.start().record
    assert record is not None
    shell.controller.pause()
    shell.until(lambda: shell.session.paused)
    began = shell.ticks
    shell.at[began + 25_000] = shell.controller.resume
    shell.run(operations.change(record, destination(record.number, 0.1)))
    assert 25_000 <= shell.ticks - began < 25_020
    # A pause while a request is on its way, and the controller answers none: given up 10 s after the pause.
    shell.controller.answers_commands = False
    began = shell.ticks
    shell.at[began + 6_000] = shell.controller.pause
    shell.at[began + 20_000] = shell.controller.resume
    with pytest.raises(EndpointError, match="did not answer a request within 10 s, though it sends states"):
        shell.run(operations.change(record, destination(record.number, 0.2)))
    assert 30_000 <= shell.ticks - began < 30_020


@settings(max_examples=cases(30))
@given(seed=st.integers(0, 2**32), stops=st.booleans())
def test_a_pause_over_a_bad_channel_costs_time_and_nothing_else(seed: int, stops: bool) -> None:
    shell = VirtualShell(Channel(seed), Channel(seed + 1))
    shell.connect()
    record = shell.start().record
    assert record is not None
    shell.controller.pause()
    shell.until(lambda: shell.session.paused)
    first = shell.session.ask(destination(record.number, 0.1))
    shell.until(lambda: bool(shell.controller.waiting))
    second = shell.session.ask(destination(record.number, 0.2))
    shell.wait(Wait(lambda: False, 0.2))
    assert [pending.done for pending in (first, second)] == [None, None]
    assert len(shell.controller.waiting) == 1
    if stops:
        assert shell.run(operations.stop(record))
    else:
        shell.controller.resume()
    shell.until(lambda: first.done is not None and second.done is not None)
    assert first.done is not None
    assert second.done is not None
    assert first.done.error == second.done.error == (RequestError.COMMAND_INVALID if stops else RequestError.NONE)
    shell.until(lambda: not shell.session.requests)
    assert shell.session.reports_lost == 0
    assert (shell.controller.operator == PAUSED) is stops


def test_a_motion_that_ended_before_its_report_came_is_told_to_be_over() -> None:
    shell = connected()
    record = shell.start().record
    assert record is not None
    updating = operations.update(record)
    wait = next(updating)
    # Shown without the motion, and without the report of its end, which is still to come.
    state = shell.controller.state()
    tell(shell.session, state._replace(reflected_sequence=100, snapshot=state.snapshot._replace(motions=())))
    assert not wait.until()
    shell.controller.fail("tracking error", "A3 is 0.2 rad behind")
    with pytest.raises(CommandInvalidException) as caught:
        updating.send(shell.wait(wait))
    assert str(caught.value) == "Command is no longer active, because tracking error"
    assert (caught.value.error_reason, caught.value.detail) == ("tracking error", "A3 is 0.2 rad behind")
    assert caught.value.__notes__ == ["A3 is 0.2 rad behind"]


# Loss


@dataclass
class Story:
    """What a run of the script came to: all that must not depend on the channel."""

    done: list[str] = field(default_factory=list)
    goals: list[tuple[int, tuple[float, ...]]] = field(default_factory=list)
    ends: list[tuple[int, str]] = field(default_factory=list)
    taken: list[str] = field(default_factory=list)


def play(shell: VirtualShell, values: list[float], wrong: bool) -> Story:
    """Start a motion, address each value in turn, let the last motion end, or fail, in one of three ways."""
    story = Story()
    shell.connect()
    session = shell.session

    def attempt(what: str, operation: Operation[object]) -> None:
        try:
            result = shell.run(operation)
        except (CommandInvalidException, IllegalStateException) as error:
            story.done.append(f"{what}: {error}")
        else:
            story.done.append(f"{what}: {result if isinstance(result, bool) else 'taken'}")

    motion, second = SmartServo(), SmartServo()
    attempt("start", operations.start(session, motion))
    attempt("start", operations.start(session, second))
    record, waiting = motion.record, second.record
    assert record is not None
    assert waiting is not None
    for value in values:
        goals = sum(isinstance(report, GoalReached) for report in session.taken)
        attempt("set", operations.change(record, destination(record.number, value)))
        shell.until(lambda goals=goals: sum(isinstance(report, GoalReached) for report in session.taken) > goals)  # type: ignore[misc]
        attempt("update", operations.update(record))
    attempt("stop too early", operations.stop(waiting))
    if wrong:
        attempt("wrong", operations.change(record, lambda number: SetDestination(number, record.number, (1.0,))))
    attempt("stop", operations.stop(record))
    attempt("stop again", operations.stop(record))
    attempt("set after the end", operations.change(record, destination(record.number, 0.0)))
    attempt("second", operations.transferred(waiting, timeout_s=10.0))
    attempt("second stops", operations.stop(waiting))
    shell.until(lambda: waiting.ended is not None)
    for report in session.taken:
        if isinstance(report, GoalReached):
            story.goals.append((report.motion, report.position))
        elif isinstance(report, MotionEnded):
            story.ends.append((report.motion, report.reason))
    story.taken = [type(request).__name__ for request in shell.controller.taken]
    return story


@settings(max_examples=cases(80))
@given(
    seed=st.integers(0, 2**32),
    values=st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=6),
    wrong=st.booleans(),
)
def test_loss_repetition_and_reordering_cost_time_and_nothing_else(seed: int, values: list[float], wrong: bool) -> None:
    undisturbed = VirtualShell()
    disturbed = VirtualShell(Channel(seed), Channel(seed + 1))
    # The goal the second motion may or may not reach before it is stopped depends on time: it is left out.
    stories = [play(shell, values, wrong) for shell in (undisturbed, disturbed)]
    for story in stories:
        story.goals = [goal for goal in story.goals if goal[0] == 1][-len(values) :]
    assert stories[0] == stories[1]
    assert disturbed.ticks > undisturbed.ticks
    for shell in (undisturbed, disturbed):
        numbers = [report.number for report in shell.session.taken]
        assert numbers == list(range(1, len(numbers) + 1))
        assert shell.session.reports_lost == 0


@given(seed=st.integers(0, 2**32), count=st.integers(1, 200), each=st.integers(1, 5))
def test_a_burst_of_destinations_over_a_bad_channel_ends_with_the_last_one(seed: int, count: int, each: int) -> None:
    shell = VirtualShell(Channel(seed), Channel(seed + 1))
    shell.connect()
    record = shell.start().record
    assert record is not None
    asked = []
    for place in range(count):
        asked.append(shell.session.ask(destination(record.number, place * 1e-3)))
        if place % each == 0:
            shell.tick()
    shell.until(lambda: asked[-1].done is not None)
    assert all(pending.done is not None for pending in asked)
    shell.wait(Wait(lambda: False, 0.5))
    taken = [request for request in shell.controller.taken if isinstance(request, SetDestination)]
    numbers = [request.number for request in taken]
    assert numbers == sorted(set(numbers))
    assert taken[-1].position == ((count - 1) * 1e-3, *START[1:])
    assert len(taken) + shell.session.requests.superseded >= count
    assert len(shell.session.requests) == 0


POSES = st.builds(
    Pose.from_abc_deg,
    st.tuples(*[st.floats(-0.4, 0.4)] * 3),
    st.floats(-179.0, 179.0),
    st.floats(-89.0, 89.0),
    st.floats(-179.0, 179.0),
)


@settings(max_examples=cases(60))
@given(
    seed=st.integers(0, 2**32),
    poses=st.lists(st.one_of(POSES, st.tuples(*[st.floats(-1.0, 1.0)] * 7)), min_size=1, max_size=6),
    frame=st.sampled_from(["flange", "tip", "side"]),
    reference=st.sampled_from(["base", "world", "table", "hole"]),
)
def test_frames_and_cartesian_destinations_over_a_bad_channel(
    seed: int, poses: list[Pose | tuple[float, ...]], frame: str, reference: str
) -> None:
    """Invariant: whatever the channel loses, the tree is whole, and each destination is the one that was set last."""
    shell = VirtualShell(Channel(seed), Channel(seed + 1))
    shell.connect()
    tree = shell.run(operations.fetch_frames(shell.session))
    assert list(tree) == list(FRAMES)
    assert all(tree[name].in_parent.distance_m(FRAMES[name].in_parent) == 0.0 for name in FRAMES)
    motion = SmartServo()
    shell.run(operations.start(shell.session, motion, moved_frame(tree, frame)))
    runtime = SmartServoRuntime(None, *shell.run(operations.transferred(motion.record, timeout_s=60.0)))  # type: ignore[arg-type]
    base, moved = FRAMES.in_base(reference), FRAMES.in_flange(frame)
    for pose in poses:
        expected = pose if isinstance(pose, Pose) else base.inverse() @ forward(pose) @ moved
        at_ns = shell.run(runtime._setting_destination(pose, reference if isinstance(pose, Pose) else None))
        assert runtime.get_time_stamp_of_set_realtime_destination() == at_ns <= runtime.get_time_stamp_of_update()
        for _ in range(2):
            there = shell.run(runtime._reading_cartesian_destination(frame, reference))
            assert there is not None
            assert there.distance_m(expected) < 1e-12
            assert there.angle_rad(expected) < 1e-12
        while not runtime.is_destination_reached():
            shell.run(runtime._updating())
        measured = runtime.get_current_cartesian_position(frame, reference)
        assert measured.distance_m(expected) < 1e-12
        assert measured.angle_rad(expected) < 1e-12
    asked = [pose for pose in poses if not isinstance(pose, Pose)]
    assert len(shell.controller.questions) <= len(FRAMES) + len(asked)
