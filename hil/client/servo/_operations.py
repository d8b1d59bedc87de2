"""What the calls of a client do, once for both shells: generators that say what they wait for, and touch no clock.

An operation yields a :class:`Wait` and is sent whether it came true in time. Between two yields a shell sends what the
session has to say and takes in what comes. What goes wrong is raised by the operation, so both shells raise the same.
"""

import math
from collections.abc import Callable, Generator
from functools import partial
from typing import Final, NamedTuple, TypeAlias, TypeVar

from hil.client.servo._frames import FLANGE_ITSELF, MovedFrame
from hil.client.servo._requests import Pending
from hil.client.servo.errors import (
    CALLED_PREMATURELY,
    NOT_TRANSFERRED_IN_TIME,
    CommandInvalidException,
    ControllerSilent,
    IllegalArgumentException,
    IllegalStateException,
    SessionEnded,
    SessionRefused,
)
from hil.client.servo.motions import Motion
from hil.client.servo.session import MotionRecord, ServoSession, Update
from hil.values.arm import Push
from hil.values.errors import ConfigurationError, EndpointError
from hil.values.frames import Frame, FrameTree
from hil.values.link import Address
from hil.values.motion import MotionEnd, MotionPhase
from hil.values.pose import Pose
from hil.values.servo import (
    MAX_REQUESTS_IN_PACKET,
    DescribeFrame,
    FlangeLocated,
    FrameDescribed,
    LoadValidated,
    LocateFlange,
    PushArm,
    Request,
    RequestDone,
    RequestError,
    Snapshot,
    StopMotion,
    ValidateLoad,
    Vector,
)

RETRY_S: Final = 0.05
"""Between two hellos."""
ANSWER_S: Final = 10.0
"""How long a request may stay without an outcome while states come, and no pause is on. Loss costs far less, at any
rate worth using."""

_ALWAYS_THERE: Final = 3
"""Frames that every robot has: world, base and flange, in this order."""

_T = TypeVar("_T")


class Wait(NamedTuple):
    """Until ``until`` holds, or ``timeout_s`` seconds have passed (None: for ever)."""

    until: Callable[[], bool]
    timeout_s: float | None


Operation: TypeAlias = Generator[Wait, bool, _T]


def connect(session: ServoSession, *, controller: Address, timeout_s: float) -> Operation[None]:
    """Knock every 50 ms until the session runs; raise an :class:`EndpointError` that says why it does not."""
    for _ in range(max(1, math.ceil(timeout_s / RETRY_S))):
        session.knock()
        yield Wait(lambda: session.running or session.over or session.refused_for_good, RETRY_S)
        if session.running:
            return
        if session.over or session.refused_for_good:
            break
    check(session)
    if session.refusal is not None:
        raise SessionRefused(controller, session.refusal.reason)
    raise ControllerSilent(
        controller,
        timeout_s=timeout_s,
        dropped=session.outcomes,
        offered=session.welcome is not None,
        trouble=session.trouble,
    )


def fetch_frames(session: ServoSession) -> Operation[FrameTree]:
    """Ask for all frames of the robot, six in a packet, and keep them for the session."""
    frames: list[Frame] = []
    of = _ALWAYS_THERE
    while len(frames) < of:
        check(session)
        places = range(len(frames), min(of, len(frames) + MAX_REQUESTS_IN_PACKET))
        asked = [session.ask(partial(_describe, place)) for place in places]
        yield Wait(lambda asked=asked: session.over or all(pending.done for pending in asked), ANSWER_S)  # type: ignore[misc]
        for pending in asked:
            if pending.done is None:
                check(session)
                raise _unanswered("did not describe the frames of the robot")
            yield from _answer(session, pending)
            if not isinstance(pending.answer, FrameDescribed):
                raise _unanswered("did not describe a frame of the robot")
            of = pending.answer.of
            frames.append(pending.answer.frame)
    try:
        session.frames = FrameTree(frames[_ALWAYS_THERE:], base_in_world=frames[1].in_parent)
    except ConfigurationError as error:
        raise EndpointError(f"the controller has frames that are no tree: {error}") from error
    return session.frames


def _describe(place: int, number: int) -> DescribeFrame:
    return DescribeFrame(number, place)


def locate_flange(session: ServoSession, position_rad: Vector) -> Operation[Pose]:
    """Ask where the flange is in the robot base at axis positions."""
    check(session)
    pending = session.ask(lambda number: LocateFlange(number, position_rad))
    yield from _answer(session, pending)
    if not isinstance(pending.answer, FlangeLocated):
        raise _unanswered("did not say where the flange is")
    return pending.answer.flange_in_base


def validate_load(session: ServoSession, moved: MovedFrame) -> Operation[str]:
    """Ask whether the load of a frame's tool is the true one; return why not, or an empty text."""
    check(session)
    pending = session.ask(lambda number: ValidateLoad(number, moved.name, moved.tool))
    yield from _answer(session, pending)
    if not isinstance(pending.answer, LoadValidated):
        raise _unanswered("did not say whether the load is valid")
    return pending.answer.reason


def push(session: ServoSession, pushed: Push) -> Operation[None]:
    """Push a simulated arm."""
    check(session)
    yield from _answer(session, session.ask(lambda number: PushArm(number, *pushed)))


