"""A rendering connection: from a station and a scene to the live view (manual 3.2 and chapter 6).

Whatever the renderer: what can be done when, which robot of the scene shows which robot of the station, and who is
lost. Nothing here waits, reads a clock or knows a network: states of robots are handed in, and drawn.
"""

from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Final, NamedTuple, Protocol, runtime_checkable

from hil.values.errors import HilError, UnknownName, UsageError
from tools.view.choices import Choices, keep_choices, load_choices
from tools.view.drawing import ArmNow, DrawnRobot, Renderer

NOT_WATCHED: Final = "nothing was heard of it yet"
NO_DEVICE: Final = "no robot of the scene was chosen for it"


class State(StrEnum):
    """How far a connection is."""

    NO_STATION = "no station"
    STATION = "station"
    SCENE_CHOSEN = "scene chosen"
    LOADED = "loaded"
    LIVE = "live"


class Action(StrEnum):
    """What a person can do; the words are those of a sentence."""

    SELECT_STATION = "selecting a station"
    SELECT_SCENE = "selecting a scene"
    LOAD_SCENE = "loading the scene"
    ASSIGN_DEVICE = "choosing which robot of the scene a robot is"
    START_LIVE_VIEW = "starting the live view"
    STOP_LIVE_VIEW = "stopping the live view"
    SYNCHRONISE_FRAMES = "synchronising the frames"
    REFRESH = "refreshing"


TABLE: Final[Mapping[tuple[State, Action], State]] = {
    (State.NO_STATION, Action.SELECT_STATION): State.STATION,
    (State.STATION, Action.SELECT_STATION): State.STATION,
    (State.STATION, Action.SELECT_SCENE): State.SCENE_CHOSEN,
    (State.STATION, Action.REFRESH): State.STATION,
    (State.SCENE_CHOSEN, Action.SELECT_STATION): State.STATION,
    (State.SCENE_CHOSEN, Action.SELECT_SCENE): State.SCENE_CHOSEN,
    (State.SCENE_CHOSEN, Action.LOAD_SCENE): State.LOADED,
    (State.SCENE_CHOSEN, Action.REFRESH): State.SCENE_CHOSEN,
    (State.LOADED, Action.SELECT_STATION): State.STATION,
    (State.LOADED, Action.SELECT_SCENE): State.SCENE_CHOSEN,
    (State.LOADED, Action.LOAD_SCENE): State.LOADED,
    (State.LOADED, Action.ASSIGN_DEVICE): State.LOADED,
    (State.LOADED, Action.START_LIVE_VIEW): State.LIVE,
    (State.LOADED, Action.SYNCHRONISE_FRAMES): State.LOADED,
    (State.LOADED, Action.REFRESH): State.LOADED,
    (State.LIVE, Action.STOP_LIVE_VIEW): State.LOADED,
    (State.LIVE, Action.SYNCHRONISE_FRAMES): State.LIVE,
    (State.LIVE, Action.REFRESH): State.LIVE,
}
"""What is possible, and the state after it. A station that keeps a scene leads on to SCENE_CHOSEN by itself."""

_FIRST: Final[Mapping[State, str]] = {
    State.NO_STATION: "select a station first",
    State.STATION: "select a scene first",
    State.SCENE_CHOSEN: "load the scene first",
    State.LOADED: "start the live view first",
    State.LIVE: "stop the live view first",
}


class Row(NamedTuple):
    """A robot of the station, for a page or a terminal."""

    robot: str
    model: str
    device: str
    """Robot of the scene that shows it; empty where none was chosen."""
    lost: str
    """Why nothing comes from it; empty while it is connected. Such a row is red (manual 6.2)."""


class NotPossible(UsageError):
    """An action that the state of the connection does not allow; says what to do first."""


@runtime_checkable
class Reconfigurable(Protocol):
    """A renderer that takes a changed station without loading its scene anew, so that nothing done there is lost."""

    def reconfigure(self, robots: Sequence[DrawnRobot]) -> None:
        """Take the robots as they are now, and look at the scene again; reconnect where that was lost."""


