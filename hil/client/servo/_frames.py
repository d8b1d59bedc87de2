"""Frames and poses as arguments of calls: what the manual's four texts of chapter 10.2 are about."""

from math import isfinite
from typing import Final, NamedTuple, TypeAlias

from hil.client.servo.errors import (
    BASE_IS_NOT_STATIC,
    BASE_IS_NULL,
    FRAME_IS_NOT_ON_FLANGE,
    FRAME_ON_FLANGE_IS_NULL,
    IllegalArgumentException,
)
from hil.values.errors import UnknownName
from hil.values.frames import FLANGE, Frame, FrameTree
from hil.values.load import AttachedTool
from hil.values.pose import NOWHERE, Pose

FrameName: TypeAlias = str | Frame
"""A frame of the robot, or its name."""
Moved: TypeAlias = FrameName | AttachedTool
"""What a motion moves: a frame that moves with the flange, or a tool of the program's own."""

_NEAR: Final = 1e-6
"""How far rows of a matrix may be from those of a rotation that is still meant as one."""


class MovedFrame(NamedTuple):
    """What a motion moves: the flange, or a frame that moves with it."""

    name: str = FLANGE
    flange_in_it: Pose = NOWHERE
    tool: AttachedTool | None = None


FLANGE_ITSELF: Final = MovedFrame()


def moved_frame(tree: FrameTree, frame: object) -> MovedFrame:
    """Return what ``frame`` is to a motion; raise :class:`IllegalArgumentException` (manual 10.2)."""
    if isinstance(frame, AttachedTool):
        return MovedFrame(FLANGE, in_flange(tree, frame).inverse(), frame)
    in_it = in_flange(tree, frame).inverse()
    return MovedFrame(_find(tree, frame, otherwise=FRAME_IS_NOT_ON_FLANGE).name, in_it)


def in_flange(tree: FrameTree, frame: object) -> Pose:
    """Return where ``frame`` stands in the flange; raise :class:`IllegalArgumentException` (manual 10.2)."""
    if frame is None:
        raise IllegalArgumentException(FRAME_ON_FLANGE_IS_NULL)
    if isinstance(frame, AttachedTool):
        return pose("TCP of the tool", frame.tcp_in_flange)
    found = _find(tree, frame, otherwise=FRAME_IS_NOT_ON_FLANGE)
    if not found.moves:
        raise IllegalArgumentException(FRAME_IS_NOT_ON_FLANGE, f"{found.name!r} stands still in the base")
    return tree.in_flange(found.name)


def in_base(tree: FrameTree, reference: object) -> Pose:
    """Return where ``reference`` stands in the base; raise :class:`IllegalArgumentException` (manual 10.2)."""
    if reference is None:
        raise IllegalArgumentException(BASE_IS_NULL)
    found = _find(tree, reference, otherwise=BASE_IS_NOT_STATIC)
    if found.moves:
        raise IllegalArgumentException(BASE_IS_NOT_STATIC, f"{found.name!r} moves with the flange")
    return tree.in_base(found.name)


def pose(name: str, value: Pose) -> Pose:
    """Return ``value``; raise :class:`IllegalArgumentException` where its numbers are no pose."""
    try:
        x, y, z, (a, b, c, d, e, f, g, h, i) = value
        # Of unit length, at right angles, and not mirrored; NaN and infinity fail here too.
        off = (
            abs(a * a + b * b + c * c - 1.0),
            abs(d * d + e * e + f * f - 1.0),
            abs(a * d + b * e + c * f),
            abs(b * f - c * e - g) + abs(c * d - a * f - h) + abs(a * e - b * d - i),
        )
        fine = isfinite(x) and isfinite(y) and isfinite(z) and sum(off) <= _NEAR
    except (TypeError, ValueError, OverflowError):
        fine = False
    if not fine:
        raise IllegalArgumentException(
            f"{name} is {value!r}; a Pose of finite numbers in m with a rotation matrix is needed"
        )
    return value


def _find(tree: FrameTree, frame: object, *, otherwise: str) -> Frame:
    """Return the frame of the tree that is meant; where there is none, raise with the text ``otherwise``, and why."""
    name = frame.name if isinstance(frame, Frame) else frame
    if not isinstance(name, str):
        raise IllegalArgumentException(otherwise, f"{frame!r} is neither a Frame nor the name of one")
    try:
        found = tree[name]
    except UnknownName as error:
        raise IllegalArgumentException(otherwise, f"this robot has no such frame: {error}") from None
    if isinstance(frame, Frame) and frame != found:
        raise IllegalArgumentException(otherwise, f"{frame} is not this robot's frame of that name: {found}")
    return found
