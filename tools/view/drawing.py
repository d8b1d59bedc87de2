"""What is drawn: robots as renderers are told of them, and what every renderer can do."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from hil.values.frames import FrameTree
from hil.values.servo import Snapshot


class DrawnRobot(NamedTuple):
    """A robot, as far as it stays the same while it is drawn."""

    name: str
    model: str
    """Name of its description, such as ``lbr-iiwa-14-r820``."""
    frames: FrameTree
    """Frames of the station as this robot knows them; ``frames.base_in_world`` is where it stands."""


class ArmNow(NamedTuple):
    """A robot now. ``lost`` says why nothing comes from it any more, and is empty while states come."""

    snapshot: Snapshot | None
    """The newest state there ever was; None before the first."""
    lost: str = ""


class Renderer(Protocol):
    """Draws robots. Calls come from one thread; each one raises :class:`hil.values.errors.HilError` in words."""

    @property
    def title(self) -> str:
        """Name for a person, such as ``browser``."""

    def load_scene(self, scene: str, robots: Sequence[DrawnRobot]) -> None:
        """Load what stands around the robots; what that text means is the renderer's."""

    def devices(self) -> tuple[str, ...]:
        """Return the robots that the loaded scene has room for, by the names it gives them."""

    def start(self, devices: Mapping[str, str]) -> None:
        """Begin the live view; ``devices`` tells which one of the scene each robot is, by the robot's name."""

    def show(self, robots: Mapping[str, ArmNow]) -> None:
        """Draw the robots as they are now, by name; called some ten times a second."""

    def synchronise_frames(self) -> int:
        """Draw the frames of the station anew, and return how many there are."""

    def stop(self) -> None:
        """End the live view; the scene stays. Does nothing when there is none."""

    def close(self) -> None:
        """Let go of everything; does nothing the second time."""