class RenderingConnection:
    """One renderer, and what it shows. Calls come from one thread.

    An action raises :class:`NotPossible` in a state without it, and whatever the renderer or the station file say; the
    state is then as it was.
    """

    def __init__(self, renderer: Renderer, *, kind: str, read_station: Callable[[Path], Sequence[DrawnRobot]]) -> None:
        """``kind`` is the renderer's key in the choices; ``read_station`` reads the robots of a station file."""
        self._renderer = renderer
        self._kind = kind
        self._read_station = read_station
        self._robots: tuple[DrawnRobot, ...] = ()
        self._assigned: dict[str, str] = {}
        self._now: Mapping[str, ArmNow] = {}
        self.state = State.NO_STATION
        self.station: Path | None = None
        self.scene = ""
        self.devices: tuple[str, ...] = ()
        """The robots of the loaded scene."""
        self.trouble = ""
        """Why the live view stands still: what the renderer said when it was last shown something. Refresh ends it."""

    def possible(self, action: Action) -> bool:
        """Return whether an action is possible now; what a button that is greyed out asks."""
        return (self.state, action) in TABLE

    def select_station(self, station: Path) -> None:
        """Choose a station file; what was chosen with it before is chosen again."""
        after = self._after(Action.SELECT_STATION)
        robots = tuple(self._read_station(station))
        kept = load_choices(station, self._kind)
        self.station, self._robots, self._assigned, self.devices = station, robots, dict(kept.devices), ()
        self._now = {}
        self.state, self.scene = (State.SCENE_CHOSEN, kept.scene) if kept.scene else (after, "")

    def select_scene(self, scene: str) -> None:
        """Choose a scene; what that text means is the renderer's."""
        after = self._after(Action.SELECT_SCENE)
        if not scene:
            raise UsageError("the name of the scene is empty")
        self._keep(scene, self._assigned)
        self.scene, self.devices, self.state = scene, (), after

    def load_scene(self) -> None:
        """Load the scene, and see which robots it has room for."""
        after = self._after(Action.LOAD_SCENE)
        self._renderer.load_scene(self.scene, self._robots)
        self._take_devices()
        self.state, self.trouble = after, ""

    def assign(self, robot: str, device: str) -> None:
        """Choose the robot of the scene that shows ``robot`` ("Toolkit device"); an empty one shows it nowhere."""
        after = self._after(Action.ASSIGN_DEVICE)
        names = [one.name for one in self._robots]
        if robot not in names:
            raise UnknownName("robot of the station", robot, names)
        if device and device not in self.devices:
            raise UnknownName("robot of the scene", device, self.devices)
        other = next((name for name, taken in self._shown().items() if taken == device and name != robot), None)
        if device and other is not None:
            raise UsageError(f"{device!r} of the scene shows the robot {other!r} already, so it cannot show {robot!r}")
        assigned = {name: taken for name, taken in self._assigned.items() if name != robot and taken != device}
        if device:
            assigned[robot] = device
        self._keep(self.scene, assigned)
        self._assigned, self.state = assigned, after

    def start_live_view(self) -> None:
        """Begin to show the robots that have one of the scene."""
        after = self._after(Action.START_LIVE_VIEW)
        shown = self._shown()
        if not shown:
            raise NotPossible(
                f"{Action.START_LIVE_VIEW} needs a robot to show: choose first which robot of the scene each one is; "
                f"the scene has {', '.join(self.devices)}, the station {', '.join(one.name for one in self._robots)}"
            )
        self._renderer.start(shown)
        self.state, self.trouble = after, ""

    def stop_live_view(self) -> None:
        """End the live view; the scene stays as it was shown last."""
        after = self._after(Action.STOP_LIVE_VIEW)
        self.state = after
        if not self.trouble:
            self._renderer.stop()

    def synchronise_frames(self) -> int:
        """Draw the frames of the station anew, and return how many there are (manual 6.4)."""
        after = self._after(Action.SYNCHRONISE_FRAMES)
        count = self._renderer.synchronise_frames()
        self.state = after
        return count

    def refresh(self) -> None:
        """Read station and scene again, and go on as before ("Synchronize configuration", manual 6.1).

        For after a change of either, and after the connection to a robot or the renderer was interrupted.
        """
        self._after(Action.REFRESH)
        if self.station is None:
            return
        self._robots = tuple(self._read_station(self.station))
        if self.state is State.LOADED:
            self._renew()
        elif self.state is State.LIVE:
            try:
                if not self.trouble:
                    self._renderer.stop()
                self._renew()
                self.state = State.LOADED
                self.start_live_view()
            except HilError as error:
                self.state, self.trouble = State.LIVE, str(error)
                raise

    def show(self, now: Mapping[str, ArmNow]) -> None:
        """Take the robots as they are now, and draw them while live.

        What the renderer cannot draw is told by :attr:`trouble`, once; nothing is drawn from then on until a refresh.
        """
        self._now = now
        if self.state is not State.LIVE or self.trouble:
            return
        unheard = ArmNow(None, NOT_WATCHED)
        try:
            self._renderer.show({name: now.get(name, unheard) for name in self._shown()})
        except HilError as error:
            self.trouble = str(error)

    def rows(self) -> tuple[Row, ...]:
        """Return all robots of the station; those that are lost say why."""
        return tuple(
            Row(
                one.name,
                one.model,
                self._shown().get(one.name, ""),
                self._now[one.name].lost if one.name in self._now else NOT_WATCHED,
            )
            for one in self._robots
        )

    def close(self) -> None:
        """Let go of the renderer; idempotent."""
        self._renderer.close()

    def _renew(self) -> None:
        if isinstance(self._renderer, Reconfigurable):
            self._renderer.reconfigure(self._robots)
        else:
            self._renderer.load_scene(self.scene, self._robots)
        self._take_devices()

    def _after(self, action: Action) -> State:
        try:
            return TABLE[self.state, action]
        except KeyError:
            raise NotPossible(self._refusal(action)) from None

    def _refusal(self, action: Action) -> str:
        if action is Action.START_LIVE_VIEW and self.state is State.LIVE:
            return "the live view is on already"
        return f"{action} is not possible now ({self.state}): {_FIRST[self.state]}"

    def _shown(self) -> dict[str, str]:
        shown: dict[str, str] = {}
        for one in self._robots:
            device = self._assigned.get(one.name)
            if device in self.devices and device not in shown.values():
                shown[one.name] = device
        return shown

    def _take_devices(self) -> None:
        self.devices = self._renderer.devices()
        shown = self._shown()
        free = [device for device in self.devices if device not in shown.values()]
        waiting = [one.name for one in self._robots if one.name not in shown]
        same = {name: name for name in waiting if name in free}
        only = {waiting[0]: free[0]} if len(self._robots) == len(self.devices) == len(waiting) == 1 else {}
        if same or only:
            assigned = {**self._assigned, **only, **same}
            self._keep(self.scene, assigned)
            self._assigned = assigned

    def _keep(self, scene: str, devices: Mapping[str, str]) -> None:
        if self.station is not None and self.station.is_file():
            keep_choices(self.station, self._kind, Choices(scene=scene, devices=dict(devices)))
