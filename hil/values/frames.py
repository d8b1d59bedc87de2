"""Frames of a robot as one tree: world, robot base, flange, tools with their frames (TCPs), and reference frames.

Source: manual 7.5.3, 8.1. World, base and flange are always there. Tools and their frames hang below the flange, so
they move; reference frames hang below world or base, so they do not. Metres and radians; degrees and millimetres are
for the edges that people and vendors see.
"""

from collections.abc import Iterable, Iterator, Mapping
from enum import IntEnum
from typing import Final, NamedTuple

from hil.values.errors import ConfigurationError, UnknownName
from hil.values.load import NO_LOAD, Load
from hil.values.pose import NOWHERE, Pose

WORLD: Final = "world"
BASE: Final = "base"
FLANGE: Final = "flange"
MAX_FRAMES: Final = 64
MAX_FRAME_NAME_BYTES: Final = 40


class FrameKind(IntEnum):
    """What a frame is."""

    WORLD = 1
    BASE = 2
    FLANGE = 3
    TOOL = 4
    """Where a tool is mounted: it may have a load."""
    TOOL_FRAME = 5
    """A frame of a tool, such as its TCP."""
    REFERENCE = 6
    """A frame that stands still in the robot base."""


class Frame(NamedTuple):
    """One frame of the tree."""

    name: str
    kind: FrameKind
    parent: str
    """Name of the frame it hangs below; empty for the world."""
    in_parent: Pose
    """For the flange, which moves, this means nothing."""
    load: Load | None = None

    @property
    def moves(self) -> bool:
        """Whether it moves with the flange."""
        return self.kind in {FrameKind.FLANGE, FrameKind.TOOL, FrameKind.TOOL_FRAME}


class _NoSuchFrame(UnknownName, KeyError):
    """Also what a mapping raises, so that ``in`` and ``get`` are those of one."""

    __str__ = Exception.__str__


class FrameTree(Mapping[str, Frame]):
    """All frames of a robot, by name. Raises :class:`ConfigurationError` where they are no tree."""

    def __init__(self, frames: Iterable[Frame] = (), *, base_in_world: Pose = NOWHERE) -> None:
        self._frames = {
            WORLD: Frame(WORLD, FrameKind.WORLD, "", NOWHERE),
            BASE: Frame(BASE, FrameKind.BASE, WORLD, base_in_world),
            FLANGE: Frame(FLANGE, FrameKind.FLANGE, BASE, NOWHERE),
        }
        for frame in frames:
            self._add(frame)
        self._in_root = {name: self._resolved(frame) for name, frame in self._frames.items()}

    def __getitem__(self, name: str) -> Frame:
        try:
            return self._frames[name]
        except KeyError:
            raise _NoSuchFrame("frame", name, self._frames) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._frames)

    def __len__(self) -> int:
        return len(self._frames)

    def in_flange(self, name: str) -> Pose:
        """Return where a frame that moves stands in the flange."""
        if not self[name].moves:
            raise ConfigurationError(f"the frame {name!r} does not move with the flange")
        return self._in_root[name]

    def in_base(self, name: str) -> Pose:
        """Return where a frame that stands still stands in the robot base."""
        if self[name].moves:
            raise ConfigurationError(f"the frame {name!r} moves with the flange")
        return self._in_root[name]

    def load_of(self, name: str) -> Load:
        """Return what hangs on the flange, in the flange, while a frame that moves is moved: the load of its tool."""
        frame = self[name]
        while frame.kind is FrameKind.TOOL_FRAME:
            frame = self[frame.parent]
        if frame.kind is not FrameKind.TOOL or frame.load is None:
            return NO_LOAD
        return frame.load.mounted(frame.in_parent)

    def _add(self, frame: Frame) -> None:
        if frame.name in self._frames:
            raise ConfigurationError(f"two frames have the name {frame.name!r}; each needs its own")
        if not frame.name or len(frame.name.encode()) > MAX_FRAME_NAME_BYTES or not frame.name.isprintable():
            raise ConfigurationError(
                f"the frame name {frame.name!r} is no printable text of 1 to {MAX_FRAME_NAME_BYTES} bytes"
            )
        if len(self._frames) >= MAX_FRAMES:
            raise ConfigurationError(f"more than {MAX_FRAMES} frames, world, base and flange included")
        parent = self._frames.get(frame.parent)
        if parent is None:
            raise ConfigurationError(
                f"the frame {frame.name!r} hangs below {frame.parent!r}, which is not there, or comes after it"
            )
        allowed = _PARENTS.get(frame.kind)
        if allowed is None or parent.kind not in allowed:
            raise ConfigurationError(
                f"the frame {frame.name!r} ({frame.kind.name}) cannot hang below {frame.parent!r} ({parent.kind.name})"
            )
        self._frames[frame.name] = frame

    def _resolved(self, frame: Frame) -> Pose:
        """Return the pose in the flange of what moves, in the robot base of what does not."""
        if frame.name in {BASE, FLANGE}:
            return NOWHERE
        if frame.name == WORLD:
            return self._frames[BASE].in_parent.inverse()
        return self._resolved(self._frames[frame.parent]) @ frame.in_parent


_PARENTS: Final = {
    FrameKind.TOOL: frozenset({FrameKind.FLANGE}),
    FrameKind.TOOL_FRAME: frozenset({FrameKind.FLANGE, FrameKind.TOOL, FrameKind.TOOL_FRAME}),
    FrameKind.REFERENCE: frozenset({FrameKind.WORLD, FrameKind.BASE, FrameKind.REFERENCE}),
}