def start(session: ServoSession, motion: Motion, moved: MovedFrame = FLANGE_ITSELF) -> Operation[None]:
    """Start a motion of a frame; it is known to be running or waiting once the controller has taken it."""
    check(session)
    pending = session.ask(lambda number: motion.request(number, moved))
    # Known at once, so that who gives up waiting can still stop it.
    motion.record = session.motions[pending.request.number]
    motion.record.flange_in_moved = moved.flange_in_it
    try:
        yield from _answer(session, pending)
    except (IllegalArgumentException, IllegalStateException, CommandInvalidException):
        motion.record = None
        raise


def move(session: ServoSession, motion: Motion, moved: MovedFrame = FLANGE_ITSELF) -> Operation[None]:
    """Start a motion and wait until it is over; raise if it did not end by itself."""
    yield from start(session, motion, moved)
    yield from finished(motion.record, timeout_s=None)


def transferred(record: MotionRecord | None, *, timeout_s: float) -> Operation[tuple[MotionRecord, Update]]:
    """Wait until a motion is in the real-time system (manual 7.10.4: it runs, or is the next one to run)."""
    if record is None:
        raise IllegalStateException(CALLED_PREMATURELY)
    yield Wait(lambda: _gone(record) or _transferred(record), timeout_s)
    check_motion(record)
    if record.shown is None or not _transferred(record):
        raise IllegalStateException(NOT_TRANSFERRED_IN_TIME, _operators_reason(record.session))
    return record, record.shown


def change(record: MotionRecord, make: Callable[[int], Request]) -> Operation[RequestDone]:
    """Ask for a change of a motion; return the controller's answer, or raise the manual's exception."""
    check_motion(record)
    return (yield from _answer(record.session, record.session.ask(make)))


def update(record: MotionRecord) -> Operation[Update]:
    """Return the motion as a state packet shows it that is sent after the call."""
    check_motion(record)
    wanted = record.session.want_state()
    # A motion that ended is not shown any more, while the report of its end may still be on its way.
    yield Wait(lambda: _gone(record) or _shows(record, wanted), ANSWER_S)
    check_motion(record)
    if record.shown is None or not _shows(record, wanted):
        raise _unanswered("sent no fresh state of the motion")
    return record.shown


def stop(record: MotionRecord | None) -> Operation[bool]:
    """Stop a motion; return whether this call did."""
    if record is None:
        raise IllegalStateException(CALLED_PREMATURELY)
    session = record.session
    check(session)
    if record.ended is not None:
        return False
    try:
        yield from _answer(session, session.ask(lambda number: StopMotion(number, record.number)))
    except CommandInvalidException:
        return False
    return True


def finished(record: MotionRecord | None, *, timeout_s: float | None) -> Operation[bool]:
    """Wait until a motion is over; return False if it is not in time, raise if it did not end by itself."""
    if record is None:
        raise IllegalStateException(CALLED_PREMATURELY)
    yield Wait(lambda: _gone(record), timeout_s)
    if record.ended is None or record.ended.end is not MotionEnd.FINISHED:
        check_motion(record)
    return record.ended is not None


def next_state(session: ServoSession, *, after: int, timeout_s: float | None) -> Operation[Snapshot | None]:
    """Return the newest state once more than ``after`` have come; None if no further one came in time."""
    yield Wait(lambda: session.states > after or session.over, timeout_s)
    check(session)
    return session.snapshot if session.states > after else None


def check(session: ServoSession) -> None:
    """Raise if the session is over."""
    if session.over:
        raise SessionEnded(session.ended_because)


def check_motion(record: MotionRecord) -> None:
    """Raise if the session is over, or the motion."""
    check(record.session)
    ended = record.ended
    if ended is not None:
        raise CommandInvalidException(ended.reason or f"the motion is {ended.end.name.lower()}", ended.detail)


def _answer(session: ServoSession, pending: Pending) -> Operation[RequestDone]:
    # A request may wait for the operator's start as long as he likes (manual 9.1.2): patience begins anew after it.
    while (yield Wait(lambda: pending.done is not None or session.over or session.paused, ANSWER_S)):
        if pending.done is not None or session.over:
            break
        yield Wait(lambda: pending.done is not None or session.over or not session.paused, None)
    done = pending.done
    if done is None:
        check(session)
        raise _unanswered("did not answer a request")
    if done.error is RequestError.NONE:
        return done
    if done.error is RequestError.COMMAND_INVALID:
        raise CommandInvalidException(done.reason, done.detail)
    if done.error is RequestError.ILLEGAL_ARGUMENT:
        raise IllegalArgumentException(done.reason, done.detail)
    raise IllegalStateException(done.reason, done.detail)


def _unanswered(what: str) -> EndpointError:
    return EndpointError(f"the controller {what} within {ANSWER_S:g} s, though it sends states; are commands lost?")


def _operators_reason(session: ServoSession) -> str:
    return "" if session.snapshot is None else session.snapshot.operator.reason


def _gone(record: MotionRecord) -> bool:
    return record.ended is not None or record.session.over


def _transferred(record: MotionRecord) -> bool:
    return record.shown is not None and record.shown.motion.phase in (MotionPhase.TRANSFERRED, MotionPhase.ACTIVE)


def _shows(record: MotionRecord, wanted: int) -> bool:
    session, shown = record.session, record.shown
    return session.is_fresh(wanted) and shown is not None and shown.snapshot is session.snapshot
